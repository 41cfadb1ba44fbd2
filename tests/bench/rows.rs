//! Rows of error against time, their reference, their page, and the comparison with earlier ones.

use super::support::{QUICK, SCENE, folder};
use crate::support::{interrupt, stderr};

#[test]
fn a_benchmark_writes_its_figures_plots_and_page() {
    let folder = folder();
    folder.write(
        "page.md",
        "before\n<!-- bench -->\nold\n<!-- end -->\nafter\n",
    );
    let shown = folder.succeed(&format!(
        "{QUICK} --target-rmse 1000 --write-docs page.md --composites additive,quotient"
    ));
    assert!(shown.contains("cpu direct sobol quotient"), "{shown}");
    assert!(shown.contains("the cheapest point is already better"));

    let report = folder.json("out/results.json");
    let rows = report["rows"].as_array().unwrap();
    assert_eq!(
        rows.len(),
        8,
        "2 estimators, 2 composites, 2 counts of rays"
    );
    for row in rows {
        assert_eq!(row["runs"].as_array().unwrap().len(), 2);
        assert_eq!(row["runs"][0]["seed"], 1);
        assert_eq!(row["runs"][1]["seed"], 2);
        let rays = row["rays_per_pixel"].as_u64().unwrap();
        let primary = row["rays"]["primary"].as_u64().unwrap();
        match row["estimator"].as_str().unwrap() {
            "paper" => assert_eq!(primary, 24 * 16 * rays),
            _ => assert!(primary > 0 && primary <= 24 * 16 * rays, "{primary}"),
        }
        let errors = &row["errors"];
        let pixels: u64 = ["background", "edge", "virtual"]
            .iter()
            .filter_map(|kind| errors[kind]["pixels"].as_u64())
            .sum();
        assert_eq!(pixels, 24 * 16, "each pixel is of one kind");
        assert!(errors["all"]["mse"].as_f64().unwrap() > 0.0);
        let product = row["cpu_secs"].as_f64().unwrap() * errors["all"]["mse"].as_f64().unwrap();
        let efficiency = row["efficiency"].as_f64().unwrap();
        assert!((efficiency * product - 1.0).abs() < 1e-9);
    }
    let references = report["references"].as_array().unwrap();
    assert_eq!(references.len(), 2, "one a composite");
    assert!(references[0]["scrambles"].as_u64().unwrap() >= 16);
    assert!(references[0]["standard_error"].as_f64().unwrap() > 0.0);
    assert!(!report["machine"]["cpu"].as_str().unwrap().is_empty());
    assert!(
        report["command"]
            .as_str()
            .unwrap()
            .starts_with("mixray bench")
    );

    let csv = folder.read("out/results.csv");
    assert_eq!(csv.lines().count(), 9);
    assert!(csv.starts_with("scene,method,"));
    let page = folder.read("out/index.html");
    assert!(page.matches("data:image/png").count() > 8);
    let docs = folder.read("page.md");
    assert!(docs.starts_with("before") && docs.ends_with("after\n") && !docs.contains("old"));
    assert!(docs.contains("    mixray bench scene.toml"));
    let name = folder.name();
    for axis in ["time", "rays"] {
        for extension in ["svg", "png"] {
            let plot = format!("out/{name}-error-{axis}.{extension}");
            assert!(folder.path(&plot).exists(), "{plot}");
        }
    }
}

