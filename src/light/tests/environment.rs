//! The environment against its own definition in f64.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::{Random, lit_by, map_environment, pearson};
use crate::light::environment::{env_evaluate, env_radiance, env_sample};
use crate::packed::NONE;
use crate::scene::{Environment, EnvironmentMap};

/// A lat-long map read in f64, with none of the code under test.
struct Map {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

impl Map {
    fn new(width: usize, height: usize, texel: impl Fn(usize, usize) -> [f32; 3]) -> Self {
        let texels = (0..width * height)
            .map(|i| texel(i % width, i / width))
            .collect();
        Self {
            width,
            height,
            texels,
        }
    }

    fn environment(&self) -> Environment {
        map_environment(self.width as u32, self.height as u32, self.texels.clone())
    }

    fn texel(&self, i: i64, j: i64) -> DVec3 {
        let i = i.rem_euclid(self.width as i64) as usize;
        let j = j.clamp(0, self.height as i64 - 1) as usize;
        Vec3::from(self.texels[j * self.width + i]).as_dvec3()
    }

    fn between(&self, u: f64, j: i64, fy: f64) -> DVec3 {
        let s = u * self.width as f64 - 0.5;
        let (i, fx) = (s.floor() as i64, s - s.floor());
        let row = |j: i64| self.texel(i, j).lerp(self.texel(i + 1, j), fx);
        row(j).lerp(row(j + 1), fy)
    }

    fn radiance(&self, u: f64, v: f64) -> DVec3 {
        let t = v * self.height as f64 - 0.5;
        self.between(u, t.floor() as i64, t - t.floor())
    }

    /// Not normalised: luminance, bilinear in azimuth and cosine.
    fn density(&self, u: f64, v: f64) -> f64 {
        let h = self.height as f64;
        let j = (v * h - 0.5).floor();
        let cos = |edge: f64| ((edge / h).clamp(0.0, 1.0) * PI).cos();
        let (top, bottom) = (cos(j + 0.5), cos(j + 1.5));
        let fy = (top - (v * PI).cos()) / (top - bottom);
        self.between(u, j as i64, fy)
            .dot(DVec3::new(0.2126, 0.7152, 0.0722))
    }

