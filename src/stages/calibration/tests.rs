//! Calibration of cameras that are simulated here, whose noise is known.

use std::path::{Path, PathBuf};

use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};

use super::*;
use crate::stages::settings::NoiseProfile;

/// SplitMix64 and the polar method: nothing shared with the code under test.
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        loop {
            let (u, v) = (2.0 * self.next() - 1.0, 2.0 * self.next() - 1.0);
            let s = u * u + v * v;
            if s > 0.0 && s < 1.0 {
                return u * (-2.0 * s.ln() / s).sqrt();
            }
        }
    }
}

const WIDTH: u32 = 160;
const HEIGHT: u32 = 120;

/// A soft scene that shows every level from `low` to `high`.
fn scene_level(x: u32, y: u32, low: f64, high: f64) -> f64 {
    let t = f64::from(x) / f64::from(WIDTH - 1);
    low + (high - low) * t + 0.37 * f64::from(y % 7)
}

struct Camera {
    low: f64,
    high: f64,
    sigma: [f64; 3],
    /// DN added to frame f.
    offset: fn(usize) -> f64,
    gain: fn(usize) -> f64,
    /// DN added to frame f at column x: light that changes over the picture.
    local: fn(usize, u32) -> f64,
}

const STILL: Camera = Camera {
    low: 40.0,
    high: 220.0,
    sigma: [2.0, 1.5, 3.0],
    offset: |_| 0.0,
    gain: |_| 1.0,
    local: |_, _| 0.0,
};

impl Camera {
    fn frame(&self, f: usize, rng: &mut Rng) -> Vec<[f64; 3]> {
        (0..WIDTH * HEIGHT)
            .map(|i| {
                let (x, y) = (i % WIDTH, i / WIDTH);
                let level = scene_level(x, y, self.low, self.high);
                self.sigma.map(|sigma| {
                    (self.gain)(f) * level
                        + (self.offset)(f)
                        + (self.local)(f, x)
                        + sigma * rng.normal()
                })
            })
            .collect()
    }

    fn record(&self, folder: &Path, frames: usize) -> Vec<PathBuf> {
        std::fs::create_dir_all(folder).unwrap();
        let mut rng = Rng(frames as u64);
        (0..frames)
            .map(|f| {
                let values = self.frame(f, &mut rng);
                let path = folder.join(format!("{f:03}.png"));
                save8(&values, &path);
                path
            })
            .collect()
    }
}

fn save8(values: &[[f64; 3]], path: &Path) {
    RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        Rgb(values[(y * WIDTH + x) as usize].map(|v| v.round().clamp(0.0, 255.0) as u8))
    })
    .save(path)
    .unwrap();
}

fn run(paths: &[PathBuf], bins: usize) -> Result<Calibration, CalibrationError> {
    calibrate(&group_frames(paths)?, bins, &mut |_, _| ())
}

fn profile(paths: &[PathBuf], bins: usize) -> NoiseProfile {
    run(paths, bins).unwrap().profile
}

/// Every measured bin holds `truth` within its interval, the interval is narrower than `width` of it, and twice the truth is outside.
fn assert_holds(profile: &NoiseProfile, truth: [f64; 3], width: f64) {
    for bin in &profile.bins {
        for c in (0..3).filter(|c| !bin.filled[*c]) {
            let (low, high) = (bin.low[c], bin.high[c]);
            assert!(
                (low..=high).contains(&truth[c]),
                "{c}: {truth:?} in {bin:?}"
            );
            assert!(high - low < width * truth[c], "{c}: {bin:?}");
            assert!(!(low..=high).contains(&(2.0 * truth[c])), "control");
        }
    }
}

#[test]
fn known_sigmas_are_within_their_intervals() {
    for sigma in [0.4, 1.0, 5.0, 20.0] {
        let folder = tempfile::tempdir().unwrap();
        let camera = Camera {
            sigma: [sigma, 1.1 * sigma, 0.9 * sigma],
            low: 80.0,
            high: 175.0,
            ..STILL
        };
        let paths = camera.record(folder.path(), 12);
        assert_holds(&profile(&paths, 4), camera.sigma, 0.12);
    }
}

