mod gpu;
mod refit;

use glam::Vec3;

use super::kernel::Kernel;
use super::*;
use crate::bench::stress::brute_force::*;
use crate::bench::stress::meshes::*;

fn kernels() -> Vec<Kernel> {
    Kernel::supported().collect()
}

/// Random rays against brute force, closest and any, on all kernels bit for bit; returns the number of hits.
fn compare(triangles: &[[Vec3; 3]], center: Vec3, scale: f32, rays: usize) -> usize {
    let first_id = 7;
    let world = WorldBvh::build(triangles, first_id).expect("builds");
    let mut random = Random(99);
    let mut hits = 0;
    for _ in 0..rays {
        let ray = random_ray(&mut random, center, scale);
        let reference = world.closest_by(Kernel::Portable, &ray);
        for kernel in kernels() {
            assert_eq!(
                world.closest_by(kernel, &ray),
                reference,
                "{kernel:?} {ray:?}"
            );
            let any = world.any_by(kernel, &ray);
            assert_eq!(any, reference.is_hit(), "{kernel:?} {ray:?}");
        }
        hits += usize::from(reference.is_hit());
        if let Err(wrong) = judge(triangles, first_id, &ray, &reference) {
            panic!("{wrong}: {ray:?}");
        }
    }
    hits
}

fn scaled(mut triangles: Vec<[Vec3; 3]>, scale: f32) -> Vec<[Vec3; 3]> {
    triangles.iter_mut().flatten().for_each(|v| *v *= scale);
    triangles
}

#[test]
fn random_triangles_match_brute_force() {
    for (size, seed) in [(0.02, 1), (0.2, 2), (2.0, 3)] {
        let hits = compare(&soup(2000, size, seed), Vec3::ZERO, 1.0, 1000);
        assert!(hits > 10, "{hits}");
    }
}

#[test]
fn slivers_match_brute_force() {
    let hits = compare(&slivers(3000, 4, 1e-3), Vec3::ZERO, 1.0, 2000);
    assert!(hits > 100, "{hits}");
}

#[test]
fn scales_from_1e_4_to_1e6_match_brute_force() {
    for scale in [1e-4, 1e-2, 1e2, 1e4, 1e6] {
        let hits = compare(&scaled(soup(1000, 0.2, 5), scale), Vec3::ZERO, scale, 500);
        assert!(hits > 100, "{hits} at {scale}");
    }
}

#[test]
fn an_outlier_a_million_times_larger_loses_nothing() {
    for scale in [1e-4, 1.0, 1e6] {
        let mut triangles = scaled(soup(1000, 0.2, 6), scale);
        let far = 1e6 * scale;
        triangles.push([
            Vec3::new(-far, -3.0 * scale, -far),
            Vec3::new(far, -3.0 * scale, -far),
            Vec3::new(0.3 * far, -3.0 * scale, far),
        ]);
        triangles.push([far, 1.01 * far, 1.02 * far].map(|x| Vec3::new(x, far, 0.5 * x * x / far)));
        let hits = compare(&triangles, Vec3::ZERO, scale, 1000);
        assert!(hits > 300, "{hits} at {scale}");
    }
}

#[test]
fn few_triangles_match_brute_force() {
    for count in 1..40 {
        compare(&soup(count, 1.0, 100 + count as u64), Vec3::ZERO, 1.0, 100);
    }
}

#[test]
fn brute_force_notices_a_lost_and_a_wrong_triangle() {
    let triangles = soup(500, 0.3, 8);
    let world = WorldBvh::build(&triangles[1..], 1).expect("builds");
    let mut random = Random(9);
    let wrong = (0..20_000)
        .filter(|_| {
            let ray = random_ray(&mut random, Vec3::ZERO, 1.0);
            judge(&triangles, 0, &ray, &world.closest(&ray)).is_err()
        })
        .count();
    assert!(wrong > 0, "triangle 0 was never missed");
    let [a, b, c] = triangles[1];
    let ray = ray((a + b + c) / 3.0 - 5.0 * Vec3::Z, Vec3::Z);
    let mut hit = world.closest(&ray);
    assert!(hit.is_hit());
    judge(&triangles, 0, &ray, &hit).expect("right as it is");
    hit.t *= 1.001;
    assert!(judge(&triangles, 0, &ray, &hit).is_err());
}

