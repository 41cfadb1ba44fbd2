//! Which of the user's patterns a quadrilateral shows: normalised cross-correlation in all four turns, as ARToolKit has it (Kato and Billinghurst 1999), and
//! by how many bits the best is more than chance and than the second.
//!
//! Light is correlated, not codes: exposure is a factor there, which the normalisation takes out. So is what a plane over the cells can do, of light from one
//! side and of pictures whose upper half is white, which is like too much. Where cells are smaller than pixels the patterns are reduced.

use super::cells::Patch;
use super::light::Tone;
use super::pattern::{Pattern, SIDES, reflected, turned};

/// Patterns that are told apart, their ids in their order.
#[derive(Clone, Debug)]
pub struct Patterns {
    list: Vec<Pattern>,
    /// Of the marker's side, what the picture fills.
    share: f64,
    /// Finest first.
    levels: Vec<Level>,
}

/// All patterns in cells of one size.
#[derive(Clone, Debug)]
struct Level {
    side: usize,
    templates: Vec<Template>,
}

#[derive(Clone, Debug)]
struct Template {
    /// In quarter turns, clockwise; each without mean and slope, of length 1.
    turns: [Vec<f32>; 4],
    /// Cells that say something of their own: neighbours mostly say the same.
    independent: f64,
}

/// What a quadrilateral shows.
#[derive(Clone, Copy, Debug)]
pub struct Likeness {
    pub id: u32,
    /// Quarter turns, clockwise in the picture, from the pattern upright to how it was seen.
    pub turn: usize,
    /// From -1 to 1.
    correlation: f64,
    /// By which it is likelier than chance and than the second best.
    pub bits: f64,
    pub is_mirrored: bool,
}

/// Of the marker's side, what the picture fills in ARToolKit's markers.
pub const USUAL_SHARE: f64 = 0.5;
/// A border has to be left, and a picture.
const SHARES: std::ops::RangeInclusive<f64> = 0.2..=0.8;
/// Cells on a side that are correlated at most and at least.
const MOST_SIDE: usize = 32;
const LEAST_SIDE: usize = 8;
/// Smaller cells are put together.
const LEAST_CELL_PX: f64 = 1.5;
/// As ARToolKit has it.
const LEAST_CORRELATION: f64 = 0.5;
/// What a marker needs: the whole video's evidence is asked for besides.
const LEAST_BITS: f64 = 6.0;
/// Patterns that are less apart than this, of a picture free of noise, are not told apart.
const CLEAN_CORRELATION: f64 = 0.95;

impl Patterns {
    /// `share`: of the marker's side, what the picture fills.
    ///
    /// # Errors
    /// Patterns that look alike, or alike after a turn, or that show too little.
    pub fn new(list: Vec<Pattern>, share: f64) -> Result<Self, String> {
        if !SHARES.contains(&share) {
            return Err(format!(
                "the pattern fills {share} of the marker's side; expected {} to {}; correct it",
                SHARES.start(),
                SHARES.end()
            ));
        }
        let side = list.first().map_or(0, |pattern| pattern.side);
        let is_whole = |p: &Pattern| SIDES.contains(&p.side) && p.codes.len() == p.side * p.side;
        if list.is_empty() || !list.iter().all(is_whole) {
            return Err("patterns are not whole; expected one or more, of N x N cells; read them from their files again".to_owned());
        }
        if let Some(other) = list.iter().find(|pattern| pattern.side != side) {
            return Err(format!(
                "{} has {} x {1} cells and {} has {side} x {side}; expected one size; make the pattern files again",
                other.name, other.side, list[0].name
            ));
        }
        let mut sides = vec![side];
        while let Some(last) = sides.last().copied()
            && last.is_multiple_of(2)
            && last / 2 >= LEAST_SIDE
        {
            sides.push(last / 2);
        }
        let coarsest = sides.last().copied().unwrap_or(side);
        sides.retain(|side| *side <= MOST_SIDE || *side == coarsest);
        let level = |side: usize| Level {
            side,
            templates: list.iter().map(|p| Template::of(p, side)).collect(),
        };
        let patterns = Self {
            levels: sides.into_iter().map(level).collect(),
            list,
            share,
        };
        patterns.check()?;
        Ok(patterns)
    }

    /// By their ids.
    pub fn list(&self) -> &[Pattern] {
        &self.list
    }

    /// Of the marker's side, what the picture fills.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Each pattern, seen clearly, is found among the others.
    fn check(&self) -> Result<(), String> {
        for level in &self.levels {
            for (id, template) in level.templates.iter().enumerate() {
                let own = &template.turns[0];
                let (second, correlation) = level.second(own, (id, 0));
                if self.bits(CLEAN_CORRELATION, correlation, template) >= LEAST_BITS {
                    continue;
                }
                let name = &self.list[id].name;
                return Err(match second {
                    (other, turn) if other == id && correlation > LEAST_CORRELATION => format!(
                        "pattern {name} looks alike after {turn} quarter turns; expected a picture whose upper side is plain to see; take another"
                    ),
                    (other, _) if correlation > LEAST_CORRELATION => format!(
                        "patterns {name} and {} look alike; expected pictures that differ; leave one out",
                        self.list[other].name
                    ),
                    _ => format!(
                        "pattern {name} shows too little to be told from chance; expected several dark and light shapes; take another"
                    ),
                });
            }
        }
        Ok(())
    }

    /// How much likelier a correlation is than one of `second`, which is that of chance if it is 0: of Gaussian errors, with the picture's gain and offset free.
    fn bits(&self, best: f64, second: f64, template: &Template) -> f64 {
        let left = |correlation: f64| (1.0 - correlation.max(0.0).powi(2)).max(1e-3);
        let looked = (4 * self.list.len()) as f64;
        0.5 * template.independent * (left(second) / left(best)).log2() - looked.log2()
    }

