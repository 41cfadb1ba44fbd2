//! Meshes and rays that are hard on a tracer, the same on every run.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::accel::Ray;
use crate::packed::NONE;
use crate::scene::Primitive;

/// A repeatable generator: SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    /// In [-1, 1) on each axis.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - Vec3::ONE
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            let squared = v.length_squared();
            if squared > 1e-3 && squared <= 1.0 {
                return v / squared.sqrt();
            }
        }
    }
}

pub fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    }
}

/// Random triangles in the unit cube with edges of about `size`.
pub fn soup(count: usize, size: f32, seed: u64) -> Vec<[Vec3; 3]> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let corner = random.cube();
            [
                corner,
                corner + random.cube() * size,
                corner + random.cube() * size,
            ]
        })
        .collect()
}

/// Long triangles across the unit cube, about `width` wide.
pub fn slivers(count: usize, seed: u64, width: f32) -> Vec<[Vec3; 3]> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let corner = random.cube();
            [corner, random.cube(), corner + random.cube() * width]
        })
        .collect()
}

/// A closed sphere of `2 * segments * (rings - 1)` triangles whose neighbours share vertices bit for bit.
pub fn sphere(rings: usize, segments: usize, radius: f32) -> Vec<[Vec3; 3]> {
    displaced_sphere(rings, segments, |_, _| radius)
}

/// The same of radius about 1, with bumps.
pub fn bumpy_sphere(rings: usize, segments: usize) -> Vec<[Vec3; 3]> {
    displaced_sphere(rings, segments, |theta, phi| {
        let bump = (9.0 * theta).sin() * (7.0 * phi).cos()
            + 0.5 * (23.0 * theta).cos() * (19.0 * phi).sin();
        1.0 + 0.08 * bump * theta.sin()
    })
}

/// `radius`: at an angle from the pole and one around the axis.
fn displaced_sphere(
    rings: usize,
    segments: usize,
    radius: impl Fn(f32, f32) -> f32,
) -> Vec<[Vec3; 3]> {
    let point = |ring: usize, segment: usize| {
        let theta = PI * ring as f32 / rings as f32;
        let phi = TAU * (segment % segments) as f32 / segments as f32;
        if ring == 0 || ring == rings {
            let radius = radius(theta, 0.0);
            return Vec3::new(0.0, if ring == 0 { radius } else { -radius }, 0.0);
        }
        radius(theta, phi)
            * Vec3::new(
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            )
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for segment in 0..segments {
            let [a, b] = [point(ring, segment), point(ring, segment + 1)];
            let [c, d] = [point(ring + 1, segment), point(ring + 1, segment + 1)];
            if ring > 0 {
                triangles.push([a, b, d]);
            }
            if ring + 1 < rings {
                triangles.push([a, d, c]);
            }
        }
    }
    triangles
}

/// The twelve triangles of a box about the origin with these half-sizes; neighbours share vertices bit for bit.
pub fn cuboid(half: Vec3) -> Vec<[Vec3; 3]> {
    let corner = |i: u32| {
        let side = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
        half * Vec3::new(side(1), side(2), side(4))
    };
    let quads = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]].map(|t| t.map(corner)))
        .collect()
}

/// A ray about a box of half-size `scale` around `center`: along an axis, at random or towards the box; some with an interval.
pub fn random_ray(random: &mut Random, center: Vec3, scale: f32) -> Ray {
    let origin = center + random.cube() * 2.0 * scale;
    let direction = match random.bits() % 4 {
        0 => random.direction(),
        1 => {
            let axis = [Vec3::X, Vec3::Y, Vec3::Z][random.bits() as usize % 3];
            if random.unit() < 0.5 { -axis } else { axis }
        }
        _ => (center + random.cube() * scale - origin).normalize(),
    };
    let mut ray = ray(origin, direction);
    if random.bits().is_multiple_of(5) {
        ray.t_max = scale * (0.5 + 2.0 * random.unit());
        ray.t_min = 0.3 * ray.t_max;
    }
    ray
}

/// The square of half-size `half` in the plane y = 0 as a fan from one corner. Its triangles narrow towards the middles of two sides,
/// until the narrowest are `aspect` times as long as wide.
pub fn fan_of_slivers(half: f64, aspect: f64) -> Primitive {
    let mut primitive = Primitive {
        name: "slivers".into(),
        ..Primitive::default()
    };
    let mut push = |x: f64, z: f64| {
        primitive.positions.push([x as f32, 0.0, z as f32]);
        primitive.normals.push([0.0, 1.0, 0.0]);
    };
    let steps = aspect.ln() / (4.0_f64 / 3.0).ln();
    let narrowing: Vec<f64> = (1..=steps.ceil() as i32)
        .map(|k| half * 0.75_f64.powi(k))
        .collect();
    let offsets: Vec<f64> = narrowing
        .iter()
        .map(|d| -d)
        .chain([0.0])
        .chain(narrowing.iter().rev().copied())
        .collect();
    push(-half, half);
    push(half, half);
    // From (half, half) along one side to (half, -half), then along the far side.
    for d in &offsets {
        push(half, -d);
    }
    push(half, -half);
    for d in offsets.iter().rev() {
        push(*d, -half);
    }
    push(-half, -half);
    let count = primitive.positions.len() as u32;
    primitive.triangles = (1..count - 1).map(|i| [0, i, i + 1]).collect();
    primitive
}
