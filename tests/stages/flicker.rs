//! Silhouettes of a static scene under camera noise: the simplification keeps them from flickering.

use mixray::scene::CartoonSettings;
use mixray::stages::EncodedImage;
use mixray::stages::cartoon::cartoon;

use crate::support::Random;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;

/// Coloured things with edges of many strengths.
fn scene(x: u32, y: u32) -> [f64; 3] {
    let (x, y) = (f64::from(x), f64::from(y));
    let mut rgb = [120.0, 125.0, 130.0 + 0.1 * y];
    for (i, (cx, cy, r)) in [
        (60.0, 60.0, 30.0),
        (160.0, 120.0, 50.0),
        (250.0, 60.0, 25.0),
        (90.0, 180.0, 40.0),
        (260.0, 180.0, 45.0),
    ]
    .into_iter()
    .enumerate()
    {
        if (x - cx).hypot(y - cy) < r {
            rgb[i % 3] += 25.0 + 15.0 * i as f64;
            rgb[(i + 1) % 3] -= 12.0 * i as f64;
        }
    }
    rgb
}

fn frame(rng: &mut Random, sigma: f64) -> EncodedImage {
    let rgb = (0..WIDTH * HEIGHT)
        .map(|i| {
            scene(i % WIDTH, i / WIDTH)
                .map(|v| ((v + sigma * rng.normal()).round().clamp(0.0, 255.0) / 255.0) as f32)
        })
        .collect();
    EncodedImage {
        width: WIDTH,
        height: HEIGHT,
        rgb,
    }
}

/// Share of edge pixels (in either frame) that change from frame to frame.
fn flicker(settings: &CartoonSettings, sigma: f64) -> f64 {
    let mut rng = Random(8);
    let edges: Vec<Vec<bool>> = (0..5)
        .map(|_| {
            let edges = cartoon(&frame(&mut rng, sigma), settings, true)
                .edges
                .expect("asked for");
            edges.silhouette.iter().map(|s| *s > 0.35).collect()
        })
        .collect();
    let (mut changed, mut all) = (0, 0);
    for pair in edges.windows(2) {
        for (a, b) in pair[0].iter().zip(&pair[1]) {
            all += usize::from(*a || *b);
            changed += usize::from(a != b);
        }
    }
    assert!(all > 1000, "there are edges: {all}");
    changed as f64 / all as f64
}

#[test]
fn the_simplification_steadies_the_silhouettes() {
    let with = CartoonSettings {
        shrunk_width: 120,
        shrunk_height: 90,
        ..CartoonSettings::default()
    };
    // Off: edges of the picture itself with the same thresholds.
    let without = CartoonSettings {
        beta: 1.0,
        a0: with.s0,
        a1: with.s1,
        ..with
    };
    let (steady, flickering) = (flicker(&with, 6.0), flicker(&without, 6.0));
    eprintln!(
        "edge pixels that change from frame to frame: {:.1}% with the simplification, {:.1}% without",
        100.0 * steady,
        100.0 * flickering
    );
    assert!(steady < 0.25 * flickering, "{steady} {flickering}");
    // Control: without noise nothing flickers, either way.
    assert_eq!(flicker(&without, 0.0), 0.0);
}
