//! The table by which a map is sampled, built once a map.

use glam::Vec3;

use crate::math::luminance;

/// Cumulative distributions for sampling a map by brightness.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvironmentTable {
    /// Marginal over the height + 1 rows (height + 2 entries from 0 to 1), then for each row the conditional over its width columns
    /// (width + 1 entries).
    pub cdf: Vec<f32>,
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
    EnvironmentTable {
        cdf,
        normaliser: if integral > 0.0 {
            (1.0 / integral) as f32
        } else {
            0.0
        },
        mean_luminance: integral / (4.0 * std::f64::consts::PI),
    }
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
