//! Every lobe against its own density, against independent f64 integrals, and at the edges of its range.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, Vec3};

use super::{Random, around, plain_surface};
use crate::material::normal::valid_shading_normal;
use crate::material::{
    Surface, bsdf_albedo, bsdf_directional_albedo_bound, bsdf_eval, bsdf_is_delta, bsdf_sample,
};
use crate::packed::{MATERIAL_LAMBERTIAN, MATERIAL_THIN_WALLED, MATERIAL_UNLIT};

fn lambertian() -> Surface {
    Surface {
        specular: 0.0,
        flags: MATERIAL_LAMBERTIAN,
        ..plain_surface()
    }
}

fn metal(alpha: f32) -> Surface {
    Surface {
        metallic: 1.0,
        ggx_alpha: alpha,
        ..plain_surface()
    }
}

fn plastic(alpha: f32) -> Surface {
    Surface {
        base_color: Vec3::new(0.8, 0.5, 0.2),
        ggx_alpha: alpha,
        ..plain_surface()
    }
}

fn glass(alpha: f32, front: bool) -> Surface {
    Surface {
        transmission: 1.0,
        ggx_alpha: alpha,
        front,
        ..plain_surface()
    }
}

fn sheet(alpha: f32) -> Surface {
    Surface {
        flags: MATERIAL_THIN_WALLED,
        ..glass(alpha, true)
    }
}

fn coated(alpha: f32, coat_alpha: f32) -> Surface {
    Surface {
        clearcoat: 0.9,
        coat_alpha,
        ..plastic(alpha)
    }
}

/// Everything at once.
fn mixture(front: bool) -> Surface {
    Surface {
        base_color: Vec3::new(0.9, 0.6, 0.3),
        metallic: 0.3,
        transmission: 0.5,
        specular: 0.7,
        specular_color: Vec3::new(1.0, 0.6, 0.8),
        ggx_alpha: 0.3,
        clearcoat: if front { 0.5 } else { 0.0 },
        coat_alpha: 0.1,
        front,
        ..plain_surface()
    }
}

fn surfaces() -> Vec<(&'static str, Surface)> {
    let mut list = vec![
        ("lambertian", lambertian()),
        ("mixture", mixture(true)),
        ("mixture from inside", mixture(false)),
        ("coated", coated(0.5, 0.2)),
        ("smooth coat", coated(0.5, 0.0)),
        ("smooth plastic", plastic(0.0)),
        (
            "tinted specular glass",
            Surface {
                specular: 0.5,
                specular_color: Vec3::new(0.2, 0.6, 1.0),
                base_color: Vec3::new(0.7, 0.8, 0.9),
                ..glass(0.2, true)
            },
        ),
        (
            "nearly matched glass",
            Surface {
                ior: 1.000_1,
                ..glass(0.3, true)
            },
        ),
    ];
    for alpha in [0.09, 0.25, 1.0] {
        list.push(("metal", metal(alpha)));
        list.push(("plastic", plastic(alpha)));
        list.push(("glass", glass(alpha, true)));
        list.push(("glass from inside", glass(alpha, false)));
        list.push(("sheet", sheet(alpha)));
    }
    let mut tilted = mixture(true);
    tilted.ns = around(tilted.ng, 0.3, 1.0);
    list.push(("tilted normal", tilted));
    let mut tilted = lambertian();
    tilted.ns = around(tilted.ng, 0.6, 1.0);
    list.push(("tilted lambertian", tilted));
    list
}

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

/// wo at an angle from the normal, on the side that the surface accepts.
fn wo_at(s: &Surface, theta: f64) -> Vec3 {
    around(s.ng, theta, 0.7)
}

