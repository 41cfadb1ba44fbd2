//! Simulated cameras whose noise is known, and one real one.

use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use mixray::film::Picture;
use mixray::scene::srgb::{decode, encode8};
use mixray::scene::{NoiseFit, NoiseProfile, NoiseSettings, WHITE};
use mixray::stages::calibration::{Calibration, calibrate, group_frames};
use mixray::stages::noise::{NoiseInput, NoiseStage, autocorrelation_of};

use super::Result;

const WIDTH: u32 = 240;
const HEIGHT: u32 = 180;
const FRAMES: usize = 16;

/// SplitMix64 and the polar method: nothing of the program's own deviates.
pub struct Rng(pub u64);

impl Rng {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        loop {
            let (u, v) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let s = u * u + v * v;
            if s > 0.0 && s < 1.0 {
                return u * (-2.0 * s.ln() / s).sqrt();
            }
        }
    }
}

struct Camera {
    name: &'static str,
    low: f64,
    high: f64,
    sigma: f64,
    /// DN added to frame f at x (0 to 1).
    light: fn(usize, f64) -> f64,
    jpeg_quality: Option<u8>,
}

const STILL: Camera = Camera {
    name: "",
    low: 60.0,
    high: 200.0,
    sigma: 2.0,
    light: |_, _| 0.0,
    jpeg_quality: None,
};

impl Camera {
    fn frame(&self, f: usize, rng: &mut Rng) -> RgbImage {
        RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let t = f64::from(x) / f64::from(WIDTH - 1);
            let level = self.low + (self.high - self.low) * t + 0.37 * f64::from(y % 7);
            let light = (self.light)(f, t);
            Rgb([(); 3].map(|()| {
                let value = level + light + self.sigma * rng.normal();
                value.round().clamp(0.0, 255.0) as u8
            }))
        })
    }

    fn save(&self, image: &RgbImage, path: &Path) -> Result<PathBuf> {
        match self.jpeg_quality {
            None => {
                let path = path.with_extension("png");
                image.save(&path)?;
                Ok(path)
            }
            Some(quality) => {
                let path = path.with_extension("jpg");
                let mut file = std::fs::File::create(&path)?;
                image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, quality)
                    .encode_image(image)?;
                Ok(path)
            }
        }
    }

    /// Frames on disk, and the spread that they really have: the given sigma, or for JPEG that of many more decoded frames.
    fn record(&self, folder: &Path, seed: u64) -> Result<(Vec<PathBuf>, f64)> {
        let mut rng = Rng(seed);
        let mut paths = Vec::new();
        for f in 0..FRAMES {
            let image = self.frame(f, &mut rng);
            paths.push(self.save(&image, &folder.join(format!("{f:03}")))?);
        }
        if self.jpeg_quality.is_none() {
            return Ok((paths, self.sigma));
        }
        let more = 200;
        let count = (WIDTH * HEIGHT) as usize;
        let mut sums = vec![(0.0f64, 0.0f64); count];
        for f in 0..more {
            let path = self.save(&self.frame(f, &mut rng), &folder.join("more"))?;
            let decoded = image::open(path)?.into_rgb8();
            for (sum, pixel) in sums.iter_mut().zip(decoded.pixels()) {
                let v = f64::from(pixel.0[1]);
                *sum = (sum.0 + v, sum.1 + v * v);
            }
        }
        let n = more as f64;
        let variance: f64 = sums
            .iter()
            .map(|(sum, squares)| (squares - sum * sum / n) / (n - 1.0))
            .sum::<f64>()
            / count as f64;
        Ok((paths, (variance - 1.0 / 12.0).sqrt()))
    }
}

fn run(paths: &[PathBuf], bins: usize) -> Result<Calibration> {
    Ok(calibrate(&group_frames(paths)?, bins, &mut |_, _| ())?)
}

fn row(name: &str, truth: f64, profile: &NoiseProfile, bin: usize) {
    let bin = &profile.bins[bin];
    let inside = (bin.low[1]..=bin.high[1]).contains(&truth);
    println!(
        "| {name} | {truth:.3} | {:.3} | {:.3} to {:.3} | {} |",
        bin.sigma[1],
        bin.low[1],
        bin.high[1],
        if inside { "yes" } else { "no" }
    );
}

