//! The commands for pictures of other programs: what they write, and what they refuse.

use exr::WritableImage as _;
use exr::prelude as exr;

use super::spread;
use crate::support::{Folder, Random, assert_refused, stderr};

/// Lacks the profile's name and the output's.
const APPLY: &str = "noise apply photo.png layer.png mask.png --profile";
/// Lacks the mask and the output.
const ANTIALIAS: &str = "antialias photo.png layer.png";

fn noisy(folder: &Folder, name: &str, level: f64, sigma: f64, seed: u64) {
    let mut rng = Random(seed);
    let values: Vec<u8> = (0..3 * 64 * 48)
        .map(|_| (level + sigma * rng.normal()).round().clamp(0.0, 255.0) as u8)
        .collect();
    folder.save(name, 64, 48, |x, y| {
        let i = 3 * (y * 64 + x) as usize;
        [values[i], values[i + 1], values[i + 2]]
    });
}

pub fn layers(folder: &Folder) {
    noisy(folder, "photo.png", 100.0, 3.0, 1);
    folder.save("layer.png", 64, 48, |_, _| [180; 3]);
    folder.save("mask.png", 64, 48, |x, _| [if x < 32 { 0 } else { 255 }; 3]);
}

#[test]
fn calibrate_writes_a_profile_that_apply_uses() {
    let folder = Folder::new();
    folder.create("scene");
    for f in 0..6 {
        noisy(&folder, &format!("scene/{f}.png"), 140.0, 3.0, 100 + f);
    }
    let said = folder.succeed("noise calibrate scene -o noise.toml --report page.html");
    assert!(
        said.contains("noise.toml") && said.contains("page.html"),
        "{said}"
    );
    assert!(folder.read("page.html").contains("<svg"));
    layers(&folder);
    let apply = |out: &str, more: &str| {
        folder.succeed(&format!("{APPLY} noise.toml -o {out} {more}"));
        folder.open(out)
    };
    let photo = folder.open("photo.png");
    let (a, b) = (apply("a.png", ""), apply("b.png", "--frame 1"));
    assert_eq!(a, apply("a2.png", "--frame 0"), "reproducible");
    for x in 0..32 {
        assert!(
            (0..48).all(|y| a.get_pixel(x, y) == photo.get_pixel(x, y)),
            "the photograph stays"
        );
    }
    let level = |picture: &image::RgbImage| {
        let values: Vec<f64> = (40..64)
            .flat_map(|x| (0..48).map(move |y| (x, y)))
            .map(|(x, y)| f64::from(picture.get_pixel(x, y).0[1]))
            .collect();
        spread(&values)
    };
    assert!((level(&a) - 3.0).abs() < 0.3, "{}", level(&a));
    assert_ne!(a, b, "frames differ");
    for more in [
        "--paper",
        "--method textures --texture-size 64 --magnification 2 --update-delay 2",
    ] {
        let picture = apply("c.png", more);
        assert!(
            (level(&picture) - 3.0).abs() < 0.4,
            "{more} {}",
            level(&picture)
        );
    }
    assert!(
        level(&apply("d.png", "--scale 0")) < 0.01,
        "control: no noise"
    );
}

/// Channels of 64 x 48 pixels in one OpenEXR file.
pub fn save_exr(folder: &Folder, name: &str, channels: &[(&str, &dyn Fn(usize) -> f32)]) {
    let list = channels.iter().map(|(name, value)| {
        let samples = (0..64 * 48).map(|i| value(i % 64)).collect();
        exr::AnyChannel::new(*name, exr::FlatSamples::F32(samples))
    });
    let layer = exr::Layer::new(
        exr::Vec2(64, 48),
        exr::LayerAttributes::default(),
        exr::Encoding::FAST_LOSSLESS,
        exr::AnyChannels::sort(list.collect()),
    );
    let written = exr::Image::from_layer(layer)
        .write()
        .to_file(folder.path(name));
    written.unwrap();
}

