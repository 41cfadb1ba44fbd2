//! Scenes from text, renders of them, and the statistics that compare two estimates.

use std::ops::Range;

use mixray::film::Picture;
use mixray::renderer::{Renderer, RendererOptions, Watcher};
use mixray::scene::{BackendChoice, EncodedPhoto, Photo, Scene};

pub use crate::support::{complete, largest, mask, scene};

/// Turns checks `fn(BackendChoice)` into tests on the CPU. `tests/backends` holds the GPU's pictures against the CPU's.
macro_rules! on_the_cpu {
    ($($check:ident),* $(,)?) => {
        mod cpu {
            $(#[test]
            fn $check() {
                super::$check(mixray::scene::BackendChoice::Cpu);
            })*
        }
    };
}
pub(crate) use on_the_cpu;

/// A Lambertian table in the plane y = 0, four metres square.
pub const TABLE: &str = r#"
[[real]]
name = "table"
shape = "quad"
corner = [-2, 0, 2]
edge_u = [4, 0, 0]
edge_v = [0, 0, -4]
material = { base_color = [0.7, 0.6, 0.5], specular = 0.0 }
"#;

/// 32 x 24 pixels that look down at the table.
pub const CAMERA: &str = r#"
[camera]
width = 32
height = 24
vertical_fov_deg = 28
position = [0, 1, 3]
look_at = [0, 0.25, 0]
"#;

/// A real quad light two metres above the table.
pub const LAMP: &str = r#"
[[light]]
kind = "quad"
corner = [-0.4, 2, -0.6]
edge_u = [0.8, 0, 0]
edge_v = [0, 0, 0.8]
radiance = [6, 5, 4]
"#;

pub fn renderer(scene: &Scene, backend: BackendChoice, options: RendererOptions) -> Renderer {
    let mut scene = scene.clone();
    scene.settings.backend = backend;
    Renderer::new(scene, options, &Watcher::none()).expect("the scene fits")
}

/// Renders all rays.
pub fn render(scene: &Scene, backend: BackendChoice) -> Renderer {
    let mut renderer = renderer(scene, backend, RendererOptions::default());
    complete(&mut renderer);
    renderer
}

/// A linear photograph.
pub fn photo_of(width: u32, height: u32, linear: Vec<[f32; 3]>) -> Photo {
    assert_eq!(linear.len(), (width * height) as usize);
    Photo {
        width,
        height,
        linear,
        encoded: EncodedPhoto::Linear,
        tags: Default::default(),
    }
}

pub fn constant_photo(width: u32, height: u32, value: f32) -> Photo {
    photo_of(width, height, vec![[value; 3]; (width * height) as usize])
}

/// Mean of the three channels.
pub fn grey(rgb: [f32; 3]) -> f64 {
    rgb.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0
}

pub fn bits(picture: &Picture) -> Vec<[u32; 3]> {
    picture.linear.iter().map(|p| p.map(f32::to_bits)).collect()
}

/// Side of the blocks over which pictures are averaged before they are compared, pixels.
const BLOCK_PX: u32 = 4;

/// Means of blocks of pixels of a picture, all channels together.
pub fn block_means(picture: &Picture) -> Vec<f64> {
    let (across, down) = (
        picture.width.div_ceil(BLOCK_PX),
        picture.height.div_ceil(BLOCK_PX),
    );
    let mut sums = vec![(0.0, 0.0); (across * down) as usize];
    for (i, value) in picture.linear.iter().enumerate() {
        let (x, y) = (i as u32 % picture.width, i as u32 / picture.width);
        let block = &mut sums[(y / BLOCK_PX * across + x / BLOCK_PX) as usize];
        block.0 += grey(*value);
        block.1 += 1.0;
    }
    sums.iter().map(|(sum, n)| sum / n).collect()
}

/// Block means of the composite, one list a seed.
pub fn over_seeds(scene: &Scene, backend: BackendChoice, seeds: Range<u32>) -> Vec<Vec<f64>> {
    let mut scene = scene.clone();
    seeds
        .map(|seed| {
            scene.settings.seed = seed;
            block_means(&render(&scene, backend).picture())
        })
        .collect()
}

