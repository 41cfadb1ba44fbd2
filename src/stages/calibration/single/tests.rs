use std::path::{Path, PathBuf};

use super::super::{calibrate, group_frames};
use super::estimate_from_one;
use crate::scene::{EncodedPhoto, read_codes};
use crate::stages::settings::{LAGS, NoiseProfile, bin_index};
use crate::stages::test_support::random;

const SIZE: (u32, u32) = (256, 192);

/// A normal deviate by pixel and channel.
fn normal(index: usize) -> f32 {
    (0..12).map(|i| random(index, 77 + i)).sum::<f32>() - 6.0
}

/// Blotches of light with noise of `sigma` DN, alike in neighbours along x if `is_grain`.
fn photograph(sigma: f32, is_grain: bool) -> EncodedPhoto {
    let (width, height) = SIZE;
    let codes = (0..(width * height) as usize).map(|i| {
        let (x, y) = ((i as u32 % width) as f32, (i as u32 / width) as f32);
        // A board of squares in one half, which is no noise.
        let board = f32::from(u8::from(
            x > 128.0 && (x as u32 / 5 + y as u32 / 5).is_multiple_of(2),
        ));
        [0, 1, 2].map(|c| {
            let white = |i: usize| normal(3 * i + c);
            let noise = match is_grain {
                true => (white(i) + white(i + 1)) * std::f32::consts::FRAC_1_SQRT_2,
                false => white(i),
            };
            (90.0 + 0.2 * x + 30.0 * board + sigma * noise).round() as u8
        })
    });
    EncodedPhoto::Codes8(codes.collect())
}

#[test]
fn known_grain_is_found() {
    for (sigma, is_grain, rho) in [(3.0, true, 0.5), (3.0, false, 0.0), (0.8, true, 0.5)] {
        let photo = photograph(sigma, is_grain);
        let profile = estimate_from_one(&photo, SIZE, 16, "made").unwrap().profile;
        // Levels 90 to 115: the half without squares.
        let bin = &profile.bins[bin_index(100.0, 16)];
        for c in 0..3 {
            assert!(
                (bin.sigma[c] / f64::from(sigma) - 1.0).abs() < 0.1,
                "{bin:?}"
            );
            assert!(bin.low[c] < f64::from(sigma) && bin.high[c] > f64::from(sigma));
            let lags = &profile.autocorrelation[c];
            assert!((lags[0][LAGS + 1] - rho).abs() < 0.06, "{lags:?}");
            assert!(lags[1][LAGS].abs() < 0.06, "{lags:?}");
        }
        assert!(
            profile
                .channel_correlation
                .iter()
                .all(|rho| rho.abs() < 0.05)
        );
    }
    let clipped = EncodedPhoto::Codes8(vec![[255; 3]; (SIZE.0 * SIZE.1) as usize]);
    assert!(
        estimate_from_one(&clipped, SIZE, 16, "white").is_err(),
        "control"
    );
}

/// The folder of shared data, or None, said aloud.
fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/data")
        .join(folder);
    if !path.is_dir() {
        eprintln!("{} is absent: nothing is tested on it", path.display());
        return None;
    }
    Some(path)
}

fn estimate(path: &Path, bins: usize) -> NoiseProfile {
    let (width, height, codes) = read_codes(path).unwrap();
    estimate_from_one(&codes, (width, height), bins, "photograph")
        .unwrap()
        .profile
}

