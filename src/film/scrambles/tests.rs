use super::*;
use crate::film::Sample;
use crate::math::{hash_u32, uniform_from_bits};

const RAYS: u32 = 8;
const IC: f32 = 0.6;

fn photo() -> Photo {
    Photo {
        width: 1,
        height: 1,
        linear: vec![[IC; 3]],
        encoded: crate::scene::EncodedPhoto::Linear,
        tags: Default::default(),
    }
}

/// A pixel half covered by something dark before a texture that the mask is correlated with.
fn scramble(number: u32) -> Film {
    let mut film = Film::new(1, 1, 0, false);
    for ray in 0..RAYS {
        let draw = |d| uniform_from_bits(hash_u32(hash_u32(number) ^ (ray * 4 + d)));
        let ir = draw(0);
        let is_virtual = draw(1) < 0.2 + 0.6 * ir;
        let contribution = if is_virtual {
            0.1 + 0.1 * draw(2)
        } else {
            -0.2 * ir
        };
        film.add(
            0,
            &Sample {
                is_virtual,
                contribution: Vec3::splat(contribution),
                real: Some(Vec3::splat(ir)),
            },
        );
    }
    film
}

fn mean_of(first: u32, count: u32, mode: Composite) -> Scrambles {
    let mut sum = Scrambles::new(&Film::new(1, 1, 0, false), mode, false, vec![0]);
    for number in first..first + count {
        sum.add(&scramble(number));
    }
    sum
}

/// Against the spread of the composite itself over many renders of 16 scrambles each. Control: the terms' variances
/// added up as if they were independent.
#[test]
fn the_stated_variance_is_the_spread_of_the_composite() {
    let photo = photo();
    for mode in [Composite::Additive, Composite::Quotient] {
        let (mut stated, mut sum_of_parts, mut sum, mut squares) = (0.0, 0.0, 0.0, 0.0);
        const RENDERS: u32 = 3000;
        for render in 0..RENDERS {
            let mean = mean_of(render * 16, 16, mode);
            stated += mean.own_variances(Some(&photo))[0].map_or(0.0, |v| v.x) / 16.0;
            let channel = &mean.moments[0].channels[0];
            let weights = gradient(&channel.mean, mode, f64::from(IC));
            sum_of_parts += (0..TERMS)
                .map(|i| {
                    let alone = std::array::from_fn(|j| if i == j { weights[i] } else { 0.0 });
                    channel.squares(alone) / (15.0 * 16.0)
                })
                .sum::<f64>();
            let x = super::super::composite(mean.film(), Some(&photo), mode).linear[0][0];
            sum += f64::from(x);
            squares += f64::from(x).powi(2);
        }
        let n = f64::from(RENDERS);
        let spread = squares / n - (sum / n).powi(2);
        let ratio = stated / n / spread;
        assert!((ratio - 1.0).abs() < 0.1, "{mode:?}: {ratio}");
        let without_products = sum_of_parts / n / spread;
        assert!(
            (without_products - 1.0).abs() > 0.2,
            "control: {without_products}"
        );
    }
}

#[test]
fn a_cleared_pixel_begins_anew() {
    let mut sum = mean_of(0, 5, Composite::Additive);
    sum.clear_pixel(0);
    for number in 7..10 {
        sum.add(&scramble(number));
    }
    let anew = mean_of(7, 3, Composite::Additive);
    assert_eq!(sum.film(), anew.film());
    let stated = |s: &Scrambles| s.own_variances(None);
    assert_eq!(stated(&sum), stated(&anew));
    assert_eq!(sum.count(0), 3);
    assert_ne!(
        stated(&sum),
        stated(&mean_of(7, 4, Composite::Additive)),
        "control"
    );
}

#[test]
fn equal_scrambles_state_no_error() {
    let mut sum = Scrambles::new(
        &Film::new(1, 1, 0, false),
        Composite::Additive,
        false,
        vec![0],
    );
    for _ in 0..16 {
        sum.add(&scramble(3));
    }
    assert_eq!(sum.own_variances(Some(&photo())), [Some(DVec3::ZERO)]);
}
