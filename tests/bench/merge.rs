//! `mixray render --range` and `mixray merge`.

use std::collections::BTreeMap;
use std::path::Path;

use mixray::output::ChannelFile;

use super::support::{SCENE, folder};
use crate::support::Folder;

/// Renders ranges of `total` rays into part-0.exr and so on.
fn render_parts(folder: &Folder, flags: &str, total: u32, ranges: &[(u32, u32)]) {
    for (number, (from, to)) in ranges.iter().enumerate() {
        folder.succeed(&format!(
            "render scene.toml {flags} --rpp {total} --range {from}..{to} -o part-{number}.exr"
        ));
    }
}

fn channels(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let mut floats = ChannelFile::read(path).unwrap().floats;
    floats.retain(|name, _| !name.starts_with("sums."));
    floats
}

/// Largest distance of any two values in units in the last place.
fn worst_ulp(a: &BTreeMap<String, Vec<f32>>, b: &BTreeMap<String, Vec<f32>>) -> u64 {
    assert!(a.keys().eq(b.keys()));
    let key = |x: f32| {
        let bits = x.to_bits() as i32;
        i64::from(if bits < 0 { i32::MIN - bits } else { bits })
    };
    let pairs = a.values().flatten().zip(b.values().flatten());
    pairs
        .map(|(&a, &b)| (key(a) - key(b)).unsigned_abs())
        .max()
        .unwrap_or(0)
}

/// Whatever the parts were rendered with.
const ALL_LAYERS: &str =
    "composite,difference,mask,depth,normal,albedo,variance,samples,real,mixed";

/// Invariant 8, through the files.
#[test]
fn ranges_merged_equal_one_run() {
    for flags in [
        "",
        "--sampler jittered --estimator paper",
        "--composite quotient",
        "--sampler cmj --no-skip plan",
        "--no-skip cones --no-skip edge-real",
    ] {
        let folder = folder();
        render_parts(&folder, flags, 16, &[(0, 3), (3, 8), (8, 16)]);
        folder.succeed(&format!(
            "render scene.toml {flags} --rpp 16 --layers {ALL_LAYERS} -o whole.exr -o whole.png"
        ));
        folder.succeed(&format!(
            "merge part-2.exr part-0.exr part-1.exr --layers {ALL_LAYERS} -o merged.exr -o merged.png"
        ));
        let whole = channels(&folder.path("whole.exr"));
        let merged = channels(&folder.path("merged.exr"));
        assert!(worst_ulp(&whole, &merged) <= 2, "{flags}");
        let open = |name: &str| image::open(folder.path(name)).unwrap();
        assert_eq!(open("whole.png"), open("merged.png"));
        folder.succeed(&format!(
            "merge part-2.exr --layers {ALL_LAYERS} -o alone.exr"
        ));
        let part = channels(&folder.path("alone.exr"));
        assert!(
            worst_ulp(&whole, &part) > 2,
            "control: a part is not the whole"
        );
        let mask = &whole["mask.Y"];
        assert!(mask.iter().any(|m| *m > 0.0 && *m < 1.0), "there are edges");

        folder.refuse(
            "merge part-0.exr part-1.exr -o part-0.exr",
            "would be overwritten",
        );
        folder.refuse("merge part-0.exr -o photo.png", "would be overwritten");
        // What is merged in part can be merged further.
        folder.succeed(&format!(
            "merge part-0.exr part-1.exr --layers {ALL_LAYERS} -o early.exr"
        ));
        folder.succeed(&format!(
            "merge early.exr part-2.exr --layers {ALL_LAYERS} -o late.exr"
        ));
        let late = channels(&folder.path("late.exr"));
        assert!(worst_ulp(&whole, &late) <= 2);
    }
}

#[test]
fn ranges_of_a_scene_without_virtual_things_merge_too() {
    let folder = folder();
    let nothing_virtual = SCENE.split("[[virtual]]").next().unwrap();
    folder.write("scene.toml", nothing_virtual);
    for (first, end) in [(0, 3), (3, 8), (8, 16)] {
        folder.succeed(&format!(
            "render scene.toml --rpp 16 --range {first}..{end} -o {first}.exr"
        ));
    }
    folder.succeed("merge 0.exr 3.exr -o early.exr");
    folder.succeed("merge early.exr 8.exr -o whole.exr -o whole.png");
    let open = |name: &str| image::open(folder.path(name)).unwrap();
    assert_eq!(open("photo.png"), open("whole.png"));
}

#[test]
fn films_that_do_not_fit_are_refused() {
    let folder = folder();
    render_parts(&folder, "", 16, &[(0, 4), (4, 8), (3, 8), (5, 8)]);
    let merge = |other: &str| format!("merge part-0.exr {other} -o merged.exr");
    folder.refuse(&merge("part-2.exr"), "overlap");
    folder.refuse(&merge("part-3.exr"), "gap");
    for (flags, part) in [
        ("--rpp 16 --seed 7", "seed"),
        ("--rpp 16 --sampler cmj", "sampler"),
        ("--rpp 16 --estimator paper", "estimator"),
        ("--rpp 16 --max-bounces 3", "path depth"),
        ("--rpp 16 --no-skip cones", "--no-skip"),
        ("--rpp 20", "rays per pixel"),
    ] {
        folder.succeed(&format!(
            "render scene.toml {flags} --range 4..8 -o other.exr"
        ));
        folder.refuse(&merge("other.exr"), part);
    }
    // What leaves every sum as it is may differ.
    folder.succeed("render scene.toml --rpp 16 --no-skip virtual-first --no-skip specialisation --no-skip adaptive --range 4..8 -o other.exr");
    folder.succeed(&merge("other.exr"));
    std::fs::remove_file(folder.path("merged.exr")).unwrap();
    folder.succeed("render scene.toml --rpp 4 -o plain.exr");
    folder.refuse(&merge("plain.exr"), "holds no film");
    folder.refuse(&merge("photo.png"), "photo.png");
    folder.refuse("render scene.toml --rpp 4 --range 0..2 -o a.png", ".exr");
    folder.refuse("render scene.toml --rpp 4 --range 2..5 -o a.exr", "2..5");
    assert!(!folder.path("merged.exr").exists());

    folder.write("scene.toml", SCENE.replace("0.31", "0.32"));
    folder.refuse(&merge("part-1.exr"), "changed since");
    folder.succeed("render scene.toml --rpp 16 --range 4..8 -o other.exr");
    folder.refuse(&merge("other.exr"), "different scenes");
    std::fs::rename(folder.path("scene.toml"), folder.path("moved.toml")).unwrap();
    folder.refuse(&merge("part-1.exr"), "--scene");
    folder.write("moved.toml", SCENE);
    folder.succeed(&format!("{} --scene moved.toml", merge("part-1.exr")));
}
