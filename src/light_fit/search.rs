//! From coarse to fine: rotation and sun in turns, and what of them is kept.

use std::sync::Arc;

use super::comparisons::{Comparisons, Costs};
use super::directions::{directions, light_by_rotation};
use super::fitter::{Candidate, Fitter, STRIDE, Strengths, Sun};
use super::points::Grid;
use super::rays::{Openness, sunlight};
use super::residual::median_around;
use super::verdict::{Gain, LEAST_SIGNIFICANCE, LEAST_SIGNIFICANCE_OF_KNOWN_ROTATION};
use super::{Explained, FitOptions, Fitted, FittedSun, LightFit, ScaleBasis, Shadows};
use crate::math::luminance;
use crate::packed::{MATERIAL_PHOTO_ALBEDO, NONE, PHOTO_PATCHES, PackedScene};
use crate::refusal::Refusal;
use crate::scene::{Environment, EnvironmentMap, Exposure, LightKind, Scene, Side};
use crate::work::{Meter, Phase, Watcher};

/// Points that a fit needs.
const LEAST_POINTS: usize = 200;
/// Mean reflectances of a proxy that are believed, and the one that is taken else.
const ALBEDO_BELIEVED: [f64; 2] = [0.15, 0.65];
const ALBEDO_GUESSED: f64 = 0.4;
/// Rounds of sun and rotation in turns, each with the spread that the round before has left.
const ROUNDS: usize = 2;
/// What the grids of directions and points cannot tell, standard deviations in degrees; where the albedo is not known neither is how much light comes from
/// the proxy itself, which turned rotations by more.
const ROTATION_GRID_DEG: f64 = 1.5;
const ROTATION_UNKNOWN_ALBEDO_DEG: f64 = 6.0;
const SUN_GRID_DEG: f64 = 0.5;
/// The same of a sun's strength over the surroundings where the albedo is not known: suns came out 2 to 17% too weak.
const RATIO_UNKNOWN_ALBEDO: f64 = 0.1;
/// The same of the scale, relative: maps of known scale came out 0.3 to 0.8% off where all albedos were right.
const SCALE_GRID: f64 = 0.005;
/// Spread of ln of luminance that a search allows for at the least where albedos are known: most points of a floor in the sun are alike to a hundredth,
/// and so narrow a cost counts a shadow that lies between two directions no less than one that is not there.
const LEAST_SPREAD: f64 = 0.2;
/// What a watcher hears of: rays, irradiances, the rounds, and what is kept.
const STEPS: u64 = 4 + 2 * ROUNDS as u64 + 4;
/// One point of so many counts as shadowed.
const SHADOWED: usize = 20;

