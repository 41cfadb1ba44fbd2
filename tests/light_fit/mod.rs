//! `mixray light fit` finds the light of photographs that were rendered under a known one, and none where there is none to find.

use glam::DVec3;
use serde_json::Value;

use crate::support::{Folder, Random, stderr};

const CAMERA: &str = "\
[camera]
width = 96
height = 72
vertical_fov_deg = 45
position = [0.3, 1.6, 2.6]
look_at = [0, 0.1, 0]
";
/// Towards the sun.
const SUN: [f64; 3] = [0.6634, 0.6428, -0.3830];
const ROTATION_DEG: f64 = 130.0;
const SCALE: f64 = 0.8;
const IRRADIANCE: f64 = 0.9;

/// A floor of tiles and boxes on it, each of its own colour.
fn things(side: &str, known: bool) -> String {
    let mut random = Random(7);
    let mut text = String::new();
    let mut add = |shape: String| {
        let grey = 0.25 + 0.4 * random.uniform();
        let colour = [0, 1, 2].map(|_| grey * (0.85 + 0.3 * random.uniform()));
        let look = match known {
            true => format!("material = {{ base_color = {colour:?}, specular = 0.0 }}"),
            false => "albedo = \"from-photo\"".to_owned(),
        };
        text += &format!("[[{side}]]\n{shape}\n{look}\n\n");
    };
    for tile in 0..36 {
        let (x, z) = (
            -2.1 + 0.7 * f64::from(tile % 6),
            2.1 - 0.7 * f64::from(tile / 6),
        );
        add(format!(
            "shape = \"quad\"\ncorner = [{x:?}, 0, {z:?}]\nedge_u = [0.7, 0, 0]\nedge_v = [0, 0, -0.7]"
        ));
    }
    for (x, z, side_m, height, turn) in [
        (-0.6, -0.3, 0.35, 0.5, 20),
        (0.5, 0.2, 0.3, 0.25, -35),
        (0.1, -0.9, 0.5, 0.8, 10),
        (-0.2, 0.7, 0.2, 0.15, 50),
    ] {
        let up = 0.5 * height + 0.001;
        add(format!(
            "shape = \"box\"\nsize = [{side_m:?}, {height:?}, {side_m:?}]\ntranslation = [{x:?}, {up:?}, {z:?}]\nrotation_deg = [0, {turn}, 0]"
        ));
    }
    text
}

fn environment(rotation_deg: f64, scale: f64) -> String {
    format!(
        "[environment]\nimage = \"room.png\" # a window and a lamp\nrotation_deg = {rotation_deg:?}\nscale = {scale:?} # by eye\n\n"
    )
}

const WHITE: &str = "[environment]\nradiance = [0.6, 0.6, 0.6]\n\n";

/// A scene without a photograph, all of it drawn: taken as one.
fn photograph(folder: &Folder, light: &str, name: &str) {
    let text = format!(
        "{CAMERA}{light}{}[render]\nrays_per_pixel = 64\nmax_bounces = 4\nbackend = \"cpu\"\n",
        things("virtual", true)
    );
    folder.write("truth.toml", text);
    folder.succeed(&["-q", "render", "truth.toml", "-o", name]);
}

fn scene(photo: &str, light: &str, known: bool) -> String {
    format!(
        "# A test.\n[photo]\nimage = \"{photo}\"\n\n{CAMERA}{light}{}",
        things("real", known)
    )
}

fn folder() -> Folder {
    let folder = Folder::new();
    folder.save("room.png", 64, 32, |x, y| {
        let window = (20..30).contains(&x) && (8..16).contains(&y);
        let lamp = (50..54).contains(&x) && (4..8).contains(&y);
        match (window, lamp) {
            (true, _) => [255; 3],
            (_, true) => [200; 3],
            _ => [70; 3],
        }
    });
    folder
}

fn sun_over(sky: f64, irradiance: f64) -> String {
    let sun = SUN.map(|x| -x);
    format!(
        "{}[[light]]\nkind = \"directional\"\nside = \"virtual\"\ndirection = {sun:?}\nirradiance = {:?}\n\n",
        environment(ROTATION_DEG, sky),
        [irradiance; 3]
    )
}

