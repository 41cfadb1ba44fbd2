// Rectangular lights by solid angle. Rust twin: src/light/rectangle.rs, where the formulas are explained.

import package::bindings::{LIGHT_QUAD, Light};
import package::math::{atan2_, cross3, dot3, length3, safe_sqrt, sincos_2pi};

const MIN_SOLID_ANGLE: f32 = 0.02;
const RIGHT_ANGLE: f32 = 1e-5;
const INV_TAU: f32 = 0.15915494;

struct Rectangle {
    ex: vec3<f32>,
    ey: vec3<f32>,
    ez: vec3<f32>,
    x0: f32,
    x1: f32,
    y0: f32,
    y1: f32,
    height: f32,
    solid_angle: f32,
}

fn rectangle_from(light: Light, position: vec3<f32>) -> Rectangle {
    let width = length3(light.axis_u.xyz);
    let depth = length3(light.axis_v.xyz);
    let ex = light.axis_u.xyz / width;
    let ey = light.axis_v.xyz / depth;
    let ez = cross3(ex, ey);
    let corner = light.position.xyz - position;
    let x0 = dot3(corner, ex);
    let y0 = dot3(corner, ey);
    var r = Rectangle(ex, ey, ez, x0, x0 + width, y0, y0 + depth, -dot3(corner, ez), 0.0);
    if light.kind != LIGHT_QUAD || abs(dot3(ex, ey)) > RIGHT_ANGLE || r.height <= 0.0 { return r; }
    let right = corner_angle(r.x1, r.y1, r.height) - corner_angle(r.x1, r.y0, r.height);
    let left = corner_angle(r.x0, r.y1, r.height) - corner_angle(r.x0, r.y0, r.height);
    let solid_angle = right - left;
    if solid_angle >= MIN_SOLID_ANGLE { r.solid_angle = solid_angle; }
    return r;
}

fn corner_angle(x: f32, y: f32, height: f32) -> f32 {
    return atan2_(x * y, height * safe_sqrt(x * x + y * y + height * height));
}

fn sample_rectangle(r: Rectangle, u0: f32, u1: f32) -> vec3<f32> {
    let height_squared = r.height * r.height;
    let p = r.y1 / safe_sqrt(r.y1 * r.y1 + height_squared);
    let q = -r.y0 / safe_sqrt(r.y0 * r.y0 + height_squared);
    let start = corner_angle(r.x0, r.y1, r.height) - corner_angle(r.x0, r.y0, r.height);
    let half_angle = sincos_2pi((start + u0 * r.solid_angle) * (0.5 * INV_TAU));
    var squared = (p + q) * (p + q) - 4.0 * p * q * half_angle.sin * half_angle.sin;
    if p * q > 0.0 {
        squared = (p - q) * (p - q) + 4.0 * p * q * half_angle.cos * half_angle.cos;
    }
    let c = clamp(2.0 * half_angle.sin * half_angle.cos / safe_sqrt(max(squared, 1e-20)), -1.0, 1.0);
    let x = clamp(c * r.height / safe_sqrt(max(1.0 - c * c, 1e-12)), r.x0, r.x1);
    let strip_squared = x * x + height_squared;
    let low = r.y0 / safe_sqrt(strip_squared + r.y0 * r.y0);
    let high = r.y1 / safe_sqrt(strip_squared + r.y1 * r.y1);
    let s = low + (high - low) * u1;
    let y = clamp(s * safe_sqrt(strip_squared) / safe_sqrt(max(1.0 - s * s, 1e-12)), r.y0, r.y1);
    return (r.ex * x + r.ey * y) - r.ez * r.height;
}
