use bytemuck::Zeroable;
use glam::{Vec2, Vec4};

use super::Random;
use crate::material::{srgb_decode, texture_sample};
use crate::packed::{
    TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_WRAP_U_SHIFT, TEXTURE_WRAP_V_SHIFT, TextureRef,
};

fn srgb_f64(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

#[test]
fn srgb_codes_decode_as_the_standard_says() {
    let error = |reference: &dyn Fn(f64) -> f64| {
        (1..256u32)
            .map(|code| {
                let expected = reference(f64::from(code) / 255.0);
                let decoded = srgb_decode(code as f32 * (1.0 / 255.0));
                (f64::from(decoded) / expected - 1.0).abs()
            })
            .fold(0.0, f64::max)
    };
    assert!(error(&srgb_f64) < 6e-7, "{}", error(&srgb_f64));
    assert_eq!(srgb_decode(0.0), 0.0);
    assert_eq!(srgb_decode(1.0), 1.0);
    // Negative control: a plain 2.2 power is another curve.
    assert!(error(&|x| x.powf(2.2)) > 0.01);
}

/// Textures with their reference: 0 repeat, 1 mirror, 2 clamp by the definition of the OpenGL specification, on f64.
fn wrap_f64(index: i64, size: i64, wrap: u32) -> i64 {
    match wrap {
        0 => index.rem_euclid(size),
        1 => {
            let m = index.rem_euclid(2 * size);
            if m < size { m } else { 2 * size - 1 - m }
        }
        _ => index.clamp(0, size - 1),
    }
}

fn reference(texels: &[u32], t: &TextureRef, uv: Vec2, srgb_first: bool) -> [f64; 4] {
    let row = |m: [f32; 4]| {
        f64::from(m[0]) * f64::from(uv.x) + f64::from(m[1]) * f64::from(uv.y) + f64::from(m[2])
    };
    let (u, v) = (row(t.transform_u), row(t.transform_v));
    let (w, h) = (i64::from(t.width), i64::from(t.height));
    let wrap_u = (t.flags >> TEXTURE_WRAP_U_SHIFT) & 3;
    let wrap_v = (t.flags >> TEXTURE_WRAP_V_SHIFT) & 3;
    let srgb = t.flags & TEXTURE_SRGB != 0;
    let fetch = |x: i64, y: i64| -> [f64; 4] {
        let index = wrap_f64(y, h, wrap_v) * w + wrap_f64(x, w, wrap_u);
        let bytes = texels[t.offset as usize + index as usize].to_le_bytes();
        std::array::from_fn(|c| {
            let stored = f64::from(bytes[c]) / 255.0;
            if srgb && srgb_first && c < 3 {
                srgb_f64(stored)
            } else {
                stored
            }
        })
    };
    let filtered: [f64; 4] = if t.flags & TEXTURE_NEAREST != 0 {
        fetch((u * w as f64).floor() as i64, (v * h as f64).floor() as i64)
    } else {
        let (x, y) = (u * w as f64 - 0.5, v * h as f64 - 0.5);
        let (ax, ay) = (x - x.floor(), y - y.floor());
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let corners = [
            fetch(x, y),
            fetch(x + 1, y),
            fetch(x, y + 1),
            fetch(x + 1, y + 1),
        ];
        std::array::from_fn(|c| {
            (corners[0][c] * (1.0 - ax) + corners[1][c] * ax) * (1.0 - ay)
                + (corners[2][c] * (1.0 - ax) + corners[3][c] * ax) * ay
        })
    };
    std::array::from_fn(|c| {
        if srgb && !srgb_first && c < 3 {
            srgb_f64(filtered[c])
        } else {
            filtered[c]
        }
    })
}

fn difference(sample: Vec4, expected: [f64; 4]) -> f64 {
    sample
        .to_array()
        .iter()
        .zip(expected)
        .map(|(s, e)| (f64::from(*s) - e).abs())
        .fold(0.0, f64::max)
}

pub fn random_texture(random: &mut Random, texels: &mut Vec<u32>) -> TextureRef {
    let size = |random: &mut Random| [1, 2, 3, 7, 16][(random.bits() % 5) as usize];
    let (width, height) = (size(random), size(random));
    let offset = texels.len() as u32;
    texels.extend((0..width * height).map(|_| random.bits()));
    let mut flags = (random.bits() % 3) << TEXTURE_WRAP_U_SHIFT;
    flags |= (random.bits() % 3) << TEXTURE_WRAP_V_SHIFT;
    flags |= random.bits() & (TEXTURE_SRGB | TEXTURE_NEAREST);
    let mut row = || {
        [
            random.range(-2.0, 2.0),
            random.range(-2.0, 2.0),
            random.range(-1.0, 1.0),
            0.0,
        ]
    };
    TextureRef {
        offset,
        width,
        height,
        flags,
        transform_u: row(),
        transform_v: row(),
    }
}

#[test]
fn filtering_and_wrapping_agree_with_f64() {
    let mut random = Random::new(5);
    let mut texels = vec![0xdead_beef; 3];
    let mut worst = 0.0f64;
    let mut late_decode_differs = 0.0f64;
    let mut outliers = 0;
    for _ in 0..400 {
        let texture = random_texture(&mut random, &mut texels);
        for _ in 0..100 {
            let uv = Vec2::new(random.range(-3.0, 3.0), random.range(-3.0, 3.0));
            let sample = texture_sample(&texels, &texture, uv);
            let error = difference(sample, reference(&texels, &texture, uv, true));
            if texture.flags & TEXTURE_NEAREST != 0 {
                // Rounding of the coordinate may land on the neighbour at a border.
                outliers += u32::from(error > 1e-5);
            } else {
                worst = worst.max(error);
                late_decode_differs = late_decode_differs
                    .max(difference(sample, reference(&texels, &texture, uv, false)));
            }
        }
    }
    assert!(worst < 6e-5, "{worst}");
    assert!(outliers < 5, "{outliers}");
    // Negative control: filtering before decoding is another result.
    assert!(late_decode_differs > 0.05, "{late_decode_differs}");
}

#[test]
fn texel_centres_and_far_coordinates_hold() {
    let texels: Vec<u32> = (0..16u32).map(|i| i * 0x0101_0101).collect();
    let mut texture = TextureRef {
        width: 4,
        height: 4,
        transform_u: [1.0, 0.0, 0.0, 0.0],
        transform_v: [0.0, 1.0, 0.0, 0.0],
        ..TextureRef::zeroed()
    };
    for wrap in 0..3 {
        texture.flags = wrap << TEXTURE_WRAP_U_SHIFT | wrap << TEXTURE_WRAP_V_SHIFT;
        for y in 0..4u32 {
            for x in 0..4u32 {
                let uv = Vec2::new((x as f32 + 0.5) / 4.0, (y as f32 + 0.5) / 4.0);
                let value = texture_sample(&texels, &texture, uv).x;
                assert!((value - (y * 4 + x) as f32 / 255.0).abs() < 1e-7);
            }
        }
        for far in [-1e30, -4e9, -1e-30, 1.0, 3e9, 1e30] {
            let value = texture_sample(&texels, &texture, Vec2::splat(far));
            assert!((0.0..=1.0).contains(&value.x), "{far}");
        }
    }
}
