//! What precedes the first sample: after the scene is packed, or after an edit.

use super::backend::Backend;
use super::core::{Core, photo_of_size};
use super::stopwatch::Stopwatch;
use super::{RenderError, Renderer, photo_albedo};
use crate::cpu::{self, LensGrid};
use crate::film::Film;
use crate::gpu::Changed;
use crate::packed::{FRAME_AOVS, MATERIAL_PHOTO_ALBEDO, PackedScene};
use crate::scene::{BackendChoice, Composite, Exposure, Scene};
use crate::work::{Meter, Phase, Place, Watcher};

/// Share of the proxy's pixels above which a limited albedo is told.
const MOSTLY: f64 = 0.5;

/// The `exposure_ev` that "auto" would take, from a few rays; `None`: it is "auto", there is no photograph, or the camera sees no lit proxy.
///
/// # Errors
/// The scene does not fit the packed form.
pub fn roughly_fitted_exposure_ev(scene: &Scene) -> Result<Option<f64>, RenderError> {
    let is_given = scene.settings.exposure != Exposure::Auto;
    let Some(photo) = scene.photo.as_ref().filter(|_| is_given) else {
        return Ok(None);
    };
    let mut packed = PackedScene::build(scene, &Watcher::none())?;
    Ok(photo_albedo::roughly_fit_exposure_ev(&mut packed, photo))
}

/// Share of the proxy whose albedo from the photograph would lie at its limit, from a few rays, where it is so large that a render tells it.
///
/// # Errors
/// The scene does not fit the packed form.
pub fn roughly_limited_albedo(scene: &Scene) -> Result<Option<f64>, RenderError> {
    let settings = &scene.settings;
    let may_be = settings.exposure != Exposure::Auto && settings.composite == Composite::Additive;
    let from_photo = scene.objects.iter().any(|object| object.albedo_from_photo);
    let Some(photo) = scene.photo.as_ref().filter(|_| may_be && from_photo) else {
        return Ok(None);
    };
    let mut packed = PackedScene::build(scene, &Watcher::none())?;
    let share = photo_albedo::roughly_limited_share(&mut packed, photo);
    Ok((share > MOSTLY).then_some(share))
}

impl Renderer {
    /// Takes up the packed scene after an edit.
    pub(super) fn restart(
        &mut self,
        real_light_changed: bool,
        changed: Changed,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let stopwatch = Stopwatch::start();
        let look_ahead = self.core.seconds.look_ahead;
        if real_light_changed {
            self.surfaces.clear();
            let begun = self.core.places.begin();
            self.prepare_photo(watcher);
            self.core.places.end(Place::Photo, begun);
        }
        let swept = self.prepare_shutter(watcher)?;
        self.keep_lens_grid();
        self.look_ahead(watcher);
        let core = &mut self.core;
        let changed = match changed {
            changed if swept => changed.max(Changed::Moving),
            changed => changed,
        };
        let begun = core.places.begin();
        core.backend.update(&core.packed, changed)?;
        core.places.end(Place::Upload, begun);
        core.seconds.build += stopwatch.secs() - (core.seconds.look_ahead - look_ahead);
        self.open_backend(watcher)
    }

    /// Opens the backend once there is something to trace.
    pub(super) fn open_backend(&mut self, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        let core = &mut self.core;
        let choice = core.scene.settings.backend;
        let may_wait = choice == BackendChoice::Auto && core.nothing_to_trace();
        if !core.backend.is_undecided() || may_wait {
            return Ok(());
        }
        let stopwatch = Stopwatch::start();
        let watcher = match choice {
            BackendChoice::Cpu => &Watcher::none(),
            BackendChoice::Gpu | BackendChoice::Auto => watcher,
        };
        let meter = Meter::begin(watcher, Phase::Kernels, 1);
        let (backend, note) = Backend::open(choice, &core.packed, core.options.without)?;
        core.backend = backend;
        if let Some(gpu) = core.backend.gpu_mut()
            && core.options.beside_window
        {
            gpu.make_way_for_window();
        }
        core.notes.extend(note);
        core.seconds.compile += stopwatch.secs();
        meter.end();
        Ok(())
    }

    /// What follows from the real world and its light: exposure, and albedo from the photograph.
    pub(super) fn prepare_photo(&mut self, watcher: &Watcher<'_>) {
        let core = &mut self.core;
        if core.options.guides {
            core.packed.frame.flags |= FRAME_AOVS;
        }
        let from_photo = (core.packed.materials.iter())
            .any(|material| material.flags & MATERIAL_PHOTO_ALBEDO != 0);
        core.photo_here = None;
        let coarse = core.coarse_photo.as_ref();
        let Some(photo) = photo_of_size(&core.scene, coarse, &core.packed.frame) else {
            return;
        };
        if core.scene.settings.exposure == Exposure::Auto {
            match photo_albedo::fit_exposure_ev(&mut core.packed, photo, watcher) {
                Some(ev) => {
                    core.packed.frame.exposure_scale = ev.exp2() as f32;
                    core.notes.push(format!(
                        "exposure_ev = {ev:.3} fits the proxy's light to the photograph"
                    ));
                }
                None => core.notes.push(
                    "exposure_ev = \"auto\": the camera sees no lit proxy; 0 is used".to_owned(),
                ),
            }
        }
        if from_photo {
            core.packed.taught = None;
            let kept = (core.photo_light.as_ref()).filter(|_| core.options.draft);
            core.photo_here = kept.and_then(|light| light.take_up(&mut core.packed, photo));
            if core.photo_here.is_some() {
                return;
            }
            let (light, limited) =
                photo_albedo::estimate_photo_albedo(&mut core.packed, photo, watcher);
            core.photo_light = core.options.draft.then_some(light);
            let is_additive = core.scene.settings.composite == Composite::Additive;
            if limited > MOSTLY && is_additive {
                let albedo = std::mem::take(&mut core.packed.photo_albedo);
                let ev = photo_albedo::fit_exposure_ev(&mut core.packed, photo, watcher);
                core.packed.photo_albedo = albedo;
                let auto = ev.map_or(String::new(), |ev| format!(" (here {ev:.2})"));
                core.notes.push(format!(
                    "warning: {:.0}% of the proxy's albedo lies at its limit: the light does not fit the photograph, and shadows will be \
                     wrong; set exposure_ev = \"auto\"{auto}, or composite = \"quotient\"",
                    100.0 * limited
                ));
            }
        }
    }

