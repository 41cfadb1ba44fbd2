//! Scenes in which one thing grows.
//!
//! A desk, a wall, a panel of light above, a small aperture; on the desk a virtual ball, or a grid of balls before the wall. All matt and two interactions
//! deep. A black backplate stands for the photograph: its content costs nothing.

use glam::DVec3;

use super::Law;
use crate::bench::scenes::{camera, matt, object, place, scene};
use crate::scene::shape::{quad, sphere};
use crate::scene::{Light, LightKind, Primitive, Scene, Side};

/// Of the picture, unless it is what grows.
const SIZE: [u32; 2] = [320, 256];
const RAYS_PER_PIXEL: u32 = 4;
/// Triangles of the ball, or of all balls together.
const BALL_TRIANGLES: u32 = 1 << 16;
/// Of the square that a grid of balls fills.
const GRID_SIDE_M: f64 = 0.72;
/// Of a ball's diameter in the side of its cell.
const FILL: f64 = 0.84;

/// A scene at one amount of work.
pub(super) struct Step {
    /// In the law's unit, as it came out.
    pub work: u64,
    pub rays_per_pixel: u32,
    pub scene: Scene,
}

/// The scenes of a law, ascending. `shrink` divides the width and height of their pictures.
pub(super) fn steps(law: Law, shrink: u32) -> Vec<Step> {
    let step = |parts: Parts, rays_per_pixel: u32, work: u64| Step {
        work,
        rays_per_pixel,
        scene: parts.scene(shrink),
    };
    match law {
        Law::Build => Vec::new(),
        Law::Triangles => triangle_counts()
            .map(|count| {
                let cells = (f64::from(count) / 4.0).sqrt().round() as u32;
                let parts = Parts {
                    desk_cells: cells,
                    ball_triangles: count / 2,
                    ..Parts::default()
                };
                let scene = parts.scene(shrink);
                Step {
                    work: triangles(&scene),
                    rays_per_pixel: RAYS_PER_PIXEL,
                    scene,
                }
            })
            .collect(),
        Law::Pixels => (0..5)
            .map(|doublings| {
                let parts = Parts {
                    size: [80 << doublings, 64 << doublings],
                    ..Parts::default()
                };
                let [width, height] = parts.size.map(|side| u64::from(side / shrink));
                step(parts, RAYS_PER_PIXEL, width * height)
            })
            .collect(),
        Law::RaysPerPixel => [1, 4, 16, 64, 256]
            .map(|rays| {
                let parts = Parts {
                    size: [160, 128],
                    ..Parts::default()
                };
                step(parts, rays, u64::from(rays))
            })
            .into(),
        Law::Objects => [1, 2, 4, 8, 16]
            .map(|side| {
                let parts = Parts {
                    balls_a_side: Some(side),
                    ..Parts::default()
                };
                step(parts, RAYS_PER_PIXEL, u64::from(side * side))
            })
            .into(),
        Law::Lights => [1, 2, 4, 8, 16]
            .map(|side| {
                let parts = Parts {
                    lights_a_side: side,
                    ..Parts::default()
                };
                step(parts, RAYS_PER_PIXEL, u64::from(side * side))
            })
            .into(),
    }
}

/// How many scenes a law has.
pub(super) fn sizes(law: Law) -> u64 {
    match law {
        Law::Build => 0,
        Law::Triangles => triangle_counts().count() as u64,
        Law::Pixels | Law::RaysPerPixel | Law::Objects | Law::Lights => 5,
    }
}

/// 1e3 to 1e6, two a decade.
pub(super) fn triangle_counts() -> impl Iterator<Item = u32> {
    (0..=6).map(|half_decades| 10f64.powf(3.0 + 0.5 * f64::from(half_decades)).round() as u32)
}

/// A ball of about as many triangles, unit radius.
pub(super) fn ball(triangles: u32) -> Primitive {
    // Of s segments there are s (s - 2).
    let segments = 1.0 + (1.0 + f64::from(triangles)).sqrt();
    sphere(2 * (0.5 * segments).round().max(2.0) as u32)
}

/// What a scene is made of.
struct Parts {
    size: [u32; 2],
    /// Squares along each side of the desk.
    desk_cells: u32,
    ball_triangles: u32,
    /// Of the grid before the wall; `None`: one ball on the desk.
    balls_a_side: Option<u32>,
    lights_a_side: u32,
}

impl Default for Parts {
    fn default() -> Self {
        Self {
            size: SIZE,
            desk_cells: 1,
            ball_triangles: BALL_TRIANGLES,
            balls_a_side: None,
            lights_a_side: 1,
        }
    }
}

