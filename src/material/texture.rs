//! Texture reads: wrapping, bilinear and nearest filtering, sRGB decoded before filtering.

use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use crate::packed::{
    PackedScene, TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_WRAP_U_SHIFT, TEXTURE_WRAP_V_SHIFT,
    TextureRef, WRAP_MIRROR, WRAP_REPEAT,
};
use crate::shared::shared;

shared! {
    const INV_255: f32 = 1.0 / 255.0;
    /// Coefficients of x^0.4 in powers of sqrt(x) - 0.65, for x in 0.09..1.
    const POWER_04: [f32; 9] = [
        0.708_485,
        0.871_979_9,
        -0.134_144_57,
        0.082_733_52,
        -0.070_257_53,
        0.063_800_65,
        -0.065_409_54,
        0.133_244_05,
        -0.172_349_69,
    ];
}

/// Decodes an sRGB value in 0..1 (IEC 61966-2-1) to within 6e-7 relative.
///
/// x^2.4 is x^2 times a polynomial for x^0.4, fitted over the range of the power branch, because a shader has no exact pow.
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        return encoded * (1.0 / 12.92);
    }
    if encoded >= 1.0 {
        // White stays exactly white.
        return 1.0;
    }
    let x = (encoded + 0.055) * (1.0 / 1.055);
    let w = x.sqrt() - 0.65;
    let mut p = POWER_04[8];
    p = p * w + POWER_04[7];
    p = p * w + POWER_04[6];
    p = p * w + POWER_04[5];
    p = p * w + POWER_04[4];
    p = p * w + POWER_04[3];
    p = p * w + POWER_04[2];
    p = p * w + POWER_04[1];
    p = p * w + POWER_04[0];
    x * x * p
}

/// `srgb_decode` of every 8-bit code.
static SRGB_TABLE: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_decode(code as f32 * INV_255)));

fn texel(texels: &[u32], texture: &TextureRef, x: u32, y: u32) -> Vec4 {
    let word = texels[(texture.offset + y * texture.width + x) as usize];
    let [r, g, b, a] = word.to_le_bytes();
    let alpha = f32::from(a) * INV_255;
    if texture.flags & TEXTURE_SRGB != 0 {
        let table = &*SRGB_TABLE;
        Vec4::new(
            table[usize::from(r)],
            table[usize::from(g)],
            table[usize::from(b)],
            alpha,
        )
    } else {
        Vec4::new(
            f32::from(r) * INV_255,
            f32::from(g) * INV_255,
            f32::from(b) * INV_255,
            alpha,
        )
    }
}

/// Brings a coordinate near the unit range first, so that far-tiled coordinates keep their fraction.
fn wrapped_coordinate(u: f32, wrap: u32) -> f32 {
    if wrap == WRAP_REPEAT {
        u - u.floor()
    } else if wrap == WRAP_MIRROR {
        u - 2.0 * (u * 0.5).floor()
    } else {
        u.clamp(0.0, 1.0)
    }
}

fn wrapped_index(index: i32, size: i32, wrap: u32) -> u32 {
    if wrap == WRAP_REPEAT {
        let mut i = index;
        if i < 0 {
            i += size;
        }
        if i >= size {
            i -= size;
        }
        i.clamp(0, size - 1) as u32
    } else if wrap == WRAP_MIRROR {
        let mut i = index;
        if i < 0 {
            i = -1 - i;
        }
        if i >= 2 * size {
            i -= 2 * size;
        }
        if i >= size {
            i = 2 * size - 1 - i;
        }
        i.clamp(0, size - 1) as u32
    } else {
        index.clamp(0, size - 1) as u32
    }
}

/// Reads a texture at texture coordinates before its transform. Colour is linear, alpha as stored.
pub fn texture_sample(texels: &[u32], texture: &TextureRef, uv: Vec2) -> Vec4 {
    let tu = texture.transform_u;
    let tv = texture.transform_v;
    let wrap_u = (texture.flags >> TEXTURE_WRAP_U_SHIFT) & 3;
    let wrap_v = (texture.flags >> TEXTURE_WRAP_V_SHIFT) & 3;
    let u = wrapped_coordinate(tu[0] * uv.x + tu[1] * uv.y + tu[2], wrap_u);
    let v = wrapped_coordinate(tv[0] * uv.x + tv[1] * uv.y + tv[2], wrap_v);
    let width = texture.width as i32;
    let height = texture.height as i32;
    if texture.flags & TEXTURE_NEAREST != 0 {
        let x = wrapped_index((u * texture.width as f32).floor() as i32, width, wrap_u);
        let y = wrapped_index((v * texture.height as f32).floor() as i32, height, wrap_v);
        return texel(texels, texture, x, y);
    }
    let px = u * texture.width as f32 - 0.5;
    let py = v * texture.height as f32 - 0.5;
    let fx = px.floor();
    let fy = py.floor();
    let ax = px - fx;
    let ay = py - fy;
    let x0 = wrapped_index(fx as i32, width, wrap_u);
    let x1 = wrapped_index(fx as i32 + 1, width, wrap_u);
    let y0 = wrapped_index(fy as i32, height, wrap_v);
    let y1 = wrapped_index(fy as i32 + 1, height, wrap_v);
    let c00 = texel(texels, texture, x0, y0);
    let c10 = texel(texels, texture, x1, y0);
    let c01 = texel(texels, texture, x0, y1);
    let c11 = texel(texels, texture, x1, y1);
    let top = c00 * (1.0 - ax) + c10 * ax;
    let bottom = c01 * (1.0 - ax) + c11 * ax;
    top * (1.0 - ay) + bottom * ay
}

/// What a material slot reads at a point: white without a texture.
pub fn slot(scene: &PackedScene, index: u32, uv0: Vec2, uv1: Vec2) -> Vec4 {
    match scene.texture_refs.get(index as usize) {
        Some(texture) => {
            let uv = if texture.flags & crate::packed::TEXTURE_UV1 != 0 {
                uv1
            } else {
                uv0
            };
            texture_sample(&scene.texels, texture, uv)
        }
        None => Vec4::ONE,
    }
}

/// The rgb part of [`slot`].
pub fn slot_rgb(scene: &PackedScene, index: u32, uv0: Vec2, uv1: Vec2) -> Vec3 {
    slot(scene, index, uv0, uv1).truncate()
}