#[test]
fn open_exr_channels_say_what_is_virtual() {
    let folder = Folder::new();
    layers(&folder);
    let decoy = |_: usize| 0.5;
    let mask = |x: usize| if x < 32 { 0.0 } else { 1.0 };
    let depth = |x: usize| if x < 32 { f32::INFINITY } else { 3.0 };
    save_exr(
        &folder,
        "own.exr",
        &[
            ("R", &decoy),
            ("normal.Z", &decoy),
            ("mask.Y", &mask),
            ("depth.Z", &depth),
        ],
    );
    save_exr(
        &folder,
        "other.exr",
        &[
            ("ViewLayer.Normal.Z", &decoy),
            ("ViewLayer.Depth.Z", &depth),
        ],
    );
    let line = |mask: &str| format!("{ANTIALIAS} {mask} -o out.png");
    let picture = |mask: &str| {
        folder.succeed(&line(mask));
        folder.open("out.png")
    };
    let expected = picture("mask.png");
    assert_eq!(expected, picture("own.exr"));
    assert_eq!(expected, picture("own.exr --depth --far 1e6"));
    assert_eq!(expected, picture("other.exr --depth --far 1e6"));
    assert_ne!(expected, picture("other.exr --depth --far 2"), "control");
    folder.refuse(&line("other.exr"), "expected one of them");
    save_exr(
        &folder,
        "nan.exr",
        &[("mask.Y", &|x| if x == 5 { f32::NAN } else { 0.0 })],
    );
    folder.refuse(&line("nan.exr"), "pixel (5, 0) is NaN");
    folder.refuse(&line("absent.exr"), "absent.exr");
}

#[test]
fn depth_and_masks_say_what_is_virtual() {
    let folder = Folder::new();
    layers(&folder);
    // Nearer than the far limit (white): the right half.
    folder.save("depth.png", 64, 48, |x, _| {
        [if x < 32 { 255 } else { 120 }; 3]
    });
    let run = |out: &str, mask: &str| {
        folder.succeed(&format!("{ANTIALIAS} {mask} -o {out}"));
        folder.open(out)
    };
    let by_mask = run("a.png", "mask.png");
    assert_eq!(by_mask, run("b.png", "depth.png --depth"));
    assert_eq!(by_mask.get_pixel(40, 20).0, [180; 3]);
    assert_ne!(
        by_mask.get_pixel(32, 20).0,
        [180; 3],
        "the border is blended"
    );
    assert_eq!(
        run("c.png", "mask.png --beta 0").get_pixel(32, 20).0,
        [180; 3],
        "control"
    );
    folder.save("soft.png", 64, 48, |x, _| [(4 * x) as u8; 3]);
    let output = folder.run(&format!("{ANTIALIAS} soft.png -o d.png"));
    assert_eq!(output.status.code(), Some(0));
    assert!(stderr(&output).contains("soft already"));
}

#[test]
fn presets_are_given_by_hand() {
    let folder = Folder::new();
    folder.succeed("noise calibrate --from 0.02,0.5 -o n.toml --bins 8");
    let profile = mixray::scene::NoiseProfile::read(&folder.path("n.toml")).unwrap();
    assert_eq!(profile.bins.len(), 8);
    let expected = (0.02f64 * 16.0 + 0.5).sqrt();
    assert!((profile.bins[0].sigma[1] - expected).abs() < 1e-5);
}

#[test]
fn the_cartoon_writes_picture_and_edges() {
    let folder = Folder::new();
    folder.save("in.png", 64, 48, |x, y| {
        if (20..40).contains(&x) && (10..30).contains(&y) {
            [200, 40, 30]
        } else {
            [90, 120, 150]
        }
    });
    let said = folder.succeed("cartoon in.png out.png --edges edges.png --shrunk 32x24");
    assert!(said.contains("out.png"), "{said}");
    let (picture, edges) = (folder.open("out.png"), folder.open("edges.png"));
    assert_eq!(picture.dimensions(), (64, 48));
    assert_eq!(edges.dimensions(), (192, 48));
    let dark = picture
        .pixels()
        .filter(|p| p.0.iter().all(|c| *c < 80))
        .count();
    assert!(dark > 40, "{dark}");
    folder.succeed("cartoon in.png flow.png --style flow");
    assert_ne!(folder.open("flow.png"), picture, "control");
    folder.succeed("cartoon out.png out.exr --iterations 0");
}