    /// Midpoint rule over the sphere, so fine that a texel holds at least 8 x 8 points.
    fn integrate<T: std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>>(
        &self,
        zero: T,
        f: impl Fn(f64, f64) -> T,
    ) -> T {
        let (columns, rows) = (8 * self.width.max(16), 8 * self.height.max(64));
        let mut sum = zero;
        for row in 0..rows {
            let v = (row as f64 + 0.5) / rows as f64;
            let strip = ((row as f64 / rows as f64 * PI).cos()
                - ((row + 1) as f64 / rows as f64 * PI).cos())
                * TAU
                / columns as f64;
            for column in 0..columns {
                sum = sum + f((column as f64 + 0.5) / columns as f64, v) * strip;
            }
        }
        sum
    }
}

/// Map coordinates of a direction at rotation 0, in f64.
fn coordinates(d: Vec3) -> (f64, f64) {
    let d = d.as_dvec3();
    let u = 0.5 + d.x.atan2(-d.z) / TAU;
    (u.rem_euclid(1.0), d.x.hypot(d.z).atan2(d.y) / PI)
}

fn noise(seed: u32) -> impl Fn(usize, usize) -> [f32; 3] {
    move |i, j| {
        let mut random = Random::new(seed + 1000 * j as u32 + i as u32);
        random.uniforms::<3>().map(|x| x * x * x)
    }
}

/// Name, map: what is known to break such code.
fn maps() -> Vec<(&'static str, Map)> {
    let dark = [0.01, 0.02, 0.03];
    let spot = |x: usize, y: usize, level: f32| {
        move |i: usize, j: usize| if (i, j) == (x, y) { [level; 3] } else { dark }
    };
    vec![
        ("noise", Map::new(13, 7, noise(1))),
        ("sun of one pixel", Map::new(32, 16, spot(20, 5, 5e4))),
        ("sun on the seam", Map::new(16, 8, spot(15, 3, 1e3))),
        ("sun at the zenith", Map::new(16, 8, spot(3, 0, 1e3))),
        ("sun at the nadir", Map::new(16, 8, spot(3, 7, 1e3))),
        (
            "light in the dark",
            Map::new(16, 8, |i, j| {
                if (i, j) == (4, 4) {
                    [1.0, 0.0, 0.0]
                } else {
                    [0.0; 3]
                }
            }),
        ),
        ("one texel", Map::new(1, 1, |_, _| [0.5, 1.0, 2.0])),
        (
            "two texels",
            Map::new(2, 1, |i, _| [1.0 + 9.0 * i as f32; 3]),
        ),
        (
            "one column",
            Map::new(1, 4, |_, j| [1.0 + 3.0 * j as f32; 3]),
        ),
    ]
}

#[test]
fn the_map_lies_as_the_design_says() {
    // Column 0 of 4 is red, its centre at u = 1/8.
    let colours = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
    let texels: Vec<[f32; 3]> = (0..12)
        .map(|k| {
            if k / 4 == 1 {
                colours[k % 4]
            } else {
                [k as f32 / 4.0; 3]
            }
        })
        .collect();
    let at = |rotation_deg: f64, direction: Vec3| {
        let environment = Environment {
            rotation_deg,
            scale: 2.0,
            ..map_environment(4, 3, texels.clone())
        };
        env_radiance(&lit_by(Some(environment), &[]), direction)
    };
    let forward_right = Vec3::new(1.0, 0.0, -1.0).normalize();
    // u = 0.5 + 1/8 is the centre of column 2: blue, at scale 2.
    assert!((at(0.0, forward_right) - Vec3::new(0.0, 0.0, 2.0)).length() < 1e-5);
    // Turned by 90 degrees the centre looks along -X, and what was right of -Z is right of -X: towards -Z.
    let left_forward = Vec3::new(-1.0, 0.0, -1.0).normalize();
    assert!((at(90.0, left_forward) - Vec3::new(0.0, 0.0, 2.0)).length() < 1e-5);
    assert!((at(90.0, forward_right) - Vec3::new(0.0, 0.0, 2.0)).length() > 1.0);
    // Row 0 is the zenith.
    let up = at(0.0, Vec3::Y).length();
    let down = at(0.0, Vec3::NEG_Y).length();
    assert!(up < down, "{up} {down}");
}

#[test]
fn radiance_and_density_are_the_f64_ones() {
    for (name, map) in maps() {
        let scene = lit_by(Some(map.environment()), &[]);
        let whole = map.integrate(0.0, |u, v| map.density(u, v));
        let brightest = map.texels.iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
        let mut random = Random::new(7);
        let mut control = 0;
        for k in 0..20_000 {
            // A share of the directions is near a pole.
            let mut d = random.direction();
            if k % 4 == 0 {
                d = (d * 0.02 + Vec3::Y * if k % 8 == 0 { 1.0 } else { -1.0 }).normalize();
            }
            let (u, v) = coordinates(d);
            let near = |found: f64, want: f64, whole: f64| {
                (found - want).abs() <= 2e-4 * want.abs() + 3e-5 * whole
            };
            let (radiance, want) = (env_radiance(&scene, d).as_dvec3(), map.radiance(u, v));
            for c in 0..3 {
                let level = f64::from(brightest);
                assert!(
                    near(radiance[c], want[c], level),
                    "{name} {d}: {radiance} {want}"
                );
            }
            let found = f64::from(env_evaluate(&scene, d).0);
            let want = map.density(u, v) / whole;
            let level = f64::from(brightest) / whole;
            assert!(near(found, want, level), "{name} {d}: {found} {want}");
            // Negative control: a map shifted by a tenth of a column is told apart.
            let shifted = map.density(u + 0.1 / map.width as f64, v) / whole;
            control += usize::from(!near(found, shifted, level));
        }
        assert!(control > 50 || map.width == 1, "{name}: {control}");
    }
}

#[test]
fn samples_follow_the_density() {
    for (name, map) in maps() {
        let scene = lit_by(Some(map.environment()), &[]);
        let whole = map.integrate(0.0, |u, v| map.density(u, v));
        // Quarters of cells: halves of texels on either side of each centre, both ways.
        let (columns, rows) = (2 * map.width, 2 * map.height);
        let mut expected = vec![0.0; columns * rows];
        const SIDE: usize = 12;
        for (cell, mass) in expected.iter_mut().enumerate() {
            for k in 0..SIDE * SIDE {
                let at = |x: usize, k: usize| x as f64 + (k as f64 + 0.5) / SIDE as f64;
                let u = at(cell % columns, k % SIDE) / columns as f64;
                let v = at(cell / columns, k / SIDE) / rows as f64;
                *mass += map.density(u, v) * (v * PI).sin();
            }
            *mass *= TAU * PI / (columns * rows * SIDE * SIDE) as f64 / whole;
        }
        let samples = 200_000;
        let mut counts = vec![0.0; columns * rows];
        let mut random = Random::new(11);
        for _ in 0..samples {
            let [a, b] = random.uniforms();
            let s = env_sample(&scene, a, b);
            assert!(s.pdf > 0.0 && s.direction.is_finite() && s.radiance.is_finite());
            assert!((s.direction.length() - 1.0).abs() < 1e-6);
            assert_eq!(s.pdf, env_evaluate(&scene, s.direction).0, "{name}");
            assert_eq!(s.radiance, env_radiance(&scene, s.direction), "{name}");
            let (u, v) = coordinates(s.direction);
            let column = ((u * columns as f64) as usize).min(columns - 1);
            let row = ((v * rows as f64) as usize).min(rows - 1);
            counts[row * columns + column] += 1.0;
        }
        let scaled = |skew: f64| -> Vec<f64> {
            expected
                .iter()
                .enumerate()
                .map(|(i, m)| {
                    m * samples as f64 * (1.0 + skew * if i % 2 == 0 { 1.0 } else { -1.0 })
                })
                .collect()
        };
        let (statistic, limit) = pearson(&counts, &scaled(0.0));
        assert!(statistic < limit, "{name}: {statistic} {limit}");
        // Negative control: columns that are a twentieth too bright and too dark in turn.
        let (statistic, limit) = pearson(&counts, &scaled(0.05));
        assert!(statistic > limit, "{name}: {statistic} {limit}");
    }
}

#[test]
fn the_integral_over_the_sphere_is_the_maps_own() {
    for (name, map) in maps() {
        let scene = lit_by(Some(map.environment()), &[]);
        let want = map.integrate(DVec3::ZERO, |u, v| map.radiance(u, v));
        // A lattice: far less noise than random numbers.
        let n = 1 << 16;
        let mut sum = DVec3::ZERO;
        for k in 0..n {
            let a = (k as f64 + 0.5) / n as f64;
            let b = (k as f64 * 0.618_033_988_749_895).fract();
            let s = env_sample(&scene, a as f32, b as f32);
            // At the rim of a black region the density may round to 0.
            if s.pdf > 0.0 {
                sum += s.radiance.as_dvec3() / f64::from(s.pdf);
            }
        }
        let found = sum / n as f64;
        let off = (found - want).abs().max_element() / want.max_element();
        assert!(off < 3e-3, "{name}: {found} {want}");
        // Negative control.
        assert!((found * 1.01 - want).abs().max_element() / want.max_element() > 3e-3);
    }
}

#[test]
fn a_black_map_is_no_light() {
    let map = Map::new(4, 2, |_, _| [0.0; 3]);
    let scene = lit_by(Some(map.environment()), &[]);
    assert_eq!((scene.frame.env_light, scene.frame.light_count), (NONE, 0));
    assert_eq!(env_radiance(&scene, Vec3::X), Vec3::ZERO);
    let s = env_sample(&scene, 0.3, 0.6);
    assert!(s.pdf == 0.0 && s.direction.is_finite());
    let grey = Map::new(4, 2, |_, _| [0.1; 3]);
    assert_eq!(lit_by(Some(grey.environment()), &[]).frame.env_light, 0);
}

#[test]
fn a_constant_environment_is_drawn_uniformly() {
    let environment = Environment {
        map: EnvironmentMap::Constant([1.0, 2.0, 3.0]),
        rotation_deg: 30.0,
        scale: 2.0,
    };
    let scene = lit_by(Some(environment), &[]);
    let mut random = Random::new(3);
    let mut mean = DVec3::ZERO;
    let mut squares = DVec3::ZERO;
    let n = 100_000;
    for _ in 0..n {
        let [a, b] = random.uniforms();
        let s = env_sample(&scene, a, b);
        assert_eq!(s.radiance, Vec3::new(2.0, 4.0, 6.0));
        assert!((f64::from(s.pdf) * 4.0 * PI - 1.0).abs() < 1e-6);
        mean += s.direction.as_dvec3() / f64::from(n);
        squares += s.direction.as_dvec3().powf(2.0) / f64::from(n);
    }
    assert!(mean.abs().max_element() < 0.012, "{mean}");
    assert!(
        (squares - 1.0 / 3.0).abs().max_element() < 0.006,
        "{squares}"
    );
}