#[test]
fn a_changed_scene_gets_a_new_reference() {
    let folder = folder();
    let source = || {
        folder.succeed(QUICK);
        let report = folder.json("out/results.json");
        report["references"][0]["source"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    assert_eq!(source(), "made");
    assert_eq!(source(), "cached");
    // The photograph alone: the scene file is as it was.
    let photo = image::RgbImage::from_pixel(24, 16, image::Rgb([90, 90, 90]));
    photo.save(folder.path("photo.png")).unwrap();
    assert_eq!(source(), "made");
    assert_eq!(source(), "cached");
    folder.write(
        "scene.toml",
        SCENE.replace("max_bounces = 2", "max_bounces = 3"),
    );
    assert_eq!(source(), "made");
}

#[test]
fn references_from_outside_are_used_if_they_fit() {
    let folder = folder();
    folder.succeed("render scene.toml -o ref.png --rpp 64");
    folder.succeed(&format!("{QUICK} --reference ref.png"));
    let report = folder.json("out/results.json");
    assert_eq!(report["references"][0]["source"], "given");
    assert_eq!(report["references"][0]["standard_error"], 0.0);
    let rmse = |row: usize| {
        report["rows"][row]["errors"]["all"]["rmse"]
            .as_f64()
            .unwrap()
    };
    assert!(
        rmse(0) < 0.5 && rmse(0) > rmse(1),
        "four rays are better than one"
    );

    folder.refuse(&format!("{QUICK} --reference ref.png --shrink 2"), "24x16");
    folder.refuse(&format!("{QUICK} --reference none.png"), "none.png");
    folder.refuse("bench a.toml b.toml --reference ref.png", "one scene");
    folder.refuse("bench none.toml --backends cpu", "none.toml");
    folder.write("page.md", "no section\n");
    folder.refuse("bench scene.toml --write-docs page.md", "<!-- bench -->");
}

#[test]
fn a_regression_exits_with_1() {
    let folder = folder();
    folder.succeed(QUICK);
    let itself = "bench --report out/results.json --against out/results.json";
    let shown = folder.succeed(itself);
    assert!(shown.contains("1.000 x efficiency") && !shown.contains("REGRESSION"));

    // As if one row had been a hundred times as efficient before.
    let mut earlier = folder.json("out/results.json");
    let row = &mut earlier["rows"][2];
    row["cpu_secs"] = (row["cpu_secs"].as_f64().unwrap() / 100.0).into();
    row["efficiency"] = (row["efficiency"].as_f64().unwrap() * 100.0).into();
    folder.write("earlier.json", earlier.to_string());
    let output = folder.run("bench --report out/results.json --against earlier.json");
    assert_eq!(output.status.code(), Some(1));
    let shown = String::from_utf8_lossy(&output.stdout);
    assert_eq!(shown.matches("REGRESSION").count(), 1, "{shown}");
    let other_way = folder.succeed("bench --report earlier.json --against out/results.json");
    assert!(!other_way.contains("REGRESSION"), "control: it grew");

    earlier["format"] = 0.into();
    folder.write("earlier.json", earlier.to_string());
    folder.refuse(
        "bench --report out/results.json --against earlier.json",
        "format",
    );
    folder.refuse(
        "bench --report out/results.json --against scene.toml",
        "results.json",
    );
}

/// What was measured before Ctrl-C is written.
#[cfg(unix)]
#[test]
fn an_interrupted_benchmark_keeps_what_is_finished() {
    let folder = folder();
    // The first run leaves the reference, so that the second measures at once.
    folder.succeed(QUICK);
    folder.remove("out/results.json");
    let endless =
        "bench scene.toml --backends cpu --rpp 1,4 --repeats 1000 --reference-error 0.5 -o out";
    for wait_ms in [1_000, 4_000, 16_000] {
        let mut child = folder
            .command(endless)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(wait_ms));
        let status = interrupt(&mut child);
        if !folder.path("out/results.json").exists() {
            // A busy machine: nothing was measured yet.
            continue;
        }
        assert_eq!(status.code(), Some(130));
        let report = folder.json("out/results.json");
        let rows = report["rows"].as_array().unwrap();
        assert!(!rows.is_empty());
        for row in rows {
            let runs = row["runs"].as_array().unwrap().len();
            assert!((1..1000).contains(&runs), "{runs}");
        }
        return;
    }
    panic!("the benchmark never began");
}

#[test]
fn the_papers_table_has_a_row_a_count_of_rays() {
    let folder = folder();
    let shown = folder.succeed("bench paper-table --backends cpu --repeats 1 --shrink 24 -o out");
    let table = folder.json("out/paper.json");
    let rows = table["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 6, "{shown}");
    for (row, published) in rows.iter().zip([59.0, 12.0, 7.0, 59.0, 12.0, 7.0]) {
        assert_eq!(row["published_fps"], published);
        let fps = row["fps"].as_f64().unwrap();
        assert!((fps * row["wall_secs"].as_f64().unwrap() - 1.0).abs() < 1e-9);
        assert!(row["rays_traced"].as_u64().unwrap() > 0);
    }
}

/// The loader of Vulkan speaks as soon as it is asked for devices.
#[cfg(target_os = "linux")]
#[test]
fn scenes_are_read_before_graphics_devices_are_asked_for() {
    if mixray::gpu::harness::test_device().is_none() {
        return;
    }
    let folder = folder();
    folder.write("broken.toml", "[camera]\nwidth = 0\n");
    let asked = |scene: &str, code: i32| {
        let line = format!(
            "bench {scene} --backends gpu --estimators direct --rpp 1 --repeats 1 --reference-error 1 --reference-rpp 16 -o asked"
        );
        let output = (folder.command(&line).env("VK_LOADER_DEBUG", "all").output()).expect("runs");
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{said}");
        said.contains("Vulkan Loader")
    };
    assert!(!asked("broken.toml", 2));
    assert!(!asked("scene.toml broken.toml", 2));
    assert!(asked("scene.toml", 0), "control");
}
