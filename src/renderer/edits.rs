//! Edits of a scene that is being rendered: each rebuilds what it changes, and the film starts anew.

use glam::DMat4;

use super::watch::Watch;
use super::{Backend, RenderError, Renderer};
use crate::cpu;
use crate::film::Film;
use crate::gpu::Changed;
use crate::packed::PackedScene;
use crate::scene::{Lens, Light, LightKind, Settings, Side};

impl Renderer {
    /// Another number of rays per pixel and another seed. Nothing is rebuilt but the pilot; the film starts anew with all samples to render.
    ///
    /// # Errors
    /// As [`Renderer::set_lens`]; or the number is 0 or above [`Settings::MAX_RAYS_PER_PIXEL`].
    pub fn set_samples(&mut self, rays_per_pixel: u32, seed: u32) -> Result<(), RenderError> {
        if !(1..=Settings::MAX_RAYS_PER_PIXEL).contains(&rays_per_pixel) {
            return Err(RenderError::RaysPerPixel(rays_per_pixel));
        }
        self.scene.settings.rays_per_pixel = rays_per_pixel;
        self.scene.settings.seed = seed;
        self.packed.frame.rays_total = rays_per_pixel;
        self.packed.frame.seed = seed;
        self.film.first_sample = 0;
        self.end_sample = rays_per_pixel;
        self.restart(false, Changed::View)
    }

    /// Another lens. Nothing is rebuilt but the pilot; the film starts anew.
    ///
    /// # Errors
    /// The new scene does not fit the adapter.
    pub fn set_lens(&mut self, lens: Lens) -> Result<(), RenderError> {
        self.scene.lens = lens;
        self.packed.set_camera(&self.scene);
        self.restart(false, Changed::View)
    }

    /// Another camera pose. While it stays near the anchor nothing is rebuilt but the pilot.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_camera_pose(&mut self, world_from_camera: DMat4) -> Result<(), RenderError> {
        self.scene.camera.world_from_camera = world_from_camera;
        if self.packed.anchor_serves(&self.scene) {
            self.packed.set_camera(&self.scene);
            return self.restart(true, Changed::View);
        }
        self.packed = PackedScene::build(&self.scene)?;
        self.restart(true, Changed::All)
    }

    /// Moves an object of the scene, which then rests there. A virtual one costs the virtual BVH, a real one everything.
    ///
    /// # Errors
    /// There is no such object, or as [`Renderer::new`].
    pub fn set_object_transform(
        &mut self,
        object: usize,
        world_from_object: DMat4,
    ) -> Result<(), RenderError> {
        let entry = self
            .scene
            .objects
            .get_mut(object)
            .ok_or(RenderError::NoSuchObject(object))?;
        entry.world_from_object = world_from_object;
        entry.motion = None;
        for instance in &mut entry.instances {
            instance.animation = None;
        }
        match entry.side {
            Side::Virtual => {
                self.packed.rebuild_virtual(&self.scene)?;
                self.restart(false, Changed::Virtual)
            }
            Side::Real => {
                self.packed = PackedScene::build(&self.scene)?;
                self.restart(true, Changed::All)
            }
        }
    }

    /// Other lights. Real quads are part of the real world, so where they change it is built anew.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<(), RenderError> {
        let real_quads = |lights: &[Light]| -> Vec<Light> {
            lights
                .iter()
                .filter(|l| l.side == Side::Real && matches!(l.kind, LightKind::Quad { .. }))
                .cloned()
                .collect()
        };
        let real_world_changes = real_quads(&self.scene.lights) != real_quads(&lights);
        self.scene.lights = lights;
        if real_world_changes {
            self.packed = PackedScene::build(&self.scene)?;
        } else {
            self.packed.rebuild_virtual(&self.scene)?;
        }
        self.restart(true, Changed::All)
    }

    /// Takes up the packed scene after an edit.
    pub(super) fn restart(
        &mut self,
        real_light_changed: bool,
        changed: Changed,
    ) -> Result<(), RenderError> {
        let watch = Watch::start();
        let look_ahead = self.seconds.look_ahead;
        if real_light_changed {
            self.prepare_photo();
        }
        let swept = self.prepare_shutter()?;
        self.look_ahead();
        if let Backend::Gpu(gpu) = &mut self.backend {
            let changed = match changed {
                Changed::View if swept => Changed::Virtual,
                changed => changed,
            };
            gpu.update_scene(&self.packed, changed)?;
        }
        self.seconds.build += watch.secs() - (self.seconds.look_ahead - look_ahead);
        if matches!(self.backend, Backend::Undecided) {
            let watch = Watch::start();
            self.backend = self.open_backend()?;
            self.seconds.compile += watch.secs();
        }
        Ok(())
    }

    /// Runs the pilot and begins the film that follows its plan.
    pub(super) fn look_ahead(&mut self) {
        let watch = Watch::start();
        self.stated = None;
        let without = self.options.without;
        without.apply_to_frame(&mut self.packed.frame);
        cpu::pilot(&mut self.packed);
        without.apply_to_pixels(&mut self.packed.pixels);
        self.film = Film::new(
            self.film.width,
            self.film.height,
            self.film.first_sample,
            self.options.all_planes,
        );
        let factors = self.packed.pixels.iter().map(|p| p.sample_factor);
        self.film.set_sample_factors(factors);
        if self.options.filter {
            self.surfaces = cpu::diffuse_surfaces(&self.packed);
        }
        self.seconds.look_ahead += watch.secs();
        self.seconds.cpu += watch.cpu_secs();
    }
}