/// `s` with the normals that `surface_at` would give it for this direction.
fn seen_from(s: &Surface, wo: Vec3) -> Surface {
    let mut seen = *s;
    if s.flags & MATERIAL_LAMBERTIAN == 0 {
        seen.ns = valid_shading_normal(s.ng, s.ns, wo);
        seen.coat_ns = valid_shading_normal(s.ng, s.coat_ns, wo);
    }
    seen
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

#[test]
fn weights_are_value_over_density_and_bounded() {
    let mut random = Random::new(7);
    let mut largest: f32 = 0.0;
    for (name, surface) in surfaces() {
        for _ in 0..5000 {
            let grazing = 10f64.powf(f64::from(random.range(-6.0, 0.19)));
            let wo = wo_at(&surface, FRAC_PI_2 - grazing);
            if wo.dot(surface.ng) <= 0.0 {
                continue;
            }
            let seen = seen_from(&surface, wo);
            let sample = bsdf_sample(&seen, wo, random.triple());
            if !sample.valid {
                assert_eq!(sample.weight, Vec3::ZERO);
                continue;
            }
            assert!(
                sample.weight.is_finite() && sample.wi.is_finite(),
                "{name} {wo}"
            );
            assert!((sample.wi.length() - 1.0).abs() < 1e-5);
            assert_eq!(sample.transmitted, sample.wi.dot(seen.ng) < 0.0, "{name}");
            largest = largest.max(sample.weight.max_element());
            if sample.delta {
                assert_eq!(sample.pdf, 0.0);
                continue;
            }
            let eval = bsdf_eval(&seen, wo, sample.wi);
            assert!((eval.pdf / sample.pdf - 1.0).abs() < 1e-5, "{name}");
            let product = sample.weight * sample.pdf;
            let error = (eval.f_cos - product).abs().max_element();
            assert!(error <= 2e-6 * eval.f_cos.max_element(), "{name} {error}");
        }
    }
    assert!(largest < 3.0, "{largest}");
}

#[test]
fn nothing_is_ever_non_finite() {
    let mut random = Random::new(8);
    let edge = [0.0f32, 1e-6, 1e-3, 0.5, 0.999, 1.0];
    let pick = |random: &mut Random, list: &[f32]| list[random.bits() as usize % list.len()];
    for _ in 0..200_000 {
        let mut s = plain_surface();
        s.ng = random.direction();
        let wo = around(
            s.ng,
            FRAC_PI_2 - 10f64.powf(f64::from(random.range(-7.0, 0.19))),
            f64::from(random.range(0.0, 6.2)),
        );
        if wo.dot(s.ng) <= 0.0 {
            continue;
        }
        s.ns = valid_shading_normal(s.ng, random.direction(), wo);
        s.coat_ns = valid_shading_normal(s.ng, random.direction(), wo);
        s.base_color = Vec3::new(
            pick(&mut random, &edge),
            pick(&mut random, &edge),
            pick(&mut random, &edge),
        );
        s.metallic = pick(&mut random, &edge);
        s.transmission = pick(&mut random, &edge);
        s.ggx_alpha = pick(&mut random, &edge);
        s.coat_alpha = pick(&mut random, &edge);
        s.clearcoat = pick(&mut random, &edge);
        s.specular = pick(&mut random, &edge);
        s.specular_color = Vec3::new(pick(&mut random, &[0.0, 1.0, 30.0]), 1.0, 0.0);
        s.ior = pick(
            &mut random,
            &[0.0, 0.5, 1.0, 1.000_01, 1.000_1, 1.5, 3.0, 100.0],
        );
        s.front = random.bits() & 1 == 0;
        s.flags = if random.bits() & 1 == 0 {
            MATERIAL_THIN_WALLED
        } else {
            0
        };
        let u = [
            pick(&mut random, &[0.0, 0.3, 0.7, 0.999_999_94]),
            pick(&mut random, &[0.0, 0.3, 0.7, 0.999_999_94]),
            pick(&mut random, &[0.0, 0.3, 0.7, 0.999_999_94]),
        ];
        let sample = bsdf_sample(&s, wo, u);
        let ok = sample.weight.is_finite() && sample.wi.is_finite() && sample.pdf.is_finite();
        assert!(
            ok && sample.weight.min_element() >= 0.0,
            "{s:?} {wo} {u:?} {sample:?}"
        );
        assert!(
            sample.weight.max_element() < 110.0,
            "{s:?} {wo} {u:?} {sample:?}"
        );
        for wi in [
            random.direction(),
            -wo,
            wo,
            sample.wi,
            around(s.ng, FRAC_PI_2, 1.0),
        ] {
            let eval = bsdf_eval(&s, wo, wi);
            let ok = eval.f_cos.is_finite() && eval.pdf.is_finite() && eval.pdf >= 0.0;
            assert!(
                ok && eval.f_cos.min_element() >= 0.0,
                "{s:?} {wo} {wi} {eval:?}"
            );
        }
        let albedo = bsdf_albedo(&s, wo);
        assert!(albedo.is_finite() && albedo.max_element() <= 1.0 && albedo.min_element() >= 0.0);
    }
}

/// Mean weight of samples: the directional albedo, and its standard error.
fn albedo(s: &Surface, wo: Vec3, count: u32, seed: u64) -> (f64, f64) {
    let mut random = Random::new(seed);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let x = f64::from(bsdf_sample(s, wo, random.triple()).weight.x);
        sum += x;
        squares += x * x;
    }
    let mean = sum / f64::from(count);
    let variance = (squares / f64::from(count) - mean * mean).max(0.0);
    (mean, (variance / f64::from(count)).sqrt())
}

