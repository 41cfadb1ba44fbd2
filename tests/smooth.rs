//! Smoothing of scanned meshes, against surfaces whose truth is known and on the desk of the RGB-D photograph.

use glam::{DMat3, DVec3, Vec3};
use mixray::scene::Primitive;
use mixray::scene::gltf::load_gltf;
use mixray::scene::smooth::{detect_scanner_noise, smooth};

use crate::support::{Random, shared_data};

fn proxy(name: &str) -> Option<Primitive> {
    let scene = load_gltf(&shared_data(name)?.join("proxy.glb")).unwrap();
    Some((*scene.instances[0].primitive).clone())
}

const CELL: f32 = 0.008;
const SIGMA: f32 = 0.002;
const SIDE: usize = 121;

/// A grid of `SIDE` x `SIDE` vertices: `surface` of the grid coordinates (metres from the middle), with noise along +Y.
fn grid(sigma: f32, surface: impl Fn(f32, f32) -> Vec3) -> (Primitive, Vec<Vec3>) {
    let mut noise = Random(7);
    let mut primitive = Primitive::default();
    let mut truth = Vec::new();
    let middle = (SIDE / 2) as f32;
    for row in 0..SIDE {
        for column in 0..SIDE {
            let point = surface(
                (column as f32 - middle) * CELL,
                (row as f32 - middle) * CELL,
            );
            truth.push(point);
            let bump = Vec3::Y * (sigma * noise.normal() as f32);
            primitive.positions.push((point + bump).to_array());
            primitive.normals.push([0.0, 1.0, 0.0]);
        }
    }
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let a = (row * SIDE + column) as u32;
            let [b, c, d] = [a + 1, a + SIDE as u32, a + SIDE as u32 + 1];
            primitive.triangles.push([a, c, b]);
            primitive.triangles.push([b, c, d]);
        }
    }
    (primitive, truth)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

#[test]
fn scanner_noise_is_detected_and_measured() {
    let (noisy, _) = grid(SIGMA, |x, z| Vec3::new(x, 0.2 * (3.0 * x).sin(), z));
    let found = detect_scanner_noise(&noisy).unwrap();
    // Noise along +Y on slopes of up to 31 degrees.
    assert!(
        (found.sigma_m / f64::from(SIGMA) - 1.0).abs() < 0.15,
        "{found:?}"
    );
    assert!((0.02..0.065).contains(&found.radius_m), "{found:?}");
    let (clean, _) = grid(0.0, |x, z| Vec3::new(x, 0.2 * (3.0 * x).sin(), z));
    assert_eq!(detect_scanner_noise(&clean), None, "negative control");
    // Waves of the same height, ten cells long, are a shape and not noise.
    let wave = |x: f32, z: f32| SIGMA * (0.6 * x / CELL).sin() * (0.6 * z / CELL).sin();
    let (wavy, _) = grid(0.0, |x, z| Vec3::new(x, wave(x, z), z));
    assert_eq!(detect_scanner_noise(&wavy), None);
    // Scaled by a thousand, all scales with it.
    let mut large = noisy.clone();
    large
        .positions
        .iter_mut()
        .flatten()
        .for_each(|v| *v *= 1000.0);
    let scaled = detect_scanner_noise(&large).unwrap();
    assert!((scaled.radius_m / found.radius_m - 1000.0).abs() < 1.0);
}

#[test]
fn depth_camera_meshes_are_detected_and_models_are_not() {
    for (name, sigma) in [
        ("tum_desk_rgbd", 0.0005..0.004),
        ("kinect_basket_rgbd", 0.0005..0.004),
    ] {
        let Some(primitive) = proxy(name) else { return };
        let found = detect_scanner_noise(&primitive).unwrap();
        eprintln!("{name}: {found:?}");
        assert!(sigma.contains(&found.sigma_m) && (0.015..0.06).contains(&found.radius_m));
    }
    let Some(models) = shared_data("gltf_models") else {
        return;
    };
    let mut looked_at = 0;
    for entry in std::fs::read_dir(models).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "glb") {
            continue;
        }
        for instance in load_gltf(&path).unwrap().instances {
            assert_eq!(
                detect_scanner_noise(&instance.primitive),
                None,
                "{}, {}",
                path.display(),
                instance.primitive.name
            );
            looked_at += 1;
        }
    }
    assert!(looked_at > 50);
}

