//! The layers of EXR files put together again by another program.

mod mattes;

use std::process::Command;

use crate::support::{Folder, root};

/// A glass ball, a lamp in the sun and its shadow, on a photograph with grain.
const SCENE: &str = "\
[photo]
image = \"photo.png\"
[camera]
vertical_fov_deg = 45
position = [0, 0.4, 2]
look_at = [0, 0, 0]
[environment]
radiance = [0.2, 0.25, 0.3]
[[light]]
kind = \"directional\"
direction = [0.4, -1, -0.3]
irradiance = [3, 3, 3]
[[real]]
shape = \"quad\"
corner = [-3, -0.3, 3]
edge_u = [6, 0, 0]
edge_v = [0, 0, -6]
material = { base_color = [0.7, 0.6, 0.5] }
[[virtual]]
shape = \"sphere\"
segments = 32
scale = 0.3
translation = [-0.35, 0, 0]
material = { base_color = [0.02, 0.02, 0.02] }
[[virtual]]
shape = \"sphere\"
segments = 32
scale = 0.25
translation = [0.35, 0, 0.2]
material = { transmission = 1.0, roughness = 0.0 }
[noise]
profile = \"noise.toml\"
[render]
rays_per_pixel = 16
backend = \"cpu\"
";

fn folder() -> Folder {
    let folder = Folder::with_scene(SCENE);
    folder.save("photo.png", 72, 48, |x, y| {
        [230, 220, 205].map(|c| (c - (x * 7 + y * 13) % 11) as u8)
    });
    folder.succeed("noise calibrate --from 0.03,0.5 -o noise.toml");
    folder
}

/// Whether Python has what the script imports.
fn has_openexr() -> bool {
    let tried = Command::new("python3")
        .args(["-c", "import cv2, numpy, OpenEXR; OpenEXR.File"])
        .output();
    let has = tried.is_ok_and(|output| output.status.success());
    if !has {
        eprintln!("SKIPPED: python3 has no OpenEXR, numpy or OpenCV");
    }
    has
}