#[test]
fn white_bodies_vanish_in_a_furnace() {
    let mut random = Random::new(11);
    let mut tilted = lambertian();
    tilted.ns = around(tilted.ng, 0.5, 2.0);
    let tinted = Surface {
        base_color: Vec3::splat(0.9),
        ..metal(0.0)
    };
    for _ in 0..20_000 {
        let wo = around(
            lambertian().ng,
            f64::from(random.range(0.0, 1.57)),
            f64::from(random.range(0.0, 6.2)),
        );
        let u = random.triple();
        for s in [
            lambertian(),
            tilted,
            metal(0.0),
            glass(0.0, true),
            glass(0.0, false),
            sheet(0.0),
        ] {
            let sample = bsdf_sample(&s, wo, u);
            assert!(sample.valid, "{s:?} {wo}");
            assert_eq!(sample.weight, Vec3::ONE, "{s:?} {wo}");
        }
        for ior in [1.0, 1.000_1, 2.4] {
            let sample = bsdf_sample(
                &Surface {
                    ior,
                    ..glass(0.0, true)
                },
                wo,
                u,
            );
            assert_eq!(sample.weight, Vec3::ONE);
            if ior == 1.0 {
                assert_eq!(sample.wi, -wo);
            }
        }
        // Negative control.
        assert!(bsdf_sample(&tinted, wo, u).weight.x < 1.0);
    }
}

/// glTF 2.0, appendix B, in f64 from the formulas as printed: D, separable G, Schlick.
fn spec_brdf(s: &Surface, no: f64, ni: f64, nh: f64, oh: f64) -> f64 {
    let a2 = f64::from(s.ggx_alpha).powi(2);
    let d = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
    let g1 = |c: f64| 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
    let specular = d * g1(no) * g1(ni) / (4.0 * no * ni);
    let schlick = |f0: f64| f0 + (1.0 - f0) * (1.0 - oh).powi(5);
    let base = f64::from(s.base_color.x);
    let f0 = ((f64::from(s.ior) - 1.0) / (f64::from(s.ior) + 1.0)).powi(2);
    let f_max = schlick(f0);
    let dielectric = (1.0 - f_max) * base / PI + f_max * specular;
    let m = f64::from(s.metallic);
    m * schlick(base) * specular + (1.0 - m) * dielectric
}