/// One shot of a flat field against the calibration by all ten.
#[test]
fn one_shot_of_a_sequence_shows_what_all_show() {
    let Some(folder) = data("nikon_d200_flat_sequence") else {
        return;
    };
    let scenes = group_frames(std::slice::from_ref(&folder)).unwrap();
    let truth = calibrate(&scenes, 16, &mut |_, _| ()).unwrap().profile;
    let most = truth
        .bins
        .iter()
        .map(|bin| bin.samples[1])
        .max()
        .unwrap_or(0);
    for path in scenes[0].paths.iter().take(3) {
        let profile = estimate(path, 16);
        for (bin, truth) in profile.bins.iter().zip(&truth.bins) {
            if truth.samples[1] * 100 < most {
                continue;
            }
            for c in 0..3 {
                let ratio = bin.sigma[c] / truth.sigma[c];
                assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
                assert!((ratio - 0.7).abs() > 0.15, "control");
            }
        }
        let rho = profile.autocorrelation[1][0][LAGS + 1];
        assert!(
            (rho - truth.autocorrelation[1][0][LAGS + 1]).abs() < 0.1,
            "{rho}"
        );
    }
}

/// Sigma by bin of a photograph less the average of many, where that average is flat: at edges the two differ by their JPEG and by how they lie.
fn sigma_of_pair(real: &Path, mean: &Path, bins: usize) -> Vec<Option<f64>> {
    let codes = |path: &Path| match read_codes(path).unwrap() {
        (width, _, EncodedPhoto::Codes8(codes)) => (width as usize, codes),
        _ => panic!("8 bits are expected"),
    };
    let ((width, real), (_, mean)) = (codes(real), codes(mean));
    let grey = |i: usize| mean[i].iter().map(|c| f64::from(*c)).sum::<f64>() / 3.0;
    let height = mean.len() / width;
    let mut sums = vec![[0.0f64; 7]; bins];
    for y in 4..height - 4 {
        for x in 4..width - 4 {
            let around =
                (y - 4..=y + 4).flat_map(|row| (x - 4..=x + 4).map(move |c| row * width + c));
            let (sum, squares) = around.fold((0.0, 0.0), |(sum, squares), i| {
                (sum + grey(i), squares + grey(i) * grey(i))
            });
            let i = y * width + x;
            if squares / 81.0 - (sum / 81.0).powi(2) > 4.0 {
                continue;
            }
            let entry = &mut sums[bin_index(grey(i), bins)];
            entry[6] += 1.0;
            for c in 0..3 {
                let d = f64::from(real[i][c]) - f64::from(mean[i][c]);
                entry[c] += d;
                entry[3 + c] += d * d;
            }
        }
    }
    let sigma = |entry: &[f64; 7]| {
        let n = entry[6];
        let variance = (0..3).map(|c| entry[3 + c] / n - (entry[c] / n).powi(2));
        (n > 0.01 * mean.len() as f64).then(|| (variance.sum::<f64>() / 3.0).sqrt())
    };
    sums.iter().map(sigma).collect()
}

/// Eight cameras' processed photographs against averages of many.
#[test]
fn photographs_show_what_their_averages_tell() {
    let Some(folder) = data("polyu_noise_pairs") else {
        return;
    };
    let mut ratios = Vec::new();
    let mut names: Vec<PathBuf> = (std::fs::read_dir(&folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_string_lossy().ends_with("_real.jpg"))
        .collect();
    names.sort();
    for real in &names {
        let mean = PathBuf::from(real.to_string_lossy().replace("_real", "_mean"));
        let profile = estimate(real, 16);
        let truth = sigma_of_pair(real, &mean, 16);
        let mut own = Vec::new();
        for (bin, truth) in profile.bins.iter().zip(truth) {
            if let Some(truth) = truth {
                own.push(bin.sigma.iter().sum::<f64>() / 3.0 / truth);
            }
        }
        own.sort_by(f64::total_cmp);
        let rho = profile.autocorrelation[1][0][LAGS + 1];
        eprintln!("{}: {own:.2?}, neighbours {rho:.2}", real.display());
        assert!(rho > 0.3, "{rho}");
        ratios.extend(own);
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    eprintln!(
        "median {median:.3}, from {:.2} to {:.2}",
        ratios[0],
        ratios[ratios.len() - 1]
    );
    assert!((median - 1.0).abs() < 0.15, "{median}");
    assert!((0.7 * median - 1.0).abs() > 0.15, "control");
}
