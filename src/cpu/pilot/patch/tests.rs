use bytemuck::Zeroable;
use glam::{DMat4, DVec3};

use super::*;
use crate::camera::shutter::camera_pose;
use crate::cpu::pilot::beam::Beam;
use crate::distortion::Distortion;
use crate::math::{hash_u32, uniform_from_bits};
use crate::pack::camera::frame_camera;
use crate::scene::{Camera, Lens};

impl LensGrid {
    /// The patch that a pixel lies in, and its place there.
    pub fn place(&self, frame: &Frame, pixel: usize) -> (&Patch, usize) {
        let found = self.patches.iter().find_map(|patch| {
            let at = patch.pixels(frame).position(|p| p == pixel)?;
            Some((patch, at))
        });
        found.expect("in the picture")
    }
}

/// Sizes are no multiples of a patch's.
fn frame(fx: f64, aperture_radius_m: f64, position: DVec3) -> Frame {
    let turned = DMat4::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 0.2);
    let camera = Camera {
        width: 150,
        height: 107,
        fx,
        fy: 131.0,
        cx: 70.0,
        cy: 55.0,
        distortion: Distortion::opencv(&[-0.27, 0.14, 0.002, -0.001]).expect("four"),
        world_from_camera: DMat4::from_translation(position) * turned,
    };
    let lens = Lens {
        aperture_radius_m,
        focus_distance_m: 0.8,
        ..Lens::PINHOLE
    };
    let mut frame = Frame::zeroed();
    frame_camera(&camera, &lens, DVec3::ZERO, &mut frame);
    frame
}

/// Against each pixel's own beam. Control: what the pixel in a patch's middle meets is not what all of them do.
#[test]
fn what_is_certain_of_a_patch_holds_for_all_of_its_pixels() {
    let random = |i: u32| uniform_from_bits(hash_u32(i));
    let (mut never, mut always, mut open, mut misled) = (0, 0, 0, 0);
    for aperture_radius_m in [0.0, 0.01] {
        let frame = frame(130.0, aperture_radius_m, DVec3::new(0.1, 0.2, -0.3));
        let pose = camera_pose(&frame);
        let grid = LensGrid::of(&frame);
        for i in 0..40 {
            let [x, y, z, r] = [0, 1, 2, 3].map(|n| random(4 * i + n));
            let depth_m = 2.2 * z - 0.2;
            let seen = Vec3::new(1.4 * x - 0.7, y - 0.5, 1.0) * depth_m;
            let sphere = (
                pose.position + in_world(&pose, seen),
                0.02 + 0.7 * r * depth_m.abs(),
            );
            for patch in &grid.patches {
                let meets: Vec<bool> = (0..patch.pixels(&frame).count())
                    .map(|at| Beam::of_pixel(&frame, patch, at).may_meet_any(&[sphere]))
                    .collect();
                let middle = meets[meets.len() / 2];
                misled += usize::from(meets.iter().any(|meets| *meets != middle));
                match patch.meets_sphere(&frame, &pose, sphere) {
                    Certainty::Never => {
                        never += 1;
                        assert!(!meets.contains(&true), "{sphere:?}");
                    }
                    Certainty::Always => {
                        always += 1;
                        assert!(!meets.contains(&false), "{sphere:?}");
                    }
                    Certainty::Open => open += 1,
                }
            }
        }
    }
    assert!(misled > 100, "control: {misled}");
    assert!(
        never > 1000 && always > 100 && open < never + always,
        "{never} {always} {open}"
    );
}

#[test]
fn a_grid_serves_its_own_lens_wherever_the_camera_stands() {
    let here = frame(130.0, 0.0, DVec3::ZERO);
    let grid = LensGrid::of(&here);
    assert!(grid.fits(&frame(130.0, 0.01, DVec3::ONE)));
    assert!(!grid.fits(&frame(131.0, 0.0, DVec3::ZERO)));
    let other = Frame {
        distortion: [-0.26, 0.14, 0.002, -0.001],
        ..here
    };
    assert!(!grid.fits(&other));
    let smaller = Frame {
        height: 106,
        ..here
    };
    assert!(!grid.fits(&smaller));
}
