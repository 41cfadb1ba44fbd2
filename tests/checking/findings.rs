//! Each check fires on what it is for, once, is silenced by its name, and leaves scenes alone that are meant.

use std::path::Path;

use mixray::check::{self, Extent};
use mixray::scene::check::Check;
use mixray::scene::{self, Choice, Scene};

use super::{BALL, TABLE};
use crate::support::{Folder, root, shared_data, stderr, stdout};

fn load(text: &str) -> Scene {
    scene::load_text(Path::new("scene.toml"), text)
        .unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn names(scene: &Scene) -> Vec<&'static str> {
    let findings = check::scene(scene, Extent::Still);
    findings.iter().map(|found| found.check.name()).collect()
}

/// Scenes with one thing wrong, by the name of the check that tells it.
fn wrong() -> Vec<(&'static str, String)> {
    let good = format!("{TABLE}{BALL}");
    let ball = |from: &str, to: &str| {
        assert!(good.contains(from));
        good.replace(from, to)
    };
    let lamp = "[[light]]\nkind = \"quad\"\ncorner = [0, 2, 0]\nedge_u = [EDGE, 0, 0]\nedge_v = [0, 0, 1]\nradiance = [9, 9, 9]\n";
    // Large enough to stand on a longer table and hold the camera.
    let around_camera = |text: &str| {
        let text = text.replace("scale = 0.25", "scale = 1.5");
        let text = text.replace("translation = [0, 0.25, 0]", "translation = [0, 1.5, 2.9]");
        text.replace("[-2, 0, 2]", "[-2, 0, 7]")
            .replace("[0, 0, -4]", "[0, 0, -9]")
    };
    vec![
        ("camera-inside", around_camera(&good)),
        (
            "camera-inside",
            around_camera(&good.replace("[[virtual]]", "[[real]]")),
        ),
        (
            "no-light",
            ball("radiance = [1, 1, 1]", "radiance = [0, 0, 0]"),
        ),
        (
            "no-light",
            ball("[environment]\nradiance = [1, 1, 1]\n", ""),
        ),
        (
            "light-faces-away",
            format!("{good}{}", lamp.replace("EDGE", "-1")),
        ),
        ("out-of-frame", ball("[0, 0.25, 0]", "[1.9, 0.25, 1.7]")),
        (
            "out-of-frame",
            ball("[0, 0.25, 0]", "[0, 0.25, 6]")
                .replace("corner = [-2, 0, 2]", "corner = [-2, 0, 7]")
                .replace("[0, 0, -4]", "[0, 0, -9]"),
        ),
        ("floating", ball("[0, 0.25, 0]", "[0, 0.27, 0]")),
        ("sunken", ball("[0, 0.25, 0]", "[0, 0.23, 0]")),
        (
            "size",
            ball("scale = 0.25", "scale = 0.0025").replace("[0, 0.25, 0]", "[0, 0.0025, 0]"),
        ),
        ("uncovered", ball("[-2, 0, 2]", "[0.1, 0, 2]")),
        (
            "uncovered",
            ball("edge_u = [4, 0, 0]", "edge_u = [2.05, 0, 0]")
                .replace("edge_v = [0, 0, -4]", "edge_v = [0, 0, -2.05]"),
        ),
        (
            "focal-length",
            format!("{good}[lens]\nf_number = 2\nfocal_length_mm = 0.05\nfocus_distance_m = 3\n"),
        ),
    ]
}

#[test]
fn each_check_fires_on_what_it_is_for_and_is_silenced_by_its_name() {
    let good = load(&format!("{TABLE}{BALL}"));
    assert_eq!(names(&good), [""; 0], "control");
    let lit = "[[light]]\nkind = \"quad\"\ncorner = [0, 2, 0]\nedge_u = [1, 0, 0]\nedge_v = [0, 0, 1]\nradiance = [9, 9, 9]\n";
    assert_eq!(
        names(&load(&format!("{TABLE}{BALL}{lit}"))),
        [""; 0],
        "control"
    );
    for (name, text) in wrong() {
        assert_eq!(names(&load(&text)), [name], "{text}");
        let allowed = load(&format!("{text}[check]\nallow = [\"{name}\"]\n"));
        assert_eq!(names(&allowed), [""; 0], "{name} is allowed");
        let other = if name == "size" { "floating" } else { "size" };
        let other = load(&format!("{text}[check]\nallow = [\"{other}\"]\n"));
        assert_eq!(names(&other), [name], "control: another is allowed");
    }
}