/// F = 2 and F = 5: without the correction sigma would be 29% and 10.6% too small.
#[test]
fn few_frames_are_not_biased() {
    for frames in [2, 5] {
        let folder = tempfile::tempdir().unwrap();
        let paths = STILL.record(folder.path(), frames);
        let found = profile(&paths, 1).bins[0].sigma;
        let uncorrected = (1.0 - 1.0 / frames as f64).sqrt();
        for (found, truth) in found.iter().zip(STILL.sigma) {
            let ratio = found / truth;
            assert!((ratio - 1.0).abs() < 0.02, "{frames}: {ratio}");
            assert!((ratio * uncorrected - 1.0).abs() > 0.05, "control");
        }
    }
}

#[test]
fn drift_and_flicker_are_removed() {
    let cameras = [
        (
            "exposure",
            Camera {
                gain: |f| 1.0 + 0.02 * ((f * 7) % 5) as f64,
                ..STILL
            },
            false,
        ),
        (
            "offset",
            Camera {
                offset: |f| 0.6 * f as f64,
                ..STILL
            },
            false,
        ),
        (
            "lamp",
            Camera {
                local: |f, x| {
                    0.5 * f as f64 * f64::from(x) / f64::from(WIDTH) * f64::from(x)
                        / f64::from(WIDTH)
                },
                ..STILL
            },
            true,
        ),
    ];
    for (name, camera, local) in cameras {
        let folder = tempfile::tempdir().unwrap();
        let paths = camera.record(folder.path(), 20);
        let calibration = run(&paths, 2).unwrap();
        for bin in &calibration.profile.bins {
            for c in 0..3 {
                let ratio = bin.sigma[c] / STILL.sigma[c];
                assert!((ratio - 1.0).abs() < 0.03, "{name}: {ratio}");
            }
        }
        let noted = calibration.notes.iter().any(|note| note.contains("drifts"));
        assert_eq!(noted, local, "{name}: {:?}", calibration.notes);
    }
}

/// Control of the test above: residuals against the average alone would be far off under such light.
#[test]
fn the_drifts_are_large_enough_to_matter() {
    let frames = 20;
    let drift: f64 = (0..frames)
        .map(|f| 0.5 * (f as f64 - 9.5) * 0.45)
        .map(|d| d * d)
        .sum::<f64>()
        / frames as f64;
    assert!((STILL.sigma[1].powi(2) + drift).sqrt() / STILL.sigma[1] > 1.2);
}

#[test]
fn clipped_values_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let camera = Camera {
        low: -10.0,
        high: 275.0,
        sigma: [4.0; 3],
        ..STILL
    };
    let paths = camera.record(folder.path(), 16);
    let calibration = run(&paths, 4).unwrap();
    assert_holds(&calibration.profile, camera.sigma, 0.1);
    // Control: with them the outer bins would show less noise.
    let all = Rng(5);
    let clipped: f64 = {
        let mut rng = all;
        let values: Vec<f64> = (0..20_000)
            .map(|_| (2.0 + 4.0 * rng.normal()).max(0.0))
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    assert!(clipped < 3.4);
}

/// Signal-dependent noise, whose fit and bins both tell; bins without pixels are filled and marked.
#[test]
fn the_fit_finds_shot_noise_and_empty_bins_are_filled() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = Rng(3);
    let (a, b) = (0.03, 1.2);
    let paths: Vec<PathBuf> = (0..12)
        .map(|f| {
            let values: Vec<[f64; 3]> = (0..WIDTH * HEIGHT)
                .map(|i| {
                    let level = scene_level(i % WIDTH, i / WIDTH, 40.0, 160.0);
                    [0; 3].map(|_| level + (a * level + b).sqrt() * rng.normal())
                })
                .collect();
            let path = folder.path().join(format!("{f}.png"));
            save8(&values, &path);
            path
        })
        .collect();
    let profile = profile(&paths, 8);
    for fit in profile.fit {
        assert!((fit.a - a).abs() < 0.003, "{fit:?}");
        assert!((fit.b - b).abs() < 0.3, "{fit:?}");
    }
    let filled: Vec<bool> = profile.bins.iter().map(|bin| bin.filled[1]).collect();
    assert_eq!(
        filled,
        [true, false, false, false, false, false, true, true]
    );
    assert_eq!(profile.bins[0].sigma, profile.bins[1].sigma);
    assert_eq!(profile.bins[7].sigma, profile.bins[5].sigma);
    let middle = profile.bins[3].sigma[0];
    assert!(
        (middle / (a * 112.0 + b).sqrt() - 1.0).abs() < 0.02,
        "{middle}"
    );
    assert!(
        profile.bins[5].sigma[0] > 1.2 * profile.bins[1].sigma[0],
        "control: it depends on the level"
    );
}

