//! Markers of one frame: quadrilaterals whose cells spell a code.

use glam::DVec2;

use super::cells::Patch;
use super::code::Code;
use super::edge::{Sides, refine};
use super::family::{Family, Match};
use super::frame_pose::Observation;
use super::light::LightImage;
use super::patterns::{Likeness, Patterns};
use super::quad::{Quad, find_quads, shortest_side};

/// A marker as it was seen.
#[derive(Clone, Debug)]
pub struct Marker {
    pub code: Code,
    pub id: u32,
    pub evidence: Evidence,
    /// From the marker's own top left, clockwise; pixels, corner origin.
    pub corners: Quad,
    /// The same sides as points, the first along the marker's top.
    pub sides: Sides,
}

/// How surely a marker is the one that it is taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Evidence {
    /// Cells of its code that were put right.
    Corrected(u32),
    /// Bits by which its pattern is more than chance, and than any other.
    Bits(f64),
}

/// Which marker a quadrilateral is.
struct Read {
    code: Code,
    id: u32,
    /// Quarter turns, clockwise in the picture, from the marker upright to how it was seen.
    turn: usize,
    evidence: Evidence,
}

/// What one frame holds.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub markers: Vec<Marker>,
    /// Of a ChArUco board: its squares' corners, numbered as its points.
    pub between: Vec<Observation>,
    /// Quadrilaterals that would be markers in a mirror, by the name of their code.
    pub mirrored: Vec<&'static str>,
    /// Dark quadrilaterals, markers or not.
    pub quads: usize,
}

/// How far cells are from the middle on average, of 0.5, where the code rests on few bits.
const LEAST_CLARITY: f32 = 0.3;
/// Of a family whose markers in a mirror are told from chance.
const LEAST_MIRROR_BITS: f64 = 1.5;
/// Families of fewer bits a marker need clear cells.
const FEW_BITS: f64 = 12.0;

/// All markers of these codes, each id once.
pub fn find_markers(image: &LightImage, codes: &[Code]) -> Seen {
    let (ringed, dark): (Vec<Code>, Vec<Code>) = codes.iter().cloned().partition(Code::is_ringed);
    let mut seen = Seen::default();
    if !dark.is_empty() {
        add_markers(&mut seen, image, &dark);
    }
    if !ringed.is_empty() {
        add_markers(&mut seen, &image.negative(), &ringed);
    }
    without_doubles(&mut seen.markers);
    seen
}

/// Those of dark quadrilaterals.
fn add_markers(seen: &mut Seen, image: &LightImage, codes: &[Code]) {
    let quads = find_quads(image);
    seen.quads += quads.len();
    for rough in quads {
        if Patch::of(image, &rough).is_none() {
            continue;
        }
        let Some((once, _)) = refine(image, &rough, 1) else {
            continue;
        };
        let Some(first) = read(image, &once, codes, &mut seen.mirrored) else {
            continue;
        };
        let Some((quad, sides)) = refine(image, &once, 3) else {
            continue;
        };
        let mut ignored = Vec::new();
        let Some(found) = read(image, &quad, &[first.code], &mut ignored) else {
            continue;
        };
        let mut corners = quad;
        corners.rotate_left(found.turn);
        seen.markers.push(Marker {
            code: found.code,
            id: found.id,
            evidence: found.evidence,
            corners,
            sides: sides.turned(found.turn),
        });
    }
}

/// An id that is in two places is in neither, but for a smaller quadrilateral around the same place.
fn without_doubles(markers: &mut Vec<Marker>) {
    let centre = |marker: &Marker| marker.corners.iter().sum::<DVec2>() / 4.0;
    markers.sort_by(|a, b| {
        let size = |marker: &Marker| shortest_side(&marker.corners);
        size(b).total_cmp(&size(a))
    });
    let all = markers.clone();
    let mut index = 0;
    markers.retain(|marker| {
        let own = index;
        index += 1;
        let same = |other: &Marker| other.id == marker.id && other.code == marker.code;
        let reach = 0.5 * shortest_side(&marker.corners);
        let is_near = |other: &Marker| centre(other).distance(centre(marker)) < reach;
        let doubled = all.iter().any(|other| same(other) && !is_near(other));
        let repeated = all[..own].iter().any(|other| same(other) && is_near(other));
        !doubled && !repeated
    });
}

/// The marker of one of the codes, the one that rests on the most bits.
fn read(
    image: &LightImage,
    quad: &Quad,
    codes: &[Code],
    in_mirror: &mut Vec<&'static str>,
) -> Option<Read> {
    let patch = Patch::of(image, quad)?;
    let mut best: Option<(f64, Read)> = None;
    let mut mirror = None;
    for code in codes {
        let found = match code {
            Code::Family(family) => of_family(&patch, family),
            Code::Patterns(patterns) => of_patterns(&patch, code, patterns),
        };
        match found {
            Found::Marker(bits, read) => {
                if best.as_ref().is_none_or(|(most, _)| bits > *most) {
                    best = Some((bits, read));
                }
            }
            Found::InMirror if mirror.is_none() => mirror = Some(code.name()),
            Found::InMirror | Found::Nothing => {}
        }
    }
    if best.is_none() {
        in_mirror.extend(mirror);
    }
    best.map(|(_, read)| read)
}

/// What a quadrilateral is of one code.
enum Found {
    /// And by how many bits that is more than chance.
    Marker(f64, Read),
    /// It would be one in a mirror.
    InMirror,
    Nothing,
}

fn of_family(patch: &Patch, family: &'static Family) -> Found {
    let Some((pattern, clarity)) = patch.code(family) else {
        return Found::Nothing;
    };
    if family.bits(0, family.codes.len()) < FEW_BITS && clarity < LEAST_CLARITY {
        return Found::Nothing;
    }
    match family.find(pattern) {
        Some(Match { id, turn, wrong }) => {
            // Cells of another size are neither black nor white where they straddle.
            let bits = family.bits(wrong, family.codes.len()) * f64::from(clarity);
            let read = Read {
                code: Code::Family(family),
                id,
                turn,
                evidence: Evidence::Corrected(wrong),
            };
            Found::Marker(bits, read)
        }
        None => {
            // Where every second pattern is a code a mirrored one says nothing.
            let says = family.bits(0, family.codes.len()) > LEAST_MIRROR_BITS;
            match family.find(family.mirrored(pattern)) {
                Some(_) if says => Found::InMirror,
                _ => Found::Nothing,
            }
        }
    }
}

fn of_patterns(patch: &Patch, code: &Code, patterns: &Patterns) -> Found {
    match patterns.find(patch) {
        Some(Likeness {
            is_mirrored: true, ..
        }) => Found::InMirror,
        Some(Likeness { id, turn, bits, .. }) => {
            let read = Read {
                code: code.clone(),
                id,
                turn,
                evidence: Evidence::Bits(bits),
            };
            Found::Marker(bits, read)
        }
        None => Found::Nothing,
    }
}
