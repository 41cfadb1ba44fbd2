//! Pictures for the tests of the stages, and how far two of them are apart.

use std::sync::Arc;

use super::GpuStages;
use crate::film::Picture;
use crate::gpu::harness::test_device;
use crate::math::{hash_combine, uniform_from_bits};

pub const SIZE: (u32, u32) = (101, 67);

/// The device that tests share, or `None` on a machine without one.
pub fn stages() -> Option<GpuStages> {
    test_device().map(|gpu| GpuStages::new(Arc::clone(gpu)))
}

pub fn random(index: usize, stream: u32) -> f32 {
    uniform_from_bits(hash_combine(index as u32, stream))
}

/// Blobs, gradients and noise, linear, some of it dark and some above 1.
pub fn picture(stream: u32) -> Picture {
    let (width, height) = SIZE;
    let linear = (0..(width * height) as usize)
        .map(|i| {
            let (x, y) = ((i as u32 % width) as f32, (i as u32 / width) as f32);
            let blob = |cx: f32, cy: f32, r: f32| f32::from(u8::from((x - cx).hypot(y - cy) < r));
            let base = 0.4 * x / width as f32 + 0.3 * blob(30.0, 30.0, 15.0);
            let rgb = [
                base,
                0.5 * base + 0.4 * blob(70.0, 40.0, 12.0),
                0.9 * y / height as f32,
            ];
            std::array::from_fn(|c| rgb[c] + 0.05 * (random(3 * i + c, stream) - 0.3))
        })
        .collect();
    Picture {
        width,
        height,
        linear,
    }
}

/// A disc with a hard border.
pub fn mask() -> Vec<f32> {
    (0..SIZE.0 * SIZE.1)
        .map(|i| {
            let (x, y) = ((i % SIZE.0) as f32, (i / SIZE.0) as f32);
            f32::from(u8::from((x - 50.0).hypot(y - 33.0) < 25.0))
        })
        .collect()
}

/// Share of values that differ by more than one 8-bit code, and the largest difference in codes.
pub fn codes_apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> (f64, i32) {
    let code = |x: f32| i32::from(crate::scene::srgb::encode8(x));
    let apart: Vec<i32> = a
        .as_flattened()
        .iter()
        .zip(b.as_flattened())
        .map(|(a, b)| (code(*a) - code(*b)).abs())
        .collect();
    let beyond = apart.iter().filter(|d| **d > 1).count();
    (
        beyond as f64 / apart.len() as f64,
        apart.into_iter().max().unwrap_or(0),
    )
}
