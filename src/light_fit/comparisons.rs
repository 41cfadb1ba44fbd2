//! What is compared: the light of two points that may have one albedo, or of one whose albedo is known. And at what cost.

use rayon::prelude::*;

use super::points::Grid;

/// From cell to cell of a pair: edges of shadows near by, slopes and other faces farther away.
const STEPS: [[isize; 2]; 12] = [
    [1, 0],
    [0, 1],
    [3, 0],
    [0, 3],
    [2, 2],
    [2, -2],
    [8, 0],
    [0, 8],
    [6, 6],
    [6, -6],
    [20, 0],
    [0, 20],
];
/// Difference in ln of chromaticity at which a pair of points hardly passes for one albedo. Shadows have colours too: a pair keeps the
/// least weight.
const CHROMATICITY: f32 = 0.15;
const LEAST_WEIGHT: f32 = 0.1;
/// Blocks of the photograph whose errors are taken for independent, across and down, and the parts of a cross-validation.
const BLOCKS: [usize; 2] = [8, 6];
pub const BLOCK_COUNT: usize = BLOCKS[0] * BLOCKS[1];
pub const FOLDS: usize = 4;
/// Spread of ln of luminance that no surface goes below, and the half-width in cells of the neighbourhood that tells it.
const LEAST_TEXTURE: f32 = 0.02;
const TEXTURE_RADIUS: usize = 3;
/// Spread of residuals in textures that no fit goes below.
const LEAST_SIGMA: f64 = 0.5;

/// Two points, or one.
#[derive(Clone, Copy, Debug)]
struct Term {
    a: u32,
    /// `u32::MAX`: the albedo of `a` is known.
    b: u32,
    /// ln of the photograph's luminance: of `a` over `b`, or of the irradiance of `a`.
    shown: f32,
    weight: f32,
    /// Over the spread of the surface's own texture there.
    inv_texture: f32,
    block: u16,
    /// Of `a`.
    material: u32,
}

/// What of the residuals is taken for independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clusters {
    /// Blocks of the photograph.
    Blocks,
    /// Materials: what the scene says wrongly of an albedo is wrong wherever it is seen.
    Materials,
}

const KNOWN: u32 = u32::MAX;

/// All comparisons of a photograph.
pub struct Comparisons {
    terms: Vec<Term>,
    /// Some albedo is known, so that the light has a size.
    pub are_absolute: bool,
    /// Spread of ln of luminance between neighbours, in the median.
    pub typical_texture: f64,
}

/// Robust costs by block of the photograph.
pub type Costs = [f64; BLOCK_COUNT];

/// The part of a cross-validation that a block belongs to.
pub fn fold_of(block: usize) -> usize {
    (block % BLOCKS[0] + 2 * (block / BLOCKS[0])) % FOLDS
}

impl Comparisons {
    /// Points whose albedo is known by themselves, the others with each other.
    pub fn of(grid: &Grid) -> Self {
        Self::asking(grid, |at| grid.points[at].albedo.is_some())
    }

    /// All points with each other, as if no albedo were known.
    pub fn of_pairs(grid: &Grid) -> Self {
        Self::asking(grid, |_| false)
    }

    fn asking(grid: &Grid, is_known: impl Fn(usize) -> bool) -> Self {
        let mut terms = Vec::new();
        let mut texture = textures(grid);
        for (a, point) in grid.points.iter().enumerate() {
            let [column, row] = point.cell;
            let block = row * BLOCKS[1] / grid.height * BLOCKS[0] + column * BLOCKS[0] / grid.width;
            let term = |b, shown: f64, weight, texture: f32| Term {
                a: a as u32,
                b,
                shown: shown as f32,
                weight,
                inv_texture: 1.0 / texture,
                block: block as u16,
                material: point.material,
            };
            if is_known(a) {
                terms.push(term(KNOWN, point.log_shown(), 1.0, texture[a]));
                continue;
            }
            for [dx, dy] in STEPS {
                let at = |at: usize, step: isize, count: usize| {
                    at.checked_add_signed(step).filter(|at| *at < count)
                };
                let place = at(column, dx, grid.width).zip(at(row, dy, grid.height));
                let there = place.and_then(|(x, y)| grid.point_of_cell[y * grid.width + x]);
                let Some(b) = there else { continue };
                let other = &grid.points[b as usize];
                if is_known(b as usize) {
                    continue;
                }
                let (here, there) = (point.chromaticity(), other.chromaticity());
                let away = (here[0] - there[0]).powi(2) + (here[1] - there[1]).powi(2);
                let alike = (-away / (CHROMATICITY * CHROMATICITY)).exp();
                let shown = point.log_shown() - other.log_shown();
                let texture = texture[a].hypot(texture[b as usize]);
                terms.push(term(b, shown, alike.max(LEAST_WEIGHT), texture));
            }
        }
        let middle = texture.len() / 2;
        let typical_texture = match texture.is_empty() {
            true => 0.0,
            false => *texture.select_nth_unstable_by(middle, f32::total_cmp).1,
        };
        let are_absolute = terms.iter().any(|term| term.b == KNOWN);
        Self {
            terms,
            are_absolute,
            typical_texture: f64::from(typical_texture),
        }
    }