/// A script of this folder, run in the other; whether it succeeded, and what it said.
fn run_python(folder: &Folder, script: &str, arguments: &[&str]) -> (bool, String) {
    let output = Command::new("python3")
        .arg(root().join("tests/compositing").join(script))
        .args(arguments)
        .current_dir(folder.root())
        .output()
        .expect("python3 starts");
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.success(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

fn recompose(folder: &Folder, name: &str, more: &[&str]) -> (bool, String) {
    let files = [format!("{name}.exr"), format!("{name}.png")];
    let named = ["photo.png", &files[0], &files[1]];
    run_python(folder, "recompose.py", &[&named, more].concat())
}

#[test]
fn layers_are_put_together_to_the_picture() {
    if !has_openexr() {
        return;
    }
    let folder = folder();
    for composite in ["additive", "quotient"] {
        folder.succeed(&format!(
            "render scene.toml --composite {composite} -o {composite}.exr -o {composite}.png"
        ));
        let (is_same, said) = recompose(&folder, composite, &[]);
        assert!(is_same, "{composite}: {said}");
        let of_mode = match composite {
            "additive" => "change",
            _ => "ratio",
        };
        for without in [of_mode, "noise"] {
            let (is_same, said) = recompose(&folder, composite, &["--without", without]);
            assert!(!is_same, "control, without {without}: {said}");
        }
    }
}

/// Sharpness filters what the layers were put together to, and is a layer itself.
#[test]
fn layers_are_put_together_to_the_sharpened_picture() {
    if !has_openexr() {
        return;
    }
    let folder = folder();
    let sharp =
        "[sharpness]\nsigma_px = [1.0, 0.9, 1.1]\nsharpening = 0.6\nsharpening_radius_px = 1.2\n";
    folder.write("scene.toml", format!("{SCENE}{sharp}"));
    for composite in ["additive", "quotient"] {
        folder.succeed(&format!(
            "render scene.toml --composite {composite} -o {composite}.exr -o {composite}.png"
        ));
        let (is_same, said) = recompose(&folder, composite, &[]);
        assert!(is_same, "{composite}: {said}");
        let (is_same, said) = recompose(&folder, composite, &["--without", "sharpness"]);
        assert!(!is_same, "control: {said}");
    }
}

/// What the header says: all that the picture depends on, and nothing that equal renders do not share.
#[test]
fn metadata_tells_settings_and_no_circumstances() {
    let folder = folder();
    folder.succeed("render scene.toml --threads 1 -o a.exr");
    folder.create("elsewhere");
    for name in ["scene.toml", "photo.png", "noise.toml"] {
        folder.write(&format!("elsewhere/{name}"), folder.bytes(name));
    }
    folder.succeed("render elsewhere/scene.toml --threads 2 -o b.exr");
    assert!(folder.bytes("a.exr") == folder.bytes("b.exr"));
    let file = mixray::output::ChannelFile::read(&folder.path("a.exr")).expect("reads");
    let text = |name: &str| file.texts[&format!("mixray.{name}")].as_str();
    assert_eq!(text("composite"), "additive");
    assert_eq!(text("stages"), "noise (missing, scale 1)");
    assert_eq!(text("version"), env!("CARGO_PKG_VERSION"));
    assert_eq!(text("sceneHash").len(), 32);
    for (name, value) in &file.texts {
        assert!(
            !value.contains('/') && !value.contains("toml"),
            "{name}: {value}"
        );
    }
    folder.write(
        "scene.toml",
        SCENE.replace("irradiance = [3,", "irradiance = [4,"),
    );
    folder.succeed("render scene.toml -o c.exr");
    let other = mixray::output::ChannelFile::read(&folder.path("c.exr")).expect("reads");
    assert_ne!(
        other.texts["mixray.sceneHash"],
        file.texts["mixray.sceneHash"]
    );
}

/// R, G and B are opaque: there is no A beside them that a program would take for theirs.
#[test]
fn the_composite_is_opaque_and_half_of_the_channels_are_half_floats() {
    let folder = folder();
    folder.succeed("render scene.toml -o a.exr");
    let exr = exr::meta::MetaData::read_from_file(folder.path("a.exr"), true).expect("reads");
    let channels = &exr.headers[0].channels.list;
    let type_of = |name: &str| {
        let channel = channels.iter().find(|channel| channel.name.eq(name));
        channel.map(|channel| format!("{:?}", channel.sample_type))
    };
    for half in ["R", "noise.B", "normal.X"] {
        assert_eq!(type_of(half).as_deref(), Some("F16"), "{half}");
    }
    for single in [
        "virtual.R",
        "virtual.A",
        "change.R",
        "depth.Z",
        "variance.G",
    ] {
        assert_eq!(type_of(single).as_deref(), Some("F32"), "{single}");
    }
    assert_eq!(type_of("A"), None);
    assert_eq!(type_of("ratio.R"), None, "the composite is additive");
}

/// Of 32-bit floats without compression.
#[test]
fn files_are_a_quarter_of_their_planes() {
    const SIZE: [u32; 2] = [288, 192];
    let folder = Folder::with_scene(&SCENE.replace("[noise]\nprofile = \"noise.toml\"\n", ""));
    folder.save("photo.png", SIZE[0], SIZE[1], |x, y| {
        [230, 220, 205].map(|c| (c - (x * 7 + y * 13) % 11) as u8)
    });
    let size_of = |name: &str, layers: &str| {
        folder.succeed(&format!("render scene.toml -o {name} {layers}"));
        let path = folder.path(name);
        let meta = exr::meta::MetaData::read_from_file(&path, true).expect("reads");
        let channels = meta.headers[0].channels.list.len();
        let planes = channels * (4 * SIZE[0] * SIZE[1]) as usize;
        (folder.bytes(name).len(), planes)
    };
    let (all, planes) = size_of("all.exr", "");
    assert!(4 * all < planes, "{all} of {planes} bytes");
    let (three, _) = size_of("three.exr", "--layers composite,virtual,change");
    assert!(2 * three < all, "{three} of {all} bytes");
    // Twice the planes are no smaller.
    let costly = "--layers composite,difference,virtual,change,mask,depth,normal,variance,samples,albedo,real,mixed";
    let (more, _) = size_of("more.exr", costly);
    assert!(more > all, "control: {more} of {all} bytes");
}