    /// Of a draft, the albedo of another exposure by what the camera is known to see; false where all of it is to be prepared.
    pub(super) fn expose_draft(&mut self) -> bool {
        let core = &mut self.core;
        let is_fixed = core.scene.settings.exposure != Exposure::Auto;
        let coarse = core.coarse_photo.as_ref();
        let photo = photo_of_size(&core.scene, coarse, &core.packed.frame);
        match (&core.photo_here, photo) {
            (Some(here), Some(photo)) if is_fixed => {
                here.set_albedo(&mut core.packed, photo);
                true
            }
            _ => false,
        }
    }

    /// [`roughly_fitted_exposure_ev`] of the scene that is rendered.
    pub fn roughly_fitted_exposure_ev(&mut self) -> Option<f64> {
        let core = &mut self.core;
        let coarse = core.coarse_photo.as_ref();
        let photo = photo_of_size(&core.scene, coarse, &core.packed.frame)?;
        if core.scene.settings.exposure == Exposure::Auto {
            return None;
        }
        let albedo = std::mem::take(&mut core.packed.photo_albedo);
        let ev = photo_albedo::roughly_fit_exposure_ev(&mut core.packed, photo);
        core.packed.photo_albedo = albedo;
        ev
    }

    /// One picture does without; where there is another, more will come.
    fn keep_lens_grid(&mut self) {
        let Core {
            lens_grid, packed, ..
        } = &mut self.core;
        if !lens_grid
            .as_ref()
            .is_some_and(|grid| grid.fits(&packed.frame))
        {
            *lens_grid = Some(LensGrid::of(&packed.frame));
        }
    }

    /// Runs the pilot again where its watcher ended it; false if this one does too.
    pub(super) fn plan(&mut self, watcher: &Watcher<'_>) -> Result<bool, RenderError> {
        if !self.core.is_planned {
            self.look_ahead(watcher);
            self.core.backend.update(&self.core.packed, Changed::Plan)?;
        }
        Ok(self.core.is_planned)
    }

    /// Runs the pilot and begins the film that follows its plan.
    pub(super) fn look_ahead(&mut self, watcher: &Watcher<'_>) {
        let stopwatch = Stopwatch::start();
        let meter = Meter::begin(
            watcher,
            Phase::LookingAhead,
            cpu::pilot_steps(&self.core.packed.frame),
        );
        self.stated = None;
        let core = &mut self.core;
        let without = core.options.without;
        without.apply_to_frame(&mut core.packed.frame);
        let begun = core.places.begin();
        let coarse = core.coarse_photo.as_ref();
        let photo = photo_of_size(&core.scene, coarse, &core.packed.frame);
        let backdrop = core.scene.settings.backdrop;
        core.packed.set_backdrop(photo, backdrop);
        let begun = core.places.end(Place::Backdrop, begun);
        cpu::pilot(&mut core.packed, core.lens_grid.as_ref(), &meter);
        core.is_planned = !meter.is_cancelled();
        without.apply_to_pixels(&mut core.packed.pixels);
        core.places.end(Place::Pilot, begun);
        let photons = core.packed.photons_per_ray > 0;
        let note = core.packed.black_shadows(photons);
        core.notes
            .extend(note.filter(|note| !core.notes.contains(note)));
        let begun = core.places.begin();
        let (width, height) = (core.packed.frame.width, core.packed.frame.height);
        let factors = core.packed.pixels.iter().map(|p| p.sample_factor);
        let fits = (core.film.width, core.film.height) == (width, height);
        if !fits {
            let first = core.film.first_sample;
            core.film = Film::new(width, height, first, core.options.guides);
        }
        // Of a film that no ray was traced for, memory is not committed.
        match fits && core.rays.traced() > 0 {
            true => core.film.renew(factors),
            false => core.film.set_sample_factors(factors),
        }
        let grouped = core.options.keeps_groups(core.scene.settings.combine);
        core.film.set_groups(grouped);
        core.film.set_photons(core.packed.photons_per_ray > 0);
        core.film_is_new = true;
        core.places.end(Place::Film, begun);
        match (core.options.filter, core.options.draft) {
            (None, _) => {}
            (Some(_), false) => self.surfaces = cpu::diffuse_surfaces(&core.packed),
            (Some(_), true) if self.surfaces.is_empty() => {
                self.surfaces =
                    cpu::diffuse_surfaces_of_pinhole(&core.packed, core.lens_grid.as_ref());
            }
            (Some(_), true) => {}
        }
        core.seconds.look_ahead += stopwatch.secs();
        core.seconds.cpu += stopwatch.cpu_secs();
        meter.end();
    }
}
