//! Invariant 3: where the photograph is what the proxy looks like, the composite is the mixed world's picture, edge pixels included.
//!
//! Both worlds' true pictures come from the same renderer without any of the difference's machinery: everything real is declared virtual, so
//! that every pixel is path traced over black.

use glam::Vec3;
use mixray::film::{PixelKind, Sum3, composite};
use mixray::scene::{BackendChoice, Composite, Scene, Side};

use super::support::*;

const SEEDS: u32 = 16;

/// Bright and dark boards behind a defocused ball; the focus lies in front of both, so that what the lens sees beside the ball and what
/// the ball hides of it go together.
fn boards() -> Scene {
    let mut text = format!("{CAMERA}{TABLE}{LAMP}");
    for i in 0..8 {
        let shade = if i % 2 == 0 { 0.9 } else { 0.05 };
        text += &format!(
            "[[real]]\nshape = \"quad\"\ncorner = [{}, 0, -0.6]\nedge_u = [0.25, 0, 0]\nedge_v = [0, 1.5, 0]\n\
             material = {{ base_color = [{shade}, {shade}, {shade}], specular = 0.0 }}\n",
            -1.0 + 0.25 * f64::from(i)
        );
    }
    text += r#"
[lens]
aperture_radius_m = 0.1
focus_distance_m = 1.5

[[virtual]]
shape = "sphere"
segments = 32
scale = 0.3
translation = [0.05, 0.3, 0]
material = { base_color = [0.6, 0.3, 0.2], specular = 0.0 }

[render]
rays_per_pixel = 64
max_bounces = 2
"#;
    scene(&text)
}

/// The same world with nothing real in it.
fn all_virtual(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.photo = None;
    for object in &mut scene.objects {
        object.side = Side::Virtual;
    }
    for light in &mut scene.lights {
        light.side = Side::Virtual;
    }
    scene
}

fn without_virtual(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.objects.retain(|o| o.side == Side::Real);
    scene
}

fn composites_converge_to_the_mixed_picture(backend: BackendChoice) {
    let scene = boards();
    let (mixed_world, real_world) = (all_virtual(&scene), all_virtual(&without_virtual(&scene)));
    let with_seed = |scene: &Scene, seed: u32| {
        let mut scene = scene.clone();
        scene.settings.seed = seed;
        scene
    };
    let truth = over_seeds(&mixed_world, backend, 0..SEEDS);
    let (mut additive, mut without_covariance) = (Vec::new(), Vec::new());
    let mut edges = 0;
    for seed in 100..100 + SEEDS {
        // The composite is linear in Ic: an independent unconverged photograph each time is as good as a converged one.
        let photo = render(&with_seed(&real_world, seed + 1000), backend).picture();
        let mut scene = with_seed(&scene, seed);
        scene.photo = Some(photo_of(photo.width, photo.height, photo.linear));
        let renderer = render(&scene, backend);
        additive.push(block_means(&renderer.picture()));
        let mut film = renderer.film().clone();
        edges = film.counts().edge;
        for sums in &mut film.pixels {
            (sums.m_ir, sums.r_ir, sums.n_real) = (Sum3::default(), Sum3::default(), 0);
        }
        without_covariance.push(block_means(&composite(
            &film,
            scene.photo.as_ref(),
            Composite::Additive,
        )));
    }
    assert!(edges > 100, "{edges} edge pixels");
    let difference = Difference::between(&additive, &truth);
    println!("perfect proxy, {edges} edge pixels: {difference}");
    assert!(difference.is_none(), "{difference}");
    let control = Difference::between(&without_covariance, &truth);
    println!("control without the covariance: {control}");
    assert!(!control.is_none(), "control: {control}");
}

/// The mask is the fraction of rays that meet the ball, whichever estimator asks, and every kind of pixel occurs.
fn every_kind_of_pixel_is_there(backend: BackendChoice) {
    let renderer = render(&boards(), backend);
    let film = renderer.film();
    for (i, &fraction) in mask(film).iter().enumerate() {
        let kind = match fraction {
            0.0 => PixelKind::Background,
            1.0 => PixelKind::Virtual,
            _ => PixelKind::Edge,
        };
        assert_eq!(film.kind(i), kind);
        let sums = &film.pixels[i];
        let replayed = if kind == PixelKind::Edge { sums.n } else { 0 };
        assert_eq!(sums.n_real, replayed, "pixel {i}");
        assert!(sums.m > 0 || sums.m_im.value().as_vec3() == Vec3::ZERO);
    }
    let counts = film.counts();
    assert!(
        counts.background > 0 && counts.edge > 0 && counts.virtual_ > 0,
        "{counts:?}"
    );
}

on_the_cpu!(
    composites_converge_to_the_mixed_picture,
    every_kind_of_pixel_is_there,
);
