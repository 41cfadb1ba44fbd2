//! Samples of every lobe against its own density, by chi-squared.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::Random;
use super::kinds::*;
use crate::material::{Surface, bsdf_eval, bsdf_sample};

const ANGLES: [f64; 3] = [0.05, 0.9, 1.5];

/// Solid-angle bins: rings about the normal, or rings about a peak, the same number of azimuths.
struct Bins {
    axis: Vec3,
    /// Polar angles, rising.
    edges: Vec<f64>,
}

const AZIMUTHS: usize = 16;
/// Most times that a bin is halved in both directions for its quadrature.
const SPLITS: u32 = 6;

impl Bins {
    /// Over the whole sphere; the horizon of `axis` is an edge.
    fn sphere(axis: Vec3) -> Self {
        let edges = (0..=36).map(|i| PI * f64::from(i) / 36.0).collect();
        Self { axis, edges }
    }

    /// Within about `width` * 30 of a narrow peak; all else counts as outside.
    fn peak(axis: Vec3, width: f64) -> Self {
        let edges = std::iter::once(0.0)
            .chain((0..24).map(|i| width * 0.3 * 1.22f64.powi(i)))
            .take_while(|edge| *edge < 0.5)
            .collect();
        Self { axis, edges }
    }

    fn frame(&self) -> [DVec3; 3] {
        let n = self.axis.as_dvec3().normalize();
        let t = n.any_orthonormal_vector();
        [t, n.cross(t), n]
    }

    fn len(&self) -> usize {
        (self.edges.len() - 1) * AZIMUTHS
    }

    /// Where a direction falls; None outside.
    fn index(&self, w: Vec3) -> Option<usize> {
        let [t, b, n] = self.frame();
        let d = w.as_dvec3();
        let theta = (d.dot(t).hypot(d.dot(b))).atan2(d.dot(n));
        let ring = self.edges.partition_point(|edge| *edge <= theta);
        if ring == 0 || ring == self.edges.len() {
            return None;
        }
        let phi = d.dot(b).atan2(d.dot(t)).rem_euclid(TAU);
        let azimuth = ((phi / TAU * AZIMUTHS as f64) as usize).min(AZIMUTHS - 1);
        Some((ring - 1) * AZIMUTHS + azimuth)
    }

    /// Integral of `density` over every bin, each split until its quadrature settles.
    fn integrate(&self, density: &dyn Fn(Vec3) -> f64) -> Vec<f64> {
        let frame = self.frame();
        // h is the squared sine of half the polar angle: solid angle is 2 dh dphi, and it keeps digits near the axis.
        let at = |h: f64, phi: f64| {
            let sin = 2.0 * (h * (1.0 - h)).max(0.0).sqrt();
            let [t, b, n] = frame;
            density((t * (sin * phi.cos()) + b * (sin * phi.sin()) + n * (1.0 - 2.0 * h)).as_vec3())
        };
        let mut sums = Vec::with_capacity(self.len());
        for ring in self.edges.windows(2) {
            let h = [ring[0], ring[1]].map(|theta| (0.5 * theta).sin().powi(2));
            for azimuth in 0..AZIMUTHS {
                let width = TAU / AZIMUTHS as f64;
                let phi = [azimuth as f64 * width, (azimuth + 1) as f64 * width];
                sums.push(settled_integral(&at, h, phi, 3e-6, SPLITS));
            }
        }
        sums
    }
}

/// Integral of `at` over a cell of (h, phi) in solid angle; `splits` bounds the recursion.
fn settled_integral(
    at: &dyn Fn(f64, f64) -> f64,
    h: [f64; 2],
    phi: [f64; 2],
    tolerance: f64,
    splits: u32,
) -> f64 {
    let solid_angle = 2.0 * (h[1] - h[0]) * (phi[1] - phi[0]);
    let mean = |n: u32| {
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let x = (f64::from(i) + 0.5) / f64::from(n);
                let y = (f64::from(j) + 0.5) / f64::from(n);
                sum += at(h[0] + (h[1] - h[0]) * x, phi[0] + (phi[1] - phi[0]) * y);
            }
        }
        sum / f64::from(n * n)
    };
    // Two splits at least: a density that ends along a ring near a cell's border escapes the comparison of a single cell.
    if splits + 2 <= SPLITS {
        let (coarse, fine) = (mean(2), mean(3));
        if splits == 0 || (fine - coarse).abs() * solid_angle <= tolerance {
            return fine * solid_angle;
        }
    }
    let (hm, pm) = (0.5 * (h[0] + h[1]), 0.5 * (phi[0] + phi[1]));
    [[h[0], hm], [hm, h[1]]]
        .into_iter()
        .flat_map(|h| [[phi[0], pm], [pm, phi[1]]].map(|phi| (h, phi)))
        .map(|(h, phi)| settled_integral(at, h, phi, 0.25 * tolerance, splits - 1))
        .sum()
}

