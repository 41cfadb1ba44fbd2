use std::sync::Arc;

use super::*;
use crate::math::{hash_combine, hash_u32, uniform_from_bits};
use crate::pack::test_scene;
use crate::renderer::photo_albedo::GROUPS;
use crate::scene::{Environment, EnvironmentMap};
use crate::work::Watcher;

const SIDE: usize = 24;
const PITCH_PX: usize = 4;
/// Standard deviation of a grid point's estimate, relative.
const NOISE: f32 = 0.03;

/// An even sky.
fn scene() -> PackedScene {
    let mut scene = test_scene();
    let side = (SIDE * PITCH_PX) as u32;
    (scene.camera.width, scene.camera.height) = (side, side);
    scene.environment = Some(Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    });
    PackedScene::build(&scene, &Watcher::none()).expect("packs")
}

/// About even in -1.7..1.7, of variance 1.
fn noise(seed: u32) -> f32 {
    (2.0 * uniform_from_bits(hash_u32(seed)) - 1.0) * 3.0_f32.sqrt()
}

/// Seen from 1 m.
fn wall() -> Seen {
    Seen {
        depth_m: 1.0,
        position: Vec3::ZERO,
        normal: Vec3::Z,
        object: 0,
    }
}

/// Noisy estimates of a light that is a function of the pixel.
fn grid(seed: u32, light: impl Fn(usize, usize) -> f32) -> Grid {
    let point = |at: usize| {
        let [x, y] = [at % SIDE, at / SIDE].map(|i| i * PITCH_PX + PITCH_PX / 2);
        let groups: [f32; GROUPS] = std::array::from_fn(|group| {
            let seed = hash_combine(seed, (at * GROUPS + group) as u32);
            light(x, y) * (1.0 + NOISE * (GROUPS as f32).sqrt() * noise(seed))
        });
        let mean = groups.iter().sum::<f32>() / GROUPS as f32;
        Some(GridPoint {
            x,
            y,
            radiance: Vec3::splat(mean),
            light: Vec3::splat(mean),
            groups: groups.map(Vec3::splat),
        })
    };
    Grid {
        width: SIDE,
        height: SIDE,
        points: (0..SIDE * SIDE).map(point).collect(),
    }
}

/// By pixel of a wall.
fn on_wall(scene: &PackedScene, grid: &Grid) -> Vec<f32> {
    let seen = vec![wall(); SIDE * SIDE * PITCH_PX * PITCH_PX];
    let light = light_on_surfaces(scene, &seen, grid, PITCH_PX);
    light.iter().map(|light| light.x).collect()
}

fn found(scene: &PackedScene, seed: u32, light: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    on_wall(scene, &grid(seed, light))
}

/// Root mean square of what is found over what is right, less 1, over pixels that are not at the picture's border.
fn error(scene: &PackedScene, light: impl Fn(usize, usize) -> f32) -> f32 {
    error_of(&light, |seed| found(scene, seed, &light))
}

fn error_of(light: impl Fn(usize, usize) -> f32, found: impl Fn(u32) -> Vec<f32>) -> f32 {
    let width = SIDE * PITCH_PX;
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 0..4 {
        for (pixel, found) in found(seed).into_iter().enumerate() {
            let (x, y) = (pixel % width, pixel / width);
            if [x, y].into_iter().all(|at| (16..width - 16).contains(&at)) {
                sum += (found / light(x, y) - 1.0).powi(2);
                count += 1.0;
            }
        }
    }
    f32::sqrt(sum / count)
}

#[test]
fn even_light_loses_most_of_its_noise() {
    let scene = scene();
    let even = |_: usize, _: usize| 0.5;
    let error = error(&scene, even);
    assert!(error < 0.25 * NOISE, "{error}");
    // Control: estimates that claim to be exact are not averaged.
    let exact = |seed| {
        let mut grid = grid(seed, even);
        for point in grid.points.iter_mut().flatten() {
            point.groups = [point.light; GROUPS];
        }
        on_wall(&scene, &grid)
    };
    let kept = error_of(even, exact);
    assert!(kept > 0.5 * NOISE, "{kept}");
}

#[test]
fn the_edge_of_a_shadow_stays() {
    let scene = scene();
    // Between two columns of grid points.
    let light = |shadow: f32| move |x: usize, _: usize| if x < 48 { 0.5 } else { 0.5 * shadow };
    let width = SIDE * PITCH_PX;
    // Means of columns of pixels.
    let column = |found: &[f32], x: usize| {
        let rows = 16..width - 16;
        rows.clone().map(|y| found[y * width + x]).sum::<f32>() / rows.len() as f32
    };
    let halved = found(&scene, 1, light(0.5));
    // At the grid points on both sides.
    for (x, expected) in [(42, 0.5), (46, 0.5), (50, 0.25), (54, 0.25)] {
        let off = column(&halved, x) / expected - 1.0;
        assert!(off.abs() < 0.05, "{x}: {off}");
    }
    // Control: an edge that is less than the noise cannot be told from it, and is blurred.
    let slight = found(&scene, 1, light(0.97));
    let step = column(&slight, 46) / column(&slight, 50) - 1.0;
    assert!(step < 0.02, "{step}");
}

#[test]
fn light_that_changes_slowly_keeps_its_value() {
    let scene = scene();
    let slope = |x: usize, _: usize| 0.5 + 0.002 * x as f32;
    let error = error(&scene, slope);
    assert!(error < 0.4 * NOISE, "{error}");
}

/// What a pixel of another normal than all grid points gets is not their light, but that of its own normal.
#[test]
fn every_normal_has_its_own_light() {
    let mut scene = test_scene();
    let side = (SIDE * PITCH_PX) as u32;
    (scene.camera.width, scene.camera.height) = (side, side);
    let texel = |i: u32| [if i / 64 < 16 { 1.0 } else { 0.2 }; 3];
    scene.environment = Some(Environment {
        map: EnvironmentMap::LatLong {
            width: 64,
            height: 32,
            texels: Arc::new((0..64 * 32).map(texel).collect()),
        },
        rotation_deg: 0.0,
        scale: 1.0,
    });
    let scene = PackedScene::build(&scene, &Watcher::none()).expect("packs");
    let unoccluded = Unoccluded::of(&scene);
    let surface = |normal: Vec3| Seen { normal, ..wall() };
    let (of_points, of_others) = (Vec3::new(0.0, 0.2, 0.98), Vec3::new(0.0, -0.4, 0.917));
    let [bright, dim] = [of_points, of_others].map(|n| unoccluded.light(&scene, Vec3::ZERO, n).x);
    assert!(bright > 1.3 * dim, "{bright} {dim}");
    let mut seen = vec![surface(of_points); SIDE * SIDE * PITCH_PX * PITCH_PX];
    let odd = 40 * SIDE * PITCH_PX + 40;
    seen[odd] = surface(of_others);
    let grid = grid(1, |_, _| bright);
    let found = light_on_surfaces(&scene, &seen, &grid, PITCH_PX)[odd].x;
    assert!((found / dim - 1.0).abs() < 0.03, "{found} {dim}");
}