#[test]
fn what_cannot_be_used_is_refused() {
    let folder = Folder::new();
    layers(&folder);
    folder.create("empty");
    folder.refuse("noise calibrate empty -o n.toml", "no pictures");
    folder.refuse("noise calibrate photo.png -o n.toml", "one frame only");
    folder.refuse("noise calibrate none.png other.png -o n.toml", "none.png");
    folder.save("small.png", 8, 8, |_, _| [9; 3]);
    folder.refuse("noise calibrate photo.png small.png -o n.toml", "one size");
    folder.refuse(
        "antialias photo.png small.png mask.png -o o.png",
        "expected one size",
    );
    folder.succeed("noise calibrate --from 0,1 -o n.toml");
    let text = folder.read("n.toml");
    folder.write("later.toml", text.replace("version = 1", "version = 9"));
    let apply = |profile: &str| format!("{APPLY} {profile} -o o.png");
    folder.refuse(&apply("later.toml"), "version 9; expected version 1");
    folder.refuse(&apply("photo.png"), "photo.png");
    folder.refuse("cartoon n.toml o.png", "format is not known");
    assert!(!folder.path("o.png").exists());
    folder.succeed(&apply("n.toml"));
    assert!(folder.path("o.png").exists(), "control");
    for bad in [3, 0] {
        let line = format!("noise calibrate --from 0,1 -o n.toml --bins {bad}");
        assert_eq!(folder.run(&line).status.code(), Some(2));
    }
}

#[test]
fn inputs_are_never_overwritten() {
    let folder = Folder::new();
    layers(&folder);
    for f in 0..3 {
        noisy(&folder, &format!("f{f}.png"), 140.0, 3.0, 100 + f);
    }
    folder.succeed("noise calibrate --from 0.02,2 -o noise.toml");
    let refused = |line: &str, kept: &str, said: &str| {
        let before = folder.bytes(kept);
        folder.refuse(line, said);
        assert_eq!(folder.bytes(kept), before);
    };
    let read = "would be overwritten";
    refused("cartoon photo.png photo.png", "photo.png", read);
    refused("cartoon photo.png ./photo.png", "photo.png", read);
    let antialias = format!("{ANTIALIAS} mask.png -o layer.png");
    refused(&antialias, "layer.png", read);
    let apply = format!("{APPLY} noise.toml -o photo.png");
    refused(&apply, "photo.png", read);
    for frames in ["f0.png f1.png f2.png", "."] {
        let calibrate = format!("noise calibrate {frames} -o f0.png");
        refused(&calibrate, "f0.png", "expected .toml");
    }
    let twice = "named for two outputs";
    refused(
        "noise calibrate f0.png f1.png -o x --report x",
        "f0.png",
        twice,
    );
    refused(
        "cartoon photo.png out.png --edges out.png",
        "photo.png",
        twice,
    );
    folder.succeed("cartoon photo.png control.png");
}

#[test]
fn what_a_calibration_cannot_use_is_named() {
    let folder = Folder::new();
    for f in 0..3 {
        noisy(&folder, &format!("f{f}.png"), 140.0, 3.0, 100 + f);
    }
    let refused = |frames: &str, said: &str| {
        let output = folder.run(&format!("noise calibrate -o n.toml {frames}"));
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{frames} {message}");
        assert!(message.contains(said), "{frames} {message}");
        assert!(!folder.path("n.toml").exists());
    };
    refused("f0.png f1.png ./f0.png", "named twice");
    refused(". .", "named twice");
    refused("nope.png f0.png", "nope.png: it cannot be read");
    refused("--from=-1,-1", "--from");
    refused("--from 1e4,1e4", "from 0 to 255 DN");
    folder.succeed("noise calibrate -o n.toml f0.png f1.png f2.png");
}

#[test]
fn textures_beyond_all_memory_are_refused() {
    let folder = Folder::new();
    layers(&folder);
    folder.succeed("noise calibrate --from 0.02,2 --bins 256 -o noise.toml");
    let apply = |texture_size: u32| {
        folder.run(&format!(
            "{APPLY} noise.toml -o out.png --method textures --texture-size {texture_size}"
        ))
    };
    assert_refused(&apply(4096), "texels in all");
    assert_eq!(apply(64).status.code(), Some(0), "control");
}
