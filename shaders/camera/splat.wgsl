// Twin of src/camera/splat.rs: the same operations in the same order.

import package::gpu::buffers::frame;
import package::shared::NONE;
import package::math::{dot3, length3};
import package::camera::lens::{lens_area, lens_distort, lens_undistort, sample_lens};
import package::camera::shutter::CameraPose;
@if(lens_models) import package::camera::lens::{coefficients, is_wide};
@if(lens_models) import package::distortion::{fisheye_angle_fast, fisheye_radius, fisheye_slope};
@if(lens_models) import package::math::atan2_;

struct LensConnection {
    pixel: u32,
    direction: vec3<f32>,
    distance: f32,
    importance: f32,
}

fn lens_connect(pose: CameraPose, position: vec3<f32>, lens_u: f32, lens_v: f32) -> LensConnection {
    var at = vec2<f32>(0.0, 0.0);
    @if(lens) {
        if frame.aperture_radius != 0.0 { at = sample_lens(lens_u, lens_v); }
    }
    let to_lens = (pose.position + (pose.right * at.x + pose.up * at.y)) - position;
    let depth = dot3(to_lens, pose.back);
    let distance = length3(to_lens);
    var connection = LensConnection(NONE, pose.back, distance, 0.0);
    @if(lens_models) {
        if is_wide() { return connect_wide(pose, to_lens, distance); }
    }
    if depth <= 0.0 { return connection; }
    connection.direction = to_lens / distance;
    let x = at.x * frame.inv_focus_distance - dot3(to_lens, pose.right) / depth;
    let y = dot3(to_lens, pose.up) / depth - at.y * frame.inv_focus_distance;
    let distorted = lens_distort(x, y);
    let px = distorted.x * frame.intrinsics.x + frame.intrinsics.z;
    let py = distorted.y * frame.intrinsics.y + frame.intrinsics.w;
    let inside = px >= 0.0 && py >= 0.0 && px < f32(frame.width) && py < f32(frame.height);
    let back = lens_undistort(distorted.x, distorted.y);
    let miss = abs(back.x - x) + abs(back.y - y);
    if !inside || miss > FOLD_TOLERANCE * (1.0 + abs(x) + abs(y)) { return connection; }
    connection.pixel = u32(py) * frame.width + u32(px);
    let secant = distance / depth;
    connection.importance = frame.intrinsics.x * frame.intrinsics.y * lens_area(x, y) * (secant * secant * secant);
    return connection;
}

@if(lens_models)
fn connect_wide(pose: CameraPose, to_lens: vec3<f32>, distance: f32) -> LensConnection {
    let x = -dot3(to_lens, pose.right);
    let y = dot3(to_lens, pose.up);
    let k = coefficients();
    let r = sqrt(x * x + y * y);
    let angle = atan2_(r, dot3(to_lens, pose.back));
    let radius = fisheye_radius(k, angle);
    var scale = 0.0;
    var density = 1.0;
    if r > 1e-6 * distance {
        scale = radius / r;
        density = scale * fisheye_slope(k, angle) * distance;
    }
    let px = x * scale * frame.intrinsics.x + frame.intrinsics.z;
    let py = y * scale * frame.intrinsics.y + frame.intrinsics.w;
    let inside = px >= 0.0 && py >= 0.0 && px < f32(frame.width) && py < f32(frame.height);
    let miss = abs(fisheye_angle_fast(k, radius) - angle);
    var connection = LensConnection(NONE, to_lens / distance, distance, 0.0);
    if inside && miss <= FOLD_TOLERANCE {
        connection.pixel = u32(py) * frame.width + u32(px);
        connection.importance = frame.intrinsics.x * frame.intrinsics.y * density;
    }
    return connection;
}

fn exposure_weight(share: f32, row: u32) -> f32 {
    let height = f32(frame.height);
    let open = max(frame.shutter_open, 1.0 / height);
    let since = share - f32(row) * ((1.0 - open) / max(height - 1.0, 1.0));
    if since >= 0.0 && since < open { return 1.0 / open; }
    return 0.0;
}