/// Integral of `spec_brdf` times cosine over the hemisphere, in half-vector coordinates so that narrow lobes are resolved.
fn spec_albedo(s: &Surface, theta_o: f64) -> f64 {
    let wo = DVec3::new(theta_o.sin(), 0.0, theta_o.cos());
    let a = f64::from(s.ggx_alpha);
    let (rings, azimuths) = (2000, 500);
    let mut sum = 0.0;
    for i in 0..rings {
        // tan^2 = a^2 x / (1 - x): GGX's own distribution of angles; the weight below undoes it.
        let x = (f64::from(i) + 0.5) / f64::from(rings);
        let tan2 = a * a * x / (1.0 - x);
        let nh = 1.0 / (1.0 + tan2).sqrt();
        let sh = (1.0 - nh * nh).max(0.0).sqrt();
        let density = a * a / (PI * (nh * nh * (a * a - 1.0) + 1.0).powi(2)) * nh;
        for j in 0..azimuths {
            let phi = TAU * (f64::from(j) + 0.5) / f64::from(azimuths);
            let h = DVec3::new(sh * phi.cos(), sh * phi.sin(), nh);
            let oh = wo.dot(h);
            let wi = h * (2.0 * oh) - wo;
            if oh <= 0.0 || wi.z <= 0.0 {
                continue;
            }
            sum += spec_brdf(s, wo.z, wi.z, nh, oh) * wi.z * 4.0 * oh / density;
        }
    }
    sum / f64::from(rings * azimuths)
}

#[test]
fn directional_albedos_are_the_specifications() {
    let half_metal = Surface {
        metallic: 0.5,
        ..plastic(0.4)
    };
    for (i, s) in [
        metal(0.04),
        metal(0.25),
        metal(1.0),
        plastic(0.25),
        plastic(1.0),
        half_metal,
    ]
    .into_iter()
    .enumerate()
    {
        for theta in [0.2, 1.0, 1.4] {
            let expected = spec_albedo(&s, theta);
            let (mean, error) = albedo(&s, wo_at(&s, theta), 100_000, i as u64);
            let tolerance = 4.5 * error + 3e-4;
            assert!(
                (mean - expected).abs() < tolerance,
                "alpha {} at {theta}: {mean} +- {error}, {expected}",
                s.ggx_alpha
            );
            if s.ggx_alpha >= 0.2 {
                let other = Surface {
                    ggx_alpha: s.ggx_alpha * 0.8,
                    ior: 1.8,
                    ..s
                };
                let wrong = spec_albedo(&other, theta);
                // Negative control wherever roughness or index matters at all.
                if (wrong - expected).abs() > 2.0 * tolerance {
                    assert!((mean - wrong).abs() > tolerance);
                }
            }
        }
    }
}

#[test]
fn no_energy_is_made_by_glass_metal_or_coat() {
    let mut largest: f64 = 0.0;
    for (name, s) in surfaces().into_iter().chain([(
        "white",
        Surface {
            ggx_alpha: 0.0,
            ..plain_surface()
        },
    )]) {
        let conserves = s.transmission == 1.0 || s.metallic == 1.0 || name == "lambertian";
        for theta in [0.1, 1.0, 1.4, 1.55, FRAC_PI_2 - 1e-4] {
            let wo = wo_at(&s, theta);
            let (mean, error) = albedo(&seen_from(&s, wo), wo, 20_000, 3);
            let slack = 1e-5 + 4.0 * error;
            assert!(
                !conserves || mean <= 1.0 + slack,
                "{name} at {theta}: {mean}"
            );
            let bound = f64::from(bsdf_directional_albedo_bound(&s));
            assert!(mean <= bound + slack, "{name} at {theta}: {mean} {bound}");
            largest = largest.max(mean);
        }
    }
    // Negative control: a smooth white dielectric does exceed 1 at grazing angles, as glTF defines it.
    assert!(largest > 1.5, "{largest}");
}

