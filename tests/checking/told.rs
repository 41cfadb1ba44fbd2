//! `mixray info FILE` tells what files are and hold.

use super::{BALL, TABLE};
use crate::support::{Folder, root, shared_data};

/// The value of a line.
fn line(text: &str, what: &str) -> String {
    let mut lines = text.lines();
    let found = lines.find_map(|line| line.strip_prefix(&format!("{what} ")));
    found
        .unwrap_or_else(|| panic!("no `{what}` in\n{text}"))
        .trim()
        .to_owned()
}

#[test]
fn every_kind_of_file_is_told_what_it_is() {
    let folder = Folder::new();
    let info = |path: &str| folder.succeed(&["info", path]);
    let root = root().display().to_string();

    let pawn = info(&format!("{root}/scenes/demo/pawn.glb"));
    assert_eq!(line(&pawn, "file"), "a glTF model");
    assert!(line(&pawn, "size").ends_with(" m"), "{pawn}");

    folder.write(
        "a.obj",
        "v 0 0 0\nv 2 0 0\nv 0 3 0\nv 0 0 4\nf 1 2 3\nf 1 3 4\n",
    );
    let mesh = info("a.obj");
    assert_eq!(line(&mesh, "size"), "2.0000 x 3.0000 x 4.0000 m");
    assert_eq!(line(&mesh, "triangles"), "2 in 1 parts");

    folder.save("a.png", 6, 4, |_, _| [9; 3]);
    let photo = info("a.png");
    assert_eq!(line(&photo, "file"), "a PNG picture");
    assert_eq!(line(&photo, "size"), "6 x 4 pixels");
    assert_eq!(line(&photo, "colours"), "sRGB");

    folder.save("a.jpg", 16, 8, |x, _| [x as u8; 3]);
    assert_eq!(line(&info("a.jpg"), "file"), "a JPEG picture", "control");
    folder.write("a.mjpeg", folder.bytes("a.jpg").repeat(3));
    let film = info("a.mjpeg");
    assert_eq!(line(&film, "file"), "a film of JPEG pictures");
    assert_eq!(line(&film, "frames"), "3");

    folder.write("scene.toml", format!("{TABLE}{BALL}"));
    let scene = info("scene.toml");
    assert!(
        line(&scene, "virtual").starts_with("ball: 0.5000 x 0.5000 x 0.5000 m"),
        "{scene}"
    );
    assert!(
        line(&scene, "real").starts_with("table: 4.0000 x 0.0000 x 4.0000 m"),
        "{scene}"
    );

    let pose = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]";
    folder.write("poses.json", format!("{{\"frames_per_second\": 25, \"frames\": [{{\"frame\": 0, \"world_from_camera\": {pose}}}, {{\"frame\": 1, \"world_from_camera\": null}}]}}"));
    let poses = info("poses.json");
    assert_eq!(line(&poses, "poses"), "1, and 1 frames without one");
    assert_eq!(line(&poses, "rate"), "25 frames a second");

    folder.write(
        "camera.json",
        "{\"fx\": 500, \"fy\": 501, \"cx\": 319.5, \"cy\": 239.5, \"width\": 640, \"height\": 480}",
    );
    let camera = info("camera.json");
    assert_eq!(line(&camera, "centre"), "320.00, 240.00 from the corner");
    assert!(line(&camera, "note").contains("half a pixel"), "{camera}");

    folder.succeed("render scene.toml --rpp 4 --range 0..2 -o film.exr");
    let film = info("film.exr");
    assert_eq!(line(&film, "rays"), "0 to 1 of 4 a pixel, seed 0");
    folder.succeed("render scene.toml -o plain.exr");
    assert_eq!(
        line(&info("plain.exr"), "file"),
        "an OpenEXR picture",
        "control"
    );

    folder.write("a.fbx", "; FBX 7.4");
    folder.refuse("info a.fbx", "it is an FBX model");
    folder.refuse("info none.glb", "none.glb");
}

/// A lat-long map that is dark but for one pixel.
#[test]
fn the_sun_of_an_environment_is_found_where_it_stands() {
    let folder = Folder::new();
    let (width, height) = (64, 32);
    // Three quarters across: 90 degrees right of the centre, along +X; a quarter down: 45 degrees high.
    let mut texels = vec![image::Rgb([0.25_f32; 3]); width * height];
    texels[8 * width + 48] = image::Rgb([64.0; 3]);
    let file = std::fs::File::create(folder.path("sky.hdr")).expect("creates");
    let encoder = image::codecs::hdr::HdrEncoder::new(file);
    encoder.encode(&texels, width, height).expect("writes");
    let told = folder.succeed("info sky.hdr");
    assert!(
        line(&told, "range").contains("0.2500 to 64.0000, 8.0 stops"),
        "{told}"
    );
    let sun = line(&told, "sun");
    assert!(
        sun.contains("42.2 degrees high, 92.8 right of the centre"),
        "{sun}"
    );
    assert!(sun.contains("towards [0.740, 0.672, 0.036]"), "{sun}");
    // A sky without a sun, and one without anything.
    for (peak, told) in [(1.0, "brightest"), (0.0, "range")] {
        let file = std::fs::File::create(folder.path("sky.hdr")).expect("creates");
        let encoder = image::codecs::hdr::HdrEncoder::new(file);
        let floor = if peak > 0.0 { 0.25 } else { 0.0 };
        texels.fill(image::Rgb([floor; 3]));
        texels[8 * width + 48] = image::Rgb([peak; 3]);
        encoder.encode(&texels, width, height).expect("writes");
        let said = folder.succeed("info sky.hdr");
        assert!(said.contains(&format!("\n{told}")), "{said}");
        assert!(!said.contains("\nsun") && !said.contains("inf"), "{said}");
    }
}

#[test]
fn a_camera_s_tags_are_told() {
    let Some(photo) = shared_data("focus_stack_pcb/pcb_001.jpg") else {
        return;
    };
    let folder = Folder::new();
    let told = folder.succeed(&["info", &photo.display().to_string()]);
    assert_eq!(line(&told, "file"), "a JPEG picture");
}