/// Known sigmas, with everything that disturbs a calibration.
pub fn calibrations() -> Result<()> {
    println!("## Calibration\n");
    println!(
        "Sequences of {FRAMES} frames, {WIDTH} x {HEIGHT}, green channel, one bin, DN. The truth of JPEG frames is the spread of 200 more of them, \
         decoded; the Nikon's is that of `noise.json` beside the shots (another program), less the rounding.\n"
    );
    println!(
        "| sequence | true sigma | measured | 95% interval | inside |\n| --- | --- | --- | --- | --- |"
    );
    let cameras = [
        Camera {
            name: "sigma 0.4",
            sigma: 0.4,
            ..STILL
        },
        Camera {
            name: "sigma 1",
            sigma: 1.0,
            ..STILL
        },
        Camera {
            name: "sigma 5",
            sigma: 5.0,
            ..STILL
        },
        Camera {
            name: "sigma 20",
            sigma: 20.0,
            low: 110.0,
            high: 145.0,
            ..STILL
        },
        Camera {
            name: "exposure drifts by 0.7 DN a frame",
            light: |f, _| 0.7 * f as f64,
            ..STILL
        },
        Camera {
            name: "flicker of 4 DN",
            light: |f, _| 4.0 * ((f * 5) % 3) as f64,
            ..STILL
        },
        Camera {
            name: "a lamp moves: drift within the picture",
            light: |f, x| 0.6 * f as f64 * x * x,
            ..STILL
        },
        Camera {
            name: "a third of the picture clipped",
            low: -40.0,
            high: 295.0,
            sigma: 4.0,
            ..STILL
        },
        Camera {
            name: "JPEG, quality 95",
            sigma: 3.0,
            jpeg_quality: Some(95),
            ..STILL
        },
        Camera {
            name: "JPEG, quality 75",
            sigma: 3.0,
            jpeg_quality: Some(75),
            ..STILL
        },
    ];
    for (seed, camera) in (1..).zip(&cameras) {
        let folder = tempfile::tempdir()?;
        let (paths, truth) = camera.record(folder.path(), seed)?;
        row(camera.name, truth, &run(&paths, 1)?.profile, 0);
    }
    nikon()?;
    println!();
    Ok(())
}

fn nikon() -> Result<()> {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/nikon_d200_flat_sequence");
    if !folder.is_dir() {
        eprintln!("left out: {} is absent", folder.display());
        return Ok(());
    }
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("noise.json"))?)?;
    let measured = json["temporal_sigma_rgb"][1].as_f64().unwrap_or(f64::NAN);
    let truth = (measured * measured - 1.0 / 12.0).sqrt();
    row(
        "Nikon D200, ten shots",
        truth,
        &run(&[folder], 4)?.profile,
        2,
    );
    Ok(())
}

/// Noise of a profile over a grey ramp, calibrated again.
pub fn round_trip() -> Result<()> {
    let mut truth = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 2.0 }, 4);
    for (j, bin) in truth.bins.iter_mut().enumerate() {
        let j = j as f64;
        bin.sigma = [1.2 + 0.4 * j, 1.0 + 0.3 * j, 2.5 - 0.3 * j];
    }
    let mut kernel = [[0.0; 7]; 7];
    for (y, row) in kernel.iter_mut().enumerate() {
        for (x, weight) in row.iter_mut().enumerate() {
            let (dx, dy) = (x as f64 - 3.0, y as f64 - 3.0);
            *weight = (-0.5 * (dx * dx / 0.8 + dy * dy / 0.5)).exp();
        }
    }
    let energy: f64 = kernel.as_flattened().iter().map(|w| w * w).sum();
    let kernel = kernel.map(|row| row.map(|weight| weight / energy.sqrt()));
    truth.autocorrelation = [
        autocorrelation_of(&kernel),
        autocorrelation_of(&kernel),
        WHITE,
    ];
    truth.channel_correlation = [0.6, 0.2, 0.1];

    let folder = tempfile::tempdir()?;
    let stage = NoiseStage::new(&NoiseSettings::new(truth.clone()), 3);
    let mut paths = Vec::new();
    for frame in 0..24 {
        let linear = (0..WIDTH * HEIGHT)
            .map(|i| [decode(f64::from(i % WIDTH) / f64::from(WIDTH - 1)) as f32; 3])
            .collect();
        let mut picture = Picture {
            width: WIDTH,
            height: HEIGHT,
            linear,
        };
        stage.apply(&mut picture, &NoiseInput::default(), frame);
        let path = folder.path().join(format!("{frame:02}.png"));
        RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
            Rgb(picture.linear[(y * WIDTH + x) as usize].map(encode8))
        })
        .save(&path)?;
        paths.push(path);
    }
    let found = run(&paths, 4)?.profile;
    let mut errors: Vec<f64> = found
        .bins
        .iter()
        .zip(&truth.bins)
        .flat_map(|(a, b)| (0..3).map(move |c| 100.0 * (a.sigma[c] / b.sigma[c] - 1.0).abs()))
        .collect();
    errors.sort_by(f64::total_cmp);
    let lags = found.autocorrelation.as_flattened().as_flattened().iter();
    let worst = lags
        .zip(truth.autocorrelation.as_flattened().as_flattened())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    println!("## Rendered noise, calibrated again\n");
    println!(
        "`missing` noise of a profile of four bins, correlated over 2 pixels, over a grey ramp, 24 frames. Sigma by bin and channel: median error \
         {:.2}%, largest {:.2}%. Autocorrelation to lag 3: largest error {worst:.3}.\n",
        errors[errors.len() / 2],
        errors[errors.len() - 1]
    );
    Ok(())
}
