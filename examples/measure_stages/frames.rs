//! What the stages make of pictures: one noise level across a soft edge, silhouettes that do not flicker.

use image::{Rgb, RgbImage};
use mixray::film::Picture;
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::srgb::encode;
use mixray::scene::{self, CartoonSettings, NoiseFit, NoiseProfile};
use mixray::stages::cartoon::cartoon;
use mixray::stages::{EncodedImage, finish};

use super::Result;
use super::cameras::Rng;

const WIDTH: u32 = 160;
const HEIGHT: u32 = 400;
const SIGMA: f64 = 2.5;

/// A defocused grey card half over a noisy grey photograph.
pub fn soft_edge() -> Result<()> {
    println!("## One noise level across a soft edge\n");
    println!(
        "A defocused grey card half over a noisy grey photograph ({SIGMA} DN); RMS noise by coverage of the pixel, DN, all columns of the \
         picture. Where few rays leave the edge noisier than the camera is, nothing is added.\n"
    );
    println!(
        "| rays per pixel | noise | photograph | to 1/4 | to 1/2 | to 3/4 | to 1 | card |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let folder = tempfile::tempdir()?;
    let mut rng = Rng(3);
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |_, _| {
        Rgb([(); 3].map(|()| (90.0 + SIGMA * rng.normal()).round() as u8))
    });
    image.save(folder.path().join("photo.png"))?;
    let profile = NoiseProfile::from_fit(
        NoiseFit {
            a: 0.0,
            b: SIGMA * SIGMA,
        },
        4,
    );
    std::fs::write(folder.path().join("noise.toml"), profile.to_toml())?;
    for rays in [49, 256, 1024] {
        let path = folder.path().join("scene.toml");
        std::fs::write(
            &path,
            format!(
                "[photo]\nimage = \"photo.png\"\n[camera]\nvertical_fov_deg = 45\n[lens]\naperture_radius_m = 0.08\nfocus_distance_m = 4\n\
                 [environment]\nradiance = [0.5, 0.5, 0.5]\n[[virtual]]\nshape = \"quad\"\ncorner = [0, -3, -2]\nedge_u = [3, 0, 0]\nedge_v = [0, 6, 0]\n\
                 material = {{ base_color = [0.4, 0.4, 0.4], specular = 0.0 }}\n[render]\nrays_per_pixel = {rays}\n[noise]\nprofile = \"noise.toml\"\n"
            ),
        )?;
        let mut renderer = Renderer::new(
            scene::load(&path)?,
            RendererOptions::default(),
            &Watcher::none(),
        )?;
        renderer.advance(Budget::Complete, &Watcher::none())?;
        let plain = renderer.picture();
        let finished = finish(
            plain.clone(),
            renderer.film(),
            renderer.scene(),
            0,
            None,
            None,
        );
        for (name, picture) in [("off", &plain), ("on", &finished.picture)] {
            let levels = levels(picture, &plain);
            let cells: Vec<String> = levels.iter().map(|level| format!("{level:.2}")).collect();
            println!("| {rays} | {name} | {} |", cells.join(" | "));
        }
    }
    println!();
    Ok(())
}

/// By coverage: below 2%, to 1/4, to 1/2, to 3/4, to 98%, above.
fn levels(picture: &Picture, reference: &Picture) -> [f64; 6] {
    let column = |picture: &Picture, x: u32, c: usize| -> (f64, f64) {
        let values = (0..HEIGHT)
            .map(|y| 255.0 * encode(f64::from(picture.linear[(y * WIDTH + x) as usize][c])));
        let values: Vec<f64> = values.collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, variance)
    };
    let mean = |x: u32| column(reference, x, 1).0;
    let (low, high) = (mean(0), mean(WIDTH - 1));
    let mut sums = [(0.0, 0.0); 6];
    for x in 0..WIDTH {
        let coverage = (mean(x) - low) / (high - low);
        let part = [0.02, 0.25, 0.5, 0.75, 0.98]
            .iter()
            .filter(|limit| coverage > **limit)
            .count();
        for c in 0..3 {
            sums[part].0 += column(picture, x, c).1;
            sums[part].1 += 1.0;
        }
    }
    sums.map(|(sum, count)| (sum / count).sqrt())
}

/// Coloured things with edges of many strengths.
fn level(x: f64, y: f64) -> [f64; 3] {
    let mut rgb = [120.0, 125.0, 130.0 + 0.05 * y];
    let discs = [
        (120.0, 120.0, 60.0),
        (320.0, 240.0, 100.0),
        (500.0, 120.0, 50.0),
        (180.0, 360.0, 80.0),
        (520.0, 360.0, 90.0),
    ];
    for (i, (cx, cy, r)) in discs.into_iter().enumerate() {
        if (x - cx).hypot(y - cy) < r {
            rgb[i % 3] += 25.0 + 15.0 * i as f64;
            rgb[(i + 1) % 3] -= 12.0 * i as f64;
        }
    }
    rgb
}

/// Share of edge pixels that change from frame to frame of a static noisy sequence.
pub fn flicker() {
    println!("## Silhouettes of a static noisy sequence\n");
    println!(
        "640 x 480, 5 frames, noise of sigma 6 DN: share of edge pixels (silhouette above a third) that change from one frame to the next. Off: \
         the same thresholds on the picture itself.\n"
    );
    println!("| simplification | share |\n| --- | --- |");
    let on = CartoonSettings::default();
    let off = CartoonSettings {
        beta: 1.0,
        a0: on.s0,
        a1: on.s1,
        ..on
    };
    for (name, settings) in [("on", on), ("off", off)] {
        let mut rng = Rng(8);
        let edges: Vec<Vec<bool>> = (0..5)
            .map(|_| {
                let rgb = (0..640 * 480)
                    .map(|i| {
                        level(f64::from(i % 640), f64::from(i / 640)).map(|v| {
                            ((v + 6.0 * rng.normal()).round().clamp(0.0, 255.0) / 255.0) as f32
                        })
                    })
                    .collect();
                let image = EncodedImage {
                    width: 640,
                    height: 480,
                    rgb,
                };
                let edges = cartoon(&image, &settings, true).edges;
                edges.map_or(Vec::new(), |e| {
                    e.silhouette.iter().map(|s| *s > 1.0 / 3.0).collect()
                })
            })
            .collect();
        let (mut changed, mut all) = (0, 0);
        for pair in edges.windows(2) {
            for (a, b) in pair[0].iter().zip(&pair[1]) {
                all += usize::from(*a || *b);
                changed += usize::from(a != b);
            }
        }
        println!(
            "| {name} | {:.1}% of {all} |",
            100.0 * changed as f64 / all as f64
        );
    }
    println!();
}
