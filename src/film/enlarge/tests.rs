use super::*;
use crate::film::{Sample, Splat, composite};
use crate::scene::Photo;

const COARSE: [u32; 2] = [6, 4];
const WHOLE: [u32; 2] = [17, 12];

fn photo() -> Photo {
    let codes = (0..WHOLE[0] * WHOLE[1]).map(|i| [i as u8, (3 * i) as u8, (7 * i) as u8]);
    Photo::from_srgb8(WHOLE[0], WHOLE[1], codes.collect())
}

/// Nothing on the left, a shadow of a tenth in the middle, virtual light on the right; two samples a pixel but on the left, where none or an idle one was taken.
fn film() -> Film {
    let mut film = Film::new(COARSE[0], COARSE[1], 0, false);
    for pixel in 0..24 {
        let column = pixel % COARSE[0] as usize;
        let contribution = [0.0, 0.0, -0.1, -0.1, 0.5, 0.5][column];
        for _ in 0..[0, 1, 2, 2, 2, 2][column] {
            film.add(
                pixel,
                &Sample {
                    is_virtual: column > 3,
                    contribution: Vec3::splat(contribution),
                    real: None,
                },
            );
        }
    }
    film
}

/// Nothing of what a film held is left, photons and groups neither. Control: they were there.
#[test]
fn a_film_that_is_used_again_is_a_new_one() {
    let mut whole = Film::new(WHOLE[0], WHOLE[1], 0, false);
    whole.set_photons(true);
    whole.set_groups(true);
    whole.set_sample_factors((0..WHOLE[0] * WHOLE[1]).map(|_| 2));
    let sample = Sample {
        is_virtual: false,
        contribution: Vec3::ONE,
        real: None,
    };
    (0..whole.pixels.len()).for_each(|pixel| whole.add(pixel, &sample));
    let splat = Splat {
        pixel: 3,
        is_virtual: false,
        value: Vec3::ONE,
    };
    whole.add_splats(4, [splat].into_iter());
    let new = enlarged(&film(), WHOLE[0], WHOLE[1], Composite::Additive);
    assert!(whole != new && whole.photons() == 4, "control");
    enlarge(&film(), Composite::Additive, &mut whole);
    assert!(whole == new);
}

/// Value less the photograph, of the sixth row.
fn change_of_a_row() -> Vec<f32> {
    let photo = photo();
    let whole = enlarged(&film(), WHOLE[0], WHOLE[1], Composite::Additive);
    let picture = composite(&whole, Some(&photo), Composite::Additive);
    let first = 5 * WHOLE[0] as usize;
    (first..first + WHOLE[0] as usize)
        .map(|pixel| picture.linear[pixel][1] - photo.linear[pixel][1])
        .collect()
}

#[test]
fn what_nothing_changed_is_the_photograph_bit_for_bit() {
    let photo = photo();
    let whole = enlarged(&film(), WHOLE[0], WHOLE[1], Composite::Additive);
    let picture = composite(&whole, Some(&photo), Composite::Additive);
    for (pixel, (value, ic)) in picture.linear.iter().zip(&photo.linear).enumerate() {
        let column = pixel as u32 % WHOLE[0];
        // The third coarse column, which begins at 5.67, takes part from the second's beginning on, at 2.83.
        assert_eq!(value == ic, column < 3, "{pixel}");
    }
}

#[test]
fn change_is_interpolated_and_virtual_light_hides_the_photograph() {
    let row = change_of_a_row();
    // In the middle of the shadow, half way into it, and within the object.
    assert!(
        (row[8] + 0.1).abs() < 1e-6 && (row[5] + 0.044).abs() < 1e-3,
        "{row:?}"
    );
    let photo = photo();
    let value = row[15] + photo.linear[5 * WHOLE[0] as usize + 15][1];
    assert!((value - 0.5).abs() < 1e-6, "{value}");
}

/// The covariance of a border between virtual and real is in it, and the variance is no smaller for the many samples that are said to be there.
#[test]
fn borders_and_variance_are_those_of_the_coarse_film() {
    let mut film = Film::new(1, 1, 0, false);
    for (is_virtual, value, real) in [(true, 0.6, 0.3), (false, -0.1, 0.2), (false, -0.2, 0.4)] {
        film.add(
            0,
            &Sample {
                is_virtual,
                contribution: Vec3::splat(value),
                real: None,
            },
        );
        film.add_real(0, is_virtual, Vec3::splat(real));
    }
    let photo = Photo::from_srgb8(1, 1, vec![[90; 3]]);
    let both = [film.clone(), enlarged(&film, 1, 1, Composite::Additive)];
    let pictures = both
        .each_ref()
        .map(|film| composite(film, Some(&photo), Composite::Additive).linear[0][0]);
    assert!((pictures[0] - pictures[1]).abs() < 2e-4, "{pictures:?}");
    let variances = both.map(|film| variance_pixel(&film.sums(0), [0.0; 3]).x);
    assert!(
        (variances[0] / variances[1] - 1.0).abs() < 1e-3,
        "{variances:?}"
    );
    assert!(variances[0] > 0.01, "control: {variances:?}");
}

#[test]
fn quotients_are_kept() {
    let mut film = Film::new(2, 2, 0, false);
    for pixel in 0..4 {
        film.add(
            pixel,
            &Sample {
                is_virtual: false,
                contribution: Vec3::splat(-0.1),
                real: None,
            },
        );
        film.add_real(pixel, false, Vec3::splat(0.4));
    }
    let photo = Photo::from_srgb8(4, 4, vec![[120; 3]; 16]);
    let whole = enlarged(&film, 4, 4, Composite::Quotient);
    let picture = composite(&whole, Some(&photo), Composite::Quotient);
    let ratio = picture.linear[5][0] / photo.linear[5][0];
    assert!((ratio - 0.75).abs() < 1e-6, "{ratio}");
}

#[test]
fn the_nearest_values_are_taken() {
    let whole = nearest(&[1, 2, 3, 4], [2, 2], [5, 3]);
    assert_eq!(whole, [1, 1, 1, 2, 2, 1, 1, 1, 2, 2, 3, 3, 3, 4, 4]);
}
