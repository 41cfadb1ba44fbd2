use super::*;
use crate::film::{Sample, Splat, group_add, guide_add, planes};
use crate::output::film_note::tests::note;
use crate::output::metadata::test_support::metadata;
use crate::scene::Composite;
use glam::Vec3;

fn film() -> Film {
    let mut film = Film::new(3, 2, 7, true);
    for pixel in 0..5 {
        for index in 0..40 {
            let x = ((pixel * 97 + index * 31) as f32 * 0.37).sin();
            let bad = pixel == 2 && index == 9;
            let sample = Sample {
                is_virtual: (pixel + index) % 3 == 0,
                contribution: Vec3::new(x, if bad { f32::NAN } else { x * 1e-7 }, x * 1e9),
                real: Some(Vec3::splat(x.abs())),
            };
            film.add(pixel as usize, &sample);
            if index % 4 > 0 {
                let normal = Vec3::new(x, 0.3, 0.1);
                let guide = &mut film.guides[pixel as usize];
                guide_add(guide, 1.0 + x.abs(), normal, Vec3::splat(x.abs()));
            }
        }
    }
    film.set_groups(true);
    for (i, groups) in film.groups.iter_mut().enumerate() {
        for evaluation in 0..9 {
            group_add(groups, evaluation, Vec3::new(1e9, 0.1, -1e-7) * i as f32);
        }
    }
    film.set_photons(true);
    let splats = (0..60).map(|i| Splat {
        pixel: i % 5,
        is_virtual: i % 3 == 0,
        value: Vec3::new(i as f32, 1e6, 1e-6 * i as f32),
    });
    film.add_splats((1 << 33) + 5, splats);
    film
}

fn note_of(film: &Film) -> FilmNote {
    let combine = match film.groups.is_empty() {
        true => Combine::Mean,
        false => Combine::Robust,
    };
    FilmNote { combine, ..note() }
}

fn written(film: &Film) -> (tempfile::TempDir, Target) {
    let folder = tempfile::tempdir().unwrap();
    let target = Target::picture(&folder.path().join("a.exr")).unwrap();
    let picture = crate::film::composite(film, None, Composite::Additive);
    let exr = ExrPicture::new(picture, planes(film, None), metadata());
    write_film(&target, &exr, film, &note_of(film)).unwrap();
    (folder, target)
}

#[test]
fn a_film_survives_its_file_bit_for_bit() {
    let film = film();
    let (_folder, target) = written(&film);
    let (read, read_note) = read_film(target.path()).unwrap();
    assert_eq!(read, film);
    assert_eq!(read_note, note());
    assert_eq!(film.non_finite_samples(), 1, "control: every field is used");

    let mut plain = film.clone();
    plain.guides.clear();
    plain.set_photons(false);
    plain.set_groups(false);
    let (_folder, target) = written(&plain);
    assert_eq!(read_film(target.path()).unwrap().0, plain);
}

#[test]
fn sums_that_are_not_finite_are_refused() {
    type Damage = fn(&mut Film);
    let damages: [(&str, Damage); 5] = [
        ("sums.m_im.hi.G of pixel (1, 1) is NaN", |f| {
            f.pixels[4].m_im.hi[1] = f32::NAN
        }),
        ("sums.sq.lo.B of pixel (2, 0) is inf", |f| {
            f.pixels[2].sq.lo[2] = f32::INFINITY
        }),
        ("sums.r_ir.hi.R of pixel (0, 0) is -inf", |f| {
            f.pixels[0].r_ir.hi[0] = f32::NEG_INFINITY
        }),
        ("sums.diff_3.hi.B of pixel (1, 0) is inf", |f| {
            f.groups[1].diff[3].hi[2] = f32::INFINITY
        }),
        ("sums.depth.hi.Z of pixel (0, 1) is NaN", |f| {
            f.guides[3].depth_hi = f32::NAN
        }),
    ];
    for (part, damage) in damages {
        let mut film = film();
        damage(&mut film);
        let (_folder, target) = written(&film);
        let message = read_film(target.path()).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
}
