//! Where things stand in the window, and that it looks alike at both display scales and in both themes.

use std::path::Path;

use egui_kittest::kittest::Queryable;
use image::RgbImage;
use mixray::preview::headless::Window;
use mixray::preview::script::Step;

use super::{folder, window};

fn step(window: &mut Window, step: Step) {
    window.step(&step, &mut |_| ()).unwrap();
}

/// Left, top, right and bottom, points.
fn place(window: &mut Window, label: &str) -> [f32; 4] {
    let rect = window.harness().get_by_label(label).rect();
    [rect.left(), rect.top(), rect.right(), rect.bottom()]
}

#[test]
fn controls_stand_in_their_order_and_none_over_another() {
    let folder = folder();
    let mut window = window(&folder);
    for scale in [1.0, 2.0] {
        step(&mut window, Step::Scale(scale));
        step(&mut window, Step::Size([1240.0, 900.0]));
        let row = [
            "Open",
            "Save",
            "Reload",
            "Undo",
            "Redo",
            "Copy command",
            "Keys",
        ];
        let row = row.map(|label| place(&mut window, label));
        for pair in row.windows(2) {
            assert!(
                pair[0][2] <= pair[1][0] && pair[0][1] == pair[1][1],
                "{pair:?}"
            );
        }
        let column = ["Noise", "Sharpness", "Antialiasing", "Cartoon", "ball"];
        let column = column.map(|label| place(&mut window, label));
        for pair in column.windows(2) {
            assert!(
                pair[0][3] <= pair[1][1] && pair[0][0] == pair[1][0],
                "{pair:?}"
            );
        }
        let picture = window.app().on_screen(glam::DVec2::new(64.0, 24.0));
        assert!(picture.x < column[0][0], "the panel is beside the picture");
    }
}

/// Each pixel the mean of `n` by `n`.
fn shrunk(image: &RgbImage, n: u32) -> Vec<[f64; 3]> {
    let (width, height) = (image.width() / n, image.height() / n);
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let mean = |(x, y): (u32, u32)| {
        let mut sum = [0.0; 3];
        for (dx, dy) in (0..n).flat_map(|dy| (0..n).map(move |dx| (dx, dy))) {
            let codes = image.get_pixel(n * x + dx, n * y + dy).0;
            for channel in 0..3 {
                sum[channel] += f64::from(codes[channel]) / f64::from(n * n);
            }
        }
        sum
    };
    places.map(mean).collect()
}

fn mean_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let values = a.as_flattened().iter().zip(b.as_flattened());
    values.map(|(a, b)| (a - b).abs()).sum::<f64>() / (3 * a.len()) as f64
}

#[test]
fn both_scales_and_themes_show_the_same_window() {
    let folder = folder();
    let mut window = window(&folder);
    step(&mut window, Step::Size([640.0, 480.0]));
    step(&mut window, Step::Select("ball".to_owned()));
    step(&mut window, Step::Wait(None));
    let shot = |window: &mut Window, name: &str| {
        let path = folder.path(name);
        step(window, Step::Screenshot(Path::new(&path).to_path_buf()));
        folder.open(name)
    };
    let small = shot(&mut window, "small.png");
    assert_eq!(small.dimensions(), (640, 480));
    step(&mut window, Step::Scale(2.0));
    step(&mut window, Step::Size([640.0, 480.0]));
    step(&mut window, Step::Wait(None));
    let large = shot(&mut window, "large.png");
    assert_eq!(large.dimensions(), (1280, 960));
    let alike = mean_difference(&shrunk(&large, 2), &shrunk(&small, 1));
    assert!(alike < 4.0, "mean difference of {alike} codes");
    step(&mut window, Step::Light);
    let light = shot(&mut window, "light.png");
    let themes = mean_difference(&shrunk(&light, 2), &shrunk(&small, 1));
    assert!(
        themes > 8.0 * alike.max(1.0),
        "control: another theme, {themes}"
    );
}