/// How two sets of independent estimates of the same numbers differ, in standard errors (Welch's t).
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// Largest of any block.
    pub worst: f64,
    /// Root mean square over the blocks: 1 for equal expectations, a little more for few seeds.
    pub rms: f64,
    /// Of the mean over all blocks.
    pub total: f64,
    /// Difference of the means over all blocks, relative to the mean magnitude of the blocks.
    pub relative: f64,
    /// Standard error of `relative`.
    pub relative_error: f64,
}

/// Blocks that differ by less than this relative to their magnitude agree whatever their spread: rounding.
const ROUNDING: f64 = 1e-6;
/// What is this much fainter than the picture may be light that one side's samples have not met yet, and then their spread tells nothing.
const RARE: f64 = 1e-3;

impl Difference {
    pub fn between(a: &[Vec<f64>], b: &[Vec<f64>]) -> Self {
        let blocks = a[0].len();
        let column =
            |set: &[Vec<f64>], i: usize| -> Vec<f64> { set.iter().map(|means| means[i]).collect() };
        let magnitudes: Vec<f64> = (0..blocks)
            .map(|i| (mean(&column(a, i)).abs() + mean(&column(b, i)).abs()) * 0.5)
            .collect();
        let scale = mean(&magnitudes);
        let mut ts = Vec::new();
        for (i, magnitude) in magnitudes.into_iter().enumerate() {
            let (x, y) = (column(a, i), column(b, i));
            let found_by_one = [&x, &y].iter().any(|side| side.iter().all(|&v| v == 0.0));
            if !(found_by_one && magnitude < RARE * scale) {
                ts.extend(welch(&x, &y));
            }
        }
        let whole =
            |set: &[Vec<f64>]| -> Vec<f64> { set.iter().map(|means| mean(means)).collect() };
        let (x, y) = (whole(a), whole(b));
        Self {
            worst: largest(ts.iter().copied()),
            rms: (ts.iter().map(|t| t * t).sum::<f64>() / ts.len().max(1) as f64).sqrt(),
            total: welch(&x, &y).unwrap_or(0.0),
            relative: (mean(&x) - mean(&y)) / scale,
            relative_error: (variance_of_mean(&x) + variance_of_mean(&y)).sqrt() / scale,
        }
    }

    /// Thresholds for 16 seeds a side and some 50 blocks: Student's t with at least 15 degrees of freedom passes 7 once in 2e5
    /// blocks, 5 once in 6000 pictures, and the root mean square of 48 of them is 1.07 +- 0.13.
    pub fn is_none(&self) -> bool {
        self.worst < 7.0 && self.total.abs() < 5.0 && self.rms < 1.7
    }
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(
            f,
            "z of the mean {:+.2}, worst block {:.2}, rms {:.2}, relative {:+.2e} +- {:.1e}",
            self.total, self.worst, self.rms, self.relative, self.relative_error
        )
    }
}

pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

fn variance_of_mean(x: &[f64]) -> f64 {
    let m = mean(x);
    let n = x.len() as f64;
    x.iter().map(|v| (v - m) * (v - m)).sum::<f64>() / ((n - 1.0) * n)
}

/// Welch's t; nothing where neither side varies and both agree.
fn welch(x: &[f64], y: &[f64]) -> Option<f64> {
    let difference = mean(x) - mean(y);
    if difference.abs() <= ROUNDING * (mean(x).abs() + mean(y).abs()) {
        return None;
    }
    Some(difference / (variance_of_mean(x) + variance_of_mean(y)).sqrt())
}

#[test]
fn a_value_that_is_not_a_number_is_a_difference() {
    let same = vec![vec![1.0, 2.0], vec![1.5, 2.5]];
    let mut other = same.clone();
    assert!(Difference::between(&same, &other).is_none(), "control");
    other[1][0] = f64::NAN;
    let found = Difference::between(&same, &other);
    assert!(found.worst.is_nan() && !found.is_none(), "{found}");
}