#[test]
fn smooth_plastic_reflects_as_fresnel_says() {
    let s = plastic(0.0);
    let wo = wo_at(&s, 1.0);
    let mut random = Random::new(4);
    let (mut delta, mut diffuse) = (0.0, 0.0);
    let count = 200_000;
    for _ in 0..count {
        let sample = bsdf_sample(&s, wo, random.triple());
        if sample.delta {
            delta += f64::from(sample.weight.x);
        } else {
            diffuse += f64::from(sample.weight.x);
        }
    }
    let expected = 0.04 + 0.96 * (1.0 - 1.0f64.cos()).powi(5);
    assert!((delta / f64::from(count) - expected).abs() < 1e-3);
    // What bsdf_albedo says, to its approximation.
    let total = (delta + diffuse) / f64::from(count);
    assert!((total - f64::from(bsdf_albedo(&s, wo).x)).abs() < 0.03);
}

#[test]
fn scattering_is_reciprocal() {
    let mut random = Random::new(12);
    let mut checked = 0;
    for _ in 0..20_000 {
        for s in [
            lambertian(),
            metal(0.3),
            plastic(0.3),
            sheet(0.3),
            glass(0.4, true),
        ] {
            let wo = random.direction();
            let wo = if wo.dot(s.ng) < 0.0 { -wo } else { wo };
            let wi = random.direction();
            let (no, ni) = (wo.dot(s.ng), wi.dot(s.ng).abs());
            if no < 1e-2 || ni < 1e-2 {
                continue;
            }
            let forward = bsdf_eval(&s, wo, wi).f_cos / ni;
            let mut turned = s;
            let mut index2 = 1.0;
            if wi.dot(s.ng) < 0.0 {
                turned.ng = -s.ng;
                turned.ns = -s.ns;
                if s.flags & MATERIAL_THIN_WALLED == 0 {
                    turned.front = !s.front;
                    // f / n_i^2 is symmetric.
                    index2 = s.ior * s.ior;
                }
            }
            let backward = bsdf_eval(&turned, wi, wo).f_cos / no * index2;
            if forward.max_element() < 1e-5 {
                continue;
            }
            checked += 1;
            let error = (forward - backward).abs().max_element();
            assert!(
                error < 2e-3 * forward.max_element() + 1e-5,
                "{s:?} {wo} {wi} {forward} {backward}"
            );
        }
    }
    assert!(checked > 20_000);
    // Negative control: a coat, weighted by one direction's Fresnel factor as the extension defines it, is not reciprocal.
    let s = coated(0.5, 0.2);
    let (a, b) = (wo_at(&s, 1.4), around(s.ng, 0.2, 2.0));
    let forward = bsdf_eval(&s, a, b).f_cos.x / b.dot(s.ng);
    let backward = bsdf_eval(&s, b, a).f_cos.x / a.dot(s.ng);
    assert!((forward / backward - 1.0).abs() > 0.05);
}

#[test]
fn kinds_of_surfaces_are_told_apart() {
    assert!(bsdf_is_delta(&metal(0.0)) && bsdf_is_delta(&glass(0.0, true)));
    assert!(bsdf_is_delta(&sheet(0.0)));
    assert!(!bsdf_is_delta(&metal(0.01)) && !bsdf_is_delta(&plastic(0.0)));
    assert!(!bsdf_is_delta(&lambertian()) && !bsdf_is_delta(&coated(0.0, 0.1)));
    let unlit = Surface {
        flags: MATERIAL_UNLIT,
        ..plain_surface()
    };
    assert!(bsdf_is_delta(&unlit));
    assert!(!bsdf_sample(&unlit, unlit.ng, [0.5; 3]).valid);
    assert_eq!(bsdf_eval(&unlit, unlit.ng, unlit.ng).f_cos, Vec3::ZERO);
    assert_eq!(bsdf_albedo(&unlit, unlit.ng), Vec3::ZERO);
}
