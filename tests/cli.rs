//! The built program: exit codes, one-line errors, what lands on stdout and on disk.

use crate::support::{Folder, assert_refused, interrupt, root, stderr, stdout};

const CAMERA: &str = "[photo]\nimage = \"photo.png\"\n[camera]\nvertical_fov_deg = 45\n[environment]\nradiance = [1, 1, 1]\n";
const VIRTUAL: &str = "[[virtual]]\nshape = \"sphere\"\nscale = 0.3\ntranslation = [0, 0, -3]\nmaterial = { base_color = [0.5, 0.4, 0.3] }\n";

/// Invariant 1 from the outside, and the default name of the picture.
#[test]
fn nothing_virtual_gives_the_photograph_back() {
    let folder = Folder::with_scene(CAMERA);
    let said = folder.succeed("render scene.toml --backend cpu");
    let picture = format!("{}.png", folder.name());
    assert!(said.contains(&picture), "says where the picture is");
    assert_eq!(folder.open(&picture), folder.open("photo.png"));
    folder.succeed(&format!("compare {picture} photo.png --max-rmse 0"));
}

#[test]
fn every_kind_of_output_is_written() {
    let folder = Folder::with_scene(&format!("{CAMERA}{VIRTUAL}"));
    let output = folder.run(
        "render scene.toml --rpp 4 --seed 7 --backend cpu --estimator paper --sampler cmj --composite quotient --max-bounces 2 \
         --png-bits 16 --threads 1 --stats s.json -o a.png -o b.exr",
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(
        stderr(&output),
        "",
        "no progress bar where there is no terminal"
    );
    let summary = stdout(&output);
    for part in ["a.png", "b.exr", "primary", "Mrays/s", "skipped", "error"] {
        assert!(summary.contains(part), "{summary} lacks {part}");
    }
    assert!(matches!(
        image::open(folder.path("a.png")).unwrap(),
        image::DynamicImage::ImageRgb16(_)
    ));
    let exr = exr::meta::MetaData::read_from_file(folder.path("b.exr"), true).unwrap();
    let names: Vec<String> = (exr.headers[0].channels.list.iter())
        .map(|channel| channel.name.to_string())
        .collect();
    for name in [
        "R",
        "difference.R",
        "real.R",
        "virtual.A",
        "variance.R",
        "mask.Y",
        "depth.Z",
        "normal.X",
        "samples.Y",
    ] {
        assert!(names.iter().any(|n| n == name), "{names:?} lacks {name}");
    }
    let stats = folder.json("s.json");
    assert_eq!(stats["backend"], "cpu");
    let pixels = &stats["pixels"];
    let total: u64 = ["background", "edge", "virtual", "skipped"]
        .iter()
        .map(|k| pixels[k].as_u64().unwrap())
        .sum();
    assert_eq!(total, 24 * 16);
    assert_eq!(
        folder.entries(),
        ["a.png", "b.exr", "photo.png", "s.json", "scene.toml"],
        "no temporary file is left"
    );
}

/// Processor seconds are those of the look-ahead and the render, and grow with the rays.
#[test]
fn stats_tell_the_processors_seconds() {
    let folder = Folder::with_scene(&format!("{CAMERA}{VIRTUAL}"));
    let seconds = |rpp: u32| {
        folder.succeed(&format!(
            "render scene.toml --backend cpu --rpp {rpp} -o a.png --stats s.json"
        ));
        let stats = folder.json("s.json");
        ["cpu", "look_ahead", "render"].map(|name| stats["seconds"][name].as_f64().unwrap())
    };
    let [few, look_ahead, _] = seconds(1);
    assert!(few > 0.0 && look_ahead > 0.0, "{few} {look_ahead}");
    // Some 4 million rays against 400.
    let [many, look_ahead, render] = seconds(10_000);
    assert!(many > 2.0 * few, "{many} {few}");
    assert!(
        look_ahead > 0.0 && look_ahead < render,
        "{look_ahead} {render}"
    );
}

/// What is switched off in vain is said; what is not, is not.
#[test]
fn savings_that_a_render_has_not_are_told() {
    let folder = Folder::with_scene(&format!("{CAMERA}{VIRTUAL}"));
    let says = |flags: &str| {
        let output = folder.run(&format!(
            "render scene.toml --backend cpu --rpp 16 -o a.png {flags}"
        ));
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        (stderr(&output), stdout(&output))
    };
    for flags in [
        "--no-skip adaptive",
        "--no-skip camera-noise",
        "--no-skip specialisation",
        "--no-skip cones --estimator paper",
        "--no-skip virtual-first --estimator paper",
        "--no-skip last-vertex --estimator paper",
        "--target-error 0.1 --no-skip camera-noise",
    ] {
        let (message, _) = says(flags);
        assert!(
            message.contains("changes nothing here"),
            "{flags}: {message}"
        );
    }
    for flags in ["--no-skip cones", "--target-error 0.1 --no-skip adaptive"] {
        assert_eq!(says(flags).0, "", "{flags}");
    }
    let noise = "--stop-at camera-noise --camera-noise 0.02,0.5";
    assert!(says(noise).1.contains("tiles stay above the goal"));
    let (_, without) = says(&format!("{noise} --no-skip camera-noise"));
    assert!(
        !without.contains("above the goal"),
        "there is none: {without}"
    );
}

#[test]
fn unusable_scenes_are_one_line_and_exit_code_2() {
    let folder = Folder::with_scene(&format!("{CAMERA}vertical_fov = 3\n"));
    folder.refuse("render scene.toml", "scene.toml:7:1");
    folder.refuse("render absent.toml", "absent.toml");
    let folder = Folder::with_scene(&CAMERA.replace("photo.png", "absent.png"));
    folder.refuse("render scene.toml", "absent.png");
}

/// The outputs are tried before the scene is even read: the scene here does not exist, and the message is about the output.
#[test]
fn unwritable_outputs_are_refused_before_any_work() {
    let folder = Folder::with_scene(CAMERA);
    folder.create("folder.png");
    for target in ["absent/a.png", "a.jpg", "folder.png"] {
        folder.refuse(&["render", "absent.toml", "-o", target], target);
    }
    let line = "render absent.toml -o a.png --stats absent/s.json";
    folder.refuse(line, "absent/s.json");
    assert_eq!(folder.entries(), ["folder.png", "photo.png", "scene.toml"]);
    folder.refuse("render absent.toml -o a.png", "absent.toml");
}

/// Nothing but errors is heard, and what was asked for.
#[test]
fn quiet_commands_say_nothing() {
    let folder = Folder::with_scene(CAMERA);
    let line = "render scene.toml --backend cpu --rpp 1 -o a.png";
    let loud = folder.run(line);
    assert!(!loud.stdout.is_empty(), "control");
    for quiet in [format!("{line} --quiet"), format!("-q {line}")] {
        let output = folder.run(&quiet);
        assert!(output.status.success());
        assert!(
            output.stdout.is_empty() && output.stderr.is_empty(),
            "{quiet}"
        );
    }
    assert!(
        folder
            .succeed("compare a.png a.png --quiet")
            .contains("rmse")
    );
    folder.refuse("render absent.toml -o a.png --quiet", "absent.toml");
}

#[test]
fn shells_and_manuals_know_every_command() {
    let folder = Folder::with_scene(CAMERA);
    for (shell, part) in [
        ("bash", "complete -F _mixray"),
        ("zsh", "#compdef mixray"),
        ("fish", "complete -c mixray"),
    ] {
        let script = folder.succeed(&format!("completions {shell}"));
        assert!(script.contains(part), "{shell}");
        assert!(
            script.contains("motion-blur") && script.contains("target-error"),
            "{shell}"
        );
    }
    assert!(folder.succeed("man").starts_with(".ie"));
    folder.succeed("man -o pages");
    let page = folder.read("pages/mixray-noise-apply.1");
    assert!(page.contains("premultiplied"), "{page}");
    folder.refuse("man -o pages.txt", "expected a folder");
}

/// No output may replace a file that the scene is made of, however it is named.
#[test]
fn inputs_are_never_overwritten() {
    let folder = Folder::with_scene(&CAMERA.replace("photo.png", "sub/../photo.png"));
    folder.create("sub");
    let photo = folder.bytes("photo.png");
    let scene = folder.bytes("scene.toml");
    let render = |arguments: &[&str]| {
        let common = ["render", "scene.toml", "--backend", "cpu"];
        folder.run(&[&common, arguments].concat())
    };
    let made_of = "would be overwritten";
    assert_refused(&render(&["-o", "photo.png"]), made_of);
    assert_refused(&render(&["-o", "./sub/../photo.png"]), made_of);
    let stats = render(&["-o", "a.png", "--stats", "scene.toml"]);
    assert_refused(&stats, "expected .json");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("photo.png", folder.path("link.png")).unwrap();
        assert_refused(&render(&["-o", "link.png"]), made_of);
        folder.remove("link.png");
    }
    // The default name is refused as well.
    let default_name = format!("{}.png", folder.name());
    std::fs::rename(folder.path("photo.png"), folder.path(&default_name)).unwrap();
    let text = CAMERA.replace("photo.png", &default_name);
    folder.write("scene.toml", text);
    assert_refused(&render(&[]), made_of);
    std::fs::rename(folder.path(&default_name), folder.path("photo.png")).unwrap();
    folder.write("scene.toml", &scene);
    assert_refused(
        &render(&["-o", "a.png", "-o", "sub/../a.png"]),
        "named for two outputs",
    );
    assert_eq!(folder.bytes("photo.png"), photo);
    assert_eq!(folder.entries(), ["photo.png", "scene.toml", "sub"]);
    // Negative control.
    let output = render(&["-o", "a.png"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

/// The files beside a glTF file are inputs too.
#[test]
fn a_models_textures_are_never_overwritten() {
    let folder = Folder::with_scene(&format!("{CAMERA}[[virtual]]\nmesh = \"model.gltf\"\n"));
    let model = r#"{ "asset": { "version": "2.0" }, "images": [{ "uri": "wood%20grain.png" }] }"#;
    folder.write("model.gltf", model);
    std::fs::copy(folder.path("photo.png"), folder.path("wood grain.png")).unwrap();
    let output = folder.run(&["render", "scene.toml", "-o", "wood grain.png"]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("would be overwritten"), "{message}");
}

#[test]
fn bad_usage_is_exit_code_2_and_help_is_0() {
    let folder = Folder::with_scene(CAMERA);
    for line in [
        "",
        "rendre",
        "render",
        "render scene.toml --rpp 0",
        "render scene.toml --rpp -4",
        "render scene.toml --sampler random",
        "render scene.toml --png-bits 12",
        "render scene.toml --threads 0",
        "compare photo.png",
        "compare photo.png photo.png --max-rmse NaN",
    ] {
        let output = folder.run(line);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{line}: {message}");
        assert!(!message.is_empty() && output.stdout.is_empty());
    }
    for line in ["--help", "--version"] {
        assert!(folder.succeed(line).contains("mixray"));
    }
    assert_eq!(folder.entries(), ["photo.png", "scene.toml"]);
}

#[test]
fn compare_prints_json_and_checks_a_limit() {
    let folder = Folder::with_scene(CAMERA);
    folder.save("a.png", 8, 8, |_, _| [100; 3]);
    folder.save("b.png", 8, 8, |_, _| [110; 3]);
    let linear = |code: f64| ((code / 255.0 + 0.055) / 1.055).powf(2.4);
    let difference = linear(110.0) - linear(100.0);
    let said = folder.succeed("compare a.png b.png");
    let json: serde_json::Value = serde_json::from_str(&said).unwrap();
    let number = |key: &str| json[key].as_f64().unwrap();
    assert!((number("rmse") - difference).abs() < 1e-7);
    assert!((number("psnr") + 20.0 * difference.log10()).abs() < 1e-3);
    let relative = difference * difference / (linear(110.0).powi(2) + 0.01);
    assert!((number("rel_mse") - relative).abs() < 1e-7);
    assert!(number("flip") > 0.0);

    let limit = |factor: f64| {
        let line = format!("compare a.png b.png --max-rmse {}", difference * factor);
        folder.run(&line).status.code()
    };
    assert_eq!((limit(0.999), limit(1.001)), (Some(1), Some(0)));
    folder.refuse("compare a.png photo.png", "8 x 8 and 24 x 16");
    folder.refuse("compare a.png absent.png", "absent.png");
    folder.refuse("compare a.png scene.toml", "scene.toml");
}

#[test]
fn info_names_the_processor_and_every_adapter() {
    let folder = Folder::with_scene(CAMERA);
    let text = folder.succeed("info");
    assert!(text.contains("threads"));
    let json = folder.succeed("info --json");
    let adapters: serde_json::Value = serde_json::from_str(&json).unwrap();
    for adapter in adapters.as_array().unwrap() {
        assert!(text.contains(adapter["name"].as_str().unwrap()));
    }
}

/// Ctrl-C ends a render that would take days; the picture is written and whole.
#[cfg(unix)]
#[test]
fn ctrl_c_writes_the_picture_and_exits_with_130() {
    use std::os::unix::process::ExitStatusExt;

    let folder = Folder::with_scene(&format!("{CAMERA}{VIRTUAL}"));
    // A signal before the render has begun just ends the program; then there has to be more patience.
    for wait_ms in [500, 2000, 8000] {
        let mut child = folder
            .command("render scene.toml --backend cpu --rpp 16777216 -o a.png")
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(wait_ms));
        assert_eq!(child.try_wait().unwrap(), None, "still rendering");
        assert!(!folder.path("a.png").exists());
        let status = interrupt(&mut child);
        if status.signal().is_some() {
            continue;
        }
        assert_eq!(status.code(), Some(130));
        let picture = image::open(folder.path("a.png")).unwrap();
        assert_eq!((picture.width(), picture.height()), (24, 16));
        assert_eq!(folder.entries(), ["a.png", "photo.png", "scene.toml"]);
        return;
    }
    panic!("the render never began");
}

/// A driver list that is not there hides every Vulkan device from the child.
#[cfg(target_os = "linux")]
#[test]
fn the_gpu_is_refused_where_there_is_none() {
    let folder = Folder::with_scene(&format!("{CAMERA}{VIRTUAL}"));
    let without_driver = |backend: &str| {
        folder
            .command(&format!(
                "render scene.toml --rpp 1 --backend {backend} -o a.png --stats s.json"
            ))
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .output()
            .unwrap()
    };
    assert_refused(&without_driver("gpu"), "no usable graphics device");
    assert_eq!(folder.entries(), ["photo.png", "scene.toml"]);
    // Negative control: `auto` takes the CPU instead.
    let output = without_driver("auto");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(folder.json("s.json")["backend"], "cpu");
}

#[test]
fn both_backends_write_the_same_picture_of_the_room() {
    if mixray::gpu::harness::test_device().is_none() {
        return;
    }
    let folder = Folder::with_scene(CAMERA);
    let scene = root().join("scenes/room/scene.toml");
    let render = |backend: &str, seed: &str| {
        let name = format!("{backend}{seed}.png");
        let status = folder
            .command("render")
            .arg(&scene)
            .args(["--rpp", "1", "--backend", backend, "--seed", seed])
            .args(["-o", &name, "--stats", "s.json"])
            .status();
        assert!(status.unwrap().success(), "{name}");
        assert_eq!(folder.json("s.json")["backend"], backend);
        folder.open(&name)
    };
    let expected = render("cpu", "0");
    // Share of the pixels that are more than a code apart.
    let apart = |picture: &image::RgbImage| {
        let pairs = picture.pixels().zip(expected.pixels());
        let far = pairs.filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 1));
        far.count() as f64 / f64::from(expected.width() * expected.height())
    };
    let share = apart(&render("gpu", "0"));
    assert!(share <= 1e-3, "{share}");
    let control = apart(&render("gpu", "1"));
    assert!(control > 0.02, "{control}");
}
