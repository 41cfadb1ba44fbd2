//! `mixray bench`, `mixray render --range` and `mixray merge` through the built program.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use mixray::output::ChannelFile;
use mixray::renderer::Skip;
use mixray::scene::Choice;

/// A ball over a textured floor, out of focus: background, edge and virtual pixels.
const SCENE: &str = "\
[photo]
image = \"photo.png\"
[camera]
vertical_fov_deg = 45
position = [0, 0.6, 2]
look_at = [0, 0.2, 0]
[lens]
aperture_radius_m = 0.05
focus_distance_m = 1.2
[environment]
radiance = [0.8, 0.9, 1.0]
[[light]]
kind = \"quad\"
corner = [-0.5, 2, -0.5]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [3, 3, 3]
[[real]]
shape = \"quad\"
corner = [-3, 0, 3]
edge_u = [6, 0, 0]
edge_v = [0, 0, -6]
material = { base_color = [0.5, 0.4, 0.3] }
[[virtual]]
shape = \"sphere\"
scale = 0.3
segments = 32
translation = [0, 0.31, 0]
material = { base_color = [0.3, 0.5, 0.7] }
[render]
max_bounces = 2
backend = \"cpu\"
";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        let photo = image::RgbImage::from_fn(24, 16, |x, y| {
            image::Rgb([(x * 10) as u8, (y * 15) as u8, (x * y) as u8])
        });
        photo.save(folder.path("photo.png")).unwrap();
        folder.write("scene.toml", SCENE);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    fn run(&self, arguments: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_mixray"))
            .current_dir(self.0.path())
            .args(arguments.split_whitespace())
            .output()
            .unwrap()
    }

    fn succeed(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {message}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Exit code 2 and one line that begins with "error:" and holds `part`.
    fn refuse(&self, arguments: &str, part: &str) {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.starts_with("error:"), "{message}");
        assert!(message.contains(part), "{message} lacks {part}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    }
}

const QUICK: &str =
    "bench scene.toml --backends cpu --rpp 1,4 --repeats 2 --reference-error 0.5 -o out";

#[test]
fn a_benchmark_writes_its_figures_plots_and_page() {
    let folder = Folder::new();
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
    let name = folder.0.path().file_name().unwrap().to_string_lossy();
    for axis in ["time", "rays"] {
        for extension in ["svg", "png"] {
            let plot = format!("out/{name}-error-{axis}.{extension}");
            assert!(folder.path(&plot).exists(), "{plot}");
        }
    }
}

#[test]
fn a_changed_scene_gets_a_new_reference() {
    let folder = Folder::new();
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
        &SCENE.replace("max_bounces = 2", "max_bounces = 3"),
    );
    assert_eq!(source(), "made");
}

#[test]
fn references_from_outside_are_used_if_they_fit() {
    let folder = Folder::new();
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
    folder.refuse("bench scene.toml --write-docs scene.toml", "<!-- bench -->");
}

