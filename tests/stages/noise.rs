//! The noise that a stage adds is the noise that a calibration measures.

use mixray::film::Picture;
use mixray::scene::srgb::{decode, encode, encode8};
use mixray::scene::{NoiseFit, NoiseMethod, NoiseProfile, NoiseSettings};
use mixray::stages::calibration::{calibrate, group_frames};
use mixray::stages::noise::{NoiseInput, NoiseStage, autocorrelation_of, fit_kernel};

use super::spread;
use crate::support::{Folder, Random, largest};

/// A grey ramp over all levels, linear.
fn ramp(width: u32, height: u32) -> Picture {
    let linear = (0..width * height)
        .map(|i| [decode(f64::from(i % width) / f64::from(width - 1)) as f32; 3])
        .collect();
    Picture {
        width,
        height,
        linear,
    }
}

/// Sigmas that differ by bin and channel, neighbours and channels that share noise.
fn profile() -> NoiseProfile {
    let mut profile = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 2.0 }, 4);
    for (j, bin) in profile.bins.iter_mut().enumerate() {
        bin.sigma = [
            1.2 + 0.4 * j as f64,
            1.0 + 0.3 * j as f64,
            2.5 - 0.3 * j as f64,
        ];
    }
    // Lags that a camera could have: those of some kernel.
    let mut kernel = [[0.0; 7]; 7];
    for (y, row) in kernel.iter_mut().enumerate() {
        for (x, weight) in row.iter_mut().enumerate() {
            let (dx, dy) = (x as f64 - 3.0, y as f64 - 3.0);
            *weight = (-0.5 * (dx * dx / 0.8 + dy * dy / 0.5)).exp();
        }
    }
    let energy: f64 = kernel.iter().flatten().map(|w| w * w).sum();
    let kernel = kernel.map(|row| row.map(|weight| weight / energy.sqrt()));
    profile.autocorrelation = [autocorrelation_of(&kernel); 3];
    profile.autocorrelation[2] = mixray::scene::WHITE;
    profile.channel_correlation = [0.6, 0.2, 0.1];
    profile
}

fn frames(folder: &Folder, settings: &NoiseSettings, seed: u32, count: u32) -> NoiseProfile {
    let stage = NoiseStage::new(settings, seed);
    let paths: Vec<_> = (0..count)
        .map(|frame| {
            let mut picture = ramp(192, 128);
            stage.apply(&mut picture, &NoiseInput::default(), frame);
            folder.save(&format!("{frame:03}.png"), 192, 128, |x, y| {
                picture.linear[(y * 192 + x) as usize].map(encode8)
            })
        })
        .collect();
    calibrate(
        &group_frames(&paths).unwrap(),
        settings.profile.bins.len(),
        &mut |_, _| (),
    )
    .unwrap()
    .profile
}

/// A shell names them by letters: 10, 100, 9.
#[test]
fn frames_are_read_in_the_order_of_their_numbers() {
    let folder = Folder::new();
    let save = |number| folder.save(&format!("frame{number}.png"), 4, 4, |_, _| [9; 3]);
    let scenes = group_frames(&[10, 100, 9].map(save)).unwrap();
    let numbers = scenes[0].paths.iter().map(|path| {
        let name = path.file_stem().unwrap().to_string_lossy();
        name.trim_start_matches("frame").to_owned()
    });
    assert_eq!(numbers.collect::<Vec<_>>(), ["9", "10", "100"]);
}

/// Relative errors of sigma over bins and channels: median and largest.
fn sigma_errors(found: &NoiseProfile, truth: &NoiseProfile) -> (f64, f64) {
    let mut errors: Vec<f64> = found
        .bins
        .iter()
        .zip(&truth.bins)
        .flat_map(|(a, b)| (0..3).map(move |c| (a.sigma[c] / b.sigma[c] - 1.0).abs()))
        .collect();
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], errors[errors.len() - 1])
}

