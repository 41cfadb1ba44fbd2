//! Which family of markers a video shows, and on how many bits that rests.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::TrackError;
use super::family::{FAMILIES, Family};
use super::light::{LightImage, Luma, Tone};
use super::marker::{Seen, find_markers};

/// The family found.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    pub family: &'static Family,
    /// By which the markers seen are more than chance.
    pub bits: f64,
    /// Different ids.
    pub ids: usize,
}

/// Frames that are looked at.
const MOST_FRAMES: usize = 40;
/// Without a family named, chance would have to be this unlikely.
const LEAST_BITS: f64 = 16.0;
/// What a further sighting of an id adds at most: they are not independent.
const BITS_AGAIN: f64 = 1.0;
const MOST_BITS_AGAIN: f64 = 8.0;

/// Looks for `wanted`, or for any family.
///
/// # Errors
/// Nothing is found, or something else.
pub fn choose_family(
    frames: &[Luma],
    wanted: Option<&'static Family>,
) -> Result<Choice, TrackError> {
    let step = frames.len().div_ceil(MOST_FRAMES).max(1);
    let all: Vec<&'static Family> = FAMILIES.iter().collect();
    let looked: Vec<&Luma> = frames.iter().step_by(step).collect();
    let seen: Vec<Seen> = looked
        .par_iter()
        .map(|luma| {
            let image = LightImage::of(luma, Tone::Srgb);
            let mut seen = find_markers(&image, &all);
            // Another family's codes may hide the wanted one's.
            if let Some(family) = wanted {
                let others = seen.markers.iter().filter(|m| m.family.name != family.name);
                let others: Vec<_> = others.cloned().collect();
                seen.markers = find_markers(&image, &[family]).markers;
                seen.markers.extend(others);
            }
            seen
        })
        .collect();
    let mut choices: Vec<Choice> = all
        .iter()
        .filter_map(|family| evidence(family, &seen))
        .collect();
    choices.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    let quads: usize = seen.iter().map(|seen| seen.quads).sum();
    match wanted {
        Some(family) => (choices.iter().copied())
            .find(|choice| choice.family.name == family.name)
            .filter(|own| {
                choices
                    .iter()
                    .all(|other| other.bits < 4.0 * own.bits + LEAST_BITS)
            })
            .ok_or_else(|| wrong_family(family, choices.first(), &seen, quads)),
        None => choices
            .first()
            .copied()
            .filter(|choice| choice.bits >= LEAST_BITS)
            .ok_or_else(|| nothing(choices.first(), &seen, quads)),
    }
}

fn evidence(family: &'static Family, seen: &[Seen]) -> Option<Choice> {
    let markers = seen.iter().flat_map(|seen| &seen.markers);
    let own: Vec<_> = markers.filter(|m| m.family.name == family.name).collect();
    let ids: BTreeSet<u32> = own.iter().map(|m| m.id).collect();
    let highest = *ids.last()? as usize;
    // Dictionaries of 50, 100 and 250 are the beginnings of the large ones.
    let sizes = [50, 100, 250, family.codes.len()];
    let codes = sizes
        .into_iter()
        .find(|size| highest < *size)
        .unwrap_or(family.codes.len());
    let codes = codes.min(family.codes.len());
    let mut again: BTreeMap<u32, f64> = BTreeMap::new();
    let mut best: BTreeMap<u32, f64> = BTreeMap::new();
    for marker in own {
        let bits = family.bits(marker.wrong, codes);
        let first = best.entry(marker.id).or_insert(bits);
        *first = first.max(bits);
        *again.entry(marker.id).or_insert(-BITS_AGAIN) += BITS_AGAIN;
    }
    let first: f64 = best.values().sum();
    let more: f64 = again.values().map(|bits| bits.min(MOST_BITS_AGAIN)).sum();
    Some(Choice {
        family,
        bits: first + more,
        ids: ids.len(),
    })
}

fn mirror_hint(seen: &[Seen]) -> Option<&'static str> {
    let mirrored: usize = seen.iter().map(|seen| seen.mirrored.len()).sum();
    let straight: usize = seen.iter().map(|seen| seen.markers.len()).sum();
    (mirrored > 4 && mirrored > 2 * straight).then_some(
        "the markers are seen in a mirror; expected a camera's own picture; turn it back (ffmpeg -vf hflip)",
    )
}

fn wrong_family(
    family: &Family,
    found: Option<&Choice>,
    seen: &[Seen],
    quads: usize,
) -> TrackError {
    let other =
        found.filter(|choice| choice.family.name != family.name && choice.bits >= LEAST_BITS);
    if let Some(other) = other {
        return TrackError::input(format!(
            "no markers of {} are seen but {} of {} ({:.0} bits); expected those; give --family {}",
            family.name, other.ids, other.family.name, other.bits, other.family.name
        ));
    }
    nothing(None, seen, quads)
}

fn nothing(weak: Option<&Choice>, seen: &[Seen], quads: usize) -> TrackError {
    if let Some(hint) = mirror_hint(seen) {
        return TrackError::input(hint);
    }
    let found = match weak {
        Some(weak) => format!(
            "what looks like markers of {} is no more than chance ({:.0} bits of {LEAST_BITS})",
            weak.family.name, weak.bits
        ),
        None => format!(
            "no marker is seen in {} frames ({quads} dark squares)",
            seen.len()
        ),
    };
    TrackError::input(format!(
        "{found}; expected black squares with a white margin, 14 px a side or more; film them nearer and sharper, or name their --family"
    ))
}
