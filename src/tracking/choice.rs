//! Which family of markers a video shows, and on how many bits that rests.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::TrackError;
use super::code::Code;
use super::families::FAMILIES;
use super::family::Family;
use super::light::{LightImage, Luma, Tone};
use super::marker::{Evidence, Seen, find_markers};

/// The family found, or the patterns.
#[derive(Clone, Debug)]
pub struct Choice {
    pub code: Code,
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
/// And of the first sighting's bits: a dark square that rests is the same code of a large family again and again.
const MOST_SHARE_AGAIN: f64 = 4.0;

/// Looks for `wanted`, or for a marker of any family.
///
/// # Errors
/// Nothing is found, or something else.
pub fn choose_code(frames: &[Luma], wanted: Option<&Code>) -> Result<Choice, TrackError> {
    let step = frames.len().div_ceil(MOST_FRAMES).max(1);
    let mut all: Vec<Code> = FAMILIES.iter().map(Code::Family).collect();
    let looked: Vec<&Luma> = frames.iter().step_by(step).collect();
    let seen: Vec<Seen> = looked
        .par_iter()
        .map(|luma| {
            let image = LightImage::of(luma, Tone::Srgb);
            let mut seen = find_markers(&image, &all);
            // Another family's codes may hide the wanted one's.
            if let Some(code) = wanted {
                let own = find_markers(&image, std::slice::from_ref(code));
                seen.markers.retain(|marker| marker.code != *code);
                seen.markers.extend(own.markers);
                seen.mirrored.extend(own.mirrored);
            }
            seen
        })
        .collect();
    if let Some(patterns @ Code::Patterns(_)) = wanted {
        all.push(patterns.clone());
    }
    let mut choices: Vec<Choice> = all
        .iter()
        .filter_map(|code| evidence(code, &seen))
        .collect();
    choices.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    if wanted.is_none() {
        recount(&mut choices, &looked);
    }
    let quads: usize = seen.iter().map(|seen| seen.quads).sum();
    match wanted {
        Some(code) => (choices.iter())
            .find(|choice| choice.code == *code)
            .filter(|own| {
                // Whatever is square and dark is like a pattern to some degree.
                let is_enough = matches!(code, Code::Family(_)) || own.bits >= LEAST_BITS;
                let is_most = |other: &Choice| other.bits < 4.0 * own.bits + LEAST_BITS;
                is_enough && choices.iter().all(is_most)
            })
            .cloned()
            .ok_or_else(|| wrong_code(code, choices.first(), &seen, quads)),
        None => choices
            .first()
            .cloned()
            .filter(|choice| choice.bits >= LEAST_BITS)
            .ok_or_else(|| nothing(choices.first(), None, &seen, quads)),
    }
}

/// Where one family's codes are some of another's, each takes markers from the other: they are counted by themselves.
fn recount(choices: &mut Vec<Choice>, looked: &[&Luma]) {
    let Some(Code::Family(first)) = choices.first().map(|choice| choice.code.clone()) else {
        return;
    };
    let related = |other: &&Family| {
        other.name != first.name && (first.is_part_of(other) || other.is_part_of(first))
    };
    let related: Vec<&Family> = FAMILIES.iter().filter(related).collect();
    if related.is_empty() {
        return;
    }
    for family in related.into_iter().chain([first]) {
        let code = Code::Family(family);
        let seen: Vec<Seen> = looked
            .par_iter()
            .map(|luma| {
                let image = LightImage::of(luma, Tone::Srgb);
                find_markers(&image, std::slice::from_ref(&code))
            })
            .collect();
        choices.retain(|choice| choice.code != code);
        choices.extend(evidence(&code, &seen));
    }
    choices.sort_by(|a, b| b.bits.total_cmp(&a.bits));
}

fn evidence(code: &Code, seen: &[Seen]) -> Option<Choice> {
    let markers = seen.iter().flat_map(|seen| &seen.markers);
    let own: Vec<_> = markers.filter(|m| m.code == *code).collect();
    let ids: BTreeSet<u32> = own.iter().map(|m| m.id).collect();
    let highest = *ids.last()? as usize;
    let mut again: BTreeMap<u32, f64> = BTreeMap::new();
    let mut best: BTreeMap<u32, f64> = BTreeMap::new();
    for marker in own {
        let bits = match (code, marker.evidence) {
            (Code::Family(family), Evidence::Corrected(wrong)) => {
                family.bits(wrong, dictionary(family, highest))
            }
            (Code::Patterns(_), Evidence::Bits(bits)) => bits,
            _ => unreachable!("each code has its own evidence"),
        };
        let first = best.entry(marker.id).or_insert(bits);
        *first = first.max(bits);
        *again.entry(marker.id).or_insert(-BITS_AGAIN) += BITS_AGAIN;
    }
    let first: f64 = best.values().sum();
    let more = best.iter().map(|(id, bits)| {
        let most = MOST_BITS_AGAIN.min(MOST_SHARE_AGAIN * bits.max(0.0));
        again[id].min(most)
    });
    let more: f64 = more.sum();
    Some(Choice {
        code: code.clone(),
        bits: first + more,
        ids: ids.len(),
    })
}

/// Codes of the smallest dictionary with this id: those of 50, 100 and 250 are the beginnings of the large ones.
fn dictionary(family: &Family, highest: usize) -> usize {
    let all = family.codes.len();
    let sizes = [50, 100, 250].into_iter();
    sizes
        .filter(|size| highest < *size)
        .min()
        .map_or(all, |size| size.min(all))
}

fn mirror_hint(seen: &[Seen], wanted: Option<&Code>) -> Option<&'static str> {
    let is_wanted = |name: &str| wanted.is_none_or(|code| code.name() == name);
    let mirrored = seen.iter().flat_map(|seen| &seen.mirrored);
    let mirrored = mirrored.filter(|name| is_wanted(name)).count();
    let straight = seen.iter().flat_map(|seen| &seen.markers);
    let straight = straight.filter(|m| is_wanted(m.code.name())).count();
    (mirrored > 4 && mirrored > 2 * straight).then_some(
        "the markers are seen in a mirror; expected a camera's own picture; turn it back (ffmpeg -vf hflip)",
    )
}

fn wrong_code(code: &Code, found: Option<&Choice>, seen: &[Seen], quads: usize) -> TrackError {
    let other = found.filter(|choice| choice.code != *code && choice.bits >= LEAST_BITS);
    if let Some(other) = other {
        return TrackError::input(format!(
            "no markers of {} are seen but {} of {} ({:.0} bits); expected those; give --family {}",
            code.name(),
            other.ids,
            other.code.name(),
            other.bits,
            other.code.name()
        ));
    }
    nothing(None, Some(code), seen, quads)
}

fn nothing(
    weak: Option<&Choice>,
    wanted: Option<&Code>,
    seen: &[Seen],
    quads: usize,
) -> TrackError {
    if let Some(hint) = mirror_hint(seen, wanted) {
        return TrackError::input(hint);
    }
    let found = match weak {
        Some(weak) => format!(
            "what looks like markers of {} is no more than chance ({:.0} bits of {LEAST_BITS})",
            weak.code.name(),
            weak.bits
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
