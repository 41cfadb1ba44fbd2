// Twin of src/camera/shutter.rs: the same operations in the same order.

import package::gpu::buffers::frame;
import package::packed::records::{FRAME_SHUTTER_ORDERED, SHUTTER_POSES};
import package::camera::sampler::{SampleKey, sample_4d};

fn camera_pose() -> CameraPose {
    return CameraPose(
        frame.camera_position.xyz,
        frame.camera_right.xyz,
        frame.camera_up.xyz,
        frame.camera_back.xyz,
    );
}

fn shutter_share(key: SampleKey, index: u32, row: u32) -> f32 {
    var within = sample_4d(key, SHUTTER_SET).x;
    if (frame.flags & FRAME_SHUTTER_ORDERED) != 0u {
        within = (f32(index) + within) / f32(key.total);
    }
    return f32(row) * frame.shutter_row + min(within, 1.0) * frame.shutter_open;
}

fn camera_pose_at(share: f32) -> CameraPose {
    let pieces = f32(SHUTTER_POSES - 1u);
    let s = clamp(share, 0.0, 1.0) * pieces;
    let piece = min(floor(s), pieces - 1.0);
    let along = s - piece;
    let first = 2u * u32(piece);
    let p0 = frame.shutter_poses[first];
    let q0 = frame.shutter_poses[first + 1u];
    let p = p0 + (frame.shutter_poses[first + 2u] - p0) * along;
    let q = q0 + (frame.shutter_poses[first + 3u] - q0) * along;
    let length = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    let x = q.x / length;
    let y = q.y / length;
    let z = q.z / length;
    let w = q.w / length;
    return CameraPose(
        p.xyz,
        vec3<f32>(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        vec3<f32>(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        vec3<f32>(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    );
}