impl Parts {
    fn scene(&self, shrink: u32) -> Scene {
        let pixels = self.size.map(|side| (side / shrink).max(1));
        let position = DVec3::new(0.0, 0.6, 2.2);
        let target = DVec3::new(0.0, 0.4, 0.0);
        let view = camera(
            pixels,
            1.6 * f64::from(pixels[1]),
            position,
            target,
            DVec3::Y,
        );
        let desk = grid(
            DVec3::new(-1.5, 0.0, 1.2),
            DVec3::new(3.0, 0.0, 0.0),
            DVec3::new(0.0, 0.0, -2.0),
            self.desk_cells,
        );
        let wall = quad(
            DVec3::new(-1.5, 0.0, -0.8),
            DVec3::new(3.0, 0.0, 0.0),
            DVec3::new(0.0, 1.8, 0.0),
        );
        let still = place(DVec3::ZERO, 0.0);
        let mut objects = vec![
            object(Side::Real, "desk", desk, matt([0.60, 0.55, 0.48]), still),
            object(Side::Real, "wall", wall, matt([0.65, 0.66, 0.68]), still),
        ];
        let red = matt([0.70, 0.25, 0.18]);
        match self.balls_a_side {
            None => {
                let mut one = object(Side::Virtual, "ball", ball(self.ball_triangles), red, still);
                one.world_from_object = at(DVec3::new(0.0, 0.301, 0.0), 0.3);
                objects.push(one);
            }
            Some(side) => {
                let cell = GRID_SIDE_M / f64::from(side);
                let one = ball(self.ball_triangles / (side * side));
                let model = object(Side::Virtual, "ball", one, red, still);
                let centre = |i: u32| cell * (f64::from(i) + 0.5) - 0.5 * GRID_SIDE_M;
                for (row, column) in (0..side).flat_map(|r| (0..side).map(move |c| (r, c))) {
                    let mut ball = model.clone();
                    let middle = DVec3::new(centre(column), 0.45 + centre(row), 0.0);
                    ball.world_from_object = at(middle, 0.5 * FILL * cell);
                    objects.push(ball);
                }
            }
        }
        let mut scene = scene(view, RAYS_PER_PIXEL, objects);
        "growth".clone_into(&mut scene.name);
        scene.lights = panel(self.lights_a_side);
        scene.lens.aperture_radius_m = 0.004;
        scene.lens.focus_distance_m = 2.2;
        scene.settings.max_bounces = 2;
        scene
    }
}

fn at(middle: DVec3, radius: f64) -> glam::DMat4 {
    place(middle, 0.0) * glam::DMat4::from_scale(DVec3::splat(radius))
}

/// Of all objects.
fn triangles(scene: &Scene) -> u64 {
    let instances = scene.objects.iter().flat_map(|o| &o.instances);
    instances.map(|i| i.primitive.triangles.len() as u64).sum()
}

/// A parallelogram of `cells` x `cells` equal ones with shared vertices.
fn grid(corner: DVec3, edge_u: DVec3, edge_v: DVec3, cells: u32) -> Primitive {
    let normal = edge_u.cross(edge_v).normalize().as_vec3().to_array();
    let share = |i: u32| f64::from(i) / f64::from(cells);
    let mut primitive = Primitive {
        name: "grid".to_owned(),
        ..Primitive::default()
    };
    for (v, u) in (0..=cells).flat_map(|v| (0..=cells).map(move |u| (v, u))) {
        let point = corner + edge_u * share(u) + edge_v * share(v);
        primitive.positions.push(point.as_vec3().to_array());
        primitive.normals.push(normal);
    }
    for (v, u) in (0..cells).flat_map(|v| (0..cells).map(move |u| (v, u))) {
        let a = v * (cells + 1) + u;
        let [b, c, d] = [a + 1, a + cells + 2, a + cells + 1];
        primitive.triangles.extend([[a, b, c], [a, c, d]]);
    }
    primitive
}

/// The panel of light, cut into `side` x `side` lights; it shines down.
fn panel(side: u32) -> Vec<Light> {
    let edge = 0.6 / f64::from(side);
    let tiles = (0..side).flat_map(|v| (0..side).map(move |u| (u, v)));
    tiles
        .map(|(u, v)| Light {
            kind: LightKind::Quad {
                corner: [-0.5 + edge * f64::from(u), 1.6, edge * f64::from(v)],
                edge_u: [edge, 0.0, 0.0],
                edge_v: [0.0, 0.0, edge],
                radiance: [10.0, 9.6, 9.0],
            },
            side: Side::Real,
        })
        .collect()
}

#[cfg(test)]
mod tests;
