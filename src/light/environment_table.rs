//! The table by which a map is sampled, built once a map.

use glam::Vec3;

use crate::math::{luminance, sincos_2pi};
use crate::packed::RowEdge;

/// Cumulative distributions for sampling a map by brightness.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvironmentTable {
    /// Marginal over the height + 1 rows (height + 2 entries from 0 to 1), then for each row the conditional over its width columns
    /// (width + 1 entries).
    pub cdf: Vec<f32>,
    /// Where [`interval_of`] begins to look: [`starts_count`] of the rows entries for the marginal, then as many as the columns have for each row.
    pub starts: Vec<u32>,
    /// Of each of the height + 1 rows, and the lower one of the last.
    pub edges: Vec<RowEdge>,
    /// 1 / integral of the cells' mean luminance over the sphere; 0 for a black map.
    pub normaliser: f32,
    /// Mean luminance over the sphere.
    pub mean_luminance: f64,
}

/// Builds the table of a map of `width` x `height` texels, three floats each.
pub fn environment_table(width: u32, height: u32, texels: &[f32]) -> EnvironmentTable {
    let (w, h) = (width as usize, height as usize);
    let lum = |i: usize, j: usize| {
        let t = &texels[3 * (j * w + i)..][..3];
        f64::from(luminance(Vec3::new(t[0], t[1], t[2])))
    };
    let rows = h + 1;
    let mut row_sums = vec![0.0_f64; rows];
    let mut conditionals = vec![0.0_f32; rows * (w + 1)];
    for r in 0..rows {
        let (top, bottom) = (r.max(1) - 1, r.min(h - 1));
        let means: Vec<f64> = (0..w)
            .map(|i| {
                0.25 * (lum(i, top)
                    + lum((i + 1) % w, top)
                    + lum(i, bottom)
                    + lum((i + 1) % w, bottom))
            })
            .collect();
        let cos_at =
            |row_edge: f64| (std::f64::consts::PI * (row_edge / h as f64).clamp(0.0, 1.0)).cos();
        let solid_angle =
            (cos_at(r as f64 - 0.5) - cos_at(r as f64 + 0.5)) * std::f64::consts::TAU / w as f64;
        let total: f64 = means.iter().sum();
        row_sums[r] = total * solid_angle;
        fill_cdf(&mut conditionals[r * (w + 1)..][..w + 1], &means);
    }
    let integral: f64 = row_sums.iter().sum();
    let mut cdf = vec![0.0_f32; rows + 1];
    fill_cdf(&mut cdf, &row_sums);
    cdf.extend_from_slice(&conditionals);
    let mut starts = starts_of(&cdf[..=rows]);
    for conditional in conditionals.chunks(w + 1) {
        starts.extend(starts_of(conditional));
    }
    EnvironmentTable {
        cdf,
        starts,
        edges: edges_of_rows(height),
        normaliser: if integral > 0.0 {
            (1.0 / integral) as f32
        } else {
            0.0
        },
        mean_luminance: integral / (4.0 * std::f64::consts::PI),
    }
}

fn edges_of_rows(height: u32) -> Vec<RowEdge> {
    let height = height as f32;
    let rows = (0..height as u32 + 2).map(|row| row as f32);
    let half_sin = |angle: f32| sincos_2pi(0.25 * angle).0;
    rows.map(|row| {
        let upper = ((row - 0.5) / height).clamp(0.0, 1.0);
        let lower = ((row + 0.5) / height).min(1.0);
        let (sin, cos) = sincos_2pi(0.25 * upper);
        RowEdge {
            v: upper,
            sin2: sin * sin,
            cos2: cos * cos,
            half_height: half_sin(upper + lower) * half_sin(lower - upper),
        }
    })
    .collect()
}

/// Running sums scaled to end at exactly 1; uniform where all weights are zero.
fn fill_cdf(cdf: &mut [f32], weights: &[f64]) {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    for (i, weight) in weights.iter().enumerate() {
        sum += weight;
        cdf[i + 1] = if total > 0.0 {
            (sum / total) as f32
        } else {
            (i + 1) as f32 / weights.len() as f32
        };
    }
    cdf[weights.len()] = 1.0;
}

/// Intervals that a part of 0..1 holds on average: with so few parts all rows' starts stay in the second-level cache, and what is then looked
/// through lies side by side.
const INTERVALS_PER_PART: usize = 32;

/// Entries that [`interval_of`] wants for so many intervals: one for each part, and one for what rounds up to 1.
pub fn starts_count(intervals: usize) -> usize {
    intervals.div_ceil(INTERVALS_PER_PART) + 1
}

/// The part that a number lies in. Monotonic, and the same wherever it is asked.
fn part_at(u: f32, parts: usize) -> usize {
    (u * parts as f32) as usize
}

/// For each part of 0..1 the last interval that begins in an earlier one.
fn starts_of(cdf: &[f32]) -> Vec<u32> {
    let intervals = cdf.len() - 1;
    let count = starts_count(intervals);
    let mut interval = 0;
    (0..count)
        .map(|part| {
            while interval + 1 < intervals && part_at(cdf[interval + 1], count - 1) < part {
                interval += 1;
            }
            interval as u32
        })
        .collect()
}

/// Last interval i with cdf\[i\] <= u, for u in 0..1 and the `starts` of this `cdf`: the cutpoint method (Chen and Asau 1974).
pub fn interval_of(cdf: &[f32], starts: &[u32], u: f32) -> u32 {
    let first = starts[part_at(u, starts.len() - 1)];
    let begins_after = cdf[first as usize + 1..cdf.len() - 1].iter();
    first + begins_after.take_while(|&&begin| begin <= u).count() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_the_last_that_begins_at_or_before_a_number() {
        let black = vec![0.0; 7];
        let peak = (0..300).map(|i| if i == 217 { 1e6 } else { 1e-3 });
        let gaps = (0..129).map(|i| if i % 5 < 3 { 0.0 } else { f64::from(i) });
        let ramp = (1..=64).map(f64::from);
        for weights in [
            black,
            peak.collect(),
            gaps.collect(),
            ramp.collect(),
            vec![2.0],
        ] {
            let mut cdf = vec![0.0; weights.len() + 1];
            fill_cdf(&mut cdf, &weights);
            let starts = starts_of(&cdf);
            let spread = (0..1000).map(|i| i as f32 / 1000.0);
            let around = cdf.iter().flat_map(|&c| [c.next_down(), c, c.next_up()]);
            let numbers = spread.chain(around).filter(|u| (0.0..1.0).contains(u));
            for u in numbers {
                let wanted = cdf[..weights.len()].partition_point(|&c| c <= u) - 1;
                assert_eq!(interval_of(&cdf, &starts, u), wanted as u32, "{u}");
            }
            let late: Vec<_> = starts.iter().map(|s| s + 1).collect();
            let is_noticed = weights.len() == 1 || interval_of(&cdf, &late, 0.0) != 0;
            assert!(is_noticed, "control: it must not begin too late");
        }
    }
}
