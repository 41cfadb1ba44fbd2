//! Which pixels' beams can meet what.

use glam::Vec3;

use super::beam::Beam;
use super::blur::Sphere;
use super::patch::{Certainty, Patch};
use crate::camera::shutter::camera_pose;
use crate::packed::{Frame, PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PackedScene};

/// Around all that is real; `None`: nothing is.
pub fn real_sphere(scene: &PackedScene) -> Option<Sphere> {
    let (lo, hi) = scene.real_bvh.bounds()?;
    Some(((lo + hi) * 0.5, (hi - lo).length() * 0.5))
}

/// What holds the virtual and the real world.
pub struct WorldSpheres {
    virtual_: Vec<Sphere>,
    real: Vec<Sphere>,
}

impl WorldSpheres {
    pub fn of(scene: &PackedScene) -> Self {
        let virtual_ = match scene.swept_spheres.as_slice() {
            [] => &scene.frame.spheres[..scene.frame.sphere_count as usize],
            swept => swept,
        };
        Self {
            virtual_: (virtual_.iter())
                .map(|s| (Vec3::new(s[0], s[1], s[2]), s[3]))
                .collect(),
            real: real_sphere(scene).into_iter().collect(),
        }
    }

    /// Of each pixel of a patch, with its number in the picture.
    pub fn flags(&self, frame: &Frame, patch: &Patch) -> Vec<(usize, u32)> {
        let pose = camera_pose(frame);
        let of_all = |spheres: &[Sphere]| {
            let each = spheres.iter();
            let each = each.map(|&sphere| patch.meets_sphere(frame, &pose, sphere));
            each.fold(Certainty::Never, Certainty::or)
        };
        let (near, real) = (of_all(&self.virtual_), of_all(&self.real));
        let each = patch.pixels(frame).enumerate();
        each.map(|(at, pixel)| {
            let asked = (near == Certainty::Open
                || near == Certainty::Never && real == Certainty::Open)
                .then(|| Beam::of_pixel(frame, patch, at));
            let meets = |certainty: Certainty, spheres: &[Sphere]| match certainty {
                Certainty::Never => false,
                Certainty::Always => true,
                Certainty::Open => asked.as_ref().is_some_and(|b| b.may_meet_any(spheres)),
            };
            let flags = match meets(near, &self.virtual_) {
                true => PIXEL_BEAM_MAY_MEET_VIRTUAL,
                false if meets(real, &self.real) => 0,
                false => PIXEL_OUT_OF_REACH,
            };
            (pixel, flags)
        })
        .collect()
    }
}