/// Noise that neighbours and channels share, as a demosaicing camera makes it.
#[test]
fn correlations_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = Rng(9);
    let paths: Vec<PathBuf> = (0..10)
        .map(|f| {
            let (w, h) = (WIDTH as usize + 2, HEIGHT as usize + 2);
            let white: Vec<[f64; 4]> = (0..w * h).map(|_| [0; 4].map(|_| rng.normal())).collect();
            let smooth = |x: usize, y: usize, c: usize| {
                // Weights 1/2, 1, 1/2 along x, 1, 1 along y, unit energy
                let at = |dx: usize, dy: usize| white[(y + dy) * w + x + dx][c];
                (0..2)
                    .map(|dy| 0.5 * at(0, dy) + at(1, dy) + 0.5 * at(2, dy))
                    .sum::<f64>()
                    / 3.0f64.sqrt()
            };
            let values: Vec<[f64; 3]> = (0..WIDTH * HEIGHT)
                .map(|i| {
                    let (x, y) = ((i % WIDTH) as usize, (i / WIDTH) as usize);
                    let shared = smooth(x, y, 3);
                    let level = scene_level(i % WIDTH, i / WIDTH, 90.0, 150.0);
                    [
                        level + 1.5 * (0.6 * shared + 0.8 * smooth(x, y, 0)),
                        level + 1.5 * (0.6 * shared + 0.8 * smooth(x, y, 1)),
                        level + 1.5 * white[y * w + x][2],
                    ]
                })
                .collect();
            let path = folder.path().join(format!("{f}.png"));
            save8(&values, &path);
            path
        })
        .collect();
    let profile = profile(&paths, 4);
    // Autocorrelation of (1/2, 1, 1/2): 1, 2/3, 1/6; of (1, 1): 1, 1/2.
    let along_x = [1.0, 2.0 / 3.0, 1.0 / 6.0, 0.0];
    for c in 0..2 {
        let lags = &profile.autocorrelation[c];
        for (dx, rho) in along_x.iter().enumerate() {
            for (dy, factor) in [1.0, 0.5, 0.0, 0.0].iter().enumerate() {
                for column in [3 - dx, 3 + dx] {
                    let found = lags[dy][column];
                    assert!(
                        (found - rho * factor).abs() < 0.02,
                        "{c} {dx} {dy}: {found}"
                    );
                }
            }
        }
    }
    assert!(
        profile.autocorrelation[2][0][4].abs() < 0.02,
        "control: blue is white"
    );
    let [rg, rb, gb] = profile.channel_correlation;
    assert!((rg - 0.36).abs() < 0.02, "{rg}");
    assert!(rb.abs() < 0.02 && gb.abs() < 0.02);
    // The interval knows that correlated values tell less.
    let bin = &profile.bins[1];
    let width = |c: usize| (bin.high[c] - bin.low[c]) / bin.sigma[c];
    assert!(width(0) > 1.3 * width(2), "{bin:?}");
    assert!((bin.low[0]..=bin.high[0]).contains(&1.5), "{bin:?}");
}