/// Best plane by least squares of the heights: a point and a unit normal towards +Y.
fn fitted_plane(points: &[DVec3]) -> (DVec3, DVec3) {
    let count = points.len() as f64;
    let mean = points.iter().sum::<DVec3>() / count;
    let mut matrix = DMat3::ZERO;
    let mut right = DVec3::ZERO;
    for point in points {
        let d = *point - mean;
        let row = DVec3::new(d.x, d.z, 1.0);
        matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        right += row * d.y;
    }
    let slopes = matrix.inverse() * right;
    (mean, DVec3::new(-slopes.x, 1.0, -slopes.y).normalize())
}

/// Roughness of the bare part of the desk in front of the keyboard: rms distance to its plane in metres, median tilt of vertex
/// and face normals against it in degrees.
fn desk_roughness(primitive: &Primitive, chosen: &[bool]) -> [f64; 3] {
    let vector = |v: &[f32; 3]| Vec3::from(*v).as_dvec3();
    let points: Vec<DVec3> = primitive
        .positions
        .iter()
        .zip(chosen)
        .filter(|(_, chosen)| **chosen)
        .map(|(point, _)| vector(point))
        .collect();
    let (mean, normal) = fitted_plane(&points);
    let tilt = |n: DVec3| n.normalize().angle_between(normal).to_degrees();
    let vertices = primitive
        .normals
        .iter()
        .zip(chosen)
        .filter(|(_, chosen)| **chosen)
        .map(|(n, _)| tilt(vector(n)));
    let faces = primitive
        .triangles
        .iter()
        .filter(|t| t.iter().all(|&v| chosen[v as usize]))
        .map(|t| {
            let [a, b, c] = t.map(|v| vector(&primitive.positions[v as usize]));
            tilt((b - a).cross(c - a))
        });
    [
        rms(points.iter().map(|point| (*point - mean).dot(normal))),
        median(vertices.collect()),
        median(faces.collect()),
    ]
}

#[test]
fn the_real_desk_becomes_smooth_and_its_rims_stay() {
    let Some(before) = proxy("tum_desk_rgbd") else {
        return;
    };
    let bare = |p: &[f32; 3]| {
        (-0.30..0.18).contains(&p[0]) && (0.03..0.17).contains(&p[2]) && p[1].abs() < 0.02
    };
    let chosen: Vec<bool> = before.positions.iter().map(bare).collect();
    assert!(chosen.iter().filter(|chosen| **chosen).count() > 1500);
    let mut after = before.clone();
    let radius_m = detect_scanner_noise(&before).unwrap().radius_m;
    let start = std::time::Instant::now();
    smooth(&mut after, radius_m);
    eprintln!(
        "{} triangles in {:?}",
        before.triangles.len(),
        start.elapsed()
    );
    let [rough, smoothed] = [&before, &after].map(|p| desk_roughness(p, &chosen));
    eprintln!("rms m, vertex and face tilt in degrees: {rough:?} before, {smoothed:?} after");
    // What is left of the rms is the camera's own warp of the desk, wider than any neighbourhood.
    assert!(smoothed[0] < 0.7 * rough[0]);
    assert!(smoothed[1] < 1.5 && smoothed[1] < rough[1] / 5.0);
    assert!(smoothed[2] < 2.5 && smoothed[2] < rough[2] / 5.0);
    // Nothing moves far, the cut edges of monitor and mug least of all sideways.
    let moved = |p: usize| Vec3::from(after.positions[p]).distance(before.positions[p].into());
    let near: Vec<f64> = (0..before.positions.len())
        .filter(|&p| before.positions[p][2] > -0.6)
        .map(|p| f64::from(moved(p)))
        .collect();
    assert!(median(near) < 0.003);
    assert!(after.triangles.len() >= before.triangles.len() - 2);
}

/// Two half planes that meet along x = 0 at `degrees` to each other, and the outward normal on either side.
fn crease(degrees: f32) -> (impl Fn(f32, f32) -> Vec3, [DVec3; 2]) {
    let (sin, cos) = (degrees / 2.0).to_radians().sin_cos();
    let normal = |side: f32| Vec3::new(side * sin, cos, 0.0).as_dvec3();
    let surface = move |x: f32, z: f32| Vec3::new(cos * x, -sin * x.abs(), z);
    (surface, [normal(-1.0), normal(1.0)])
}

