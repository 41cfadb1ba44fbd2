// Twin of the f32 half of src/distortion.rs: the same operations in the same order. Coefficients: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.

@if(lens_models) import package::math::{INV_TAU, atan2_, sincos_2pi};

fn distort(model: u32, k: array<f32, 12>, ideal: vec2<f32>) -> vec2<f32> {
    @if(lens_models) {
        if model == LENS_FISHEYE { return fisheye_distort(k, ideal); }
        if model == LENS_RATIONAL { return rational_distort(k, ideal); }
    }
    let x = ideal.x;
    let y = ideal.y;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    return vec2<f32>(
        x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
        y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y,
    );
}

fn jacobian(model: u32, k: array<f32, 12>, ideal: vec2<f32>) -> vec4<f32> {
    @if(lens_models) {
        if model == LENS_FISHEYE { return fisheye_jacobian(k, ideal); }
        if model == LENS_RATIONAL { return rational_jacobian(k, ideal); }
    }
    let x = ideal.x;
    let y = ideal.y;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    let slope = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]);
    let across = 2.0 * x * y * slope + 2.0 * k[2] * x + 2.0 * k[3] * y;
    return vec4<f32>(
        radial + 2.0 * x * x * slope + 2.0 * k[2] * y + 6.0 * k[3] * x,
        across,
        across,
        radial + 2.0 * y * y * slope + 6.0 * k[2] * y + 2.0 * k[3] * x,
    );
}

@if(lens_models)
fn rational_distort(k: array<f32, 12>, ideal: vec2<f32>) -> vec2<f32> {
    let x = ideal.x;
    let y = ideal.y;
    let r2 = x * x + y * y;
    let above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    let below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    let radial = above / below;
    return vec2<f32>(
        x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x) + r2 * (k[8] + r2 * k[9]),
        y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y + r2 * (k[10] + r2 * k[11]),
    );
}

@if(lens_models)
fn rational_jacobian(k: array<f32, 12>, ideal: vec2<f32>) -> vec4<f32> {
    let x = ideal.x;
    let y = ideal.y;
    let r2 = x * x + y * y;
    let above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    let below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    let radial = above / below;
    let above_slope = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]);
    let below_slope = k[5] + r2 * (2.0 * k[6] + r2 * 3.0 * k[7]);
    let slope = (above_slope + -1.0 * (radial * below_slope)) / below;
    let across = 2.0 * x * y * slope + 2.0 * k[2] * x + 2.0 * k[3] * y;
    let prism_x = 2.0 * (k[8] + 2.0 * k[9] * r2);
    let prism_y = 2.0 * (k[10] + 2.0 * k[11] * r2);
    return vec4<f32>(
        radial + 2.0 * x * x * slope + 2.0 * k[2] * y + 6.0 * k[3] * x + prism_x * x,
        across + prism_x * y,
        across + prism_y * x,
        radial + 2.0 * y * y * slope + 6.0 * k[2] * y + 2.0 * k[3] * x + prism_y * y,
    );
}

@if(lens_models)
fn fisheye_radius(k: array<f32, 12>, angle: f32) -> f32 {
    let t2 = angle * angle;
    return angle * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

@if(lens_models)
fn fisheye_slope(k: array<f32, 12>, angle: f32) -> f32 {
    let t2 = angle * angle;
    return 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
}

@if(lens_models)
fn fisheye_distort(k: array<f32, 12>, ideal: vec2<f32>) -> vec2<f32> {
    let r = sqrt(ideal.x * ideal.x + ideal.y * ideal.y);
    if r < CENTRE { return ideal; }
    let scale = fisheye_radius(k, atan2_(r, 1.0)) / r;
    return vec2<f32>(ideal.x * scale, ideal.y * scale);
}

@if(lens_models)
fn fisheye_jacobian(k: array<f32, 12>, ideal: vec2<f32>) -> vec4<f32> {
    let x = ideal.x;
    let y = ideal.y;
    let r = sqrt(x * x + y * y);
    if r < CENTRE { return vec4<f32>(1.0, 0.0, 0.0, 1.0); }
    let angle = atan2_(r, 1.0);
    let around = fisheye_radius(k, angle) / r;
    let outwards = fisheye_slope(k, angle) / (1.0 + r * r);
    let difference = (outwards + -1.0 * around) / (r * r);
    let across = difference * x * y;
    return vec4<f32>(around + difference * x * x, across, across, around + difference * y * y);
}

fn distortion_area(model: u32, k: array<f32, 12>, ideal: vec2<f32>) -> f32 {
    let j = jacobian(model, k, ideal);
    return abs(j.x * j.w - j.y * j.z);
}

fn undistort_fast(model: u32, k: array<f32, 12>, distorted: vec2<f32>) -> vec2<f32> {
    @if(lens_models) {
        if model == LENS_FISHEYE { return fisheye_undistort_fast(k, distorted); }
    }
    if model == LENS_RADIAL && k[0] == 0.0 && k[1] == 0.0 && k[2] == 0.0 && k[3] == 0.0 && k[4] == 0.0 {
        return distorted;
    }
    var x = distorted.x;
    var y = distorted.y;
    for (var i = 0u; i < UNDISTORT_STEPS; i++) {
        let at = distort(model, k, vec2<f32>(x, y));
        let ex = at.x - distorted.x;
        let ey = at.y - distorted.y;
        let j = jacobian(model, k, vec2<f32>(x, y));
        let determinant = j.x * j.w - j.y * j.z;
        let inverse = 1.0 / max(determinant, 1e-4);
        x -= clamp((j.w * ex - j.y * ey) * inverse, -0.5, 0.5);
        y -= clamp((j.x * ey - j.z * ex) * inverse, -0.5, 0.5);
    }
    return vec2<f32>(x, y);
}

@if(lens_models)
fn fisheye_angle_fast(k: array<f32, 12>, r: f32) -> f32 {
    var angle = min(r, WIDEST_ANGLE);
    for (var i = 0u; i < UNDISTORT_STEPS; i++) {
        let error = fisheye_radius(k, angle) - r;
        angle -= clamp(error / max(fisheye_slope(k, angle), 1e-4), -0.5, 0.5);
        angle = clamp(angle, 0.0, WIDEST_ANGLE);
    }
    return angle;
}

@if(lens_models)
fn fisheye_direction(k: array<f32, 12>, distorted: vec2<f32>) -> vec3<f32> {
    let r = sqrt(distorted.x * distorted.x + distorted.y * distorted.y);
    if r < CENTRE { return vec3<f32>(distorted.x, distorted.y, 1.0); }
    let turned = sincos_2pi(fisheye_angle_fast(k, r) * INV_TAU);
    let scale = turned.sin / r;
    return vec3<f32>(distorted.x * scale, distorted.y * scale, turned.cos);
}

@if(lens_models)
fn fisheye_undistort_fast(k: array<f32, 12>, distorted: vec2<f32>) -> vec2<f32> {
    let r = sqrt(distorted.x * distorted.x + distorted.y * distorted.y);
    if r < CENTRE { return distorted; }
    let angle = min(fisheye_angle_fast(k, r), FARTHEST_ANGLE);
    let turned = sincos_2pi(angle * INV_TAU);
    let scale = turned.sin / (turned.cos * r);
    return vec2<f32>(distorted.x * scale, distorted.y * scale);
}