fn sunny(folder: &Folder) {
    photograph(folder, &sun_over(SCALE, IRRADIANCE), "photo.png");
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// Degrees between the sun that was found and the one that shone.
fn off_sun_deg(fit: &Value) -> f64 {
    let found = fit["sun"]["direction"].as_array().expect("a sun is found");
    let found = DVec3::from_slice(&found.iter().map(number).collect::<Vec<f64>>());
    (-found).angle_between(DVec3::from(SUN)).to_degrees()
}

#[test]
fn sun_and_rotation_are_found() {
    let folder = folder();
    sunny(&folder);
    folder.write(
        "scene.toml",
        scene("photo.png", &environment(10.0, 1.0), false),
    );
    folder.succeed("light fit scene.toml -o fitted.toml --residual left.png --stats fit.json");
    let fit = folder.json("fit.json");
    let off = off_sun_deg(&fit);
    assert!(off < 3.0, "{off} degrees: {fit:#}");
    let rotation = number(&fit["rotation_deg"]["is"]);
    assert!((rotation - ROTATION_DEG).abs() < 10.0, "{fit:#}");
    let share = number(&fit["sun"]["irradiance"]) / number(&fit["scale"]["is"]);
    let right = IRRADIANCE / SCALE;
    assert!((share / right - 1.0).abs() < 0.25, "{share}, not {right}");
    let explained = &fit["explained"];
    assert!(number(&explained["fitted"]) > number(&explained["as_given"]) + 0.1);
    assert!(number(&explained["fitted"]) > number(&explained["by_white_sky"]) + 0.1);
    assert!(folder.open("left.png").width() > 900);
    let text = folder.read("fitted.toml");
    for kept in ["# A test.", "# a window and a lamp", "# by eye"] {
        assert!(text.contains(kept), "{kept}: {text}");
    }
    // The sun that was written is fitted again, not added to.
    folder.succeed("light fit fitted.toml --write --stats again.json");
    let text = folder.read("fitted.toml");
    assert_eq!(text.matches("[[light]]").count(), 1, "{text}");
    assert!(off_sun_deg(&folder.json("again.json")) < 3.0);
}

const STRONG_OVER_SKY: f64 = 10.0;

/// Of a photograph of 96 x 72 pixels under a sun that is ten times as strong as the room's light.
fn strong_sun(known: bool) -> Value {
    let folder = folder();
    let sky = 0.25;
    photograph(&folder, &sun_over(sky, STRONG_OVER_SKY * sky), "photo.png");
    let begin = environment(10.0, 1.0);
    folder.write("scene.toml", scene("photo.png", &begin, known));
    folder.run("light fit scene.toml --stats fit.json");
    folder.json("fit.json")
}

fn assert_strong_sun(fit: &Value) {
    let off = off_sun_deg(fit);
    assert!(off < 4.0, "{off} degrees: {fit:#}");
    let share = number(&fit["sun"]["irradiance"]) / number(&fit["scale"]["is"]);
    assert!((share / STRONG_OVER_SKY - 1.0).abs() < 0.25, "{share}");
    assert!(
        (share / (1.6 * STRONG_OVER_SKY) - 1.0).abs() > 0.25,
        "control"
    );
}

#[test]
fn a_strong_sun_in_a_small_photograph_is_as_strong_as_it_is() {
    let fit = strong_sun(false);
    assert_eq!(fit["poor"], false, "{fit:#}");
    assert_strong_sun(&fit);
}

#[test]
fn a_strong_sun_over_known_albedos_is_as_strong_as_it_is() {
    let fit = strong_sun(true);
    assert_eq!(fit["poor"], false, "{fit:#}");
    assert_strong_sun(&fit);
    let rotation = number(&fit["rotation_deg"]["is"]);
    assert!((rotation - ROTATION_DEG).abs() < 10.0, "{fit:#}");
    let share = number(&fit["sun"]["irradiance"]) / number(&fit["scale"]["is"]);
    let sigma = number(&fit["sun"]["irradiance_relative_sigma"]);
    let off = (share / STRONG_OVER_SKY).ln().abs();
    assert!(off < 2.0 * sigma, "{off}: {fit:#}");
    assert!(sigma < 0.5, "control: {sigma}");
}

#[test]
fn under_a_white_sky_no_sun_is_invented() {
    let folder = folder();
    photograph(&folder, WHITE, "photo.png");
    for known in [true, false] {
        let white = WHITE.replace("0.6", "1.0");
        folder.write("scene.toml", scene("photo.png", &white, known));
        // Whether or not so little shading is worth a scene.
        folder.run("light fit scene.toml --stats fit.json");
        let fit = folder.json("fit.json");
        assert_eq!(fit["sun"], Value::Null, "{fit:#}");
        assert_eq!(fit["rotation_deg"], Value::Null);
        if known {
            let scale = number(&fit["scale"]["is"]);
            assert!((scale / 0.6 - 1.0).abs() < 0.03, "{fit:#}");
        }
    }
    // Another environment than that of the photograph is told.
    folder.write(
        "scene.toml",
        scene("photo.png", &environment(0.0, 1.0), true),
    );
    let output = folder.run("light fit scene.toml");
    assert!(
        stderr(&output).contains("try --white-sky"),
        "{}",
        stderr(&output)
    );
}

/// The scene says other albedos than were photographed, each its own by 5%.
#[test]
fn the_scale_is_as_sure_as_it_says() {
    let folder = folder();
    let (mut told, mut told_off) = (0, 0);
    for case in 0..4u32 {
        let scale = 0.5 + 0.1 * f64::from(case);
        let (name, light) = (format!("{case}.png"), environment(ROTATION_DEG, scale));
        photograph(&folder, &light, &name);
        let mut random = Random(100 + u64::from(case));
        let text = scene(&name, &environment(ROTATION_DEG, 1.0), true);
        let lines = text.lines().map(|line| {
            let Some(start) = line.strip_prefix("material = { base_color = [") else {
                return line.to_owned();
            };
            let (colour, rest) = start.split_once(']').expect("a list");
            let error = 1.0 + 0.05 * random.normal();
            let channels = colour
                .split(", ")
                .map(|c| c.parse::<f64>().expect("a number") * error);
            let colour: Vec<f64> = channels.collect();
            format!("material = {{ base_color = {colour:?}{rest}")
        });
        folder.write("scene.toml", lines.collect::<Vec<_>>().join("\n"));
        folder.succeed("light fit scene.toml --keep-rotation --stats fit.json");
        let found = &folder.json("fit.json")["scale"];
        let (is, sigma) = (number(&found["is"]), number(&found["sigma"]));
        assert!(sigma < 0.05 * scale, "it says something: {found:#}");
        told += u32::from((is - scale).abs() <= 2.0 * sigma);
        told_off += u32::from((is - 1.2 * scale).abs() <= 2.0 * sigma);
    }
    assert!(told >= 3, "{told} of 4 within two standard deviations");
    assert_eq!(told_off, 0, "control: of another scale none");
}

#[test]
fn a_photograph_of_something_else_is_told_and_changes_nothing() {
    let folder = folder();
    let mut random = Random(3);
    let spots: Vec<u8> = (0..12 * 9)
        .map(|_| (40.0 + 160.0 * random.uniform()) as u8)
        .collect();
    folder.save("photo.png", 96, 72, |x, y| {
        [spots[(y / 8 * 12 + x / 8) as usize]; 3]
    });
    let text = scene("photo.png", &environment(10.0, 1.0), false);
    folder.write("scene.toml", &text);
    let output = folder.run("light fit scene.toml -o fitted.toml --stats fit.json");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("everything is kept"));
    assert!(!folder.path("fitted.toml").exists());
    assert_eq!(folder.json("fit.json")["poor"], true);
    folder.succeed("info scene.toml");
    assert_eq!(folder.read("scene.toml"), text, "control: it stays");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let folder = folder();
    folder.save("photo.png", 96, 72, |x, _| [x as u8 + 60; 3]);
    folder.write("scene.toml", scene("photo.png", WHITE, true));
    folder.create("other");
    folder.refuse(
        "light fit scene.toml -o other/new.toml",
        "lies in another folder",
    );
    folder.refuse("light fit scene.toml -o scene.toml", "scene.toml");
    let lamp = "[[light]]\nkind = \"point\"\nposition = [0, 2, 0]\nintensity = [1, 1, 1]\n";
    folder.write("lamp.toml", folder.read("scene.toml") + lamp);
    folder.refuse("light fit lamp.toml", "lamps near by");
    let bare = folder
        .read("scene.toml")
        .replace("[photo]\nimage = \"photo.png\"\n", "");
    folder.write("bare.toml", bare);
    folder.refuse("light fit bare.toml", "no photograph");
    let away = folder
        .read("scene.toml")
        .replace("look_at = [0, 0.1, 0]", "look_at = [0, 9, 9]");
    folder.write("away.toml", away);
    folder.refuse("light fit away.toml", "at 0 points");
}
