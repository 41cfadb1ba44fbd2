//! How the values of flags about markers are read, where several commands take the like.

use super::values::length;
use crate::tracking::{Family, Flatness, Readout, Tone, family_named};

/// `None`: whichever is found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen(pub Option<&'static Family>);

/// `None`: estimated, or as the board has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gamma(pub Option<Tone>);

pub(super) fn family(name: &str) -> Result<Chosen, String> {
    match name {
        "auto" => Ok(Chosen(None)),
        _ => family_named(name).map(|family| Chosen(Some(family))),
    }
}

pub(super) fn gamma(text: &str) -> Result<Gamma, &'static str> {
    match (text, text.parse::<f64>()) {
        ("auto", _) => Ok(Gamma(None)),
        ("srgb", _) => Ok(Gamma(Some(Tone::Srgb))),
        (_, Ok(power)) if (0.5..=4.0).contains(&power) => Ok(Gamma(Some(Tone::Power(power)))),
        _ => Err("expected auto, srgb, or a power from 0.5 to 4"),
    }
}

pub(super) fn flatness(text: &str) -> Result<Flatness, &'static str> {
    match text {
        "rigid" => Ok(Flatness::RIGID),
        _ => length(text)
            .map(Flatness::of_paper)
            .map_err(|_| "expected a length such as 2mm, or rigid"),
    }
}

pub(super) fn readout(text: &str) -> Result<Readout, &'static str> {
    if text == "solve" {
        return Ok(Readout::Solve);
    }
    let number = |unit: &str| text.strip_suffix(unit)?.trim().parse::<f64>().ok();
    let secs = number("ms").map(|ms| ms / 1e3).or_else(|| number("s"));
    secs.filter(|secs| secs.is_finite())
        .map(Readout::Known)
        .ok_or("expected a time with its unit such as 20ms, or solve")
}

/// Seconds, where no later frames are there to solve for it.
pub(super) fn known_readout(text: &str) -> Result<f64, &'static str> {
    match readout(text) {
        Ok(Readout::Known(secs)) => Ok(secs),
        Ok(Readout::Solve) => Err(
            "it is solved for from whole recordings; expected a time with its unit such as 20ms; find it by mixray track --readout-time solve",
        ),
        Err(_) => Err("expected a time with its unit such as 20ms"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_need_their_unit() {
        assert!((length("40mm").unwrap() - 0.04).abs() < 1e-12);
        assert!((length("1.5in").unwrap() - 0.0381).abs() < 1e-12);
        assert!((length("0.2m").unwrap() - 0.2).abs() < 1e-12);
        for wrong in ["40", "mm", "-4mm", "4 feet", "nanm"] {
            assert!(length(wrong).is_err(), "{wrong}");
        }
        assert!(flatness("rigid").unwrap().is_rigid() && !flatness("2mm").unwrap().is_rigid());
        assert_eq!(readout("20ms"), readout("0.02s"));
        assert_eq!(readout("-8.5 ms"), Ok(Readout::Known(-8.5e-3)));
        assert_eq!(readout("solve"), Ok(Readout::Solve));
        assert_eq!(known_readout("20ms"), Ok(0.02));
        assert!(known_readout("solve").is_err_and(|why| why.contains("mixray track")));
        assert!(readout("20").is_err() && readout("infms").is_err() && readout("ms").is_err());
        assert!(gamma("9").is_err() && gamma("1.4").is_ok() && family("hiro").is_err());
    }
}
