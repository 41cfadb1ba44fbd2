//! Cryptomatte, read by another program by its published specification.

use mixray::output::ChannelFile;

use super::{has_openexr, run_python};
use crate::support::Folder;

/// What each object is, its own table left open.
const BALL: &str = "shape = \"sphere\"\nname = \"ball\"\nsegments = 32\nscale = 0.3\ntranslation = [-0.2, 0, 0.1]\n";
/// Of the same name, far out of focus, behind both others.
const OTHER_BALL: &str = "shape = \"sphere\"\nname = \"ball\"\nsegments = 32\nscale = 0.5\ntranslation = [0.1, 0.1, -2.5]\n";
const CRATE: &str = "shape = \"box\"\nsize = [0.3, 0.5, 0.3]\ntranslation = [0.35, 0, 0.4]\nrotation_deg = [0, 25, 10]\n";

const AROUND: &str = "\
[camera]
width = 72
height = 48
vertical_fov_deg = 45
position = [0, 0.4, 2]
look_at = [0, 0, 0]
[lens]
aperture_radius_m = 0.06
focus_distance_m = 1.9
[environment]
radiance = [0.6, 0.6, 0.6]
[[real]]
shape = \"quad\"
corner = [-3, -0.3, 3]
edge_u = [6, 0, 0]
edge_v = [0, 0, -6]
[[real]]
shape = \"box\"
size = [0.15, 0.2, 0.1]
translation = [-0.35, -0.2, 0.6]
[render]
rays_per_pixel = 32
max_bounces = 1
backend = \"cpu\"
";

/// The objects, those of them virtual that are named so.
fn scene(is_virtual: [bool; 3]) -> String {
    let objects = [BALL, OTHER_BALL, CRATE].into_iter().zip(is_virtual);
    let tables = objects.map(|(object, is_virtual)| match is_virtual {
        true => format!("[[virtual]]\n{object}"),
        false => format!("[[real]]\n{object}"),
    });
    AROUND.to_owned() + &tables.collect::<String>()
}

fn decode(folder: &Folder, object: &str, mask: &str) -> (bool, String) {
    run_python(folder, "mattes.py", &["all.exr", object, mask])
}

/// The mask of a render in which the other objects are real: they hide what they hid. Both take the same samples: no plan, for it differs.
#[test]
fn mattes_are_the_masks_of_the_objects_alone() {
    if !has_openexr() {
        return;
    }
    let folder = Folder::with_scene(&scene([true; 3]));
    folder.succeed("render scene.toml --no-skip plan --layers virtual,cryptomatte -o all.exr");
    let objects = ["ball", "ball.2", "box"];
    for (index, object) in objects.into_iter().enumerate() {
        let alone = std::array::from_fn(|other| other == index);
        folder.write("alone.toml", scene(alone));
        let render = "render alone.toml --no-skip plan --layers mask";
        folder.succeed(&format!("{render} -o {object}.exr"));
    }
    for object in objects {
        for mask in objects {
            let (is_same, said) = decode(&folder, object, &format!("{mask}.exr"));
            assert_eq!(is_same, object == mask, "{object}, {mask}: {said}");
        }
    }
    let (is_there, said) = decode(&folder, "no such object", "ball.exr");
    assert!(!is_there && said.contains("KeyError"), "control: {said}");
}

/// All objects together cover what is virtual, whether it was rendered at once or in parts.
#[test]
fn coverages_add_up_to_the_mask_and_parts_are_merged() {
    let folder = Folder::with_scene(&scene([true; 3]));
    folder.succeed("render scene.toml --layers virtual,cryptomatte -o all.exr");
    for range in ["0..20", "20..32"] {
        folder.succeed(&format!("render scene.toml --range {range} -o {range}.exr"));
    }
    folder.succeed("merge 0..20.exr 20..32.exr --layers virtual,cryptomatte -o merged.exr");
    let read = |name: &str| ChannelFile::read(&folder.path(name)).expect("reads").floats;
    let (all, merged) = (read("all.exr"), read("merged.exr"));
    let mut shared = 0;
    for (pixel, mask) in all["virtual.A"].iter().enumerate() {
        let ranks = ["00.green", "00.alpha", "01.green"];
        let coverages = ranks.map(|rank| all[&format!("CryptoObject{rank}")][pixel]);
        assert!(
            (coverages.iter().sum::<f32>() - mask).abs() < 1e-6,
            "{pixel}"
        );
        shared += u32::from(coverages[1] > 0.0);
    }
    assert!(shared > 20, "control: {shared} pixels show two objects");
    let names = all.keys().filter(|name| name.starts_with("Crypto"));
    assert_eq!(names.clone().count(), 8);
    for name in names {
        assert_eq!(all[name], merged[name], "{name}");
    }
    let usual = read("0..20.exr");
    assert!(!usual.keys().any(|name| name.starts_with("Crypto")));
    folder.refuse(
        "render scene.toml --layers motion -o a.exr",
        "mixray sequence",
    );
    folder.refuse(
        "merge 0..20.exr --layers motion -o a.exr",
        "mixray sequence",
    );
}
