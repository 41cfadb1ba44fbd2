//! Invariant 10: nothing is NaN or infinite (every render of these tests asserts it), and no energy appears or is lost at extreme scales and
//! places, at grazing angles, on slivers, or where a virtual base lies in the real table's plane.

use std::sync::Arc;

use glam::DVec3;
use mixray::bench::stress::{fan_of_slivers, placed};
use mixray::scene::{BackendChoice, Environment, EnvironmentMap, Primitive, Scene};

use super::support::*;

/// A glass ball, a metal box on the table exactly, a lamp, defocus.
fn still_life() -> Scene {
    let mut scene = scene(&format!(
        r#"{CAMERA}{TABLE}{LAMP}
[environment]
radiance = [0.4, 0.5, 0.6]

[lens]
aperture_radius_m = 0.03
focus_distance_m = 2.8

[[virtual]]
shape = "sphere"
segments = 32
scale = 0.25
translation = [0.35, 0.25, 0.1]
material = {{ transmission = 1.0, roughness = 0.0 }}

[[virtual]]
shape = "box"
size = [0.4, 0.3, 0.4]
translation = [-0.3, 0.15, 0]
rotation_deg = [0, 25, 0]
material = {{ base_color = [0.9, 0.7, 0.5], metallic = 1.0, roughness = 0.4 }}
"#
    ));
    scene.settings.rays_per_pixel = 32;
    scene
}

/// Root mean square of the difference of block means, and difference of the means, both relative to the mean magnitude.
fn deviation(scene: &Scene, reference: &Scene, backend: BackendChoice) -> (f64, f64) {
    let a = block_means(&render(scene, backend).picture());
    let b = block_means(&render(reference, backend).picture());
    let scale = b.iter().map(|b| b.abs()).sum::<f64>() / b.len() as f64;
    let squares: f64 = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum();
    (
        (squares / a.len() as f64).sqrt() / scale,
        (mean(&a) - mean(&b)) / scale,
    )
}

/// The random numbers are the same: only decisions that rounding flips may differ.
fn scale_and_place_do_not_matter(backend: BackendChoice) {
    let scene = still_life();
    for (scale, offset) in [
        (1e-4, 0.0),
        (1e-2, 0.0),
        (300.0, 0.0),
        (1e6, 0.0),
        (1.0, 1e5),
        (1.0, -1e6),
        (1e-3, 1e3),
    ] {
        let moved = placed(
            &scene,
            scale,
            DVec3::new(offset, 0.7 * offset, -0.3 * offset),
        );
        let (rms, bias) = deviation(&moved, &scene, backend);
        println!("scaled by {scale:e}, moved by {offset:e} m: rms {rms:.1e}, mean {bias:+.1e}");
        assert!(rms < 0.02, "{rms}");
        assert!(bias.abs() < 2e-3, "{bias}");
    }
    let mut other = placed(&scene, 1e6, DVec3::ZERO);
    other.lens = scene.lens;
    let (rms, _) = deviation(&other, &scene, backend);
    assert!(rms > 0.03, "control: a lens that did not grow shows: {rms}");
}

/// The table as a fan whose triangles narrow from decimetres to tenths of a micrometre.
fn sliver_table() -> Primitive {
    fan_of_slivers(2.0, 3e7)
}

fn slivers_lose_nothing(backend: BackendChoice) {
    let scene = still_life();
    let with_table = |primitive: Primitive| {
        let mut scene = scene.clone();
        let primitive = Arc::new(primitive);
        for object in scene.objects.iter_mut().filter(|o| o.name == "table") {
            object.instances[0].primitive = primitive.clone();
        }
        scene
    };
    let plain = over_seeds(&scene, backend, 0..16);
    let difference = |table: Primitive| {
        Difference::between(&over_seeds(&with_table(table), backend, 100..116), &plain)
    };
    let slivers = difference(sliver_table());
    println!("table of slivers: {slivers}");
    assert!(slivers.is_none(), "{slivers}");
    let mut torn = sliver_table();
    // Those on both sides of the diagonal, which runs through the middle of the picture.
    torn.triangles.drain(119..125);
    let control = difference(torn);
    assert!(
        !control.is_none(),
        "control: a missing part shows: {control}"
    );
}

