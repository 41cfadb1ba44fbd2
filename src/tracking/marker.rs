//! Markers of one frame: quadrilaterals whose cells spell a code.

use glam::DVec2;

use super::edge::{Sides, refine};
use super::family::{Family, Match, mirrored};
use super::homography::{apply, of_square};
use super::light::LightImage;
use super::quad::{Quad, find_quads, shortest_side};

/// A marker as it was seen.
#[derive(Clone, Debug)]
pub struct Marker {
    pub family: &'static Family,
    pub id: u32,
    /// Cells that were put right.
    pub wrong: u32,
    /// From the marker's own top left, clockwise; pixels, corner origin.
    pub corners: Quad,
    /// The same sides as points, the first along the marker's top.
    pub sides: Sides,
}

/// What one frame holds.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub markers: Vec<Marker>,
    /// Quadrilaterals that would be markers in a mirror, by family.
    pub mirrored: Vec<&'static str>,
    /// Dark quadrilaterals, markers or not.
    pub quads: usize,
}

/// White paper and black ink differ at least by this much light.
const LEAST_CONTRAST: f32 = 0.02;
/// Shares of the way from black to white that a cell may have at most and at least.
const DARKEST_WHITE: f32 = 0.5;
/// How far cells are from the middle on average, of 0.5, where the code rests on few bits.
const LEAST_CLARITY: f32 = 0.3;
/// Families of fewer bits a marker need clear cells.
const FEW_BITS: f64 = 12.0;

/// All markers of these families, each id once.
pub fn find_markers(image: &LightImage, families: &[&'static Family]) -> Seen {
    let quads = find_quads(image);
    let mut seen = Seen {
        quads: quads.len(),
        ..Seen::default()
    };
    for rough in quads {
        if contrast(image, &rough).is_none() {
            continue;
        }
        let Some((once, _)) = refine(image, &rough, 1) else {
            continue;
        };
        let Some((family, _)) = read(image, &once, families, &mut seen.mirrored) else {
            continue;
        };
        let Some((quad, sides)) = refine(image, &once, 3) else {
            continue;
        };
        let mut ignored = Vec::new();
        let Some((family, found)) = read(image, &quad, &[family], &mut ignored) else {
            continue;
        };
        let mut corners = quad;
        corners.rotate_left(found.turn);
        seen.markers.push(Marker {
            family,
            id: found.id,
            wrong: found.wrong,
            corners,
            sides: sides.turned(found.turn),
        });
    }
    without_doubles(&mut seen.markers);
    seen
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
        let same =
            |other: &Marker| other.id == marker.id && other.family.name == marker.family.name;
        let reach = 0.5 * shortest_side(&marker.corners);
        let is_near = |other: &Marker| centre(other).distance(centre(marker)) < reach;
        let doubled = all.iter().any(|other| same(other) && !is_near(other));
        let repeated = all[..own].iter().any(|other| same(other) && is_near(other));
        !doubled && !repeated
    });
}

/// Light of ink and paper along the sides.
#[derive(Clone, Copy)]
struct Contrast {
    black: f32,
    white: f32,
}

/// `None`: the quadrilateral has no dark border with a light surround.
fn contrast(image: &LightImage, quad: &Quad) -> Option<Contrast> {
    const PLACES: usize = 6;
    // Half of the narrowest border, 1/16 of the side; outside as far as a margin of a cell reaches.
    const INSIDE: f64 = 0.06;
    let map = of_square(*quad);
    let outside = (1.5 / shortest_side(quad)).clamp(0.07, 0.12);
    let (mut black, mut white) = (Vec::new(), Vec::new());
    for index in 0..PLACES {
        let t = (index as f64 + 0.5) / PLACES as f64;
        for (near, list) in [(INSIDE, &mut black), (-outside, &mut white)] {
            for place in [(t, near), (t, 1.0 - near), (near, t), (1.0 - near, t)] {
                list.push(image.at(apply(&map, place.into())));
            }
        }
    }
    black.sort_by(f32::total_cmp);
    white.sort_by(f32::total_cmp);
    let found = Contrast {
        black: black[black.len() / 2],
        white: white[white.len() / 2],
    };
    let middle = 0.5 * (found.black + found.white);
    let is_border = black[black.len() * 9 / 10] < middle && white[white.len() / 10] > middle;
    (found.white - found.black > LEAST_CONTRAST && is_border).then_some(found)
}

