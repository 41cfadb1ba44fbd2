// Rectangular lights by solid angle. Rust twin: src/light/rectangle.rs, where the formulas are explained.

import package::packed::records::{LIGHT_QUAD, Light};
import package::math::{INV_TAU, TAU, atan2_, cross3, dot3, safe_sqrt, sincos_2pi};

fn is_right_angle(ex: vec3<f32>, ey: vec3<f32>) -> bool {
    return abs(dot3(ex, ey)) <= RIGHT_ANGLE;
}

fn rectangle_from(light: Light, position: vec3<f32>) -> Rectangle {
    let ex = light.unit_u.xyz;
    let ey = light.unit_v.xyz;
    let ez = cross3(ex, ey);
    let offset = light.position.xyz - position;
    let x0 = dot3(offset, ex);
    let y0 = dot3(offset, ey);
    var r = Rectangle(ex, ey, ez, x0, x0 + light.unit_u.w, y0, y0 + light.unit_v.w, -dot3(offset, ez), 0.0, 0.0);
    if light.kind != LIGHT_QUAD || !is_right_angle(ex, ey) || r.height <= 0.0 { return r; }
    let inv_height = 1.0 / r.height;
    let nx0 = in_heights(r.x0, inv_height);
    let nx1 = in_heights(r.x1, inv_height);
    let ny0 = in_heights(r.y0, inv_height);
    let ny1 = in_heights(r.y1, inv_height);
    let left = between(corner(nx0, ny1), corner(nx0, ny0));
    let right = between(corner(nx1, ny1), corner(nx1, ny0));
    let whole = between(right, left);
    var solid_angle = atan2_(whole.y, whole.x);
    if solid_angle < 0.0 { solid_angle += TAU; }
    if solid_angle >= MIN_SOLID_ANGLE {
        r.solid_angle = solid_angle;
        r.start = atan2_(left.y, left.x);
    }
    return r;
}

fn in_heights(x: f32, inv_height: f32) -> f32 {
    return clamp(x * inv_height, -FARTHEST, FARTHEST);
}

fn corner(x: f32, y: f32) -> vec2<f32> {
    return vec2<f32>(safe_sqrt(x * x + y * y + 1.0), x * y);
}

fn between(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}

fn sample_rectangle(r: Rectangle, u0: f32, u1: f32) -> vec3<f32> {
    let height_squared = r.height * r.height;
    let p = r.y1 / safe_sqrt(r.y1 * r.y1 + height_squared);
    let q = -r.y0 / safe_sqrt(r.y0 * r.y0 + height_squared);
    let half_angle = sincos_2pi((r.start + u0 * r.solid_angle) * (0.5 * INV_TAU));
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