#[test]
fn nothing_is_hit_without_triangles() {
    let world = WorldBvh::build(&[], 0).expect("builds");
    for kernel in kernels() {
        let ray = ray(Vec3::ZERO, Vec3::Z);
        assert_eq!(world.closest_by(kernel, &ray), Hit::MISS);
        assert!(!world.any_by(kernel, &ray));
    }
    assert_eq!(world.bounds(), None);
    assert!(!world.gpu_nodes()[0].is_empty());
    assert!(world.gpu_leaves().concat().is_empty());
    assert!(cover(&[], 4).is_empty());
}

#[test]
fn rays_that_are_not_finite_miss() {
    let world = WorldBvh::build(&soup(100, 2.0, 10), 0).expect("builds");
    let good = ray(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
    assert!(world.any(&good));
    for bad in [f32::NAN, f32::INFINITY] {
        for axis in 0..3 {
            let mut origin = good;
            origin.origin[axis] = bad;
            let mut direction = good;
            direction.direction[axis] = bad;
            assert!(!world.any(&origin) && !world.any(&direction));
        }
    }
    let (mut no_start, mut no_end) = (good, good);
    no_start.t_min = f32::NAN;
    no_end.t_max = f32::NAN;
    let still = ray(good.origin, Vec3::ZERO);
    for bad in [no_start, no_end, still] {
        for kernel in kernels() {
            assert_eq!(world.closest_by(kernel, &bad), Hit::MISS);
        }
    }
}

#[test]
fn negative_zero_directions_hit_as_positive_ones() {
    let triangles = soup(2000, 0.3, 11);
    let world = WorldBvh::build(&triangles, 0).expect("builds");
    let mut random = Random(12);
    let mut hits = 0;
    for _ in 0..1000 {
        let origin = random.cube() + Vec3::new(0.0, 0.0, -3.0);
        for kernel in kernels() {
            let expected = world.closest_by(kernel, &ray(origin, Vec3::Z));
            let got = world.closest_by(kernel, &ray(origin, Vec3::new(-0.0, -0.0, 1.0)));
            assert_eq!(got, expected);
            hits += usize::from(got.is_hit());
        }
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn coincident_triangles_are_met_once_each_in_order_of_id() {
    let quad = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let triangles = vec![quad; 100];
    let world = WorldBvh::build(&triangles, 50).expect("builds");
    for kernel in kernels() {
        let mut ray = ray(Vec3::new(0.2, 0.3, -1.5), Vec3::Z);
        for expected in 50..150 {
            let hit = world.closest_by(kernel, &ray);
            assert_eq!((hit.triangle, hit.t), (expected, 1.5));
            ray.t_min = hit.t;
            ray.skip = hit.triangle;
        }
        assert_eq!(world.closest_by(kernel, &ray), Hit::MISS);
        assert!(!world.any_by(kernel, &ray));
    }
}

#[test]
fn the_far_end_is_excluded() {
    let world = WorldBvh::build(&[[Vec3::ZERO, Vec3::X, Vec3::Y]], 0).expect("builds");
    for kernel in kernels() {
        let mut ray = ray(Vec3::new(0.25, 0.25, -2.0), Vec3::Z);
        ray.t_max = 2.0;
        assert!(!world.any_by(kernel, &ray));
        ray.t_max = 2.0f32.next_up();
        assert!(world.any_by(kernel, &ray));
        ray.t_min = 2.0;
        assert!(!world.any_by(kernel, &ray), "skip = NONE excludes t_min");
    }
}

#[test]
fn barycentric_coordinates_rebuild_the_point() {
    let triangles = soup(500, 0.5, 13);
    let world = WorldBvh::build(&triangles, 0).expect("builds");
    let mut random = Random(14);
    let mut hits = 0;
    for _ in 0..2000 {
        let ray = random_ray(&mut random, Vec3::ZERO, 1.0);
        let hit = world.closest(&ray);
        if hit.is_hit() {
            let [a, b, c] = triangles[hit.triangle as usize];
            let point = (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
            let along = ray.origin + ray.direction * hit.t;
            let normal = (b - a).cross(c - a).normalize();
            let cosine = normal.dot(ray.direction).abs();
            assert!(point.distance(along) * cosine < 5e-6, "{point} {along}");
            hits += 1;
        }
    }
    assert!(hits > 500, "{hits}");
}

/// Rays from inside a closed mesh at points of its edges and vertices; counts misses and rays.
fn leaks(
    kernel: Kernel,
    world: &WorldBvh,
    mesh: &[[Vec3; 3]],
    rays_per_edge: usize,
) -> (usize, usize) {
    let mut random = Random(15);
    let (mut missed, mut total) = (0, 0);
    for [a, b, c] in mesh {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            for index in 0..rays_per_edge {
                let target = match index {
                    0 => *p,
                    1 => 0.5 * (*p + *q),
                    _ => p.lerp(*q, random.unit()),
                };
                let origin = if index % 3 == 0 {
                    Vec3::ZERO
                } else {
                    random.cube() * 0.5
                };
                let hit = world.any_by(kernel, &ray(origin, (target - origin).normalize()));
                missed += usize::from(!hit);
                total += 1;
            }
        }
    }
    (missed, total)
}

#[test]
fn rays_at_shared_edges_and_vertices_never_pass() {
    let mesh = sphere(60, 120, 1.0);
    let world = WorldBvh::build(&mesh, 0).expect("builds");
    let mut total = 0;
    for kernel in kernels() {
        let (missed, rays) = leaks(kernel, &world, &mesh, 12);
        assert_eq!(missed, 0, "{kernel:?} of {rays}");
        total += rays;
    }
    assert!(total > 1_000_000 || kernels().len() == 1, "{total}");
    let mut open = mesh.clone();
    open.remove(1234);
    let open = WorldBvh::build(&open, 0).expect("builds");
    assert!(leaks(Kernel::best(), &open, &mesh, 2).0 > 0);
}

/// Edges a thousand times longer than their distance from the ray.
#[test]
fn rays_along_long_thin_boxes_never_pass() {
    let (long, thin) = (1e3, 1.0);
    let mesh = cuboid(Vec3::new(long, thin, thin));
    let world = WorldBvh::build(&mesh, 0).expect("builds");
    let mut random = Random(16);
    for kernel in kernels() {
        for _ in 0..100_000 {
            let target = Vec3::new(
                (random.unit() - 0.5) * 2.0 * long,
                if random.unit() < 0.5 { -thin } else { thin },
                if random.unit() < 0.5 { -thin } else { thin },
            );
            let origin = random.cube() * Vec3::new(0.1 * long, 0.5, 0.5);
            let ray = ray(origin, (target - origin).normalize());
            assert!(world.any_by(kernel, &ray), "{kernel:?} {ray:?}");
        }
    }
}

/// 1e5 triangles on which a naive clustering makes a chain.
fn hostile() -> Vec<(&'static str, Vec<[Vec3; 3]>)> {
    let base = [
        Vec3::new(-1.0, -1.0, 0.0),
        Vec3::new(1.0, -1.0, 0.1),
        Vec3::new(0.0, 1.0, 0.2),
    ];
    let size = |i: usize| 1.0 + i as f32 * 1e-3;
    vec![
        ("identical", vec![base; 100_000]),
        (
            "concentric",
            (0..100_000).map(|i| base.map(|v| v * size(i))).collect(),
        ),
        (
            "nested in a corner",
            (0..100_000)
                .map(|i| base.map(|v| (v - base[0]) * size(i)))
                .collect(),
        ),
        (
            "nested pairs",
            (0..100_000)
                .map(|i| base.map(|v| v * size(i / 2) * if i % 2 == 0 { 1.0 } else { -1.0 }))
                .collect(),
        ),
    ]
}

#[test]
fn identical_and_nested_triangles_build() {
    for (name, triangles) in hostile() {
        let world = WorldBvh::build(&triangles, 3).expect("builds");
        let ray = ray(Vec3::new(0.05, 0.02, -3000.0), Vec3::Z);
        let hit = world.closest(&ray);
        assert!(hit.is_hit(), "{name}");
        judge(&triangles, 3, &ray, &hit).expect(name);
    }
}

#[test]
fn coordinates_out_of_range_are_refused() {
    for bad in [f32::NAN, f32::INFINITY, 2e13, -2e13] {
        let mut triangles = soup(3, 0.1, 17);
        triangles[1][2].y = bad;
        let error = WorldBvh::build(&triangles, 0).err();
        assert_eq!(error, Some(AccelError::Coordinate { triangle: 1 }));
    }
}

fn covered(triangles: &[[Vec3; 3]], spheres: &[[f32; 4]]) -> bool {
    triangles.iter().all(|triangle| {
        // A triangle lies in a ball if its corners do; one ball must hold all three.
        spheres.iter().any(|&[x, y, z, r]| {
            let center = Vec3::new(x, y, z).as_dvec3();
            let inside = |v: &Vec3| v.as_dvec3().distance(center) <= f64::from(r);
            triangle.iter().all(inside)
        })
    })
}

fn moved(triangles: &[[Vec3; 3]], by: Vec3) -> Vec<[Vec3; 3]> {
    triangles.iter().map(|t| t.map(|v| v + by)).collect()
}

fn mesh(triangles: &[[Vec3; 3]]) -> Mesh {
    let corners = 3 * triangles.len() as u32;
    Mesh {
        points: triangles.concat(),
        triangles: (0..corners).step_by(3).map(|i| [i, i + 1, i + 2]).collect(),
    }
}

fn cover(triangles: &[[Vec3; 3]], max: usize) -> Vec<[f32; 4]> {
    Cover::spheres(&[&Cover::of(&mesh(triangles), max)], max)
}

#[test]
fn spheres_cover_tightly_and_are_few() {
    let ball = sphere(30, 60, 1.0);
    let one = cover(&ball, 16);
    assert_eq!(one.len(), 1, "{one:?}");
    assert!(one[0][3] < 1.00001, "{one:?}");
    assert!(covered(&ball, &one));
    assert!(!covered(&moved(&ball, Vec3::X * 1e-3), &one));

    let mut three = ball.clone();
    three.extend(moved(&ball, Vec3::new(10.0, 0.0, 0.0)));
    three.extend(moved(&ball, Vec3::new(0.0, 20.0, 5.0)));
    let spheres = cover(&three, 16);
    assert_eq!(spheres.len(), 3, "{spheres:?}");
    assert!(spheres.iter().all(|s| s[3] < 1.00001), "{spheres:?}");
    for max in 0..5 {
        let spheres = cover(&three, max);
        assert!(spheres.len() <= max.max(1));
        assert!(covered(&three, &spheres));
    }

    for (seed, scale) in [(1, 1e-4), (2, 1.0), (3, 1e6)] {
        let mesh = scaled(slivers(2000, seed, 1e-3), scale);
        let spheres = cover(&mesh, 16);
        assert!(covered(&mesh, &spheres), "{spheres:?}");
    }
}

#[test]
fn spheres_over_two_meshes_cover_both_and_are_shared_out_by_what_they_save() {
    let rests = slivers(2000, 4, 1e-3);
    let ball = moved(&sphere(30, 60, 1.0), Vec3::X * 50.0);
    let covers = [&rests, &ball].map(|triangles| Cover::of(&mesh(triangles), 16));
    let spheres = Cover::spheres(&[&covers[0], &covers[1]], 16);
    assert!(covered(&rests, &spheres) && covered(&ball, &spheres));
    assert!(spheres.len() <= 16);
    // The ball needs but one; the rest is as it is alone with one less.
    assert_eq!(spheres[..spheres.len() - 1], cover(&rests, 15));
    assert!(!covered(&ball, &spheres[..spheres.len() - 1]), "control");
}

/// A world of two parts, and the same triangles as one.
fn parted(resting: &[[Vec3; 3]], moving: &[[Vec3; 3]]) -> [WorldBvh; 2] {
    let mut parts = WorldBvh::build(resting, 7).expect("builds");
    // What moved before leaves nothing behind.
    parts.set_moving(&soup(300, 0.5, 77)).expect("builds");
    parts.set_moving(moving).expect("builds");
    let whole = WorldBvh::build(&[resting, moving].concat(), 7).expect("builds");
    [parts, whole]
}

#[test]
fn a_moving_part_is_hit_as_if_all_were_one() {
    let (rests, moves) = (soup(2000, 0.2, 21), soup(500, 0.3, 22));
    let both = [&rests[..], &moves[..]].concat();
    // The last moves exactly where it rested: the smaller id is hit.
    for (resting, moving) in [
        (&both[..2000], &both[2000..]),
        (&both[..0], &both[..]),
        (&both[..], &both[..0]),
        (&both[..500], &both[..500]),
    ] {
        let [parts, whole] = parted(resting, moving);
        assert_eq!(parts.bounds(), whole.bounds());
        let mut random = Random(23);
        let mut hits = [0; 2];
        for _ in 0..3000 {
            let ray = random_ray(&mut random, Vec3::ZERO, 1.0);
            let expected = whole.closest(&ray);
            for kernel in kernels() {
                assert_eq!(parts.closest_by(kernel, &ray), expected, "{ray:?}");
                assert_eq!(parts.any_by(kernel, &ray), expected.is_hit(), "{ray:?}");
            }
            if expected.is_hit() {
                hits[usize::from(expected.triangle >= 7 + resting.len() as u32)] += 1;
            }
        }
        let twice = resting == moving;
        assert_eq!(hits[0] > 100, !resting.is_empty(), "{hits:?}");
        assert_eq!(hits[1] > 100, !moving.is_empty() && !twice, "{hits:?}");
    }
}

#[test]
fn what_rests_is_not_built_again() {
    let (rests, moves) = (soup(2000, 0.2, 24), soup(100, 0.3, 25));
    let [mut parts, _] = parted(&rests, &moves);
    let resting = |world: &WorldBvh| {
        (
            world.resting.wide.nodes.as_ptr(),
            world.gpu_nodes()[1].as_ptr(),
        )
    };
    let moving = |world: &WorldBvh| world.moving.as_ref().map(|tree| tree.wide.nodes.as_ptr());
    let before = (resting(&parts), moving(&parts));
    let kept = std::mem::take(&mut parts.moving);
    parts.set_moving(&moved(&moves, Vec3::X)).expect("builds");
    assert_eq!(resting(&parts), before.0);
    assert_ne!(moving(&parts), before.1, "control");
    drop(kept);
}

/// Against a tree built anew, bit for bit, with half of the triangles moved far off. Control: the tree before.
#[test]
fn a_refitted_tree_meets_what_a_new_one_meets() {
    let before = soup(2000, 0.2, 5);
    let mut after = before.clone();
    for triangle in &mut after[..1000] {
        *triangle = triangle.map(|v| Vec3::new(v.y, 0.5 * v.x, v.z + 0.7));
    }
    let new = WorldBvh::build(&after, 7).expect("builds");
    let old = WorldBvh::build(&before, 7).expect("builds");
    let mut refitted = WorldBvh::build(&before, 7).expect("builds");
    assert!(refitted.refit(&after).expect("finite"));
    let mut random = Random(3);
    let mut others = 0;
    for _ in 0..2000 {
        let ray = random_ray(&mut random, Vec3::ZERO, 1.0);
        let hit = new.closest(&ray);
        for kernel in kernels() {
            assert_eq!(refitted.closest_by(kernel, &ray), hit, "{kernel:?} {ray:?}");
            assert_eq!(
                refitted.any_by(kernel, &ray),
                hit.is_hit(),
                "{kernel:?} {ray:?}"
            );
        }
        others += usize::from(old.closest(&ray) != hit);
    }
    assert!(others > 100, "control: {others}");
    assert_eq!(refitted.bounds(), new.bounds());
    assert_eq!(
        refitted.gpu_leaves(),
        new.gpu_leaves(),
        "built anew for a device"
    );
    assert!(
        !refitted.refit(&after[1..]).expect("finite"),
        "another number"
    );
}

/// Half of the triangles go far off, and come back. Control: a little way, which leaves the tree as good as it was.
#[test]
fn a_tree_is_worn_once_its_triangles_are_far_from_where_it_was_built() {
    let before = soup(2000, 0.2, 5);
    let by = |way: f32| {
        let mut after = before.clone();
        for triangle in after.iter_mut().step_by(2) {
            *triangle = triangle.map(|v| v + way * Vec3::new(1.0, 0.5, 0.2));
        }
        after
    };
    let mut world = WorldBvh::build(&before, 7).expect("builds");
    assert!(!world.is_worn());
    for (way, worn) in [(1e-3, false), (0.5, true), (1e-3, false)] {
        assert!(world.refit(&by(way)).expect("finite"));
        assert_eq!(world.is_worn(), worn, "{way} m");
    }
}

/// The triangles below a node of the GPU's tree lie in the box that it gives them, decompressed as the shader does; how many there are.
fn held(nodes: &[[[u32; 4]; 5]], leaves: &[[f32; 4]], node: usize) -> Result<usize, String> {
    let word = |at: usize| nodes[node][at / 4][at % 4];
    let byte = |at: usize| (word(at / 4) >> (8 * (at % 4))) & 255;
    let corner = [0, 1, 2].map(|axis| f64::from(f32::from_bits(word(axis))));
    let cell = [0, 1, 2].map(|axis| (f64::from(byte(12 + axis)) - 127.0).exp2());
    let inner = byte(15);
    let mut count = 0;
    for slot in 0..8 {
        let meta = byte(24 + slot);
        let low = [0, 1, 2]
            .map(|axis| corner[axis] + cell[axis] * f64::from(byte(32 + 16 * axis + slot)));
        let high = [0, 1, 2]
            .map(|axis| corner[axis] + cell[axis] * f64::from(byte(40 + 16 * axis + slot)));
        let below: Vec<usize> = if meta == 0 {
            Vec::new()
        } else if inner >> slot & 1 == 1 {
            let child = word(4) as usize + (inner & ((1 << slot) - 1)).count_ones() as usize;
            count += held(nodes, leaves, child)?;
            triangles_below(nodes, child)
        } else {
            let first = (word(5) + (meta & 31)) as usize;
            let own: Vec<usize> = (first..first + (meta >> 5).count_ones() as usize).collect();
            count += own.len();
            own
        };
        for corner in below
            .iter()
            .flat_map(|&triangle| &leaves[3 * triangle..3 * triangle + 3])
        {
            for axis in 0..3 {
                let x = f64::from(corner[axis]);
                if x < low[axis] || x > high[axis] {
                    return Err(format!("{x} outside {} to {}", low[axis], high[axis]));
                }
            }
        }
    }
    Ok(count)
}

fn triangles_below(nodes: &[[[u32; 4]; 5]], node: usize) -> Vec<usize> {
    let word = |at: usize| nodes[node][at / 4][at % 4];
    let byte = |at: usize| (word(at / 4) >> (8 * (at % 4))) & 255;
    let inner = byte(15);
    let mut all = Vec::new();
    for slot in (0..8).filter(|&slot| byte(24 + slot) != 0) {
        let meta = byte(24 + slot);
        if inner >> slot & 1 == 1 {
            let child = word(4) as usize + (inner & ((1 << slot) - 1)).count_ones() as usize;
            all.extend(triangles_below(nodes, child));
        } else {
            let first = (word(5) + (meta & 31)) as usize;
            all.extend(first..first + (meta >> 5).count_ones() as usize);
        }
    }
    all
}

/// A device's tree that is there is refitted where it lies, beside what moves too. Control: the boxes of before.
#[test]
fn a_refitted_tree_of_a_device_holds_its_triangles() {
    let before = soup(2000, 0.2, 5);
    let after = moved(&before, Vec3::new(0.3, -0.2, 0.1));
    let moving = soup(50, 0.3, 6);
    let mut world = WorldBvh::build(&before, 7).expect("builds");
    let whole = |world: &WorldBvh| (world.gpu_nodes().concat(), world.gpu_leaves().concat());
    let (old_nodes, old_leaves) = whole(&world);
    assert_eq!(held(&old_nodes, &old_leaves, 0), Ok(2000));
    assert!(world.refit(&after).expect("finite"));
    let (nodes, leaves) = whole(&world);
    assert_eq!(held(&nodes, &leaves, 0), Ok(2000));
    assert_eq!(nodes.len(), old_nodes.len(), "refitted where it lies");
    assert!(held(&old_nodes, &leaves, 0).is_err(), "control");
    world.set_moving(&moving).expect("builds");
    assert!(world.refit(&before).expect("finite"));
    let (nodes, leaves) = whole(&world);
    assert_eq!(held(&nodes, &leaves, 0), Ok(2050));
}
