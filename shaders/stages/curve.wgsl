// Twin of src/stages/curve.rs: the same operations in the same order.

import package::math::{exp_, log_};

fn encode_(linear: f32) -> f32 {
    if linear <= 0.0031308 {
        return linear * 12.92;
    }
    return 1.055 * exp_(log_(linear) * (1.0 / 2.4)) - 0.055;
}

fn encode_rgb(linear: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(encode_(linear.x), encode_(linear.y), encode_(linear.z));
}

fn decode_(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        return encoded * (1.0 / 12.92);
    }
    return exp_(log_((encoded + 0.055) * (1.0 / 1.055)) * 2.4);
}

fn decode_slope(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        return 1.0 / 12.92;
    }
    return exp_(log_((encoded + 0.055) * (1.0 / 1.055)) * 1.4) * (2.4 / 1.055);
}
