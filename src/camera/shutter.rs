//! Where the camera is while the shutter is open. WGSL twin: `shaders/camera/shutter.wgsl`.
//!
//! The way is cut into equal pieces of time; within one the position moves along a straight line and the orientation's quaternion too, made
//! a unit again.

use glam::Vec3;

use super::sampler::{SampleKey, sample_4d};
use crate::packed::{FRAME_SHUTTER_ORDERED, Frame, SHUTTER_POSES};
use crate::shared::shared;

shared! {
    /// Pixel and lens are set 0; the vertices' sets begin at 7.
    const SHUTTER_SET: u32 = 1;

    /// Anchor-relative position in metres, and unit axes.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct CameraPose {
        pub position: Vec3,
        pub right: Vec3,
        pub up: Vec3,
        pub back: Vec3,
    }
}

/// The pose at the picture's time.
pub fn camera_pose(frame: &Frame) -> CameraPose {
    let xyz = |v: [f32; 4]| Vec3::new(v[0], v[1], v[2]);
    CameraPose {
        position: xyz(frame.camera_position),
        right: xyz(frame.camera_right),
        up: xyz(frame.camera_up),
        back: xyz(frame.camera_back),
    }
}

/// When a sample of that row is taken: a share of the time from the opening of the first row to the closing of the last. `index` counts
/// the pixel's samples; where they are ordered in time, each has its own slice of the exposure.
pub fn shutter_share(frame: &Frame, key: SampleKey, index: u32, row: u32) -> f32 {
    let mut within = sample_4d(key, SHUTTER_SET)[0];
    if frame.flags & FRAME_SHUTTER_ORDERED != 0 {
        within = (index as f32 + within) / key.total as f32;
    }
    row as f32 * frame.shutter_row + within.min(1.0) * frame.shutter_open
}

/// The pose at a share of the shutter's time, 0 to 1.
pub fn camera_pose_at(frame: &Frame, share: f32) -> CameraPose {
    let pieces = (SHUTTER_POSES - 1) as f32;
    let x = share.clamp(0.0, 1.0) * pieces;
    let piece = x.floor().min(pieces - 1.0);
    let along = x - piece;
    let first = 2 * piece as usize;
    let [p0, q0, p1, q1] = [0, 1, 2, 3].map(|i| frame.shutter_poses[first + i]);
    let mix = |a: [f32; 4], b: [f32; 4]| [0, 1, 2, 3].map(|i| a[i] + (b[i] - a[i]) * along);
    let p = mix(p0, p1);
    let q = mix(q0, q1);
    let length = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let [x, y, z, w] = q.map(|component| component / length);
    CameraPose {
        position: Vec3::new(p[0], p[1], p[2]),
        right: Vec3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + w * z),
            2.0 * (x * z - w * y),
        ),
        up: Vec3::new(
            2.0 * (x * y - w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + w * x),
        ),
        back: Vec3::new(
            2.0 * (x * z + w * y),
            2.0 * (y * z - w * x),
            1.0 - 2.0 * (x * x + y * y),
        ),
    }
}
