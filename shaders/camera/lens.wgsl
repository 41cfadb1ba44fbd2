// Twin of the f32 half of src/camera/lens.rs: the same operations in the same order.

import package::gpu::buffers::frame;
import package::packed::records::{APERTURE_DISC, APERTURE_SQUARE};
import package::math::{INV_TAU, dot3, normalize3, sincos_2pi};
import package::camera::shutter::{CameraPose, camera_pose};
import package::distortion::{distort, distortion_area, undistort_fast};
@if(lens_models) import package::distortion::{LENS_FISHEYE, fisheye_angle_fast, fisheye_direction, fisheye_radius};
@if(lens_models) import package::math::atan2_;

fn sample_lens(u: f32, v: f32) -> vec2<f32> {
    let radius = frame.aperture_radius;
    let a = 2.0 * u - 1.0;
    let b = 2.0 * v - 1.0;
    if frame.aperture_shape == APERTURE_DISC {
        if a == 0.0 && b == 0.0 {
            return vec2<f32>(0.0, 0.0);
        }
        var r = b;
        var turns = 0.0;
        if abs(a) > abs(b) {
            r = a;
            turns = 0.125 * (b / a);
        } else {
            turns = 0.25 - 0.125 * (a / b);
        }
        let around = sincos_2pi(turns);
        return vec2<f32>(radius * r * around.cos, radius * r * around.sin);
    }
    let rotation = frame.blade_rotation * INV_TAU;
    if frame.aperture_shape == APERTURE_SQUARE {
        let turned = sincos_2pi(rotation);
        return vec2<f32>(
            radius * (a * turned.cos - b * turned.sin),
            radius * (a * turned.sin + b * turned.cos),
        );
    }
    let blades = f32(frame.aperture_shape);
    let blade = min(floor(u * blades), blades - 1.0);
    let along = sqrt(max(u * blades - blade, 0.0)) * radius;
    let half = sincos_2pi(0.5 / blades);
    let x = along * half.cos;
    let y = along * half.sin * b;
    let turned = sincos_2pi((blade + 0.5) / blades + rotation);
    return vec2<f32>(x * turned.cos - y * turned.sin, x * turned.sin + y * turned.cos);
}

fn camera_ray(px: f32, py: f32, lens_u: f32, lens_v: f32) -> CameraRay {
    return camera_ray_from(camera_pose(), px, py, lens_u, lens_v);
}

fn camera_ray_from(pose: CameraPose, px: f32, py: f32, lens_u: f32, lens_v: f32) -> CameraRay {
    @if(lens_models) {
        if is_wide() {
            let distorted = vec2<f32>((px - frame.intrinsics.z) / frame.intrinsics.x, (py - frame.intrinsics.w) / frame.intrinsics.y);
            let d = fisheye_direction(coefficients(), distorted);
            return CameraRay(pose.position, normalize3(pose.right * d.x - (pose.up * d.y + pose.back * d.z)));
        }
    }
    let ideal = lens_undistort(
        (px - frame.intrinsics.z) / frame.intrinsics.x,
        (py - frame.intrinsics.w) / frame.intrinsics.y,
    );
    let d = pose.right * ideal.x - (pose.up * ideal.y + pose.back);
    @if(lens) {
        if frame.aperture_radius != 0.0 {
            let at = sample_lens(lens_u, lens_v);
            let offset = pose.right * at.x + pose.up * at.y;
            return CameraRay(pose.position + offset, normalize3(d - offset * frame.inv_focus_distance));
        }
    }
    return CameraRay(pose.position, normalize3(d));
}

fn camera_project(position: vec3<f32>) -> Projection {
    @if(lens_models) {
        if is_wide() { return project_wide(position); }
    }
    let v = position - frame.camera_position.xyz;
    let depth = -dot3(v, frame.camera_back.xyz);
    if depth <= 0.0 {
        return Projection(0.0, 0.0, depth, false);
    }
    let x = dot3(v, frame.camera_right.xyz) / depth;
    let y = -dot3(v, frame.camera_up.xyz) / depth;
    let distorted = lens_distort(x, y);
    let px = distorted.x * frame.intrinsics.x + frame.intrinsics.z;
    let py = distorted.y * frame.intrinsics.y + frame.intrinsics.w;
    let inside = px >= 0.0 && py >= 0.0 && px < f32(frame.width) && py < f32(frame.height);
    let back = lens_undistort(distorted.x, distorted.y);
    let miss = abs(back.x - x) + abs(back.y - y);
    return Projection(px, py, depth, inside && miss <= 1e-3 * (1.0 + abs(x) + abs(y)));
}

@if(lens_models)
fn project_wide(position: vec3<f32>) -> Projection {
    let v = position - frame.camera_position.xyz;
    let depth = -dot3(v, frame.camera_back.xyz);
    let x = dot3(v, frame.camera_right.xyz);
    let y = -dot3(v, frame.camera_up.xyz);
    let k = coefficients();
    let r = sqrt(x * x + y * y);
    let angle = atan2_(r, depth);
    let radius = fisheye_radius(k, angle);
    var scale = 0.0;
    if r > 0.0 { scale = radius / r; }
    let px = x * scale * frame.intrinsics.x + frame.intrinsics.z;
    let py = y * scale * frame.intrinsics.y + frame.intrinsics.w;
    let inside = px >= 0.0 && py >= 0.0 && px < f32(frame.width) && py < f32(frame.height);
    let miss = abs(fisheye_angle_fast(k, radius) - angle);
    return Projection(px, py, depth, inside && miss <= 1e-3 && (r > 0.0 || depth > 0.0));
}

fn lens_distort(x: f32, y: f32) -> vec2<f32> {
    return distort(frame.lens_model, coefficients(), vec2<f32>(x, y));
}

fn lens_undistort(xd: f32, yd: f32) -> vec2<f32> {
    return undistort_fast(frame.lens_model, coefficients(), vec2<f32>(xd, yd));
}

fn lens_area(x: f32, y: f32) -> f32 {
    return distortion_area(frame.lens_model, coefficients(), vec2<f32>(x, y));
}

@if(lens_models)
fn is_wide() -> bool {
    return frame.lens_model == LENS_FISHEYE && frame.aperture_radius == 0.0;
}

fn coefficients() -> array<f32, 12> {
    let k = frame.distortion;
    let more = frame.distortion_more;
    return array<f32, 12>(
        k.x, k.y, k.z, k.w, frame.distortion_k3,
        more[0].x, more[0].y, more[0].z, more[0].w, more[1].x, more[1].y, more[1].z,
    );
}
