//! The inside of a dark quadrilateral: its light between that of its border and that of the paper around it, cell by cell.

use glam::{DMat3, DVec2};

use super::family::Family;
use super::homography::{apply, of_square};
use super::light::LightImage;
use super::quad::{Quad, shortest_side};

/// White paper and black ink differ at least by this much light.
const LEAST_CONTRAST: f32 = 0.02;
/// Shares of the way from black to white that a cell may have at most and at least.
const DARKEST_WHITE: f32 = 0.5;

/// A quadrilateral with a dark border and a light surround.
pub struct Patch<'a> {
    image: &'a LightImage,
    map: DMat3,
    contrast: Contrast,
    side_px: f64,
}

impl<'a> Patch<'a> {
    /// `None`: the quadrilateral has no dark border with a light surround.
    pub fn of(image: &'a LightImage, quad: &Quad) -> Option<Self> {
        Some(Self {
            image,
            map: of_square(*quad),
            contrast: contrast(image, quad)?,
            side_px: shortest_side(quad),
        })
    }

    /// Of the shortest side, pixels.
    pub fn side_px(&self) -> f64 {
        self.side_px
    }

    /// 0 for black, 1 for white; places are shares of the sides from the top left.
    pub fn level(&self, place: DVec2) -> f32 {
        let Contrast { black, white } = self.contrast;
        (self.image.at(apply(&self.map, place)) - black) / (white - black)
    }

    /// Whether the border is dark all around; `side`: of the marker, in cells, and `border`: of them the border's.
    pub fn has_dark_border(&self, side: f64, border: f64) -> bool {
        let around = side.round() as usize;
        let near = 0.5 * border;
        (0..around).all(|index| {
            let along = (index as f64 + 0.5) * side / around as f64;
            let places = [
                (along, near),
                (along, side - near),
                (near, along),
                (side - near, along),
            ];
            places
                .into_iter()
                .all(|place| self.level(DVec2::from(place) / side) <= DARKEST_WHITE)
        })
    }

    /// A pattern as [`Family::codes`] has them, and how far they are from the middle on average, 0 to 0.5; `None`: the border has light cells.
    pub fn code(&self, family: &Family) -> Option<(u64, f32)> {
        let (n, border, side) = (family.cells, family.border, family.side_cells());
        if !self.has_dark_border(side, border) {
            return None;
        }
        let level = |x: f64, y: f64| self.level(DVec2::new(x, y) / side);
        let cell = |x: f64, y: f64| {
            const OFF: f64 = 0.2;
            let around = [(-OFF, -OFF), (OFF, -OFF), (-OFF, OFF), (OFF, OFF)];
            let sum: f32 = around.iter().map(|(dx, dy)| level(x + dx, y + dy)).sum();
            (2.0 * level(x, y) + sum) / 6.0
        };
        let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x as f64 + 0.5, y as f64 + 0.5)));
        let mut values: Vec<f32> = cells.map(|(x, y)| cell(border + x, border + y)).collect();
        sharpen(&mut values, n, self.side_px / side);
        let ring = family.ring().map(|(x, y)| cell(x, y));
        let (mut pattern, mut clarity) = (0, 0.0);
        for value in ring.chain(values) {
            // What is ringed is read from the picture's negative.
            pattern = pattern << 1 | u64::from((value > DARKEST_WHITE) != family.is_ringed);
            clarity += (value - DARKEST_WHITE).abs().min(0.5);
        }
        Some((pattern, clarity / family.code_cells() as f32))
    }

    /// Mean light of `n` x `n` cells, row by row, that fill the middle `share` of the sides.
    pub fn means(&self, share: f64, n: usize) -> Vec<f32> {
        const MOST: f64 = 8.0;
        let cell = share / n as f64;
        let per_cell = (cell * self.side_px).ceil().clamp(2.0, MOST) as usize;
        let first = 0.5 * (1.0 - share);
        let at = |index: usize, part: usize| {
            first + cell * (index as f64 + (part as f64 + 0.5) / per_cell as f64)
        };
        let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
        let parts: Vec<(usize, usize)> = (0..per_cell)
            .flat_map(|j| (0..per_cell).map(move |i| (i, j)))
            .collect();
        let mean = |(x, y): (usize, usize)| {
            let all = parts
                .iter()
                .map(|(i, j)| self.level(DVec2::new(at(x, *i), at(y, *j))));
            all.sum::<f32>() / parts.len() as f32
        };
        cells.map(mean).collect()
    }
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
