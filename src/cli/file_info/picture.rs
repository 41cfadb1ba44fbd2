//! Photographs, environments and films of `render --range`.

use std::f64::consts::{PI, TAU};
use std::io::Cursor;
use std::path::Path;

use exif::{In, Tag};
use glam::Vec3;
use image::metadata::Orientation;

use super::Report;
use crate::cli::Failure;
use crate::decode::{ImageFile, MAX_PICTURE_BYTES, Pixels, jpegs_of_film, read_file, read_image};
use crate::math::luminance;
use crate::output::read_film;
use crate::scene::Choice;

/// Tags that say with what and how a photograph was taken.
const TAGS: [(&str, Tag); 7] = [
    ("camera", Tag::Model),
    ("lens", Tag::LensModel),
    ("focal length", Tag::FocalLength),
    ("on 35 mm", Tag::FocalLengthIn35mmFilm),
    ("aperture", Tag::FNumber),
    ("exposure", Tag::ExposureTime),
    ("sensitivity", Tag::PhotographicSensitivity),
];

/// What is this many times as bright as its map in the mean, and up, is its sun or a lamp.
const SUN: f64 = 20.0;

pub(super) fn describe(path: &Path, name: &str, report: &mut Report) -> Result<(), Failure> {
    if name.contains("OpenEXR")
        && let Ok((film, note)) = read_film(path)
    {
        report.line("file", "a film of `mixray render --range`");
        report.line("size", format!("{} x {} pixels", film.width, film.height));
        let (first, end) = note.range;
        report.line(
            "rays",
            format!(
                "{first} to {} of {} a pixel, seed {}",
                end - 1,
                note.total,
                note.seed
            ),
        );
        report.line("estimator", note.estimator.name());
        return Ok(());
    }
    let image =
        read_image(path).map_err(|problem| Failure(format!("{}: {problem}", path.display())))?;
    let size = format!("{} x {} pixels", image.width, image.height);
    if name.contains("JPEG") {
        let bytes = read_file(path, MAX_PICTURE_BYTES).map_err(Failure)?;
        if let Some(film) = jpegs_of_film(&bytes) {
            report.line("file", "a film of JPEG pictures");
            report.line("size", size);
            report.line("frames", film.len());
            report.line("use", "frames of `mixray sequence` and `mixray track`");
            return Ok(());
        }
    }
    report.line("file", name);
    report.line("size", size);
    match &image.pixels {
        Pixels::Codes8(_) | Pixels::Codes16(_) => of_codes(path, &image, report)?,
        Pixels::Linear(pixels) => of_light(&image, pixels, report),
    }
    report.notes(&image.warnings);
    Ok(())
}

fn of_codes(path: &Path, image: &ImageFile, report: &mut Report) -> Result<(), Failure> {
    let bits = if matches!(image.pixels, Pixels::Codes8(_)) {
        8
    } else {
        16
    };
    report.line("bits", format!("{bits} a channel"));
    report.line(
        "colours",
        match &image.tags.profile {
            Some(_) => "of its own profile, which is converted and kept",
            None => "sRGB",
        },
    );
    if image.tags.orientation != Orientation::NoTransforms {
        report.line(
            "orientation",
            format!(
                "to be turned (EXIF {}): [photo] orientation = \"apply\" turns it",
                image.tags.orientation.to_exif()
            ),
        );
    }
    let bytes = read_file(path, MAX_PICTURE_BYTES).map_err(Failure)?;
    // Without tags, or with broken ones, a photograph is as good as any.
    if let Ok(tags) = exif::Reader::new().read_from_container(&mut Cursor::new(bytes)) {
        for (what, tag) in TAGS {
            if let Some(field) = tags.get_field(tag, In::PRIMARY) {
                report.line(what, field.display_value().with_unit(&tags));
            }
        }
    }
    Ok(())
}

/// Linear light: of a lat-long map the sun too.
fn of_light(image: &ImageFile, pixels: &[[f32; 3]], report: &mut Report) {
    let light = |pixel: &[f32; 3]| luminance(Vec3::from(*pixel));
    let brightest = pixels
        .iter()
        .enumerate()
        .max_by(|a, b| light(a.1).total_cmp(&light(b.1)));
    let Some((place, brightest)) = brightest else {
        return;
    };
    let sum: f64 = pixels.iter().map(|pixel| f64::from(light(pixel))).sum();
    let mean = sum / pixels.len() as f64;
    let dark = pixels
        .iter()
        .map(light)
        .filter(|l| *l > 0.0)
        .fold(f32::INFINITY, f32::min);
    let peak = light(brightest);
    if peak <= 0.0 {
        report.line("range", "linear, black all over");
        return;
    }
    let stops = f64::from(peak / dark).log2();
    report.line(
        "range",
        format!("linear, luminance {dark:.4} to {peak:.4}, {stops:.1} stops; mean {mean:.4}"),
    );
    let (width, height) = (image.width as usize, image.height as usize);
    if width != 2 * height {
        return;
    }
    let across = ((place % width) as f64 + 0.5) / width as f64;
    let down = ((place / width) as f64 + 0.5) / height as f64;
    // At rotation 0 the centre column looks along -Z, +X to its right.
    let (azimuth, elevation) = ((across - 0.5) * TAU, (0.5 - down) * PI);
    let flat = elevation.cos();
    let towards = [flat * azimuth.sin(), elevation.sin(), -flat * azimuth.cos()];
    let times = f64::from(peak) / mean;
    let what = match times >= SUN && elevation > 0.0 {
        true => "sun",
        false => "brightest",
    };
    report.line(what, format!(
        "{:.0} times the mean, {:.1} degrees high, {:.1} right of the centre: towards [{:.3}, {:.3}, {:.3}] at rotation_deg = 0",
        times, elevation.to_degrees(), azimuth.to_degrees(), towards[0], towards[1], towards[2]
    ));
}