/// Fits the light of the scene to its photograph.
///
/// # Errors
/// There is no photograph or too little proxy in it, or lamps of the real world whose light is not fitted.
pub fn fit(scene: &Scene, options: FitOptions, watcher: &Watcher<'_>) -> Result<LightFit, Refusal> {
    let Some(photo) = &scene.photo else {
        return Err(
            "it has no photograph; expected one whose light is sought; name it as `image` in [photo]"
                .into(),
        );
    };
    let mut lamps = scene.lights.iter().filter(|light| light.side == Side::Real);
    if lamps.any(|light| !matches!(light.kind, LightKind::Directional { .. })) {
        return Err("it has lamps near by, which are not fitted; expected an environment and directional lights alone in the real world; take the lamps out".into());
    }
    let packed = real_world(scene, watcher)?;
    let grid = Arc::new(Grid::of(&packed, photo));
    if grid.points.len() < LEAST_POINTS {
        return Err(format!(
            "the camera sees matt proxy, neither clipped nor dark, at {} points of the {LEAST_POINTS} that a fit needs; expected a proxy of what the photograph shows; add [[real]] objects, or correct the camera",
            grid.points.len()
        )
        .into());
    }
    let meter = Meter::begin(watcher, Phase::FittingLight, STEPS);
    let directions = directions();
    let openness = Openness::of(&packed, &grid, &directions);
    meter.add(2);
    let comparisons = Comparisons::of(&grid);
    let white = Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    };
    let own = scene.environment.as_ref().filter(|_| !options.white_sky);
    let environment = own.unwrap_or(&white);
    let irradiance = |environment: &Environment| {
        let light = light_by_rotation(environment, &directions);
        openness.irradiance(&grid.points, &directions, &light)
    };
    let surroundings = irradiance(environment);
    meter.add(2);
    if surroundings.iter().flatten().all(|light| *light == 0.0) {
        return Err("its environment is black where it could light the proxy; expected light; give [environment] a `radiance` or an `image`".into());
    }
    let mut search = Search {
        scene,
        keeps_rotation: options.keep_rotation,
        environment,
        is_white_sky: own.is_none(),
        white_sky: irradiance(&white).swap_remove(0),
        fitter: Fitter {
            scene: &packed,
            grid: &grid,
            directions: &directions,
            openness: &openness,
            comparisons: &comparisons,
            surroundings,
            fixed: openness.from_proxy.clone(),
            mean_albedo: ALBEDO_GUESSED,
            sigma: 1.0,
        },
    };
    let fit = search.run(&grid, &meter);
    meter.end();
    Ok(fit)
}

/// Without virtual objects and lamps; albedo from the photograph is not known yet.
fn real_world(scene: &Scene, watcher: &Watcher<'_>) -> Result<PackedScene, Refusal> {
    let mut real = scene.clone();
    real.objects.retain(|object| object.side == Side::Real);
    real.lights.clear();
    let mut packed =
        PackedScene::build(&real, watcher).map_err(|problem| Refusal::from(problem.to_string()))?;
    if (packed.materials.iter()).any(|m| m.flags & MATERIAL_PHOTO_ALBEDO != 0) {
        let objects = (packed.triangles.iter())
            .filter(|triangle| triangle.object != NONE)
            .map(|triangle| triangle.object + 1)
            .max();
        let pixels = packed.frame.width * packed.frame.height;
        let records = pixels + objects.unwrap_or(0) * 2 * PHOTO_PATCHES;
        packed.photo_albedo = vec![[0.5, 0.5, 0.5, 0.0]; records as usize];
    }
    Ok(packed)
}

struct Search<'a> {
    scene: &'a Scene,
    environment: &'a Environment,
    is_white_sky: bool,
    keeps_rotation: bool,
    white_sky: Vec<f32>,
    fitter: Fitter<'a>,
}

fn least(candidates: &[Candidate]) -> &Candidate {
    let best = candidates
        .iter()
        .min_by(|a, b| a.cost().total_cmp(&b.cost()));
    best.expect("something was tried")
}