/// rms distance to the true plane at each number of cells from the crease (rows near the rim left out).
fn crease_errors(primitive: &Primitive, truth: &[Vec3], normals: [DVec3; 2]) -> Vec<f64> {
    let middle = SIDE / 2;
    (0..middle - 8)
        .map(|cells| {
            let columns = [middle - cells, middle + cells];
            let deviations = (10..SIDE - 10).flat_map(|row| {
                [0, 1].map(|side| {
                    let vertex = row * SIDE + columns[side];
                    let point = Vec3::from(primitive.positions[vertex]) - truth[vertex];
                    point.as_dvec3().dot(normals[side])
                })
            });
            rms(deviations)
        })
        .collect()
}

#[test]
fn a_noisy_crease_stays_within_a_cell() {
    for degrees in [90.0, 60.0, 40.0] {
        let (surface, normals) = crease(degrees);
        let (before, truth) = grid(SIGMA, surface);
        let mut after = before.clone();
        smooth(&mut after, 0.04);
        let rough = crease_errors(&before, &truth, normals);
        let errors = crease_errors(&after, &truth, normals);
        eprintln!(
            "{degrees} degrees: {:?} mm",
            errors.iter().map(|e| e * 1e3).take(8).collect::<Vec<_>>()
        );
        // Away from the crease the noise falls more than fourfold; next to it nothing is worse than half a cell.
        let flat = 8..errors.len();
        let ratio = rms(rough[flat.clone()].iter().copied()) / rms(errors[flat].iter().copied());
        assert!(ratio > 4.0, "{degrees} degrees: noise falls {ratio} times");
        assert!(
            errors[0] < 0.5 * f64::from(CELL),
            "{degrees} degrees: {errors:?}"
        );
        assert!(
            errors[2..8].iter().all(|e| *e < 0.5 * f64::from(SIGMA)),
            "{degrees}: {errors:?}"
        );

        // Negative control: the mean over the same neighbourhood rounds the crease off.
        let mut mean = before.clone();
        for (vertex, position) in mean.positions.iter_mut().enumerate() {
            let centre = Vec3::from(before.positions[vertex]);
            let (row, column) = (vertex / SIDE, vertex % SIDE);
            let near = (row.saturating_sub(5)..(row + 6).min(SIDE)).flat_map(|r| {
                (column.saturating_sub(5)..(column + 6).min(SIDE)).map(move |c| r * SIDE + c)
            });
            let near: Vec<Vec3> = near
                .map(|v| Vec3::from(before.positions[v]))
                .filter(|p| p.distance(centre) < 0.04)
                .collect();
            *position = (near.iter().sum::<Vec3>() / near.len() as f32).to_array();
        }
        let rounded = crease_errors(&mean, &truth, normals);
        assert!(rounded[0] > 0.5 * f64::from(CELL), "{degrees}: {rounded:?}");
    }
}

#[test]
fn a_step_keeps_its_levels_and_the_rim_its_place() {
    let (before, truth) = grid(SIGMA, |x, z| {
        Vec3::new(x, if x > 0.0 { 0.05 } else { 0.0 }, z)
    });
    let mut after = before.clone();
    smooth(&mut after, 0.04);
    let middle = SIDE / 2;
    let off = |vertex: usize| f64::from(after.positions[vertex][1] - truth[vertex].y);
    let inner = (0..SIDE * SIDE).filter(|v| {
        let (row, column) = (v / SIDE, v % SIDE);
        (8..SIDE - 8).contains(&row) && (8..SIDE - 8).contains(&column)
    });
    let beside = inner.clone().filter(|v| (v % SIDE).abs_diff(middle) < 4);
    assert!(rms(beside.map(off)) < 0.6 * f64::from(SIGMA));
    assert!(rms(inner.map(off)) < 0.35 * f64::from(SIGMA));
    // The rim neither shrinks nor frays.
    for (vertex, place) in truth.iter().enumerate() {
        let (row, column) = (vertex / SIDE, vertex % SIDE);
        if row % (SIDE - 1) == 0 || column % (SIDE - 1) == 0 {
            let moved = Vec3::from(after.positions[vertex]) - place;
            assert!(moved.x.hypot(moved.z) < 0.002, "{moved}");
        }
    }
}

