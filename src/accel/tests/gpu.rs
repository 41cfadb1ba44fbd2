//! The shader's hits against the CPU's.

use glam::Vec3;

use crate::accel::{Hit, Ray, WorldBvh};
use crate::bench::stress::backend::traced_by_shader;
use crate::bench::stress::meshes::*;
use crate::gpu::harness::test_device;
use crate::shared::NONE;

/// Hits in (real, virtual) worlds as the shader finds them; `None` without a device.
fn shader_hits(worlds: [&WorldBvh; 2], rays: &[(Ray, u32)], any_hit: bool) -> Option<Vec<Hit>> {
    Some(traced_by_shader(test_device()?, worlds, rays, any_hit).expect("runs"))
}

/// How many ids differ, and the largest relative difference of distances where they agree.
fn difference(expected: &[Hit], got: &[Hit]) -> (usize, f32) {
    let mut ids = 0;
    let mut distance = 0.0f32;
    for (a, b) in expected.iter().zip(got) {
        if a.triangle != b.triangle {
            ids += 1;
        } else if a.is_hit() {
            distance = distance.max((a.t - b.t).abs() / a.t);
        }
    }
    (ids, distance)
}

fn rays_about(scale: f32, count: usize, seed: u64) -> Vec<(Ray, u32)> {
    let mut random = Random(seed);
    (0..count)
        .map(|index| {
            let origin = random.cube() * 2.0 * scale;
            let mut direction = random.direction();
            if index % 2 == 0 {
                direction = (random.cube() * scale - origin).normalize();
            } else if index % 7 == 0 {
                direction = [Vec3::X, -Vec3::Y, Vec3::new(-0.0, -0.0, 1.0)][index % 3];
            }
            let mut ray = ray(origin, direction);
            if index % 5 == 0 {
                ray.t_max = scale * (0.5 + 2.0 * random.unit());
                ray.t_min = 0.3 * ray.t_max;
            }
            (ray, index as u32 / 3 % 2)
        })
        .collect()
}

/// Traces both worlds on both sides and demands the same hits.
fn agree(name: &str, real: &[[Vec3; 3]], added: &[[Vec3; 3]], rays: &[(Ray, u32)]) {
    let worlds = [
        WorldBvh::build(real, 0).expect("builds"),
        WorldBvh::build(added, real.len() as u32).expect("builds"),
    ];
    let Some(got) = shader_hits([&worlds[0], &worlds[1]], rays, false) else {
        return;
    };
    let on_cpu = |(ray, world): &(Ray, u32)| worlds[*world as usize].closest(ray);
    let expected: Vec<Hit> = rays.iter().map(on_cpu).collect();
    let (ids, distance) = difference(&expected, &got);
    eprintln!(
        "{name}: {ids} ids of {} differ, distances by {distance:e}",
        rays.len()
    );
    assert_eq!(ids, 0, "{name}");
    assert!(distance < 1e-6, "{name}: {distance:e}");
    let any = shader_hits([&worlds[0], &worlds[1]], rays, true).unwrap_or_default();
    for ((hit, expected), (ray, _)) in any.iter().zip(&expected).zip(rays) {
        assert_eq!(hit.is_hit(), expected.is_hit(), "{name}: {ray:?}");
    }
}

#[test]
fn the_shader_finds_the_hits_of_the_cpu() {
    for (scale, seed) in [(1e-4, 1), (1.0, 2), (1e6, 3)] {
        let fit = |mut mesh: Vec<[Vec3; 3]>| {
            mesh.iter_mut().flatten().for_each(|v| *v *= scale);
            mesh
        };
        agree(
            &format!("scale {scale:e}"),
            &fit(soup(3000, 0.2, seed)),
            &fit(sphere(20, 40, 0.5)),
            &rays_about(scale, 4000, seed),
        );
    }
}

#[test]
fn the_shader_loses_nothing_beside_an_outlier() {
    for scale in [1e-4, 1.0, 1e6] {
        let mut mesh: Vec<[Vec3; 3]> = soup(2000, 0.1, 4)
            .into_iter()
            .map(|t| t.map(|v| v * scale))
            .collect();
        let far = 1e6 * scale;
        mesh.push([
            Vec3::new(-far, -3.0 * scale, -far),
            Vec3::new(far, -3.0 * scale, -far),
            Vec3::new(0.3 * far, -3.0 * scale, far),
        ]);
        agree(
            &format!("outlier at {far:e}"),
            &mesh,
            &mesh,
            &rays_about(scale, 4000, 5),
        );
    }
}

#[test]
fn the_shader_handles_worlds_without_triangles() {
    let rays = rays_about(1.0, 64, 6);
    let mesh = soup(50, 0.5, 7);
    agree("no real world", &[], &mesh, &rays);
    agree("no virtual world", &mesh, &[], &rays);
    agree("no world", &[], &[], &rays);
    agree("one triangle", &mesh[..1], &mesh[1..2], &rays);
}