#[test]
fn a_regression_exits_with_1() {
    let folder = Folder::new();
    folder.succeed(QUICK);
    let itself = "bench --report out/results.json --against out/results.json";
    let shown = folder.succeed(itself);
    assert!(shown.contains("1.000 x efficiency") && !shown.contains("REGRESSION"));

    // As if one row had been a hundred times as efficient before.
    let mut earlier = folder.json("out/results.json");
    let row = &mut earlier["rows"][2];
    row["cpu_secs"] = (row["cpu_secs"].as_f64().unwrap() / 100.0).into();
    row["efficiency"] = (row["efficiency"].as_f64().unwrap() * 100.0).into();
    folder.write("earlier.json", &earlier.to_string());
    let output = folder.run("bench --report out/results.json --against earlier.json");
    assert_eq!(output.status.code(), Some(1));
    let shown = String::from_utf8_lossy(&output.stdout);
    assert_eq!(shown.matches("REGRESSION").count(), 1, "{shown}");
    let other_way = folder.succeed("bench --report earlier.json --against out/results.json");
    assert!(!other_way.contains("REGRESSION"), "control: it grew");

    earlier["format"] = 0.into();
    folder.write("earlier.json", &earlier.to_string());
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
    use std::time::{Duration, Instant};

    let folder = Folder::new();
    // The first run leaves the reference, so that the second measures at once.
    folder.succeed(QUICK);
    std::fs::remove_file(folder.path("out/results.json")).unwrap();
    let endless =
        "bench scene.toml --backends cpu --rpp 1,4 --repeats 1000 --reference-error 0.5 -o out";
    for wait_ms in [1_000, 4_000, 16_000] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_mixray"))
            .current_dir(folder.0.path())
            .args(endless.split_whitespace())
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        let kill = Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status();
        assert!(kill.unwrap().success());
        let start = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if start.elapsed() > Duration::from_secs(30) {
                child.kill().unwrap();
                panic!("did not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        };
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
    let folder = Folder::new();
    let shown = folder.succeed("bench --paper-table --backends cpu --repeats 1 --shrink 24 -o out");
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

#[test]
fn growth_has_a_curve_a_law_and_method() {
    let folder = Folder::new();
    folder.write("page.md", "a\n<!-- growth -->\n<!-- end -->\nb\n");
    let table = folder.succeed(
        "bench --growth=rays,objects --shrink 16 --repeats 1 --backends cpu -o out --write-docs page.md",
    );
    assert!(
        table.contains("virtual objects") && table.contains("expected"),
        "{table}"
    );
    let curves = &folder.json("out/growth.json")["curves"];
    let laws: Vec<&str> = curves
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["law"].as_str().unwrap())
        .collect();
    assert_eq!(
        laws,
        ["rays", "rays", "objects", "objects"],
        "two methods each"
    );
    assert_eq!(curves[0]["points"].as_array().unwrap().len(), 5);
    // The paper's rays are as many as asked for, whatever the time they take.
    let exponent = curves[1]["rays_exponent"]["slope"].as_f64().unwrap();
    assert!((exponent - 1.0).abs() < 0.02, "{exponent}");
    assert!(
        folder.path("out/growth-rays.svg").exists()
            && folder.path("out/growth-objects.png").exists()
    );
    assert!(
        !folder.path("out/growth-build.svg").exists(),
        "control: was not asked for"
    );
    assert!(
        folder
            .read("page.md")
            .contains("| render | cpu paper jittered |")
    );
    assert_eq!(folder.read("out/growth.csv").lines().count(), 21);
    for wrong in ["bench scene.toml --growth", "bench --growth=moons"] {
        assert_eq!(folder.run(wrong).status.code(), Some(2), "{wrong}");
    }
}
#[test]
fn each_saving_has_its_rows() {
    let folder = Folder::new();
    let shown = folder.succeed(&format!("{QUICK} --ablate --goal-rpp 64"));
    let report = folder.json("out/results.json");
    let rows = report["rows"].as_array().unwrap();
    // paper, direct, and direct without seven savings, at two counts of rays; two goals with their savings and without.
    assert_eq!(rows.len(), 2 * (2 + 7) + 2 * 2);
    for (name, _) in Skip::CHOICES {
        let has_row = rows.iter().any(|row| row["without"] == *name);
        assert_eq!(has_row, *name != "specialisation", "{name}");
    }
    let rays_of = |row: &serde_json::Value| -> u64 {
        let rays = row["rays"].as_object().unwrap();
        rays.values().map(|count| count.as_u64().unwrap()).sum()
    };
    let rays = |without: serde_json::Value| {
        let row = rows.iter().find(|row| {
            row["estimator"] == "direct" && row["rays_per_pixel"] == 4 && row["without"] == without
        });
        rays_of(row.unwrap())
    };
    for saving in ["edge-real", "virtual-first"] {
        assert!(rays(saving.into()) > rays(serde_json::Value::Null));
    }
    let goals: Vec<_> = rows.iter().filter(|row| row["goal"].is_object()).collect();
    let [to_error, not_adaptive, to_noise, not_stopped] = goals.as_slice() else {
        panic!("{goals:?}");
    };
    // One digit of the error at the middle of 1 and 4 rays per pixel.
    let aim = to_error["goal"]["aim"]["target-error"].as_f64().unwrap();
    let usual = rows
        .iter()
        .find(|r| r["estimator"] == "direct" && r["rays_per_pixel"] == 4);
    let usual = usual.unwrap()["errors"]["all"]["rmse"].as_f64().unwrap();
    assert!((aim / usual - 1.0).abs() < 0.5, "{aim} {usual}");
    assert!(shown.contains(&format!("cpu direct sobol to error {aim} without adaptive")));
    assert!(rays_of(not_adaptive) >= rays_of(to_error));
    assert_eq!(not_adaptive["without"], "adaptive");
    assert!(shown.contains("cpu direct sobol to camera noise without camera-noise"));
    assert_eq!(to_noise["goal"]["aim"]["camera-noise"][2][0], 0.02);
    assert_eq!(not_stopped["without"], "camera-noise");
    let taken = |row: &serde_json::Value| row["mean_rays_per_pixel"].as_f64().unwrap();
    assert!(taken(to_noise) >= 16.0 && taken(to_noise) <= taken(not_stopped));
    assert_eq!(taken(not_stopped), 64.0);
}

#[test]
fn savings_and_goals_have_rows_by_name() {
    let folder = Folder::new();
    folder.succeed(&format!(
        "{QUICK} --estimators direct --no-skip cones --target-error 0.5 --camera-noise 0.5,20 --goal-rpp 16"
    ));
    let report = folder.json("out/results.json");
    let shown: Vec<String> = (report["rows"].as_array().unwrap().iter())
        .map(|row| format!("{} {}", row["without"], row["goal"]["aim"]))
        .collect();
    let noise = "{\"camera-noise\":[[0.5,20.0],[0.5,20.0],[0.5,20.0]]}";
    let expected = [
        "null null".to_owned(),
        "null null".to_owned(),
        "\"cones\" null".to_owned(),
        "\"cones\" null".to_owned(),
        "null {\"target-error\":0.5}".to_owned(),
        format!("null {noise}"),
    ];
    assert_eq!(shown, expected);
    folder.refuse(
        &format!("{QUICK} --no-skip specialisation"),
        "--backends gpu",
    );
    folder.refuse(&format!("{QUICK} --camera-noise 1"), "--camera-noise");
}

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
        let folder = Folder::new();
        render_parts(&folder, flags, 16, &[(0, 3), (3, 8), (8, 16)]);
        folder.succeed(&format!(
            "render scene.toml {flags} --rpp 16 -o whole.exr -o whole.png"
        ));
        folder.succeed("merge part-2.exr part-0.exr part-1.exr -o merged.exr -o merged.png");
        let whole = channels(&folder.path("whole.exr"));
        let merged = channels(&folder.path("merged.exr"));
        assert!(worst_ulp(&whole, &merged) <= 2, "{flags}");
        let open = |name: &str| image::open(folder.path(name)).unwrap();
        assert_eq!(open("whole.png"), open("merged.png"));
        let part = channels(&folder.path("part-2.exr"));
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
        folder.succeed("merge part-0.exr part-1.exr -o early.exr");
        folder.succeed("merge early.exr part-2.exr -o late.exr");
        let late = channels(&folder.path("late.exr"));
        assert!(worst_ulp(&whole, &late) <= 2);
    }
}

#[test]
fn ranges_of_a_scene_without_virtual_things_merge_too() {
    let folder = Folder::new();
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
    let folder = Folder::new();
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
    folder.succeed("render scene.toml --rpp 4 -o plain.exr");
    folder.refuse(&merge("plain.exr"), "holds no film");
    folder.refuse(&merge("photo.png"), "photo.png");
    folder.refuse("render scene.toml --rpp 4 --range 0..2 -o a.png", ".exr");
    folder.refuse("render scene.toml --rpp 4 --range 2..5 -o a.exr", "2..5");
    assert!(!folder.path("merged.exr").exists());

    folder.write("scene.toml", &SCENE.replace("0.31", "0.32"));
    folder.refuse(&merge("part-1.exr"), "changed since");
    folder.succeed("render scene.toml --rpp 16 --range 4..8 -o other.exr");
    folder.refuse(&merge("other.exr"), "different scenes");
    std::fs::rename(folder.path("scene.toml"), folder.path("moved.toml")).unwrap();
    folder.refuse(&merge("part-1.exr"), "--scene");
    folder.write("moved.toml", SCENE);
    folder.succeed(&format!("{} --scene moved.toml", merge("part-1.exr")));
}
