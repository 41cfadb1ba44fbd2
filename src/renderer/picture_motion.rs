//! How the objects moved in the picture since the frame before.

use glam::{DMat4, DVec3};
use rayon::prelude::*;

use super::Renderer;
use super::core::Core;
use crate::accel::Ray;
use crate::camera::lens::camera_ray;
use crate::film::nearest;
use crate::packed::{Frame, NONE};
use crate::scene::projection::project;
use crate::scene::{Camera, Object, Side};
use crate::stages::{ObjectBlur, PictureMotion};

/// A frame beside the one that is rendered, through the same lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeighbourView {
    pub world_from_camera: DMat4,
    pub time_secs: f64,
}

impl NeighbourView {
    /// The camera there, if `now` is the camera of the frame that is rendered.
    pub(super) fn camera(&self, now: &Camera) -> Camera {
        Camera {
            world_from_camera: self.world_from_camera,
            ..now.clone()
        }
    }
}

impl Renderer {
    /// The motion of every virtual object's centre from the frame before to this one (Fischer and Bartz 2006, equation 11), and which object
    /// each pixel shows. The centre is that of the box around the object's vertices.
    pub fn picture_motion(&self, previous: &NeighbourView) -> PictureMotion {
        let before = previous.camera(&self.core.scene.camera);
        let objects = self.core.scene.objects.iter().enumerate();
        let blurs = objects
            .filter(|(_, object)| object.side == Side::Virtual)
            .filter_map(|(index, object)| {
                let (now, then) = self.centres(object, &before, previous.time_secs)?;
                let blur = now.truncate() - then.truncate();
                Some(ObjectBlur {
                    object: index as u32,
                    blur_px: blur.as_vec2().to_array(),
                    depth_m: now.z,
                })
            })
            .collect();
        PictureMotion {
            objects: self.objects_of_the_camera(),
            blurs,
        }
    }

    /// Pixel and depth of an object's centre, now and in the frame before.
    fn centres(&self, object: &Object, before: &Camera, time_secs: f64) -> Option<(DVec3, DVec3)> {
        let now = object.centre_at(self.core.time_secs)?;
        let then = object.centre_at(time_secs)?;
        Some((
            project(&self.core.scene.camera, now)?,
            project(before, then)?,
        ))
    }

    /// By pixel of the camera, of which fewer may be traced.
    fn objects_of_the_camera(&self) -> Vec<u32> {
        let Core { film, scene, .. } = &self.core;
        let camera = &scene.camera;
        let from = [film.width, film.height];
        nearest(
            &self.objects_of_pixels(),
            from,
            [camera.width, camera.height],
        )
    }

    fn objects_of_pixels(&self) -> Vec<u32> {
        let packed = &self.core.packed;
        let pinhole = pinhole(&packed.frame);
        (self.core.film.pixels.par_iter().enumerate())
            .map(|(pixel, sums)| {
                if sums.m == 0 {
                    return NONE;
                }
                let ray = central_ray(&pinhole, pixel);
                match packed.virtual_bvh.closest(&ray).triangle {
                    NONE => NONE,
                    triangle => packed.triangles[triangle as usize].object,
                }
            })
            .collect()
    }
}

/// The frame without its lens.
pub(super) fn pinhole(frame: &Frame) -> Frame {
    Frame {
        aperture_radius: 0.0,
        ..*frame
    }
}

/// Through the middle of a pixel, named by its row-major index.
pub(super) fn central_ray(pinhole: &Frame, pixel: usize) -> Ray {
    let (x, y) = (pixel as u32 % pinhole.width, pixel as u32 / pinhole.width);
    let ray = camera_ray(pinhole, x as f32 + 0.5, y as f32 + 0.5, 0.5, 0.5);
    Ray {
        origin: ray.origin,
        direction: ray.direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    }
}