#[test]
fn what_is_a_hundred_times_too_large_is_told() {
    let pole = |factor: f64| {
        let box_of = format!(
            "size = [0.5, 0.5, 0.5]\ntranslation = [0, {}, 0]\nscale = [1, {factor}, 1]\n",
            0.25 * factor
        );
        load(&format!("{TABLE}[[virtual]]\nshape = \"box\"\n{box_of}"))
    };
    assert_eq!(names(&pole(1.0)), [""; 0], "control");
    assert_eq!(names(&pole(100.0)), ["size"]);
}

#[test]
fn an_object_may_stand_on_another() {
    let tower = format!(
        "{TABLE}{BALL}{}",
        BALL.replace("[0, 0.25, 0]", "[0, 0.75, 0]")
    );
    assert_eq!(names(&load(&tower)), [""; 0]);
    let apart = tower.replace("[0, 0.75, 0]", "[0.6, 0.75, 0]");
    assert_eq!(names(&load(&apart)), ["floating"], "control");
}

#[test]
fn every_check_has_a_name_in_the_docs_and_unknown_names_are_refused() {
    let page = std::fs::read_to_string(root().join("docs/checks.md")).expect("reads");
    for (name, _) in Check::CHOICES {
        assert!(page.contains(&format!("| `{name}` |")), "{name}");
    }
    let text = format!("{TABLE}{BALL}[check]\nallow = [\"floatin\"]\n");
    let error = scene::load_text(Path::new("scene.toml"), &text).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("did you mean `floating`?"), "{error}");
}

#[test]
fn none_fires_on_the_scenes_that_come_with_the_program() {
    let folders = std::fs::read_dir(root().join("scenes")).expect("reads");
    let mut seen = 0;
    for folder in folders {
        for entry in std::fs::read_dir(folder.expect("reads").path()).expect("reads") {
            let path = entry.expect("reads").path();
            if path.extension().is_some_and(|ending| ending == "toml") {
                let scene = scene::load(&path).expect("loads");
                assert_eq!(names(&scene), [""; 0], "{}", path.display());
                seen += 1;
            }
        }
    }
    assert!(seen >= 7, "{seen}");
}

/// Desk and basket with a ball that rests on them, and the videos with one on the paper.
#[test]
fn none_fires_on_photographs_and_videos() {
    for (name, pixel) in [
        ("tum_desk_rgbd", "[330, 330]"),
        ("kinect_basket_rgbd", "[320, 420]"),
    ] {
        let Some(data) = shared_data(name) else {
            continue;
        };
        let data = data.display();
        let text = format!(
            "[photo]\nimage = \"{data}/photo.png\"\nexposure_ev = \"auto\"\n[camera]\nfile = \"{data}/camera.json\"\npixel_origin = \"centre\"\n\
             [environment]\nradiance = [1, 1, 1]\n[[real]]\nmesh = \"{data}/proxy.glb\"\n\
             [[virtual]]\nshape = \"sphere\"\nsize_m = 0.1\nrest_on = \"real\"\npixel = {pixel}\n"
        );
        let scene = load(&text);
        assert_eq!(names(&scene), [""; 0], "{name}");
        let floats = load(&text.replace("rest_on = \"real\"\npixel = ", "#"));
        assert_ne!(names(&floats), [""; 0], "control: it is where it falls");
    }
    for name in ["webcam_marker_grid_video", "webcam_chessboard_video"] {
        if shared_data(name).is_none() {
            continue;
        }
        let text = "[camera]\nwidth = 640\nheight = 480\nfx = 698\n[environment]\nradiance = [1, 1, 1]\n\
             [[real]]\nshape = \"quad\"\ncorner = [-0.3, 0, 0.3]\nedge_u = [0.6, 0, 0]\nedge_v = [0, 0, -0.6]\n\
             [[virtual]]\nshape = \"box\"\nsize = [0.04, 0.04, 0.04]\ntranslation = [0, 0.02, 0]\n";
        let found = check::scene(&load(text), Extent::WithoutCamera);
        assert_eq!(found, [], "{name}");
        let found = check::scene(
            &load(&text.replace("[0, 0.02, 0]", "[0, 0.1, 0]")),
            Extent::WithoutCamera,
        );
        assert_eq!(found.len(), 1, "control");
    }
}

#[test]
fn the_command_and_a_render_say_the_same() {
    let folder = Folder::new();
    folder.write("scene.toml", format!("{TABLE}{BALL}"));
    assert_eq!(folder.succeed("check scene.toml"), "nothing to tell\n");
    let said = stderr(&folder.run("render scene.toml -o out.png"));
    assert!(!said.contains("[check]"), "control: {said}");
    folder.write(
        "scene.toml",
        format!("{TABLE}{BALL}").replace("[0, 0.25, 0]", "[0, 0.27, 0]"),
    );
    let output = folder.run("check scene.toml");
    assert_eq!(output.status.code(), Some(1));
    let line = stdout(&output);
    assert!(
        line.starts_with("`ball`, 50.0 cm large, floats 2.0 cm"),
        "{line}"
    );
    let output = folder.run("render scene.toml -o out.png");
    assert_eq!(output.status.code(), Some(0));
    let said = stderr(&output);
    assert!(said.contains(&format!("warning: {line}")), "{said}");
}

