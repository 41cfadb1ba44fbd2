//! Camera stages, materials and the shutter set in the window: the file renders what it showed.

use mixray::preview::headless;
use mixray::preview::render_threads::Level;
use mixray::preview::script::parse;
use mixray::scene::{NoiseFit, NoiseProfile};

use super::{FRAME_TIME, SCENE, folder, window};
use crate::support::Folder;

fn run(folder: &Folder, script: &str) {
    let steps = parse(script).unwrap();
    let scene = folder.path("scene.toml");
    headless::run(&scene, &steps, FRAME_TIME, &mut |_| ()).unwrap();
}

/// The table and ball as a camera with noise of its own takes them.
fn noisy() -> Folder {
    let folder = Folder::new();
    let profile = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 4.0 }, 4);
    folder.write("noise.toml", profile.to_toml());
    let stages = "
[noise] # by ten shots
profile = \"noise.toml\"
scale = 1.0 # the camera's own

[antialias]
beta = 0.8
";
    folder.write("scene.toml", format!("{SCENE}{stages}"));
    folder
}

#[test]
fn stages_are_set_saved_and_rendered_alike() {
    let folder = noisy();
    run(
        &folder,
        "\
expect noise_scale 1
set noise_scale 0.5
set antialias_beta 0.4
press Sharpness
set sharpness_sigma_px 1.2
set sharpening 0.5
set blades 6
set blade_rotation_deg 12
expect file-differs-from-window
save
expect file-equals-window
set noise_scale 3
expect file-differs-from-window
undo
expect noise_scale 0.5
undo
expect blade_rotation_deg 0
redo
expect blade_rotation_deg 12
expect file-equals-window
",
    );
    let text = folder.read("scene.toml");
    for line in [
        "[noise] # by ten shots",
        "scale = 0.5 # the camera's own",
        "beta = 0.4",
        "sigma_px = 1.2",
        "sharpening = 0.5",
        "aperture = 6",
        "blade_rotation_deg = 12.0",
        "f_number = 1.8 # wide open",
    ] {
        assert!(text.contains(line), "{line}:\n{text}");
    }
    assert!(!folder.path("scene.toml.unsaved").exists(), "nobody's work");
}

#[test]
fn a_cartoon_takes_the_place_of_the_other_stages_and_gives_it_back() {
    let folder = noisy();
    let before = folder.read("scene.toml");
    run(
        &folder,
        "\
press Cartoon
set cartoon_iterations 2
set cartoon_sigma_p 0.05
save
expect file-equals-window
",
    );
    let text = folder.read("scene.toml");
    assert!(
        text.contains("[cartoon]\niterations = 2\nsigma_p = 0.05\n"),
        "{text}"
    );
    assert!(
        !text.contains("[noise]") && !text.contains("[antialias]"),
        "{text}"
    );
    folder.write("scene.toml", &before);
    run(
        &folder,
        "\
press Cartoon
press Cartoon
expect noise_scale 1
expect saved
press Noise
expect unsaved
undo
expect saved
",
    );
    assert_eq!(folder.read("scene.toml"), before);
}

#[test]
fn another_stage_keeps_the_film() {
    let folder = noisy();
    let mut window = window(&folder);
    window.wait_for_picture(None).unwrap();
    let before = window.session().shown().unwrap();
    window.session_mut().edit("noise", |composition| {
        composition.stages.noise = None;
    });
    window.wait_for_picture(None).unwrap();
    assert_ne!(window.session().shown().unwrap().codes, before.codes);
    let latencies = || window.session().renderers().latencies();
    let of_stages: Vec<_> = latencies()
        .into_iter()
        .filter(|l| l.change == "stages")
        .collect();
    assert!(
        !of_stages.is_empty() && of_stages.iter().all(|l| l.level == Level::Fine),
        "no coarse picture: {of_stages:?}"
    );
    window.session_mut().edit("focus", |composition| {
        composition.lens.focus_distance_m = 2.0;
    });
    window.wait_for_picture(None).unwrap();
    let has_coarse = |l: &mixray::preview::render_threads::Latency| {
        l.change == "lens" && l.level == Level::Coarse
    };
    let latencies = window.session().renderers().latencies();
    assert!(latencies.iter().any(has_coarse), "control");
}

#[test]
fn a_material_is_set_saved_and_rendered_alike() {
    let folder = Folder::new();
    let material = "name = \"ball\"\nmaterial = { base_color = [0.8, 0.1, 0.1] } # red";
    folder.write("scene.toml", SCENE.replace("name = \"ball\"", material));
    run(
        &folder,
        "\
expect material ball red 0.8
expect material ball roughness 1
material ball roughness 0.25
material ball metallic 1
expect file-differs-from-window
save
expect file-equals-window
material ball green 0.7
undo
expect material ball green 0.1
expect file-equals-window
",
    );
    let text = folder.read("scene.toml");
    let line =
        "material = { base_color = [0.8, 0.1, 0.1] , metallic = 1.0, roughness = 0.25 } # red";
    let words = |text: &str| {
        text.split([' ', ','])
            .filter(|w| !w.is_empty())
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert!(words(&text).contains(&words(line)), "{text}");
}

#[test]
fn an_objects_own_material_is_replaced_on_demand() {
    let folder = folder();
    run(
        &folder,
        "\
click 32 19
press Replace material
expect material ball roughness 1
material ball clearcoat 0.5
material ball blue 0.25
save
expect file-equals-window
undo
undo
undo
expect file-differs-from-window
",
    );
    let text = folder.read("scene.toml");
    assert!(
        text.contains("clearcoat = 0.5") && text.contains("0.25]"),
        "{text}"
    );
}

#[test]
fn the_shutter_is_opened_and_time_goes_on() {
    let folder = Folder::new();
    let motion = "
[[virtual.motion]]
time_secs = 0.0

[[virtual.motion]]
time_secs = 1.0 # a second later
translation = [0.8, 0.0, 0.0]

[render]";
    folder.write("scene.toml", SCENE.replace("\n[render]", motion));
    run(
        &folder,
        "\
press Motion blur
set exposure_secs 0.4
set time_secs 0.5
expect time_secs 0.5
save
expect file-equals-window
set exposure_secs 0.1
expect file-differs-from-window
undo
undo
expect time_secs 0
",
    );
    let text = folder.read("scene.toml");
    assert!(
        text.contains("[shutter]\nexposure_secs = 0.4\ntime_secs = 0.5\n"),
        "{text}"
    );
    assert!(text.contains("time_secs = 1.0 # a second later"), "{text}");
}