#[test]
fn calibrated_rendered_and_calibrated_again() {
    let truth = profile();
    let found = frames(&Folder::new(), &NoiseSettings::new(truth.clone()), 3, 16);
    let (median, most) = sigma_errors(&found, &truth);
    eprintln!(
        "sigma by bin and channel: median error {:.2}%, largest {:.2}%",
        100.0 * median,
        100.0 * most
    );
    assert!(median < 0.02 && most < 0.05, "{found:?}");
    let mut worst = 0.0f64;
    for c in 0..3 {
        for (a, b) in found.autocorrelation[c]
            .iter()
            .flatten()
            .zip(truth.autocorrelation[c].iter().flatten())
        {
            worst = worst.max((a - b).abs());
        }
    }
    eprintln!("autocorrelation to lag 3: largest error {worst:.3}");
    assert!(worst < 0.03, "{found:?}");
    for (a, b) in found
        .channel_correlation
        .iter()
        .zip(truth.channel_correlation)
    {
        assert!((a - b).abs() < 0.03, "{found:?}");
    }
    // Controls: the bins and the channels differ by more than that.
    let mut other = truth.clone();
    other.bins.rotate_left(1);
    assert!(sigma_errors(&found, &other).0 > 0.05);
    assert!((found.autocorrelation[0][0][4] - found.autocorrelation[2][0][4]).abs() > 0.2);
}

#[test]
fn the_papers_textures_have_the_measured_sigma_too() {
    let truth = profile();
    let settings = NoiseSettings {
        method: NoiseMethod::Textures,
        ..NoiseSettings::new(truth.clone())
    };
    let found = frames(&Folder::new(), &settings, 3, 16);
    let (median, most) = sigma_errors(&found, &truth);
    assert!(median < 0.02 && most < 0.05, "{found:?}");
    let scaled = NoiseSettings {
        scale: 1.5,
        ..settings
    };
    let found = frames(&Folder::new(), &scaled, 3, 8);
    assert!(
        sigma_errors(&found, &truth).0 > 0.3,
        "control: another scale"
    );
}

/// Texels are squares of the magnification's size where nothing is rotated away; 8 bits hold whole codes only; a delay keeps frames.
#[test]
fn textures_have_the_papers_refinements() {
    let base = NoiseSettings {
        method: NoiseMethod::Textures,
        texture_size: 64,
        eight_bit: true,
        ..NoiseSettings::new(profile())
    };
    let variation = |settings: &NoiseSettings, frame: u32| -> Vec<i32> {
        let mut picture = Picture {
            width: 96,
            height: 96,
            linear: vec![[decode(0.5) as f32; 3]; 96 * 96],
        };
        NoiseStage::new(settings, 1).apply(&mut picture, &NoiseInput::default(), frame);
        picture
            .linear
            .iter()
            .map(|v| {
                let dn = 255.0 * (encode(f64::from(v[1])) - 0.5);
                assert!((dn - dn.round()).abs() < 0.01, "whole codes: {dn}");
                dn.round() as i32
            })
            .collect()
    };
    let equal_neighbours = |v: &[i32]| {
        let pairs = v.windows(2).filter(|w| w[0] == w[1]).count();
        pairs as f64 / v.len() as f64
    };
    let plain = equal_neighbours(&variation(&base, 0));
    let magnified = NoiseSettings {
        magnification: 4.0,
        ..base.clone()
    };
    let large = equal_neighbours(&variation(&magnified, 0));
    assert!(large > 0.65 && plain < 0.4, "{large} {plain}");
    assert_ne!(variation(&base, 0), variation(&base, 1));
    let delayed = NoiseSettings {
        update_delay_frames: 3,
        ..base.clone()
    };
    assert_eq!(variation(&delayed, 3), variation(&delayed, 5));
    assert_ne!(variation(&delayed, 5), variation(&delayed, 6));
}