/// JPEG changes the noise; the truth is then the spread of the decoded values over many frames, pixel by pixel.
#[test]
fn jpeg_frames_show_the_noise_that_they_hold() {
    let folder = tempfile::tempdir().unwrap();
    let camera = Camera {
        sigma: [3.0; 3],
        low: 60.0,
        high: 190.0,
        ..STILL
    };
    let mut rng = Rng(21);
    let mut decoded = Vec::new();
    let paths: Vec<PathBuf> = (0..60)
        .map(|f| {
            let values = camera.frame(f, &mut rng);
            let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
                Rgb(values[(y * WIDTH + x) as usize].map(|v| v.round().clamp(0.0, 255.0) as u8))
            });
            let path = folder.path().join(format!("{f:02}.jpg"));
            let mut file = std::fs::File::create(&path).unwrap();
            image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 85)
                .encode_image(&image)
                .unwrap();
            decoded.push(image::open(&path).unwrap().into_rgb8());
            path
        })
        .collect();
    let truth = {
        let frames = decoded.len() as f64;
        let mut sum = 0.0;
        for x in 0..WIDTH {
            for y in 0..HEIGHT {
                let values: Vec<f64> = decoded
                    .iter()
                    .map(|d| f64::from(d.get_pixel(x, y).0[1]))
                    .collect();
                let mean = values.iter().sum::<f64>() / frames;
                sum += values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (frames - 1.0);
            }
        }
        (sum / f64::from(WIDTH * HEIGHT) - 1.0 / 12.0).sqrt()
    };
    let bin = profile(&paths[..12], 1).bins[0];
    assert!(
        (bin.low[1]..=bin.high[1]).contains(&truth),
        "{truth} {bin:?}"
    );
    assert!(
        (truth - 3.0).abs() > 0.05,
        "control: JPEG changes it: {truth}"
    );
}

#[test]
fn a_scene_that_moves_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = Rng(1);
    let moving: Vec<PathBuf> = (0..8u32)
        .map(|f| {
            let values: Vec<[f64; 3]> = (0..WIDTH * HEIGHT)
                .map(|i| {
                    let (x, y) = (f64::from(i % WIDTH), f64::from(i / WIDTH));
                    let disc = (x - 40.0 - 4.0 * f64::from(f)).hypot(y - 60.0) < 18.0;
                    [if disc { 160.0 } else { 110.0 } + 2.0 * rng.normal(); 3]
                })
                .collect();
            let path = folder.path().join(format!("{f}.png"));
            save8(&values, &path);
            path
        })
        .collect();
    let error = run(&moving, 4).unwrap_err();
    assert!(matches!(error, CalibrationError::Moving { .. }), "{error}");
    assert!(error.to_string().contains("moved"), "{error}");
    // Control: the same disc at rest is fine, but for one pixel, without which it would be a copy.
    let again = folder.path().join("again.png");
    let mut picture = image::open(&moving[0]).unwrap().into_rgb8();
    picture.get_pixel_mut(0, 0).0[0] ^= 1;
    picture.save(&again).unwrap();
    let still = vec![moving[0].clone(), again];
    assert!(run(&still, 4).is_ok());
}

#[test]
fn real_cameras_that_move_are_refused() {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/webcam_chessboard_video/frames");
    if !folder.is_dir() {
        eprintln!("skipped: {} is absent", folder.display());
        return;
    }
    let error = run(&[folder], 4).unwrap_err();
    assert!(matches!(error, CalibrationError::Moving { .. }), "{error}");
}

/// Ten real shots: sigma by an independent script (noise.json), neighbours' correlation too.
#[test]
fn the_nikon_sequence_has_the_noise_that_was_measured_before() {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/nikon_d200_flat_sequence");
    if !folder.is_dir() {
        eprintln!("skipped: {} is absent", folder.display());
        return;
    }
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("noise.json")).unwrap()).unwrap();
    let profile = profile(&[folder], 4);
    let bin = &profile.bins[2];
    for c in 0..3 {
        // That script did not take the rounding out.
        let measured = json["temporal_sigma_rgb"][c].as_f64().unwrap();
        let truth = (measured * measured - 1.0 / 12.0).sqrt();
        assert!(
            (bin.low[c]..=bin.high[c]).contains(&truth),
            "{truth} {bin:?}"
        );
        assert!(
            !(bin.low[c]..=bin.high[c]).contains(&(1.1 * truth)),
            "control"
        );
    }
    let x = json["neighbour_correlation_x"].as_f64().unwrap();
    let lags = &profile.autocorrelation;
    let found = (lags[0][0][4] + lags[1][0][4] + lags[2][0][4]) / 3.0;
    assert!((found - x).abs() < 0.06, "{found} {x}");
}