/// Surfaces that only pass near each other do not pull each other.
#[test]
fn sheets_apart_keep_their_distance() {
    let (mut both, _) = grid(SIGMA, |x, z| Vec3::new(x, 0.0, z));
    let (other, _) = grid(0.0, |x, z| Vec3::new(x, 0.01, z));
    let first = both.positions.len() as u32;
    both.positions.extend(&other.positions);
    both.normals.extend(&other.normals);
    both.triangles
        .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    smooth(&mut both, 0.04);
    let mean = |range: std::ops::Range<usize>| {
        let heights = both.positions[range.clone()]
            .iter()
            .map(|p| f64::from(p[1]));
        heights.sum::<f64>() / range.len() as f64
    };
    let count = first as usize;
    assert!(mean(0..count).abs() < 1e-4);
    assert!((mean(count..2 * count) - 0.01).abs() < 1e-6);
}

#[test]
fn a_noisy_mug_keeps_its_radius() {
    let radius = 0.045;
    let (before, _) = grid(0.0, |x, z| {
        let angle = x / radius * 0.25;
        Vec3::new(radius * angle.sin(), radius * angle.cos(), z * 0.25)
    });
    let mut noise = Random(3);
    let mut after = before.clone();
    for position in &mut after.positions {
        let [x, y, _] = *position;
        let scale = 1.0 + 0.0005 * noise.normal() as f32 / x.hypot(y);
        position[0] *= scale;
        position[1] *= scale;
    }
    smooth(&mut after, 0.012);
    let inner = (0..SIDE * SIDE)
        .filter(|v| (10..SIDE - 10).contains(&(v / SIDE)) && (10..SIDE - 10).contains(&(v % SIDE)));
    let errors = inner.map(|v| {
        let [x, y, _] = after.positions[v];
        f64::from(x.hypot(y) - radius)
    });
    let (sum, count) = errors
        .clone()
        .fold((0.0, 0.0), |(s, n), e| (s + e, n + 1.0));
    assert!((sum / count).abs() < 0.0004, "mean {} m", sum / count);
    assert!(rms(errors) < 0.0005);
}

#[test]
fn the_result_does_not_depend_on_how_vertices_are_shared() {
    let (shared, _) = grid(SIGMA, |x, z| Vec3::new(x, 0.0, z));
    let mut apart = Primitive::default();
    for triangle in &shared.triangles {
        let first = apart.positions.len() as u32;
        for &vertex in triangle {
            apart.positions.push(shared.positions[vertex as usize]);
            apart.normals.push([0.0, 1.0, 0.0]);
        }
        apart.triangles.push([first, first + 1, first + 2]);
    }
    let mut untouched = shared.clone();
    smooth(&mut untouched, 0.0);
    assert_eq!(untouched.positions, shared.positions, "radius 0 is off");
    let mut joined = shared.clone();
    smooth(&mut joined, 0.03);
    smooth(&mut apart, 0.03);
    assert_eq!(detect_scanner_noise(&apart), None, "nothing left to smooth");
    for (triangle, parts) in joined.triangles.iter().zip(&apart.triangles) {
        for (a, b) in triangle.iter().zip(parts) {
            let a = Vec3::from(joined.positions[*a as usize]);
            assert!(a.distance(apart.positions[*b as usize].into()) < 1e-5);
        }
    }
}

/// Sizes at which squares leave f32, lone triangles, slivers: nothing becomes NaN.
#[test]
fn odd_meshes_stay_finite() {
    for scale in [1e-30f32, 1e-5, 1e6, 1e25] {
        let (mut primitive, _) = grid(SIGMA, |x, z| Vec3::new(x, 0.0, z));
        primitive.triangles.truncate(3000);
        primitive
            .positions
            .iter_mut()
            .flatten()
            .for_each(|v| *v *= scale);
        smooth(&mut primitive, 0.03 * f64::from(scale));
        assert!(primitive.positions.iter().flatten().all(|v| v.is_finite()));
        let unit = |n: &[f32; 3]| (Vec3::from(*n).length() - 1.0).abs() < 1e-4;
        assert!(primitive.normals.iter().all(unit), "scale {scale}");
    }
    let mut lone = Primitive {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 1e-7, 0.0], [5.0; 3]],
        normals: vec![[0.0, 0.0, 1.0]; 4],
        triangles: vec![[0, 1, 2]],
        ..Primitive::default()
    };
    smooth(&mut lone, 10.0);
    assert!(lone.positions.iter().flatten().all(|v| v.is_finite()));
    assert_eq!(lone.positions[3], [5.0; 3]);
}