/// Photographed, half covered, rendered, shadowed and brightened pixels have one noise level.
#[test]
fn mixed_pixels_have_one_noise_level() {
    let (width, height) = (200u32, 300u32);
    let sigma = 2.5;
    let profile = NoiseProfile::from_fit(
        NoiseFit {
            a: 0.0,
            b: sigma * sigma,
        },
        4,
    );
    let mut rng = Random(11);
    // Columns: photograph, soft edge, card, shadow (ratio 0.5), all over a noisy grey photograph.
    let photo: Vec<[f32; 3]> = (0..width * height)
        .map(|_| {
            [(); 3].map(|()| {
                decode(((110.0 + sigma * rng.normal()).round() / 255.0).clamp(0.0, 1.0)) as f32
            })
        })
        .collect();
    let card = decode(150.0 / 255.0) as f32;
    let place = |x: u32| -> (f32, f32) {
        match x {
            0..40 => (0.0, 1.0),
            40..120 => ((x as f32 - 39.5) / 80.0, 1.0),
            120..160 => (1.0, 1.0),
            _ => (0.0, 0.5),
        }
    };
    let mut mask = Vec::new();
    let mut ratio = Vec::new();
    let mut linear = Vec::new();
    for (i, ic) in photo.iter().enumerate() {
        let (a, r) = place(i as u32 % width);
        mask.push(a);
        ratio.push([r; 3]);
        linear.push(if a == 0.0 && r == 1.0 {
            *ic
        } else {
            ic.map(|ic| a * card + (1.0 - a) * r * ic)
        });
    }
    let levels = |picture: &Picture| -> Vec<f64> {
        let column = |x: u32| -> Vec<f64> {
            (0..height)
                .flat_map(|y| {
                    picture.linear[(y * width + x) as usize].map(|v| 255.0 * encode(f64::from(v)))
                })
                .collect()
        };
        // Ten columns each, whose own means differ.
        (0..width / 10)
            .map(|g| {
                let variances = (10 * g..10 * g + 10).map(|x| spread(&column(x)).powi(2));
                (variances.sum::<f64>() / 10.0).sqrt()
            })
            .collect()
    };
    let mut picture = Picture {
        width,
        height,
        linear,
    };
    let before = levels(&picture);
    let input = NoiseInput {
        photo: Some(&photo),
        mask: Some(&mask),
        ratio: Some(&ratio),
        variance: None,
    };
    NoiseStage::new(&NoiseSettings::new(profile), 5).apply(&mut picture, &input, 0);
    let after = levels(&picture);
    eprintln!("noise level by column group, without the stage: {before:.2?}");
    eprintln!("noise level by column group, with the stage:    {after:.2?}");
    for level in &after {
        assert!((level / sigma - 1.0).abs() < 0.05, "{after:.2?}");
    }
    assert!(
        before[11] < 0.3 * sigma && before[17] < 0.9 * sigma,
        "control: {before:.2?}"
    );
    let untouched = (0..height).all(|y| {
        (0..40).all(|x| {
            let i = (y * width + x) as usize;
            picture.linear[i].map(f32::to_bits) == photo[i].map(f32::to_bits)
        })
    });
    assert!(untouched, "the photograph's own pixels are left alone");
}

#[test]
fn noise_is_the_same_for_any_number_of_threads() {
    let settings = NoiseSettings::new(profile());
    let run = |threads: usize, seed: u32| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut picture = ramp(97, 71);
            NoiseStage::new(&settings, seed).apply(&mut picture, &NoiseInput::default(), 2);
            picture
        })
    };
    assert_eq!(run(1, 4), run(3, 4));
    assert_ne!(run(1, 4), run(1, 5), "control");
}

#[test]
fn the_fitted_kernel_meets_the_measured_lags() {
    let lags = profile().autocorrelation[0];
    let fitted = autocorrelation_of(&fit_kernel(&lags));
    let pairs = lags.iter().flatten().zip(fitted.iter().flatten());
    let worst = largest(pairs.map(|(a, b)| a - b));
    assert!(worst < 0.01, "{worst}");
}