/// A white world seen from a millimetre above its table: nothing may show.
fn grazing_views_keep_the_energy(backend: BackendChoice) {
    let furnace = |albedo: f64, height_m: f64| {
        let mut scene = scene(&format!(
            r#"
[camera]
width = 24
height = 12
vertical_fov_deg = 30
position = [0, {height_m}, 1.5]
look_at = [0, {height_m}, 0]

[environment]
radiance = [1, 1, 1]

[[real]]
shape = "quad"
corner = [-2, 0, 2]
edge_u = [4, 0, 0]
edge_v = [0, 0, -4]
material = {{ base_color = [{albedo}, {albedo}, {albedo}], specular = 0.0 }}

[[virtual]]
shape = "sphere"
segments = 48
scale = 0.2
translation = [0.1, 0.2, 0]
material = {{ base_color = [{albedo}, {albedo}, {albedo}], metallic = 1.0, roughness = 0.0 }}

[render]
rays_per_pixel = 32
max_bounces = 128
"#
        ));
        scene.photo = Some(constant_photo(24, 12, 1.0));
        scene
    };
    let ones = vec![vec![1.0; 18]; 2];
    for height_m in [0.1, 1e-3, 1e-5] {
        let means = over_seeds(&furnace(1.0, height_m), backend, 0..16);
        let difference = Difference::between(&means, &ones);
        println!("grazing from {height_m} m: {difference}");
        assert!(difference.is_none(), "{difference}");
    }
    let means = over_seeds(&furnace(0.99, 1e-3), backend, 0..16);
    let control = Difference::between(&means, &ones);
    assert!(
        !control.is_none(),
        "control: 1% of absorption shows: {control}"
    );
}

/// A virtual sheet exactly in the plane of a tilted real one, up to the rounding of their vertices.
fn sheets(lift_m: f64) -> Scene {
    scene(&format!(
        r#"
[camera]
width = 48
height = 48
vertical_fov_deg = 40
position = [0.1, 2.1, 1.7]
look_at = [0, 0, 0]

[environment]
radiance = [0.5, 0.5, 0.5]

[[real]]
shape = "quad"
corner = [-2, 0, 2]
edge_u = [4, 0, 0]
edge_v = [0, 0, -4]
rotation_deg = [17, 33, 5]
material = {{ base_color = [0.5, 0.5, 0.5], specular = 0.0 }}

[[virtual]]
shape = "quad"
corner = [-0.3, {lift_m}, 0.3]
edge_u = [0.6, 0, 0]
edge_v = [0, 0, -0.6]
rotation_deg = [17, 33, 5]
material = {{ base_color = [0.7, 0.3, 0.3], specular = 0.0 }}

[render]
rays_per_pixel = 16
"#
    ))
}

fn coincident_sheets_do_not_fight(backend: BackendChoice) {
    let in_plane = mask(render(&sheets(0.0), backend).film());
    // A tenth of a millimetre above, there is no doubt which is nearer.
    let above = mask(render(&sheets(1e-4), backend).film());
    let differing = in_plane
        .iter()
        .zip(&above)
        .filter(|(a, b)| (*a - *b).abs() > 0.2)
        .count();
    let inside = above.iter().filter(|&&m| m == 1.0).count();
    let speckles = in_plane
        .iter()
        .zip(&above)
        .filter(|(a, b)| **b == 1.0 && **a < 0.9)
        .count();
    println!("coincident sheet: {inside} pixels inside, {differing} differ from the lifted one");
    assert!(inside > 100);
    assert_eq!((differing, speckles), (0, 0));
    let brightness = |lift_m: f64| block_means(&render(&sheets(lift_m), backend).picture());
    let (touching, lifted) = (brightness(0.0), brightness(1e-4));
    for (i, (a, b)) in touching.iter().zip(&lifted).enumerate() {
        assert!(
            (a - b).abs() < 0.02,
            "block {i}: {a} in the plane, {b} above it"
        );
    }
    let below = mask(render(&sheets(-1e-3), backend).film());
    assert!(
        below.iter().all(|&m| m == 0.0),
        "control: under the table it is hidden"
    );
}

