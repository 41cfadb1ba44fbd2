//! `--sandbox`: what a scene names outside its folder is refused, by every command that reads scenes, and is followed without it.

use crate::support::{Folder, assert_refused, stderr};

const CAMERA: &str = "[camera]\nwidth = 24\nheight = 16\nvertical_fov_deg = 45\n";
const MODEL: &str = r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
"meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }], "buffers": [{ "uri": "@model.bin", "byteLength": 36 }],
"materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }], "textures": [{ "source": 0 }],
"bufferViews": [{ "buffer": 0, "byteLength": 36 }], "images": [{ "uri": "%texture.png" }],
"accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }] }"#;

/// Every kind of file that a scene can name, in the scene's folder and beside it.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.create("scene/in");
    for place in ["", "scene/"] {
        let at = |name: &str| format!("{place}{name}");
        for name in ["photo.png", "texture.png"] {
            folder.save(&at(name), 24, 16, |x, y| {
                [x * 9, y * 9, 40].map(|c| c as u8)
            });
        }
        exr::prelude::write_rgb_file(folder.path(&at("env.exr")), 4, 2, |_, _| (1.0f32, 1.0, 1.0))
            .expect("writes");
        let corners = [0.0f32, 0.0, -3.0, 1.0, 0.0, -3.0, 0.0, 1.0, -3.0];
        folder.write(
            &at("model.bin"),
            corners
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<u8>>(),
        );
        folder.write(&at("model.gltf"), MODEL.replace(['@', '%'], ""));
        folder.succeed(&format!(
            "noise calibrate --from 0.02,0.5 -o {}",
            at("noise.toml")
        ));
    }
    for number in 0..2 {
        std::fs::copy(
            folder.path("photo.png"),
            folder.path(&format!("scene/in/f_{number}.png")),
        )
        .expect("copies");
    }
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    folder.write("poses.json", format!(r#"{{"frames_per_second": 10, "frames": [{{"frame": 0, "world_from_camera": {pose}}}, {{"frame": 1, "world_from_camera": {pose}}}]}}"#));
    folder
}

/// A scene that names each kind of file, `name` under the path `written`.
fn scene(name: &str, written: &str) -> String {
    let path = |own: &str| {
        if own == name {
            written.to_owned()
        } else {
            own.to_owned()
        }
    };
    format!(
        "[photo]\nimage = {:?}\n{CAMERA}[environment]\nimage = {:?}\n[[virtual]]\nmesh = {:?}\n[noise]\nprofile = {:?}\n[render]\nbackend = \"cpu\"\nrays_per_pixel = 2\n",
        path("photo.png"),
        path("env.exr"),
        path("model.gltf"),
        path("noise.toml")
    )
}

const RENDER: &str = "render scene/scene.toml -o out.png";

fn refused(folder: &Folder, line: &str, name: &str) {
    let output = folder.run(&format!("{line} --sandbox"));
    assert_refused(&output, name);
    let message = stderr(&output);
    assert!(message.contains("outside the scene's folder"), "{message}");
    assert!(!folder.path("out.png").exists(), "{message}");
}

#[test]
fn what_lies_outside_is_followed_or_refused() {
    let folder = folder();
    folder.write("scene/scene.toml", scene("", ""));
    folder.succeed(&format!("{RENDER} --sandbox"));
    folder.remove("out.png");
    for name in ["photo.png", "env.exr", "model.gltf", "noise.toml"] {
        let absolute = folder.path(name).display().to_string();
        for written in [
            format!("../{name}"),
            absolute,
            format!("in/../../{name}"),
            format!("../absent-{name}"),
        ] {
            folder.write("scene/scene.toml", scene(name, &written));
            refused(&folder, RENDER, name);
            if !written.contains("absent") {
                folder.succeed(RENDER);
                folder.remove("out.png");
            }
        }
        // The scene's own, by a roundabout way.
        folder.write(
            "scene/scene.toml",
            scene(name, &format!("../scene/in/../{name}")),
        );
        folder.succeed(&format!("{RENDER} --sandbox"));
        folder.remove("out.png");
    }
}

#[test]
fn what_a_model_names_is_held_to_the_same_folder() {
    let folder = folder();
    folder.write("scene/scene.toml", scene("", ""));
    for (mark, name) in [('@', "model.bin"), ('%', "texture.png")] {
        let model = MODEL.replace(mark, "../").replace(['@', '%'], "");
        folder.write("scene/model.gltf", model);
        refused(&folder, RENDER, name);
        folder.succeed(RENDER);
        folder.remove("out.png");
    }
}

#[cfg(unix)]
#[test]
fn links_are_followed_before_it_is_asked_where_a_file_lies() {
    let folder = folder();
    folder.write("scene/scene.toml", scene("photo.png", "link.png"));
    std::os::unix::fs::symlink("../photo.png", folder.path("scene/link.png")).expect("links");
    refused(&folder, RENDER, "photo.png");
    folder.succeed(RENDER);
    folder.remove("out.png");
    folder.remove("scene/link.png");
    std::os::unix::fs::symlink("photo.png", folder.path("scene/link.png")).expect("links");
    folder.succeed(&format!("{RENDER} --sandbox"));
}

#[test]
fn every_command_that_reads_scenes_has_it() {
    let folder = folder();
    folder.write("scene/scene.toml", scene("env.exr", "../env.exr"));
    folder.succeed("render scene/scene.toml --rpp 4 --range 0..2 -o part.exr");
    for line in [
        "render scene/scene.toml -o out.png",
        "sequence scene/scene.toml --frames scene/in --trajectory poses.json -o out",
        "merge part.exr -o out.png",
        "bench scene/scene.toml --backends cpu --rpp 1 --repeats 1 --reference-error 0.5 -o bench",
    ] {
        refused(&folder, line, "env.exr");
    }
    folder.succeed("merge part.exr -o out.png");
    // What the command line names may lie anywhere.
    folder.remove("out.png");
    folder.write("scene/scene.toml", scene("", ""));
    folder.succeed(
        "sequence scene/scene.toml --sandbox --frames scene/in --trajectory poses.json -o out",
    );
}

/// A film says where its scene is by the way from its own folder, which may be anybody's.
#[test]
fn a_film_is_not_followed_out_of_its_folder() {
    let folder = folder();
    folder.write("scene/scene.toml", scene("", ""));
    folder.create("films");
    folder.succeed("render scene/scene.toml --rpp 4 --range 0..2 -o films/part.exr");
    let merge = "merge films/part.exr -o out.png";
    let output = folder.run(&format!("{merge} --sandbox"));
    assert_refused(&output, "scene.toml");
    assert!(stderr(&output).contains("outside the film's folder"));
    for line in [
        merge.to_owned(),
        format!("{merge} --sandbox --scene scene/scene.toml"),
    ] {
        folder.succeed(&line);
        folder.remove("out.png");
    }
}
