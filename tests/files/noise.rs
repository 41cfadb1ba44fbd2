//! Noise of films that repeat frames, and of grain that is wider than a profile.

use crate::support::{Folder, Random, stderr};

const SIDE: u32 = 96;

/// Frames of noise of sigma 3 about a ramp, blurred over `blur` pixels; each `repeats` times.
fn frames(folder: &Folder, count: u32, repeats: u32, blur: i32) {
    folder.create("f");
    for frame in 0..count {
        let mut random = Random(u64::from(frame) + 7);
        let white: Vec<f64> = (0..SIDE * SIDE * 3).map(|_| random.normal()).collect();
        let at = |x: i32, y: i32, c: u32| {
            let side = SIDE as i32;
            let (x, y) = (x.rem_euclid(side) as u32, y.rem_euclid(side) as u32);
            white[((y * SIDE + x) * 3 + c) as usize]
        };
        let reach = -blur..=blur;
        let values = f64::from((2 * blur + 1) * (2 * blur + 1)).sqrt();
        for copy in 0..repeats {
            let name = format!("f/s{:03}.png", frame * repeats + copy);
            folder.save(&name, SIDE, SIDE, |x, y| {
                [0, 1, 2].map(|c| {
                    let noise: f64 = reach
                        .clone()
                        .flat_map(|dy| reach.clone().map(move |dx| (dx, dy)))
                        .map(|(dx, dy)| at(x as i32 + dx, y as i32 + dy, c))
                        .sum();
                    let level = 30.0 + 2.0 * f64::from(x);
                    (level + 3.0 * noise / values).round().clamp(0.0, 255.0) as u8
                })
            });
        }
    }
}

/// Of the first channel's bins.
fn sigmas(folder: &Folder) -> Vec<f64> {
    let profile: toml::Table = folder.read("noise.toml").parse().expect("parses");
    let bins = profile["bin"].as_array().expect("bins");
    bins.iter()
        .map(|bin| {
            bin["sigma"].as_array().expect("three")[0]
                .as_float()
                .expect("a number")
        })
        .collect()
}

fn calibrate(folder: &Folder) -> String {
    let output = folder.run("noise calibrate f -o noise.toml");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    stderr(&output)
}

#[test]
fn n_dup() {
    let folder = Folder::new();
    frames(&folder, 8, 2, 0);
    let said = calibrate(&folder);
    assert!(said.contains("8 of 16 frames repeat"), "{said}");
    for sigma in sigmas(&folder) {
        assert!((sigma - 3.0).abs() < 0.15, "{sigma}");
    }
    let single = Folder::new();
    frames(&single, 8, 1, 0);
    assert!(!calibrate(&single).contains("repeat"), "control");
    let copies = Folder::new();
    frames(&copies, 1, 4, 0);
    copies.refuse(
        "noise calibrate f -o noise.toml",
        "all 4 frames hold the same pixels",
    );
}

#[test]
fn n_grain() {
    let folder = Folder::new();
    frames(&folder, 8, 1, 2);
    let said = calibrate(&folder);
    assert!(said.contains("finer grain"), "{said}");
    let narrow = Folder::new();
    frames(&narrow, 8, 1, 1);
    let said = calibrate(&narrow);
    assert!(!said.contains("finer grain"), "control: {said}");
}