/// A code of one of the families, the one that rests on the most bits.
fn read(
    image: &LightImage,
    quad: &Quad,
    families: &[&'static Family],
    in_mirror: &mut Vec<&'static str>,
) -> Option<(&'static Family, Match)> {
    let contrast = contrast(image, quad)?;
    let map = of_square(*quad);
    let mut best = None;
    let mut most_bits = f64::NEG_INFINITY;
    let mut mirror = None;
    for family in families {
        let bits = family.bits(0, family.codes.len());
        let cell_px = shortest_side(quad) / family.side_cells();
        let Some((pattern, clarity)) = pattern(image, &map, contrast, family, cell_px) else {
            continue;
        };
        if bits < FEW_BITS && clarity < LEAST_CLARITY {
            continue;
        }
        match family.find(pattern) {
            Some(found) => {
                // Cells of another size are neither black nor white where they straddle.
                let bits = family.bits(found.wrong, family.codes.len()) * f64::from(clarity);
                if bits > most_bits {
                    most_bits = bits;
                    best = Some((*family, found));
                }
            }
            None if mirror.is_none() => {
                let reflected = family.find(mirrored(pattern, family.cells));
                mirror = reflected.map(|_| family.name);
            }
            None => {}
        }
    }
    if best.is_none() {
        in_mirror.extend(mirror);
    }
    best
}

/// Cells row by row, 1 for white, and how far they are from the middle on average, 0 to 0.5; `None`: the border has light cells.
fn pattern(
    image: &LightImage,
    map: &glam::DMat3,
    Contrast { black, white }: Contrast,
    family: &Family,
    cell_px: f64,
) -> Option<(u64, f32)> {
    let side = family.side_cells();
    let (n, border) = (family.cells, family.border);
    let level = |x: f64, y: f64| {
        let value = image.at(apply(map, DVec2::new(x, y) / side));
        (value - black) / (white - black)
    };
    let cell = |x: f64, y: f64| {
        const OFF: f64 = 0.2;
        let around = [(-OFF, -OFF), (OFF, -OFF), (-OFF, OFF), (OFF, OFF)];
        let sum: f32 = around.iter().map(|(dx, dy)| level(x + dx, y + dy)).sum();
        (2.0 * level(x, y) + sum) / 6.0
    };
    let mut light_border = 0;
    let around = side.round() as usize;
    for index in 0..around {
        let along = (index as f64 + 0.5) * side / around as f64;
        let near = 0.5 * border;
        for (x, y) in [
            (along, near),
            (along, side - near),
            (near, along),
            (side - near, along),
        ] {
            light_border += usize::from(level(x, y) > DARKEST_WHITE);
        }
    }
    if light_border > 0 {
        return None;
    }
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x as f64 + 0.5, y as f64 + 0.5)));
    let mut values: Vec<f32> = cells.map(|(x, y)| cell(border + x, border + y)).collect();
    sharpen(&mut values, n, cell_px);
    let (mut pattern, mut clarity) = (0, 0.0);
    for value in values {
        pattern = pattern << 1 | u64::from(value > DARKEST_WHITE);
        clarity += (value - DARKEST_WHITE).abs().min(0.5);
    }
    Some((pattern, clarity / (n * n) as f32))
}

/// Standard deviation of a camera's blur, the pixels' own included.
const BLUR_PX: f64 = 0.9;

/// Takes from cells of few pixels what their neighbours' light adds by the blur; around them is the black border.
fn sharpen(values: &mut [f32], n: usize, cell_px: f64) {
    const ROUNDS: usize = 4;
    // Of a Gaussian, what lies beyond half a cell to one side.
    let z = 0.5 * cell_px / BLUR_PX;
    let lost = (0.5 * (-0.717 * z - 0.416 * z * z).exp()) as f32;
    for (step, other) in [(1, n), (n, 1)] {
        for line in 0..n {
            let seen: Vec<f32> = (0..n).map(|k| values[line * other + k * step]).collect();
            let mut sharp = seen.clone();
            for _ in 0..ROUNDS {
                let before = sharp.clone();
                let at = |k: usize| before.get(k).copied().unwrap_or(0.0);
                for k in 0..n {
                    let around = at(k.wrapping_sub(1)) + at(k + 1);
                    sharp[k] += seen[k] - ((1.0 - 2.0 * lost) * before[k] + lost * around);
                }
            }
            for (k, value) in sharp.into_iter().enumerate() {
                values[line * other + k * step] = value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sharpening_undoes_the_blur_between_small_cells() {
        let n = 5;
        let white = |x: usize, y: usize| f32::from(u8::from((x * 3 + y * 5) % 4 < 2));
        let lost = 0.14;
        let at = |x: i32, y: i32| match (0..5).contains(&x) && (0..5).contains(&y) {
            true => white(x as usize, y as usize),
            false => 0.0,
        };
        let across =
            |x: i32, y: i32| (1.0 - 2.0 * lost) * at(x, y) + lost * (at(x - 1, y) + at(x + 1, y));
        let blurred = |x: i32, y: i32| {
            (1.0 - 2.0 * lost) * across(x, y) + lost * (across(x, y - 1) + across(x, y + 1))
        };
        let cells = (0..5).flat_map(|y| (0..5).map(move |x| (x, y)));
        let mut values: Vec<f32> = cells.map(|(x, y)| blurred(x, y)).collect();
        let worst = |values: &[f32]| {
            let off = (0..n * n).map(|k| (values[k] - white(k % n, k / n)).abs());
            off.fold(0.0, f32::max)
        };
        let before = worst(&values);
        sharpen(&mut values, n, 1.95);
        assert!(
            before > 0.3 && worst(&values) < 0.15,
            "{before} {}",
            worst(&values)
        );
    }
}