/// What moves is replaced under a tree that the shader knows, as part of a whole and alone.
#[test]
fn the_shader_hits_a_moving_part_as_if_all_were_one() {
    let (rests, moves) = (soup(2000, 0.2, 9), soup(300, 0.3, 10));
    let rays = rays_about(1.0, 4000, 11);
    let real = WorldBvh::build(&rests, 0).expect("builds");
    for resting in [&rests[..], &[]] {
        let mut parts = WorldBvh::build(resting, 2000).expect("builds");
        for moving in [&moves[..100], &[], &moves[..1], &moves[..]] {
            parts.set_moving(moving).expect("builds");
            let all = [resting, moving].concat();
            let whole = WorldBvh::build(&all, 2000).expect("builds");
            let traced = |world| shader_hits([&real, world], &rays, false);
            let (Some(got), Some(expected)) = (traced(&parts), traced(&whole)) else {
                return;
            };
            assert_eq!(got, expected);
            let moved = |hit: &&Hit| hit.is_hit() && hit.triangle >= (2000 + resting.len()) as u32;
            let moved = got.iter().filter(moved).count();
            assert!(
                (moved > 50) == (moving.len() > 50),
                "{moved} of {}",
                moving.len()
            );
        }
    }
}

#[test]
fn the_shader_refuses_rays_that_are_not_finite() {
    let world = WorldBvh::build(&soup(100, 2.0, 8), 0).expect("builds");
    let good = ray(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
    let mut rays = vec![(good, 0)];
    for bad in [f32::NAN, f32::INFINITY] {
        for axis in 0..3 {
            let mut ray = good;
            ray.origin[axis] = bad;
            rays.push((ray, 0));
            ray = good;
            ray.direction[axis] = bad;
            rays.push((ray, 0));
        }
    }
    let Some(hits) = shader_hits([&world, &world], &rays, false) else {
        return;
    };
    assert!(hits[0].is_hit());
    assert!(hits[1..].iter().all(|hit| !hit.is_hit()));
}

#[test]
fn the_shader_lets_no_ray_pass_shared_edges() {
    let mesh = sphere(30, 60, 1.0);
    let mut random = Random(9);
    let mut rays = Vec::new();
    for [a, b, c] in &mesh {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            for weight in [0.0, 0.5, random.unit(), random.unit()] {
                let origin = random.cube() * 0.5;
                let target = p.lerp(*q, weight);
                rays.push((ray(origin, (target - origin).normalize()), 0));
            }
        }
    }
    let world = WorldBvh::build(&mesh, 0).expect("builds");
    let mut open = mesh.clone();
    open.swap_remove(500);
    let open = WorldBvh::build(&open, 0).expect("builds");
    let missed = |world: &WorldBvh| -> Option<usize> {
        let hits = shader_hits([world, world], &rays, false)?;
        Some(hits.iter().filter(|hit| !hit.is_hit()).count())
    };
    let Some(leaks) = missed(&world) else { return };
    assert_eq!(leaks, 0, "of {}", rays.len());
    assert_ne!(missed(&open), Some(0));
}

#[test]
fn the_shader_continues_through_coincident_triangles() {
    let mesh = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 30];
    let world = WorldBvh::build(&mesh, 0).expect("builds");
    let rays: Vec<(Ray, u32)> = (0..30)
        .map(|skip| {
            let mut ray = ray(Vec3::new(0.2, 0.3, -1.5), Vec3::Z);
            (ray.t_min, ray.skip) = if skip == 0 {
                (0.0, NONE)
            } else {
                (1.5, skip - 1)
            };
            (ray, 0)
        })
        .collect();
    let Some(hits) = shader_hits([&world, &world], &rays, false) else {
        return;
    };
    let ids: Vec<u32> = hits.iter().map(|hit| hit.triangle).collect();
    assert_eq!(ids, (0..30).collect::<Vec<u32>>());
}

#[test]
fn a_perturbed_tree_is_noticed() {
    let mesh = soup(1000, 0.2, 10);
    let rays = rays_about(1.0, 1000, 11);
    let world = WorldBvh::build(&mesh, 0).expect("builds");
    let mut moved = mesh.clone();
    moved.iter_mut().flatten().for_each(|v| v.x += 1e-5);
    let moved = WorldBvh::build(&moved, 0).expect("builds");
    let Some(got) = shader_hits([&moved, &moved], &rays, false) else {
        return;
    };
    let expected: Vec<Hit> = rays.iter().map(|(ray, _)| world.closest(ray)).collect();
    let (ids, distance) = difference(&expected, &got);
    assert!(ids > 0 || distance > 1e-6, "{ids} {distance:e}");
}