impl Search<'_> {
    fn run(&mut self, grid: &Arc<Grid>, meter: &Meter<'_>) -> LightFit {
        self.fitter.sigma = {
            let flat = vec![0.0; self.fitter.fixed.len()];
            let off = self
                .fitter
                .comparisons
                .median_of_known(&flat)
                .unwrap_or(0.0);
            let flat = vec![off as f32; flat.len()];
            self.fitter.comparisons.spread(&flat)
        };
        self.fitter.sigma = self.fitter.sigma.max(self.least_sigma());
        let (given, basis) = self.as_given();
        let given_deg = self.environment.rotation_deg;
        let turns = self.fitter.surroundings.len() > 1 && !self.keeps_rotation;
        let mut rotation_deg = given_deg;
        let mut suns = Vec::new();
        for round in 0..ROUNDS {
            suns = match turns && round == 0 {
                true => self.fitter.suns_under_any_rotation(),
                false => self.fitter.suns(rotation_deg),
            };
            meter.add(1);
            let mut best = least(&suns).clone();
            if turns {
                let turned = self.fitter.rotations(best.sun.map(|sun| sun.direction));
                best = least(&turned).clone();
                rotation_deg = best.rotation_deg;
            }
            self.fitter.sigma = self.spread_of(&best).max(self.least_sigma());
            meter.add(1);
        }
        // With the last spread, costs are comparable.
        let flat = self.fitter.flat();
        let alone = self.without_sun(turns);
        suns.clear();
        suns.extend(self.fitter.suns(rotation_deg));
        meter.add(1);
        let gain_of_sun = Gain::of(&suns, &alone, &flat, LEAST_SIGNIFICANCE);
        let mut sun = gain_of_sun.is_real().then(|| least(&suns).sun).flatten();
        let mut gain_of_rotation = None;
        if turns {
            let turned = match sun {
                Some(sun) => self.fitter.rotations(Some(sun.direction)),
                None => alone.clone(),
            };
            let kept = [self
                .fitter
                .candidate(given_deg, sun.map(|sun| sun.direction))];
            let needed = self.least_significance_of_rotation();
            let gain = Gain::of(&turned, &kept, &flat, needed);
            gain_of_rotation = Some(gain);
            if gain.is_real() {
                rotation_deg = between(&turned);
            } else {
                rotation_deg = given_deg;
                if sun.is_some() {
                    suns = self.fitter.suns(given_deg);
                    sun = least(&suns).sun;
                }
            }
        }
        meter.add(1);
        let sun = sun.map(|sun| self.fitter.refine_sun(rotation_deg, sun));
        meter.add(1);
        let candidates = match sun {
            Some(_) => suns,
            None => vec![self.fitter.candidate(rotation_deg, None)],
        };
        let gain = Gain::over_flat(&candidates, &flat);
        let white = [self.fitter.of_light(&self.white_sky)];
        let gain_of_white_sky = Gain::of(&white, &candidates, &flat, LEAST_SIGNIFICANCE);
        let strengths = self.strengths(rotation_deg, sun);
        let sun = sun.map(|sun| Sun {
            ratio: strengths.ratio,
            ..sun
        });
        let errors = self
            .fitter
            .uncertainty((rotation_deg, turns), sun, strengths.scale);
        let [off_ratio, off_scale] = self.off_by_pairs(rotation_deg, sun);
        let scale = self.scene_scale(strengths.scale);
        let (model_deg, model_ratio) = match self.fitter.comparisons.are_absolute {
            true => (ROTATION_GRID_DEG, off_ratio),
            false => (ROTATION_UNKNOWN_ALBEDO_DEG, RATIO_UNKNOWN_ALBEDO),
        };
        let is_map = self.fitter.surroundings.len() > 1;
        LightFit {
            points: grid.points.len(),
            left_out: grid.left_out,
            scale: Fitted {
                was: self.environment.scale,
                is: scale,
                sigma: errors
                    .log_scale
                    .map(|sigma| sigma.hypot(SCALE_GRID).hypot(off_scale) * scale),
                is_kept: basis == ScaleBasis::Exposure,
            },
            scale_basis: basis,
            rotation_deg: is_map.then(|| match gain_of_rotation.is_some_and(|g| g.is_real()) {
                true => Fitted {
                    was: given_deg,
                    is: rotation_deg,
                    sigma: errors.rotation_deg.map(|sigma| sigma.hypot(model_deg)),
                    is_kept: false,
                },
                false => Fitted::kept(given_deg),
            }),
            sun: sun.map(|sun| FittedSun {
                direction: -sun.direction.as_dvec3(),
                irradiance: scale * sun.ratio,
                direction_sigma_deg: errors.sun_deg.map(|sigma| sigma.hypot(SUN_GRID_DEG)),
                irradiance_sigma: errors.log_ratio.map(|sigma| sigma.hypot(model_ratio)),
            }),
            gain_of_sun,
            gain_of_rotation,
            explained: self.explained(&given, &strengths.log_light, &flat),
            gain,
            gain_of_white_sky,
            is_white_sky: self.is_white_sky,
            shadows: self.shadows(&given, &strengths.log_light),
            texture: self.fitter.comparisons.typical_texture,
            mean_albedo: self.mean_albedo(&strengths.log_light),
            log_light: strengths.log_light,
            grid: Arc::clone(grid),
        }
    }

    /// The light as the scene has it, and what its scale follows from.
    fn as_given(&mut self) -> (Vec<f32>, ScaleBasis) {
        let surroundings = self.fitter.surroundings_at(self.environment.rotation_deg);
        let scale = self.environment.scale;
        let directional = self
            .scene
            .lights
            .iter()
            .filter_map(|light| match light.kind {
                LightKind::Directional {
                    direction,
                    irradiance,
                } if light.side == Side::Real => {
                    let towards = -glam::DVec3::from(direction).as_vec3();
                    Some((towards, luminance(irradiance.into())))
                }
                _ => None,
            });
        let mut light: Vec<f32> = surroundings
            .iter()
            .map(|light| light * scale as f32)
            .collect();
        for (towards, irradiance) in directional {
            let sunlight = sunlight(self.fitter.scene, &self.fitter.grid.points, towards);
            for (light, sunlight) in light.iter_mut().zip(sunlight) {
                *light += irradiance * sunlight;
            }
        }
        let basis = match self.scene.settings.exposure {
            Exposure::Auto => ScaleBasis::Exposure,
            Exposure::Ev(_) if self.fitter.comparisons.are_absolute => ScaleBasis::Albedo,
            Exposure::Ev(ev) => {
                let exposed = |light: &f32| light * ev.exp2() as f32;
                let pairs = light.iter().map(exposed).zip(&self.fitter.fixed);
                let log_light: Vec<f32> =
                    pairs.map(|(light, fixed)| (light + fixed).ln()).collect();
                let albedo = self.mean_albedo(&log_light);
                match (ALBEDO_BELIEVED[0]..=ALBEDO_BELIEVED[1]).contains(&albedo) {
                    true => {
                        self.fitter.mean_albedo = albedo;
                        ScaleBasis::SameReflectance
                    }
                    false => ScaleBasis::GuessedReflectance,
                }
            }
        };
        (light, basis)
    }

    /// What the points reflect of the light in the mean.
    fn mean_albedo(&self, log_light: &[f32]) -> f64 {
        let points = &self.fitter.grid.points;
        let shown: f64 = (points.iter())
            .map(|p| f64::from(luminance(p.shown.into())))
            .sum();
        let light: f64 = log_light.iter().map(|log| f64::from(log.exp())).sum();
        shown * std::f64::consts::PI / light.max(1e-12)
    }

    fn without_sun(&self, turns: bool) -> Vec<Candidate> {
        match turns {
            true => self.fitter.rotations(None),
            false => vec![self.fitter.candidate(self.environment.rotation_deg, None)],
        }
    }

    fn strengths(&self, rotation_deg: f64, sun: Option<Sun>) -> Strengths {
        let surroundings = self.fitter.surroundings_at(rotation_deg);
        let points = &self.fitter.grid.points;
        let light = sun.map(|sun| {
            (
                sunlight(self.fitter.scene, points, sun.direction),
                sun.ratio,
            )
        });
        let sun = light.as_ref().map(|(light, ratio)| (&light[..], *ratio));
        self.fitter.strengths(&surroundings, sun)
    }

    /// Where albedos are known: what two ways to tell the strength of a sun differ by. Their errors have causes of their own.
    fn off_by_pairs(&self, rotation_deg: f64, sun: Option<Sun>) -> [f64; 2] {
        let Some(sun) = sun.filter(|_| self.fitter.comparisons.are_absolute) else {
            return [0.0; 2];
        };
        let sunlight = sunlight(self.fitter.scene, &self.fitter.grid.points, sun.direction);
        let surroundings = self.fitter.surroundings_at(rotation_deg);
        (self.fitter).off_by_pairs(&surroundings, &sunlight, sun.ratio)
    }

    fn least_significance_of_rotation(&self) -> f64 {
        match self.fitter.comparisons.are_absolute {
            true => LEAST_SIGNIFICANCE_OF_KNOWN_ROTATION,
            false => LEAST_SIGNIFICANCE,
        }
    }

    /// In textures.
    fn least_sigma(&self) -> f64 {
        match self.fitter.comparisons.are_absolute {
            true => LEAST_SPREAD / self.fitter.comparisons.typical_texture.max(1e-3),
            false => 0.0,
        }
    }

    fn spread_of(&self, candidate: &Candidate) -> f64 {
        let strengths = self.strengths(candidate.rotation_deg, candidate.sun);
        self.fitter.comparisons.spread(&strengths.log_light)
    }

    /// The scale as the scene file has it, of one in the photograph's units.
    fn scene_scale(&self, scale: f64) -> f64 {
        match self.scene.settings.exposure {
            Exposure::Ev(ev) => scale / ev.exp2(),
            Exposure::Auto if self.environment.scale > 0.0 => self.environment.scale,
            Exposure::Auto => 1.0,
        }
    }

    fn shadows(&self, given: &[f32], fitted: &[f32]) -> Shadows {
        let grid = self.fitter.grid;
        let over_around = |log: &[f32]| -> Vec<f32> {
            let points = 0..log.len();
            points
                .map(|at| log[at] - median_around(grid, log, at))
                .collect()
        };
        let of_light = |light: &[f32]| over_around(&self.fitter.strengths(light, None).log_light);
        let by_white_sky = of_light(&self.white_sky);
        let mut darkest: Vec<usize> = (0..by_white_sky.len()).collect();
        darkest.sort_by(|a, b| by_white_sky[*a].total_cmp(&by_white_sky[*b]));
        darkest.truncate(darkest.len().div_ceil(SHADOWED));
        let median = |over: &[f32]| {
            let mut values: Vec<f32> = darkest.iter().map(|at| over[*at]).collect();
            let middle = values.len() / 2;
            f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1).exp()
        };
        let shown: Vec<f32> = (grid.points.iter()).map(|p| p.log_shown() as f32).collect();
        Shadows {
            in_photograph: median(&over_around(&shown)),
            as_given: median(&of_light(given)),
            by_white_sky: median(&by_white_sky),
            fitted: median(&over_around(fitted)),
        }
    }

    fn explained(&self, given: &[f32], fitted: &[f32], flat: &Costs) -> Explained {
        let fitter = &self.fitter;
        let all: f64 = flat.iter().sum();
        let share = |log_light: &[f32]| {
            1.0 - fitter.comparisons.cost(log_light, fitter.sigma, STRIDE) / all.max(1e-12)
        };
        Explained {
            as_given: share(&fitter.strengths(given, None).log_light),
            by_white_sky: share(&fitter.strengths(&self.white_sky, None).log_light),
            fitted: share(fitted),
        }
    }
}

/// Of rotations in steps, where the parabola through the best and its neighbours is least.
fn between(turned: &[Candidate]) -> f64 {
    let costs: Vec<f64> = turned.iter().map(Candidate::cost).collect();
    let n = costs.len();
    let best = (0..n)
        .min_by(|a, b| costs[*a].total_cmp(&costs[*b]))
        .unwrap_or(0);
    let (before, at, after) = (
        costs[(best + n - 1) % n],
        costs[best],
        costs[(best + 1) % n],
    );
    let curvature = before - 2.0 * at + after;
    let step = match curvature > 0.0 {
        true => (0.5 * (before - after) / curvature).clamp(-0.5, 0.5),
        false => 0.0,
    };
    turned[best].rotation_deg + step * 360.0 / n as f64
}
