use super::*;
use crate::film::Sample;
use crate::math::{hash_u32, uniform_from_bits};

const SIDE: usize = 48;

/// A wall and a floor, chequered; the light on the floor is twice that on the wall.
fn surface(pixel: usize) -> RealSurface {
    let (x, y) = ((pixel % SIDE) as f32, (pixel / SIDE) as f32);
    let floor = pixel / SIDE >= SIDE / 2;
    let (position, normal) = if floor {
        (Vec3::new(x, -24.0, y - 24.0), Vec3::Y)
    } else {
        (Vec3::new(x, -y, 0.0), Vec3::Z)
    };
    let dark = (pixel % SIDE / 3 + pixel / SIDE / 3).is_multiple_of(2);
    RealSurface {
        position,
        depth_m: 50.0,
        normal,
        albedo: Vec3::splat(if dark { 0.2 } else { 0.8 }),
    }
}

fn truth(pixel: usize) -> f32 {
    let light = if pixel / SIDE >= SIDE / 2 { -0.2 } else { -0.1 };
    light * surface(pixel).albedo.x
}

fn film(rays: u32) -> Film {
    let mut film = Film::new(SIDE as u32, SIDE as u32, 0, false);
    for pixel in 0..SIDE * SIDE {
        for ray in 0..rays {
            let x = uniform_from_bits(hash_u32(pixel as u32 * 977 + ray));
            film.add(
                pixel,
                &Sample {
                    is_virtual: pixel == 100,
                    contribution: Vec3::splat(2.0 * x * truth(pixel)),
                    real: None,
                },
            );
        }
    }
    film
}

fn mean_squared_error(film: &Film) -> f64 {
    let error = |pixel: usize| {
        let sums = &film.pixels[pixel];
        sums.diff.value().x / f64::from(sums.n) - f64::from(truth(pixel))
    };
    let pixels = (0..SIDE * SIDE).filter(|&pixel| pixel != 100);
    pixels.map(|pixel| error(pixel).powi(2)).sum::<f64>() / (SIDE * SIDE) as f64
}

/// Against the known light. Control: guides that know neither albedo nor the edge between wall and floor.
#[test]
fn noise_goes_and_texture_and_edges_stay() {
    for rays in [1, 8] {
        let raw = film(rays);
        let surfaces: Vec<_> = (0..SIDE * SIDE).map(|p| Some(surface(p))).collect();
        let filtered = mean_squared_error(&filter_difference(&raw, &surfaces));
        let before = mean_squared_error(&raw);
        assert!(filtered < 0.1 * before, "{rays} rays: {filtered} {before}");
        let blind: Vec<_> = (0..SIDE * SIDE)
            .map(|pixel| {
                surfaces[pixel].map(|s| RealSurface {
                    albedo: Vec3::ONE,
                    normal: Vec3::Z,
                    position: Vec3::ZERO,
                    ..s
                })
            })
            .collect();
        let blind = mean_squared_error(&filter_difference(&raw, &blind));
        assert!(blind > 3.0 * filtered, "control: {blind} {filtered}");
    }
}

#[test]
fn what_is_not_a_diffuse_real_surface_stays_as_it_is() {
    let raw = film(2);
    let some = |pixel: usize| (!pixel.is_multiple_of(7)).then(|| surface(pixel));
    let filtered = filter_difference(&raw, &(0..SIDE * SIDE).map(some).collect::<Vec<_>>());
    for pixel in (0..SIDE * SIDE).step_by(7) {
        assert_eq!(raw.pixels[pixel], filtered.pixels[pixel]);
    }
    assert_eq!(raw.pixels[100], filtered.pixels[100], "virtual");
    assert_ne!(raw.pixels[101], filtered.pixels[101], "control");
}