/// A glass box whose base lies in the table's plane; `table` is the albedo.
fn glass_box(table: f64, lift_m: f64) -> Scene {
    scene(&format!(
        r#"
[camera]
width = 24
height = 18
vertical_fov_deg = 18
position = [0.2, 1, 2.5]
look_at = [0, 0.12, 0]

[environment]
radiance = [1, 1, 1]

[[real]]
shape = "quad"
corner = [-8, 0, 8]
edge_u = [16, 0, 0]
edge_v = [0, 0, -16]
material = {{ base_color = [{table}, {table}, {table}], specular = 0.0 }}

[[virtual]]
shape = "box"
size = [0.5, 0.3, 0.5]
translation = [0, {}, 0]
rotation_deg = [0, 37, 0]
material = {{ transmission = 1.0, roughness = 0.0 }}

[render]
rays_per_pixel = 32
max_bounces = 256
"#,
        0.15 + lift_m
    ))
}

/// Light only from below the horizon, which the table hides.
fn glass_on_a_table_leaks_no_light(backend: BackendChoice) {
    let below = Environment {
        map: EnvironmentMap::LatLong {
            width: 32,
            height: 16,
            // Dark down to 6 degrees below the horizon, so that nothing shines past the table's edge.
            texels: Arc::new(
                (0..32 * 16)
                    .map(|i| [if i < 32 * 9 { 0.0 } else { 1.0 }; 3])
                    .collect(),
            ),
        },
        rotation_deg: 0.0,
        scale: 1.0,
    };
    let brightness = |scene: &Scene| {
        let picture = render(scene, backend).picture();
        mean(&picture.linear.iter().map(|&p| grey(p)).collect::<Vec<_>>())
    };
    let mut on_table = glass_box(0.5, 0.0);
    on_table.environment = Some(below);
    let leak = brightness(&on_table);
    println!("light from under the table through the glass: {leak:.1e}");
    assert!(leak.abs() < 1e-6, "{leak}");
    let mut without_table = on_table;
    without_table.objects.retain(|o| o.name != "quad");
    let through = brightness(&without_table);
    assert!(
        through > 0.01,
        "control: without a table it shines: {through}"
    );
}

/// In a furnace a clear box on a white table is invisible, whether it touches the table, hovers or has sunk in a little.
fn glass_on_a_table_keeps_the_energy(backend: BackendChoice) {
    let ones = vec![vec![1.0; 30]; 2];
    for (table, lift_m, invisible) in [
        (1.0, 0.0, true),
        (1.0, 1e-3, true),
        (1.0, -1e-3, true),
        (0.97, 0.0, false),
    ] {
        let mut scene = glass_box(table, lift_m);
        scene.photo = Some(constant_photo(24, 18, 1.0));
        let means = over_seeds(&scene, backend, 0..16);
        let difference = Difference::between(&means, &ones);
        println!("glass box {lift_m} m above a table of albedo {table}: {difference}");
        assert_eq!(difference.is_none(), invisible, "{difference}");
    }
}

on_the_cpu!(
    scale_and_place_do_not_matter,
    slivers_lose_nothing,
    grazing_views_keep_the_energy,
    coincident_sheets_do_not_fight,
    glass_on_a_table_leaks_no_light,
    glass_on_a_table_keeps_the_energy,
);