/// Pearson's statistic as a number of standard deviations of its chi-squared distribution (Wilson and Hilferty 1931), sparse bins
/// pooled. The last bin of both is "anything else".
fn chi_squared_z(expected: &[f64], observed: &[u32]) -> f64 {
    let (mut statistic, mut degrees) = (0.0, -1.0);
    let (mut pool_expected, mut pool_observed) = (0.0, 0.0);
    for (e, o) in expected.iter().zip(observed) {
        if *e < 10.0 {
            pool_expected += e;
            pool_observed += f64::from(*o);
        } else {
            statistic += (f64::from(*o) - e).powi(2) / e;
            degrees += 1.0;
        }
    }
    if pool_expected > 5.0 {
        statistic += (pool_observed - pool_expected).powi(2) / pool_expected;
        degrees += 1.0;
    } else if pool_observed > 30.0 {
        return f64::INFINITY;
    }
    if degrees < 1.0 {
        return 0.0;
    }
    let v = 2.0 / (9.0 * degrees);
    ((statistic / degrees).cbrt() - (1.0 - v)) / v.sqrt()
}

/// Draws from `sampled`, expects the density of `claimed`.
fn agreement(sampled: &Surface, claimed: &Surface, wo: Vec3, bins: &Bins, seed: u64) -> f64 {
    const COUNT: u32 = 60_000;
    let mut random = Random::new(seed);
    let mut observed = vec![0u32; bins.len() + 1];
    let outside = bins.len();
    for _ in 0..COUNT {
        let sample = bsdf_sample(sampled, wo, random.triple());
        let bin = if sample.valid && !sample.delta {
            bins.index(sample.wi).unwrap_or(outside)
        } else {
            outside
        };
        observed[bin] += 1;
    }
    let mut expected: Vec<f64> = bins
        .integrate(&|wi| f64::from(bsdf_eval(claimed, wo, wi).pdf))
        .into_iter()
        .map(|p| p * f64::from(COUNT))
        .collect();
    let inside: f64 = expected.iter().sum();
    assert!(
        inside < f64::from(COUNT) * 1.004,
        "pdf integrates to {}",
        inside / f64::from(COUNT)
    );
    expected.push((f64::from(COUNT) - inside).max(0.0));
    chi_squared_z(&expected, &observed)
}

#[test]
fn samples_follow_their_density() {
    let mut worst: f64 = 0.0;
    for (i, (name, surface)) in surfaces().into_iter().enumerate() {
        for (j, theta) in ANGLES.into_iter().enumerate() {
            let wo = wo_at(&surface, theta);
            let seen = seen_from(&surface, wo);
            let z = agreement(
                &seen,
                &seen,
                wo,
                &Bins::sphere(seen.ng),
                (i * 10 + j) as u64 + 1,
            );
            worst = worst.max(z);
            assert!(
                z < 5.0,
                "{name} alpha {} at {theta}: z = {z}",
                seen.ggx_alpha
            );
        }
    }
    // Negative controls: a few per cent in roughness or index are found out.
    for (sampled, claimed) in [
        (metal(0.25), metal(0.27)),
        (
            glass(0.25, true),
            Surface {
                ior: 1.55,
                ..glass(0.25, true)
            },
        ),
        (sheet(0.25), sheet(0.27)),
        (coated(0.5, 0.2), coated(0.5, 0.3)),
    ] {
        let wo = wo_at(&sampled, 1.2);
        let z = agreement(&sampled, &claimed, wo, &Bins::sphere(sampled.ng), 99);
        assert!(z > 8.0, "{z}");
    }
    eprintln!("largest z {worst:.2}");
}

#[test]
fn narrow_peaks_follow_their_density() {
    for (i, alpha) in [0.002f32, 0.01, 0.03].into_iter().enumerate() {
        for (j, theta) in [0.05, 0.6, 1.2].into_iter().enumerate() {
            let seed = (i * 10 + j) as u64 + 500;
            let wo = wo_at(&metal(alpha), theta);
            let n = metal(alpha).ns;
            let mirror = n * (2.0 * n.dot(wo)) - wo;
            let width = f64::from(alpha);
            let z = agreement(
                &metal(alpha),
                &metal(alpha),
                wo,
                &Bins::peak(mirror, width),
                seed,
            );
            assert!(z < 5.0, "metal {alpha} at {theta}: {z}");
            for front in [true, false] {
                let s = glass(alpha, front);
                let straight = bsdf_sample(&glass(0.0, front), wo, [0.999, 0.5, 0.5]);
                if !straight.transmitted {
                    continue;
                }
                let z = agreement(&s, &s, wo, &Bins::peak(straight.wi, width * 0.5), seed);
                assert!(z < 5.0, "glass {alpha} {front} at {theta}: {z}");
                let other = glass(alpha * 1.1, front);
                let z = agreement(&s, &other, wo, &Bins::peak(straight.wi, width * 0.5), seed);
                assert!(z > 8.0, "negative control: {z}");
            }
        }
    }
}