/// The table, photographed in its own light, and in light of a quarter.
#[test]
fn light_that_does_not_fit_the_photograph_is_told() {
    let folder = Folder::new();
    let scene = |ev: f64| {
        let photo = format!("[photo]\nimage = \"photo.png\"\nexposure_ev = {ev}\n");
        format!("{photo}{TABLE}{BALL}")
    };
    // 0.5 in linear light, about what an albedo of 0.5 shows under white light.
    folder.save("photo.png", 64, 48, |_, _| [188; 3]);
    for (ev, is_told) in [(0.0, false), (0.8, false), (2.0, true), (-2.0, true)] {
        folder.write("scene.toml", scene(ev));
        let output = folder.run("check scene.toml");
        let said = stdout(&output);
        assert_eq!(said.contains("stops too"), is_told, "{ev}: {said}");
    }
}

/// Of a reddish table one channel alone asks for more light than its albedo can make up.
#[test]
fn albedo_at_its_limit_is_told_before_a_render_tells_it() {
    let folder = Folder::new();
    folder.save("photo.png", 64, 48, |_, _| [250, 150, 120]);
    let table = TABLE
        .lines()
        .map(|line| match line.starts_with("material") {
            true => "albedo = \"from-photo\"",
            false => line,
        });
    let table = table.collect::<Vec<_>>().join("\n");
    for (ev, is_told) in [(0.2, false), (-0.5, true)] {
        let photo = format!("[photo]\nimage = \"photo.png\"\nexposure_ev = {ev}\n");
        folder.write("scene.toml", format!("{photo}{table}\n{BALL}"));
        let checked = stdout(&folder.run("check scene.toml"));
        let rendered = stderr(&folder.run("render scene.toml -o out.png"));
        for said in [&checked, &rendered] {
            assert_eq!(said.contains("lies at its limit"), is_told, "{ev}: {said}");
        }
        assert!(!checked.contains("stops too"), "control: {checked}");
    }
}

/// A grey JPEG whose tags note a focal length as on 35 mm film.
fn noted(focal_mm: u16) -> Vec<u8> {
    let mut jpeg = Vec::new();
    let grey = image::RgbImage::from_pixel(64, 48, image::Rgb([188; 3]));
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 95);
    grey.write_with_encoder(encoder).expect("encodes");
    // TIFF, the least significant byte first: a directory with one entry, the EXIF directory after it, with FocalLengthIn35mmFilm alone.
    let mut tags = b"Exif\0\0II*\0\x08\0\0\0".to_vec();
    let entry = |tag: u16, kind: u16, value: u32| {
        let mut directory = 1u16.to_le_bytes().to_vec();
        directory.extend([tag, kind].iter().flat_map(|number| number.to_le_bytes()));
        directory.extend([1, value, 0].iter().flat_map(|number| number.to_le_bytes()));
        directory
    };
    tags.extend(entry(0x8769, 4, 26));
    tags.extend(entry(0xa405, 3, focal_mm.into()));
    let length = (tags.len() as u16 + 2).to_be_bytes();
    let segment = [&[0xff, 0xe1], &length[..], &tags].concat();
    jpeg.splice(2..2, segment);
    jpeg
}

/// The table's camera is one of 35.7 mm.
#[test]
fn another_focal_length_than_the_photograph_s_camera_notes_is_told() {
    let folder = Folder::new();
    let scene = format!("[photo]\nimage = \"photo.jpg\"\n{TABLE}{BALL}");
    for (focal_mm, is_told) in [(36, false), (39, false), (41, true), (26, true), (0, false)] {
        folder.write("photo.jpg", noted(focal_mm));
        folder.write("scene.toml", &scene);
        let said = stdout(&folder.run("check scene.toml"));
        assert_eq!(said.contains("notes a focal length"), is_told, "{said}");
        if focal_mm == 26 {
            assert!(said.contains("vertical_fov_deg = 53.1"), "{said}");
            let said = stderr(&folder.run("render scene.toml -o out.png"));
            assert!(said.contains("notes a focal length"), "{said}");
        }
        folder.write(
            "scene.toml",
            format!("{scene}[check]\nallow = [\"focal-length\"]\n"),
        );
        let said = stdout(&folder.run("check scene.toml"));
        assert_eq!(said, "nothing to tell\n");
    }
}