#[test]
fn sixteen_bits_and_grey_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = Rng(4);
    let (deep, grey) = (folder.path().join("deep"), folder.path().join("grey"));
    std::fs::create_dir_all(&deep).unwrap();
    std::fs::create_dir_all(&grey).unwrap();
    for f in 0..8 {
        let value =
            |x: u32, y: u32, rng: &mut Rng| scene_level(x, y, 70.0, 180.0) + 0.1 * rng.normal();
        ImageBuffer::<Luma<u16>, _>::from_fn(WIDTH, HEIGHT, |x, y| {
            Luma([(value(x, y, &mut rng) * 257.0).round() as u16])
        })
        .save(deep.join(format!("{f}.png")))
        .unwrap();
        GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
            Luma([(scene_level(x, y, 70.0, 180.0) + 2.0 * rng.normal()).round() as u8])
        })
        .save(grey.join(format!("{f}.png")))
        .unwrap();
    }
    // A tenth of an 8-bit code: only 16 bits can tell.
    assert_holds(&profile(&[deep], 4), [0.1; 3], 0.1);
    let grey = profile(&[grey], 4);
    assert_holds(&grey, [2.0; 3], 0.1);
    assert!(
        grey.channel_correlation.iter().all(|rho| *rho > 0.95),
        "{grey:?}"
    );
}

#[test]
fn scenes_are_folders_and_each_has_its_own_average() {
    let folder = tempfile::tempdir().unwrap();
    let dark = Camera {
        low: 20.0,
        high: 60.0,
        sigma: [1.0; 3],
        ..STILL
    };
    let bright = Camera {
        low: 140.0,
        high: 180.0,
        sigma: [3.0; 3],
        ..STILL
    };
    let mut paths = dark.record(&folder.path().join("dark"), 8);
    paths.extend(bright.record(&folder.path().join("bright"), 6));
    let profile = profile(&paths, 4);
    for c in 0..3 {
        assert!((profile.bins[0].sigma[c] - 1.0).abs() < 0.03);
        assert!((profile.bins[2].sigma[c] - 3.0).abs() < 0.09);
        assert!(profile.bins[1].filled[c] && profile.bins[3].filled[c]);
        let between = ((1.0 + 9.0) / 2.0f64).sqrt();
        assert!((profile.bins[1].sigma[c] - between).abs() < 0.1);
    }
    assert_eq!(profile.sources.len(), 2);
}

#[test]
fn what_cannot_be_used_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let message = |paths: &[PathBuf]| run(paths, 4).unwrap_err().to_string();
    assert!(message(&[]).contains("no frames"));
    std::fs::create_dir(at("empty")).unwrap();
    assert!(message(&[at("empty")]).contains("no pictures"));
    let frames = STILL.record(&at("scene"), 2);
    assert!(message(&frames[..1]).contains("one frame only"));
    RgbImage::new(7, 5).save(at("scene/002.png")).unwrap();
    let sizes = message(&[at("scene")]);
    assert!(
        sizes.contains("002.png: it has 7x5 pixels where the scene's first frame has 160x120"),
        "{sizes}"
    );
    std::fs::write(at("scene/002.png"), "no picture").unwrap();
    assert!(message(&[at("scene")]).contains("002.png"));
    assert!(matches!(run(&frames, 3), Err(CalibrationError::Bins(3))));
    std::fs::create_dir(at("black")).unwrap();
    for (code, name) in [(0, "black/0.png"), (1, "black/1.png")] {
        let mut black = RgbImage::new(32, 32);
        black.get_pixel_mut(0, 0).0[0] = code;
        black.save(at(name)).unwrap();
    }
    assert!(message(&[at("black")]).contains("clipping"));
    assert!(run(&frames, 4).is_ok(), "control");
}

#[test]
fn the_report_shows_every_bin() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = run(&STILL.record(folder.path(), 3), 4).unwrap();
    let page = report_html(&calibration);
    assert_eq!(page.matches("variation, DN").count(), 12);
    assert_eq!(page.matches(": sigma</text>").count(), 3);
    assert!(!page.contains("NaN"));
    let counted: u64 = calibration
        .histograms
        .iter()
        .map(|h| h[0].iter().sum::<u64>())
        .sum();
    assert_eq!(counted, u64::from(3 * WIDTH * HEIGHT));
}