    /// `None`: it shows none of them, in a mirror or not.
    pub fn find(&self, patch: &Patch) -> Option<Likeness> {
        let border = 0.5 * (1.0 - self.share);
        let side = self.list.first()?.side as f64;
        if !patch.has_dark_border(side, border * side) {
            return None;
        }
        let fits =
            |level: &&Level| patch.side_px() * self.share >= LEAST_CELL_PX * level.side as f64;
        let level = self.levels.iter().find(fits).or(self.levels.last())?;
        let seen = patch.means(self.share, level.side);
        let mirrored = normalised(reflected(&seen, level.side), level.side)?;
        let straight = self.likeness(level, &normalised(seen, level.side)?, false);
        let mirrored = self.likeness(level, &mirrored, true);
        match (straight, mirrored) {
            (Some(own), Some(other)) => {
                let template = &level.templates[other.id as usize];
                let gain = self.bits(other.correlation, own.correlation, template);
                // A picture that is much like its own mirror image is taken as it is.
                if gain > LEAST_BITS {
                    mirrored
                } else {
                    straight
                }
            }
            _ => straight.or(mirrored),
        }
    }

    fn likeness(&self, level: &Level, seen: &[f32], is_mirrored: bool) -> Option<Likeness> {
        let ((id, turn), correlation) = level.second(seen, (usize::MAX, 0));
        let (_, second) = level.second(seen, (id, turn));
        let bits = self.bits(correlation, second, &level.templates[id]);
        (correlation > LEAST_CORRELATION && bits > LEAST_BITS).then_some(Likeness {
            id: id as u32,
            turn,
            correlation,
            bits,
            is_mirrored,
        })
    }
}

impl Level {
    /// Pattern and turn with the highest correlation, but for `first`.
    fn second(&self, seen: &[f32], first: (usize, usize)) -> ((usize, usize), f64) {
        let all = self
            .templates
            .iter()
            .enumerate()
            .flat_map(|(id, template)| {
                let turns = template.turns.iter().enumerate();
                turns.map(move |(turn, cells)| ((id, turn), product(cells, seen)))
            });
        all.filter(|(which, _)| *which != first)
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or(((0, 0), 0.0))
    }
}

impl Template {
    /// In `side` x `side` cells, of which the pattern has a multiple.
    fn of(pattern: &Pattern, side: usize) -> Self {
        let by = pattern.side / side;
        let mean = |x: usize, y: usize| {
            let cells = (0..by).flat_map(|j| (0..by).map(move |i| (x * by + i, y * by + j)));
            let light = cells.map(|(x, y)| Tone::Srgb.light(pattern.codes[y * pattern.side + x]));
            light.sum::<f32>() / (by * by) as f32
        };
        let cells = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
        let light: Vec<f32> = cells.map(|(x, y)| mean(x, y)).collect();
        // A picture of one colour correlates with nothing.
        let upright = normalised(light, side).unwrap_or_else(|| vec![0.0; side * side]);
        let once = turned(&upright, side);
        let twice = turned(&once, side);
        let thrice = turned(&twice, side);
        Self {
            independent: independent(&upright, side),
            turns: [upright, once, twice, thrice],
        }
    }
}

/// Without the plane that fits them best, and of length 1; `None`: a plane is all that they are.
fn normalised(mut cells: Vec<f32>, side: usize) -> Option<Vec<f32>> {
    let middle = 0.5 * (side as f32 - 1.0);
    let axes = |index: usize| {
        let place = |at: usize| at as f32 - middle;
        [1.0, place(index % side), place(index / side)]
    };
    let (mut sums, mut squares) = ([0.0; 3], [0.0; 3]);
    for (index, value) in cells.iter().enumerate() {
        for (k, axis) in axes(index).into_iter().enumerate() {
            sums[k] += axis * value;
            squares[k] += axis * axis;
        }
    }
    for (index, value) in cells.iter_mut().enumerate() {
        for (k, axis) in axes(index).into_iter().enumerate() {
            *value -= axis * sums[k] / squares[k];
        }
    }
    let length = cells.iter().map(|value| value * value).sum::<f32>().sqrt();
    cells.iter_mut().for_each(|value| *value /= length);
    (length > 1e-4).then_some(cells)
}

fn product(a: &[f32], b: &[f32]) -> f64 {
    let products = a.iter().zip(b).map(|(a, b)| a * b);
    f64::from(products.sum::<f32>())
}

/// Cells by the squares of their own correlations at all distances: what is seen by chance is taken to be as smooth as the pattern (Clifford, Richardson and
/// Hémon 1989).
fn independent(cells: &[f32], side: usize) -> f64 {
    let mut squares = 0.0;
    for down in 0..side {
        for across in 0..side {
            let overlap = |is_mirrored: bool| {
                let rows = 0..side - down;
                let sum = rows.map(|y| {
                    let (upper, lower) = (y * side, (y + down) * side);
                    let (a, b) = match is_mirrored {
                        false => (upper, lower + across),
                        true => (upper + across, lower),
                    };
                    let count = side - across;
                    product(&cells[a..a + count], &cells[b..b + count])
                });
                sum.sum::<f64>()
            };
            // Each distance and its opposite.
            squares += match (down, across) {
                (0, 0) => overlap(false).powi(2),
                (0, _) | (_, 0) => 2.0 * overlap(false).powi(2),
                _ => 2.0 * (overlap(false).powi(2) + overlap(true).powi(2)),
            };
        }
    }
    (side * side) as f64 / squares.max(1e-9)
}
