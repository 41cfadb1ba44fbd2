//! Environment maps made by formula: lat-long, the centre column along -Z.

use std::error::Error;
use std::path::Path;

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage, f16};
use glam::DVec3;

/// Lat-long, twice as wide as high, row-major from the top left.
pub struct Map {
    pub width: usize,
    pub height: usize,
    pub texels: Vec<[f32; 3]>,
}

impl Map {
    /// Samples a radiance of direction at the texel centres.
    fn new(height: usize, radiance: impl Fn(DVec3) -> DVec3) -> Self {
        let width = height * 2;
        let texels = (0..width * height)
            .map(|index| {
                let u = ((index % width) as f64 + 0.5) / width as f64;
                let v = ((index / width) as f64 + 0.5) / height as f64;
                radiance(direction(u, v)).as_vec3().to_array()
            })
            .collect();
        Self {
            width,
            height,
            texels,
        }
    }
}

/// u = 0.5 looks along -Z, growing u turns towards +X; v = 0 is up.
fn direction(u: f64, v: f64) -> DVec3 {
    let (sin_phi, cos_phi) = ((u - 0.5) * std::f64::consts::TAU).sin_cos();
    let (sin_theta, cos_theta) = (v * std::f64::consts::PI).sin_cos();
    DVec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
}

/// 1 at or below `from`, 0 at or above `to`, smooth between.
fn falling(from: f64, to: f64, x: f64) -> f64 {
    let t = ((to - x) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A blue sky, brighter at the horizon, over dull ground, with a hazy sun of 5 degrees radius, 50 degrees up on the left behind
/// the camera.
pub fn sunny_sky() -> Map {
    let elevation = 50.0_f64.to_radians();
    let sun = DVec3::new(
        -0.6 * elevation.cos(),
        elevation.sin(),
        0.8 * elevation.cos(),
    );
    Map::new(128, |direction| {
        let up = direction.y;
        let sky = DVec3::new(0.22, 0.34, 0.62)
            .lerp(DVec3::new(0.70, 0.74, 0.80), (-4.0 * up.max(0.0)).exp());
        let ground = DVec3::new(0.22, 0.20, 0.18);
        let away_deg = direction.angle_between(sun).to_degrees();
        let disc = DVec3::new(60.0, 55.0, 48.0) * falling(3.0, 7.0, away_deg);
        ground.lerp(sky, falling(-0.02, 0.02, -up)) + disc
    })
}

/// Half floats, compressed.
pub fn write_exr(map: &Map, path: &Path) -> Result<(), Box<dyn Error>> {
    let channels = SpecificChannels::rgb(|position: exr::math::Vec2<usize>| {
        let [r, g, b] = map.texels[position.y() * map.width + position.x()];
        (f16::from_f32(r), f16::from_f32(g), f16::from_f32(b))
    });
    let layer = Layer::new(
        (map.width, map.height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        channels,
    );
    Image::from_layer(layer).write().to_file(path)?;
    Ok(())
}
