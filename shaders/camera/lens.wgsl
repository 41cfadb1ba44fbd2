// Twin of the f32 half of src/camera/lens.rs: the same operations in the same order.

import package::gpu::buffers::frame;
import package::packed::records::{APERTURE_DISC, APERTURE_SQUARE};
import package::math::{INV_TAU, dot3, normalize3, sincos_2pi};
import package::camera::shutter::{CameraPose, camera_pose};
import package::distortion::{distort, distortion_area, undistort_fast};

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

fn lens_distort(x: f32, y: f32) -> vec2<f32> {
    return distort(coefficients(), vec2<f32>(x, y));
}

fn lens_undistort(xd: f32, yd: f32) -> vec2<f32> {
    return undistort_fast(coefficients(), vec2<f32>(xd, yd));
}

fn lens_area(x: f32, y: f32) -> f32 {
    return distortion_area(coefficients(), vec2<f32>(x, y));
}

fn coefficients() -> array<f32, 5> {
    let k = frame.distortion;
    return array<f32, 5>(k.x, k.y, k.z, k.w, frame.distortion_k3);
}