    /// ln.
    fn residual(term: &Term, log_light: &[f32]) -> f32 {
        let light = log_light[term.a as usize];
        match term.b {
            KNOWN => term.shown - light,
            b => term.shown - (light - log_light[b as usize]),
        }
    }

    /// Over the texture.
    fn scaled_residual(term: &Term, log_light: &[f32]) -> f32 {
        Self::residual(term, log_light) * term.inv_texture
    }

    /// Of what light is missing where the albedo is known, ln; `None`: it is known nowhere.
    pub fn median_of_known(&self, log_light: &[f32]) -> Option<f64> {
        if !self.are_absolute {
            return None;
        }
        let known = self.terms.iter().filter(|term| term.b == KNOWN);
        let mut missing: Vec<f32> = known.map(|term| Self::residual(term, log_light)).collect();
        let middle = missing.len() / 2;
        let (_, median, _) = missing.select_nth_unstable_by(middle, f32::total_cmp);
        Some(f64::from(*median))
    }

    /// Cauchy's cost of every `stride`th comparison, by block.
    pub fn costs(&self, log_light: &[f32], sigma: f64, stride: usize) -> Costs {
        let mut costs = [0.0; BLOCK_COUNT];
        let inv = (1.0 / (sigma * sigma)) as f32;
        for term in self.terms.iter().step_by(stride) {
            let r = Self::scaled_residual(term, log_light);
            costs[usize::from(term.block)] += f64::from(term.weight * (r * r * inv).ln_1p());
        }
        costs
    }

    pub fn cost(&self, log_light: &[f32], sigma: f64, stride: usize) -> f64 {
        self.costs(log_light, sigma, stride).iter().sum()
    }

    /// Of the residuals in textures, from their median absolute value.
    pub fn spread(&self, log_light: &[f32]) -> f64 {
        let mut sizes: Vec<f32> = (self.terms.par_iter())
            .map(|term| Self::scaled_residual(term, log_light).abs())
            .collect();
        if sizes.is_empty() {
            return LEAST_SIGMA;
        }
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f32::total_cmp);
        (1.4826 * f64::from(*median)).max(LEAST_SIGMA)
    }

    /// Residuals with the weights of iteratively reweighted least squares, by cluster, and what `slopes`, by parameter and point, make of
    /// them: all that a step of Gauss and Newton needs.
    pub fn linearised(
        &self,
        log_light: &[f32],
        slopes: &[Vec<f32>],
        sigma: f64,
        clusters: Clusters,
    ) -> Linearised {
        let n = slopes.len();
        let cluster_of = |term: &Term| match clusters {
            Clusters::Blocks => usize::from(term.block),
            Clusters::Materials => term.material as usize,
        };
        let count = self
            .terms
            .iter()
            .map(cluster_of)
            .max()
            .map_or(0, |last| last + 1);
        let inv = (1.0 / (sigma * sigma)) as f32;
        let mut sums = Linearised {
            normal: vec![0.0; n * n],
            gradients: vec![vec![0.0; n]; count],
        };
        let mut row = vec![0.0f64; n];
        for term in &self.terms {
            let r = Self::scaled_residual(term, log_light);
            let weight = f64::from(term.weight / (1.0 + r * r * inv));
            for (value, slope) in row.iter_mut().zip(slopes) {
                let here = slope[term.a as usize];
                *value = f64::from(match term.b {
                    KNOWN => here,
                    b => here - slope[b as usize],
                }) * f64::from(term.inv_texture);
            }
            let gradient = &mut sums.gradients[cluster_of(term)];
            for i in 0..n {
                gradient[i] += weight * f64::from(r) * row[i];
                for j in 0..n {
                    sums.normal[i * n + j] += weight * row[i] * row[j];
                }
            }
        }
        sums
    }
}

/// Spread of ln of luminance from cell to cell about each point: what of its neighbours' differences is albedo and noise.
fn textures(grid: &Grid) -> Vec<f32> {
    let step_to = |cell: usize, other: usize| {
        let [here, there] = [cell, other].map(|cell| grid.point_of_cell[cell]);
        let (here, there) = here.zip(there)?;
        let [here, there] = [here, there].map(|point| &grid.points[point as usize]);
        Some((here.log_shown() - there.log_shown()).abs() as f32)
    };
    let around = |at: usize, count: usize| {
        at.saturating_sub(TEXTURE_RADIUS)..(at + TEXTURE_RADIUS + 1).min(count - 1)
    };
    (grid.points.par_iter())
        .map(|point| {
            let [column, row] = point.cell;
            let mut steps = Vec::new();
            for y in around(row, grid.height) {
                for x in around(column, grid.width) {
                    let cell = y * grid.width + x;
                    steps.extend(step_to(cell, cell + 1));
                    steps.extend(step_to(cell, cell + grid.width));
                }
            }
            if steps.is_empty() {
                return LEAST_TEXTURE;
            }
            let middle = steps.len() / 2;
            let median = *steps.select_nth_unstable_by(middle, f32::total_cmp).1;
            (1.4826 * median * std::f32::consts::FRAC_1_SQRT_2).max(LEAST_TEXTURE)
        })
        .collect()
}

/// Normal equations of the parameters.
pub struct Linearised {
    /// Row-major.
    pub normal: Vec<f64>,
    /// By block, of the parameters.
    pub gradients: Vec<Vec<f64>>,
}
