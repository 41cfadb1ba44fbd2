//! The camera in the frame.

use glam::DVec3;

use crate::packed::{APERTURE_DISC, APERTURE_SQUARE, Frame};
use crate::scene::{Aperture, Camera, Lens};

/// Fills the camera and lens fields of `frame`. Positions become relative to `anchor` (world, metres), subtracted in f64.
pub fn frame_camera(camera: &Camera, lens: &Lens, anchor: DVec3, frame: &mut Frame) {
    let pose = camera.world_from_camera;
    let axis = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    frame.camera_position = axis(pose.w_axis.truncate() - anchor);
    frame.camera_right = axis(pose.x_axis.truncate());
    frame.camera_up = axis(pose.y_axis.truncate());
    frame.camera_back = axis(pose.z_axis.truncate());
    frame.intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy].map(|v| v as f32);
    frame.lens_model = camera.distortion.model;
    let k = camera.distortion.coefficients.map(|v| v as f32);
    let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = k;
    frame.distortion = [k1, k2, p1, p2];
    frame.distortion_k3 = k3;
    frame.distortion_more = [[k4, k5, k6, s1], [s2, s3, s4, 0.0]];
    frame.aperture_radius = lens.aperture_radius_m as f32;
    frame.inv_focus_distance = (1.0 / lens.focus_distance_m) as f32;
    frame.blade_rotation = lens.blade_rotation_deg.to_radians() as f32;
    frame.aperture_shape = match lens.aperture {
        Aperture::Disc => APERTURE_DISC,
        Aperture::Square => APERTURE_SQUARE,
        Aperture::Blades(count) => count,
    };
    frame.width = camera.width;
    frame.height = camera.height;
}
