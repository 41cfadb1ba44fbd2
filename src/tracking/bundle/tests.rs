use glam::DVec2;

use super::*;
use crate::math::{hash_u32, uniform_from_bits};
use crate::tracking::pose::turn;

const NOISE_PX: f64 = 0.05;

fn normal(seed: u32) -> f64 {
    let each = (0..12).map(|k| uniform_from_bits(hash_u32(12 * seed + k)));
    each.map(f64::from).sum::<f64>() - 6.0
}

/// A square of 80 mm seen once in each of 24 frames.
fn solved(seed: u32) -> Solution {
    let points = crate::tracking::board::square(DVec2::splat(-0.04), 0.08, 0);
    let exact = Lens::ideal(640, 480, 700.0);
    let views = (0..24_u32).map(|frame| {
        let way = |k: u32| normal(1000 + 8 * frame + k);
        let pose = Pose {
            rotation: turn(DVec3::new(2.2 + 0.3 * way(0), 0.5 * way(1), 0.5 * way(2))),
            translation: DVec3::new(0.05 * way(3), 0.04 * way(4), 0.35 + 0.04 * way(5)),
        };
        let observations = (0..4).map(|point| {
            let seen = pose.of(points[point]);
            let off = |axis: u32| {
                NOISE_PX * normal(5000 + 200 * seed + 8 * frame + 2 * point as u32 + axis)
            };
            Observation {
                point,
                pixel: exact.pixel_of(DVec2::new(seen.x, seen.y) / seen.z)
                    + DVec2::new(off(0), off(1)),
            }
        });
        View {
            observations: observations.collect(),
            pose,
        }
    });
    let problem = Problem {
        views: views.collect(),
        lens: exact,
        free_lens: [true, true, true, true, true, false, false, false],
        points: points.to_vec(),
        free_points: false,
        priors: &[],
        noise_px: 1.0,
    };
    problem.solve().expect("the frames determine it")
}

/// Against the noise that was put in, and the focal length. Control: what the errors alone, most of which the poses have taken, would say.
#[test]
fn the_error_of_a_lens_found_from_single_markers_is_what_is_stated() {
    const SEEDS: u32 = 32;
    let (mut squares, mut noise, mut naive) = (0.0, 0.0, 0.0);
    for seed in 0..SEEDS {
        let found = solved(seed);
        let off = found.lens.focal.x - 700.0;
        squares += off * off / found.covariance[(0, 0)] / f64::from(SEEDS);
        noise += found.noise_px / f64::from(SEEDS);
        naive += found.rms_px / 2.0_f64.sqrt() / f64::from(SEEDS);
    }
    assert!((0.4..2.0).contains(&squares), "{squares}");
    assert!((0.75..1.3).contains(&(noise / NOISE_PX)), "{noise}");
    assert!(naive < 0.6 * NOISE_PX, "control: {naive}");
}
