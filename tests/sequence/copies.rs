//! The paper's copies, against its own formula.

use image::{Rgb, RgbImage};
use mixray::scene::MotionBlurSettings;
use mixray::stages::motion_blur::{Copies, draw_copies};

use crate::support::Folder;

const WIDTH: usize = 96;
const HEIGHT: usize = 8;

/// A white square from column 28 to 67, drawn over black.
fn drawn(copies: &Copies) -> Vec<f64> {
    let layer: Vec<[f32; 4]> = (0..WIDTH * HEIGHT)
        .map(|i| match (28..68).contains(&(i % WIDTH)) {
            true => [1.0; 4],
            false => [0.0; 4],
        })
        .collect();
    let mut canvas = vec![[0.0; 4]; WIDTH * HEIGHT];
    draw_copies(&mut canvas, (WIDTH as u32, HEIGHT as u32), &layer, copies);
    let row = &canvas[4 * WIDTH..5 * WIDTH];
    assert!(
        row.iter().all(|pixel| (pixel[0] - pixel[3]).abs() < 1e-6),
        "covered as it is white"
    );
    row.iter().map(|pixel| f64::from(pixel[0])).collect()
}

#[test]
fn the_profile_is_the_papers() {
    let settings = MotionBlurSettings::default();
    let copies = Copies::of([20.0, 0.0], &settings).expect("long enough");
    assert_eq!(copies.count, 20);
    let row = drawn(&copies);
    let n = 20.0f64;
    for (x, found) in row.iter().enumerate() {
        // The copies stand at -10, -9 ... 9 px.
        let covering = (-10..10)
            .filter(|offset| (28..68).contains(&(x as i64 - offset)))
            .count();
        let mut expected = 1.0 - (1.0 - 1.0 / n).powi(covering as i32);
        if (28..68).contains(&x) {
            expected = 1.0 - (1.0 - expected) * (1.0 - 0.8);
        }
        assert!(
            (found - expected).abs() < 1e-5,
            "{x}: {found}, not {expected}"
        );
    }
    // As wide as a shutter's ramp of 20 px within a step.
    let touched = row
        .iter()
        .take(48)
        .filter(|v| **v > 0.0 && **v < row[48] - 1e-6)
        .count();
    assert!((19..=21).contains(&touched), "{touched}");
    let other = Copies::of([16.0, 0.0], &settings).expect("long enough");
    assert!(
        (drawn(&other)[20] - row[20]).abs() > 0.05,
        "control: another length"
    );
}

#[test]
fn the_thresholds_leave_short_and_long_motion_alone() {
    let settings = MotionBlurSettings::default();
    for (blur, is_blurred) in [
        ([4.9, 0.0], false),
        ([3.0, 4.1], true),
        ([0.0, 149.0], true),
        ([-150.5, 0.0], false),
        ([f32::NAN, 0.0], false),
    ] {
        assert_eq!(
            Copies::of(blur, &settings).is_some(),
            is_blurred,
            "{blur:?}"
        );
    }
    let coarse = MotionBlurSettings {
        step_px: 3.0,
        ..settings
    };
    assert_eq!(
        Copies::of([20.0, 0.0], &coarse).expect("long enough").count,
        6,
        "rounded down"
    );
}

/// A layer of another program, over a photograph.
#[test]
fn layers_of_other_programs_are_blurred() {
    let folder = Folder::new();
    let grey = |name: &str, value: fn(u32) -> u8| {
        let picture = RgbImage::from_fn(96, 8, |x, _| Rgb([value(x); 3]));
        picture.save(folder.path(name)).expect("saves");
    };
    grey("photo.png", |_| 0);
    grey("layer.png", |_| 255);
    grey("mask.png", |x| if (28..68).contains(&x) { 255 } else { 0 });
    let done = |vector: &str, out: &str| {
        let output = folder.run(&[
            "motion-blur",
            "photo.png",
            "layer.png",
            "mask.png",
            "--vector",
            vector,
            "-o",
            out,
        ]);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        image::open(folder.path(out)).expect("opens").into_rgb8()
    };
    let blurred = done("-20,0", "out.png");
    let settings = MotionBlurSettings::default();
    let row = drawn(&Copies::of([-20.0, 0.0], &settings).expect("long enough"));
    for (x, expected) in row.iter().enumerate() {
        let expected = mixray::scene::srgb::encode8(*expected as f32);
        assert!(
            blurred.get_pixel(x as u32, 4).0[0].abs_diff(expected) <= 1,
            "{x}"
        );
    }
    let sharp = done("3,0", "sharp.png");
    assert_eq!(
        (sharp.get_pixel(27, 4).0[0], sharp.get_pixel(28, 4).0[0]),
        (0, 255),
        "control: too short"
    );
    let output = folder.run(&[
        "motion-blur",
        "photo.png",
        "layer.png",
        "mask.png",
        "--vector",
        "x",
        "-o",
        "out.png",
    ]);
    assert_eq!(output.status.code(), Some(2));
}
