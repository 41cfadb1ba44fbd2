// Twin of src/material/texture.rs: the same operations in the same order.

import package::gpu::buffers::{texels, texture_refs};
import package::packed::records::{TextureRef, TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_UV1, TEXTURE_WRAP_U_SHIFT, TEXTURE_WRAP_V_SHIFT, WRAP_MIRROR, WRAP_REPEAT};
import package::shared::NONE;

fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        return encoded * (1.0 / 12.92);
    }
    if encoded >= 1.0 {
        return 1.0;
    }
    let x = (encoded + 0.055) * (1.0 / 1.055);
    let w = sqrt(x) - 0.65;
    var p = POWER_04[8];
    p = p * w + POWER_04[7];
    p = p * w + POWER_04[6];
    p = p * w + POWER_04[5];
    p = p * w + POWER_04[4];
    p = p * w + POWER_04[3];
    p = p * w + POWER_04[2];
    p = p * w + POWER_04[1];
    p = p * w + POWER_04[0];
    return x * x * p;
}

fn texel(entry: TextureRef, x: u32, y: u32) -> vec4<f32> {
    let word = texels[entry.offset + y * entry.width + x];
    let stored = vec4<f32>(
        f32(word & 255u),
        f32((word >> 8u) & 255u),
        f32((word >> 16u) & 255u),
        f32(word >> 24u),
    ) * INV_255;
    if (entry.flags & TEXTURE_SRGB) != 0u {
        return vec4<f32>(srgb_decode(stored.x), srgb_decode(stored.y), srgb_decode(stored.z), stored.w);
    }
    return stored;
}

fn wrapped_coordinate(u: f32, wrap: u32) -> f32 {
    if wrap == WRAP_REPEAT {
        return u - floor(u);
    }
    if wrap == WRAP_MIRROR {
        return u - 2.0 * floor(u * 0.5);
    }
    return clamp(u, 0.0, 1.0);
}

fn wrapped_index(index: i32, size: i32, wrap: u32) -> u32 {
    var i = index;
    if wrap == WRAP_REPEAT {
        if i < 0 {
            i += size;
        }
        if i >= size {
            i -= size;
        }
    } else if wrap == WRAP_MIRROR {
        if i < 0 {
            i = -1 - i;
        }
        if i >= 2 * size {
            i -= 2 * size;
        }
        if i >= size {
            i = 2 * size - 1 - i;
        }
    }
    return u32(clamp(i, 0, size - 1));
}

fn texture_sample(entry: TextureRef, uv: vec2<f32>) -> vec4<f32> {
    let tu = entry.transform_u;
    let tv = entry.transform_v;
    let wrap_u = (entry.flags >> TEXTURE_WRAP_U_SHIFT) & 3u;
    let wrap_v = (entry.flags >> TEXTURE_WRAP_V_SHIFT) & 3u;
    let u = wrapped_coordinate(tu.x * uv.x + tu.y * uv.y + tu.z, wrap_u);
    let v = wrapped_coordinate(tv.x * uv.x + tv.y * uv.y + tv.z, wrap_v);
    let width = i32(entry.width);
    let height = i32(entry.height);
    if (entry.flags & TEXTURE_NEAREST) != 0u {
        let x = wrapped_index(i32(floor(u * f32(entry.width))), width, wrap_u);
        let y = wrapped_index(i32(floor(v * f32(entry.height))), height, wrap_v);
        return texel(entry, x, y);
    }
    let px = u * f32(entry.width) - 0.5;
    let py = v * f32(entry.height) - 0.5;
    let fx = floor(px);
    let fy = floor(py);
    let ax = px - fx;
    let ay = py - fy;
    let x0 = wrapped_index(i32(fx), width, wrap_u);
    let x1 = wrapped_index(i32(fx) + 1, width, wrap_u);
    let y0 = wrapped_index(i32(fy), height, wrap_v);
    let y1 = wrapped_index(i32(fy) + 1, height, wrap_v);
    let c00 = texel(entry, x0, y0);
    let c10 = texel(entry, x1, y0);
    let c01 = texel(entry, x0, y1);
    let c11 = texel(entry, x1, y1);
    let top = c00 * (1.0 - ax) + c10 * ax;
    let bottom = c01 * (1.0 - ax) + c11 * ax;
    return top * (1.0 - ay) + bottom * ay;
}

fn slot(index: u32, uv0: vec2<f32>, uv1: vec2<f32>) -> vec4<f32> {
    if index == NONE {
        return vec4<f32>(1.0);
    }
    let entry = texture_refs[index];
    return texture_sample(entry, select(uv0, uv1, (entry.flags & TEXTURE_UV1) != 0u));
}

fn slot_rgb(index: u32, uv0: vec2<f32>, uv1: vec2<f32>) -> vec3<f32> {
    return slot(index, uv0, uv1).xyz;
}
