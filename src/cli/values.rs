//! How the values of flags are read, where several commands take the like.

use std::path::Path;

use clap::builder::{PossibleValuesParser, RangedI64ValueParser, TypedValueParser};

use super::Failure;
use crate::output::PngBits;
use crate::renderer::CameraNoise;
use crate::scene::{Choice, NoiseFit, NoiseProfile, Settings};

/// One of the names that the scene file uses too.
pub(super) fn choice<T: Choice + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let names = T::CHOICES.iter().map(|&(name, _)| name);
    PossibleValuesParser::new(names).try_map(|name| T::from_name(&name).ok_or("is not a choice"))
}

/// From `least` to what a render can count.
pub(super) fn rays_per_pixel(least: u32) -> RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(i64::from(least)..=i64::from(Settings::MAX_RAYS_PER_PIXEL))
}

pub(super) fn png_bits() -> impl TypedValueParser<Value = PngBits> {
    PossibleValuesParser::new(["8", "16"]).map(|name| match name.as_str() {
        "16" => PngBits::Sixteen,
        _ => PngBits::Eight,
    })
}

pub(super) fn above_zero(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("expected a number above 0"),
    }
}

/// In the range, ends included; the caller says what was expected.
pub(super) fn within(text: &str, least: f32, most: f32) -> Option<f32> {
    text.parse().ok().filter(|x| (least..=most).contains(x))
}

/// A share, a weight.
pub(super) fn unit(text: &str) -> Result<f32, &'static str> {
    within(text, 0.0, 1.0).ok_or("expected a number from 0 to 1")
}

/// "16..32".
pub(super) fn whole_range(text: &str) -> Result<(u32, u32), &'static str> {
    let ends = text.split_once("..");
    let parsed = ends.and_then(|(from, to)| Some((from.parse().ok()?, to.parse().ok()?)));
    match parsed {
        Some((from, to)) if from < to => Ok((from, to)),
        _ => Err("expected FROM..TO, two whole numbers, the first below the second"),
    }
}

/// "16..32", or as engines of farms write it "16-31".
pub(super) fn part(text: &str) -> Result<(u32, u32), &'static str> {
    let numbers = |(a, b): (&str, &str)| Some((a.parse::<u32>().ok()?, b.parse::<u32>().ok()?));
    let parsed = if let Some(ends) = text.split_once("..") {
        numbers(ends)
    } else if let Some(ends) = text.split_once('-') {
        numbers(ends).and_then(|(from, last)| Some((from, last.checked_add(1)?)))
    } else {
        numbers((text, text)).and_then(|(from, last)| Some((from, last.checked_add(1)?)))
    };
    match parsed {
        Some((from, to)) if from < to => Ok((from, to)),
        _ => Err("expected FROM..TO with the first below the second, FROM-LAST, or one number"),
    }
}

/// "0.01,0.2", or the name of a file.
pub(super) fn camera_noise(text: &str) -> Result<CameraNoise, Failure> {
    let parse = |part: &str| part.trim().parse::<f64>().ok();
    let numbers: Option<Vec<f64>> = text.split(',').map(parse).collect();
    match numbers.as_deref() {
        Some(&[a, b]) if a >= 0.0 && b >= 0.0 && a + b > 0.0 && (a + b).is_finite() => {
            Ok(CameraNoise {
                fit: [NoiseFit { a, b }; 3],
            })
        }
        Some(_) => Err(Failure(format!(
            "--camera-noise {text}: expected two numbers of 0 or more, not both 0, such as 0.02,0.5"
        ))),
        None => {
            let profile = NoiseProfile::read(Path::new(text))
                .map_err(|problem| Failure(format!("{text}: {problem}")))?;
            Ok(CameraNoise { fit: profile.fit })
        }
    }
}

/// Metres of "40mm", "4cm", "0.04m" or "1.5in".
pub(super) fn length(text: &str) -> Result<f64, &'static str> {
    let units = [("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254), ("m", 1.0)];
    let parsed = units.into_iter().find_map(|(unit, metres)| {
        let number = text.strip_suffix(unit)?.trim().parse::<f64>().ok()?;
        (number > 0.0 && number < 1e6).then_some(number * metres)
    });
    parsed.ok_or("expected a length with its unit, such as 40mm, 4cm, 0.04m or 1.5in")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_read_in_every_form() {
        for (text, ends) in [("16..32", (16, 32)), ("16-31", (16, 32)), ("16", (16, 17))] {
            assert_eq!(part(text), Ok(ends), "{text}");
        }
        for text in ["", "3..3", "4-3", "1,2", "4294967295", "-1", "1-3-5"] {
            assert!(part(text).is_err(), "{text}");
        }
    }
}
