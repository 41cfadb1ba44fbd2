//! How every pixel's content moves in the picture from frame to frame, by its middle and the nearest surface there.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::core::Core;
use super::picture_motion::{central_ray, pinhole};
use super::{NeighbourView, RenderError, Renderer};
use crate::accel::Ray;
use crate::packed::{NONE, Vertex, xyz};
use crate::scene::Camera;
use crate::scene::projection::project;

/// Pixels, x to the right, y up as compositing programs have it; row-major from the top left. 0 where there is no such frame, and where the camera
/// does not see it there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionVectors {
    /// From here to where it is in the next frame.
    pub forward: Vec<[f32; 2]>,
    /// From here to where it was in the frame before.
    pub backward: Vec<[f32; 2]>,
}

impl MotionVectors {
    /// Of a picture in which nothing moves.
    pub fn none(pixels: usize) -> Self {
        Self {
            forward: vec![[0.0; 2]; pixels],
            backward: vec![[0.0; 2]; pixels],
        }
    }
}

/// What the middle of a pixel shows.
enum Shown {
    /// A triangle, and the weights of its corners.
    Surface(u32, Vec3),
    /// Nothing that is modelled lies in this direction: it is infinitely far.
    Nothing(Vec3),
}

impl Renderer {
    /// The motion of the nearest surface, virtual or real, at the picture's time and without depth of field, by camera and objects. Rolling shutters are
    /// not looked at.
    ///
    /// # Errors
    /// As [`Renderer::set_frame`](Self::set_frame).
    pub fn motion_vectors(
        &mut self,
        before: Option<&NeighbourView>,
        after: Option<&NeighbourView>,
    ) -> Result<MotionVectors, RenderError> {
        let core = &mut self.core;
        let now = moving_vertices(core, core.time_secs)?;
        let pinhole = pinhole(&core.packed.frame);
        let shown: Vec<Shown> = (0..core.film.pixels.len())
            .into_par_iter()
            .map(|pixel| shown(core, &central_ray(&pinhole, pixel)))
            .collect();
        let camera = core.scene.camera.clone();
        let mut towards = |view: Option<&NeighbourView>| {
            let Some(view) = view else {
                return Ok(MotionVectors::none(shown.len()).forward);
            };
            let then = moving_vertices(core, view.time_secs)?;
            let other = view.camera(&camera);
            let moved = |shown: &Shown| match shown {
                Shown::Surface(triangle, weights) => {
                    let point = |vertices| point_on(core, *triangle, *weights, vertices);
                    let from = project(&camera, point(&now))?;
                    Some(project(&other, point(&then))?.truncate() - from.truncate())
                }
                Shown::Nothing(direction) => between(&camera, &other, direction.as_dvec3()),
            };
            let vectors = shown.par_iter().map(|shown| {
                let [x, y] = moved(shown).unwrap_or(DVec2::ZERO).as_vec2().to_array();
                [x, 0.0 - y]
            });
            Ok::<_, RenderError>(vectors.collect())
        };
        let vectors = MotionVectors {
            forward: towards(after)?,
            backward: towards(before)?,
        };
        moving_vertices(core, core.time_secs)?;
        Ok(vectors)
    }
}

/// The vertices of what moves, where they are at a time; there they are left.
fn moving_vertices(core: &mut Core, time_secs: f64) -> Result<Vec<Vertex>, RenderError> {
    core.scene.set_time(time_secs);
    core.packed.rebuild_moving(&core.scene)?;
    Ok(core.packed.vertices[core.packed.resting.vertices..].to_vec())
}

fn shown(core: &Core, ray: &Ray) -> Shown {
    let packed = &core.packed;
    let hits = [&packed.virtual_bvh, &packed.real_bvh].map(|world| world.closest(ray));
    let nearest = match hits[0].t <= hits[1].t {
        true => hits[0],
        false => hits[1],
    };
    match nearest.triangle {
        NONE => Shown::Nothing(ray.direction),
        triangle => {
            let weights = Vec3::new(1.0 - nearest.u - nearest.v, nearest.u, nearest.v);
            Shown::Surface(triangle, weights)
        }
    }
}

/// World space, of what moves at the time that `moving` is of.
fn point_on(core: &Core, triangle: u32, weights: Vec3, moving: &[Vertex]) -> DVec3 {
    let packed = &core.packed;
    let resting = packed.resting.vertices;
    let corner = |vertex: u32| match (vertex as usize).checked_sub(resting) {
        Some(moved) => xyz(moving[moved].position_u0).as_dvec3(),
        None => xyz(packed.vertices[vertex as usize].position_u0).as_dvec3(),
    };
    let [a, b, c] = packed.triangles[triangle as usize].vertices.map(corner);
    let weights = weights.as_dvec3();
    DVec3::from(packed.anchor_m) + a * weights.x + b * weights.y + c * weights.z
}

/// By the turn of the camera alone.
fn between(camera: &Camera, other: &Camera, direction: DVec3) -> Option<DVec2> {
    let seen = |camera: &Camera| {
        let eye = camera.world_from_camera.w_axis.truncate();
        project(camera, eye + direction)
    };
    Some(seen(other)?.truncate() - seen(camera)?.truncate())
}
