//! Textures made by formula.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use mixray::math::{hash_combine, uniform_from_bits};
use mixray::scene::{Texture, TextureRef, Wrap, srgb};

/// Samples a linear colour of (u, v) in 0..1, v downwards, at the texel centres.
fn paint(name: &str, width: u32, height: u32, color: impl Fn(DVec2) -> DVec3) -> TextureRef {
    let texel = |index: u32| {
        let x = f64::from(index % width) + 0.5;
        let y = f64::from(index / width) + 0.5;
        let [r, g, b] = color(DVec2::new(x / f64::from(width), y / f64::from(height)))
            .as_vec3()
            .to_array()
            .map(srgb::encode8);
        [r, g, b, 255]
    };
    TextureRef {
        texture: Arc::new(Texture {
            name: name.to_owned(),
            width,
            height,
            rgba8: (0..width * height).map(texel).collect(),
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            nearest: false,
        }),
        uv_set: 0,
        transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

/// Smooth value noise, 0..1, one cell a unit.
fn noise(point: DVec2) -> f64 {
    let cell = point.floor();
    let t = point - cell;
    let t = t * t * (DVec2::splat(3.0) - t * 2.0);
    let corner = |dx: i32, dy: i32| {
        let (x, y) = (cell.x as i32 + dx, cell.y as i32 + dy);
        f64::from(uniform_from_bits(hash_combine(
            hash_combine(7, x as u32),
            y as u32,
        )))
    };
    let top = corner(0, 0) * (1.0 - t.x) + corner(1, 0) * t.x;
    let bottom = corner(0, 1) * (1.0 - t.x) + corner(1, 1) * t.x;
    top * (1.0 - t.y) + bottom * t.y
}

/// Noise at four scales, 0..1.
fn fractal_noise(point: DVec2) -> f64 {
    let octave = |i: i32| noise(point * 2.0_f64.powi(i) + f64::from(i) * 17.3) * 0.5_f64.powi(i);
    (0..4).map(octave).sum::<f64>() / 1.875
}

/// 1 inside the interval, 0 outside, with a ramp of `soft` about its ends.
fn inside(x: f64, low: f64, high: f64, soft: f64) -> f64 {
    let ramp = |d: f64| (d / soft + 0.5).clamp(0.0, 1.0);
    ramp(x - low) * ramp(high - x)
}

/// Boards of wood, the grain along u; `size_m` is what the texture covers.
pub fn wooden_boards(size_m: DVec2) -> TextureRef {
    const BOARD_M: f64 = 0.118;
    paint("wooden boards", 2400, 1800, |uv| {
        let place = uv * size_m;
        let board = (place.y / BOARD_M).floor();
        let across = place.y / BOARD_M - board;
        // Each board is cut from another place of the tree.
        let local = place + DVec2::new(board * 3.71, board * 1.93);
        let bend = fractal_noise(local * DVec2::new(2.5, 9.0)) * 0.05;
        let rings = (fractal_noise(DVec2::new(local.x * 1.2, (local.y + bend) * 60.0)) - 0.5) * 2.0;
        let fibre = fractal_noise(local * DVec2::new(30.0, 700.0)) - 0.5;
        let tone = 0.5 + 0.40 * rings + 0.55 * fibre + 0.16 * (noise(DVec2::new(board, 0.5)) - 0.5);
        let dark = DVec3::new(0.16, 0.072, 0.030);
        let light = DVec3::new(0.47, 0.265, 0.125);
        let gap = inside(across, 0.008, 0.992, 0.008);
        dark.lerp(light, tone.clamp(0.0, 1.0)) * (0.25 + 0.75 * gap)
    })
}

/// Painted wallpaper: stripes with a row of diamonds on every other one.
pub fn wallpaper(size_m: DVec2) -> TextureRef {
    const STRIPE_M: f64 = 0.09;
    paint("wallpaper", 1600, 1024, |uv| {
        let place = uv * size_m;
        let stripe = (place.x / STRIPE_M).floor();
        let across = place.x / STRIPE_M - stripe - 0.5;
        let even = stripe.rem_euclid(2.0) < 0.5;
        let down = (place.y / 0.11).rem_euclid(1.0) - 0.5;
        let diamond = if even {
            inside(across.abs() + 0.62 * down.abs(), -1.0, 0.2, 0.03)
        } else {
            0.0
        };
        let line = inside(across.abs(), 0.43, 0.47, 0.02);
        let ground = if even {
            DVec3::new(0.33, 0.42, 0.40)
        } else {
            DVec3::new(0.27, 0.36, 0.35)
        };
        let print = DVec3::new(0.58, 0.56, 0.44);
        let paper = 0.96 + 0.08 * fractal_noise(place * 160.0);
        ground.lerp(print, (0.75 * diamond).max(0.5 * line)) * paper
    })
}

/// A cloth cover with a gilt frame and a title.
pub fn book_cover() -> TextureRef {
    paint("book cover", 512, 700, |uv| {
        let cloth =
            DVec3::new(0.33, 0.035, 0.035) * (0.8 + 0.4 * noise(uv * DVec2::new(180.0, 250.0)));
        let from_edge = (uv.x.min(1.0 - uv.x) * 0.73).min(uv.y.min(1.0 - uv.y));
        let frame = inside(from_edge, 0.045, 0.056, 0.004) + inside(from_edge, 0.068, 0.072, 0.004);
        let word = |low: f64, high: f64, from: f64, to: f64| {
            let letter = (noise(DVec2::new(uv.x * 60.0, low * 90.0)) > 0.3) as u8;
            inside(uv.y, low, high, 0.005) * inside(uv.x, from, to, 0.008) * f64::from(letter)
        };
        let title = word(0.24, 0.30, 0.22, 0.78)
            + word(0.34, 0.40, 0.30, 0.70)
            + word(0.78, 0.805, 0.36, 0.64);
        cloth.lerp(DVec3::new(0.72, 0.50, 0.18), (frame + title).min(1.0))
    })
}

/// The edges of many sheets; v runs across them.
pub fn pages() -> TextureRef {
    paint("pages", 64, 256, |uv| {
        let sheet = 0.86 + 0.28 * (noise(DVec2::new(uv.x * 3.0, uv.y * 90.0)) - 0.5);
        DVec3::new(0.76, 0.70, 0.58) * sheet
    })
}

/// White glaze with a blue band and thin lines; v = 0 is the foot.
pub fn mug_glaze() -> TextureRef {
    paint("glaze", 64, 512, |uv| {
        let band = inside(uv.y, 0.30, 0.66, 0.006)
            + inside(uv.y, 0.24, 0.26, 0.006)
            + inside(uv.y, 0.70, 0.72, 0.006);
        DVec3::new(0.76, 0.74, 0.69).lerp(DVec3::new(0.04, 0.13, 0.30), band.min(1.0))
    })
}

/// Orange peel.
pub fn peel() -> TextureRef {
    paint("peel", 512, 256, |uv| {
        let pores = noise(uv * DVec2::new(120.0, 60.0));
        let patches = fractal_noise(uv * DVec2::new(8.0, 4.0));
        DVec3::new(0.80, 0.27, 0.025) * (0.78 + 0.16 * pores + 0.2 * patches)
    })
}
