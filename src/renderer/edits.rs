//! Edits of a scene that is being rendered: each rebuilds what it changes, and the film starts anew.

use std::sync::Arc;

use glam::DMat4;

use super::{RenderError, Renderer};
use crate::gpu::Changed;
use crate::pack::traced_shutter;
use crate::packed::FRAME_AOVS;
use crate::scene::{Exposure, Lens, Light, LightKind, Material, Settings, Side, Stages};
use crate::work::Watcher;

impl Renderer {
    /// Another number of rays per pixel and another seed. Nothing is rebuilt but the pilot; the film starts anew with all samples to render.
    ///
    /// # Errors
    /// As [`Renderer::set_lens`]; or the number is 0 or above [`Settings::MAX_RAYS_PER_PIXEL`].
    pub fn set_samples(
        &mut self,
        rays_per_pixel: u32,
        seed: u32,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        if !(1..=Settings::MAX_RAYS_PER_PIXEL).contains(&rays_per_pixel) {
            return Err(RenderError::RaysPerPixel(rays_per_pixel));
        }
        self.core.scene.settings.rays_per_pixel = rays_per_pixel;
        self.core.scene.settings.seed = seed;
        self.core.packed.frame.rays_total = rays_per_pixel;
        self.core.packed.frame.seed = seed;
        self.core.film.first_sample = 0;
        self.end_sample = rays_per_pixel;
        self.restart(false, Changed::Plan, watcher)
    }

    /// Depth, normal and albedo of the first hit are traced from now on, or are not; the film starts anew. False, and it stays, where it is so already.
    ///
    /// # Errors
    /// As [`Renderer::set_lens`].
    pub fn set_guides(&mut self, guides: bool, watcher: &Watcher<'_>) -> Result<bool, RenderError> {
        let flags = &mut self.core.packed.frame.flags;
        if (*flags & FRAME_AOVS != 0) == guides {
            return Ok(false);
        }
        *flags = *flags & !FRAME_AOVS | if guides { FRAME_AOVS } else { 0 };
        self.core.options.guides = guides;
        self.restart(false, Changed::Plan, watcher)?;
        Ok(true)
    }

    /// Makes a virtual object of one material. Its trees stay; where it was of one that is its own, so do all other materials. A real one costs
    /// everything.
    ///
    /// # Errors
    /// There is no such object, or as [`Renderer::new`].
    pub fn set_material(
        &mut self,
        object: usize,
        material: Material,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let core = &mut self.core;
        let entry =
            (core.scene.objects.get_mut(object)).ok_or(RenderError::NoSuchObject(object))?;
        let material = Arc::new(material);
        let before: Vec<Arc<Material>> = (entry.instances.iter_mut())
            .map(|part| std::mem::replace(&mut part.material, material.clone()))
            .collect();
        if entry.side == Side::Real {
            core.photo_light = None;
            core.pack(watcher)?;
            return self.restart(true, Changed::All, watcher);
        }
        if let Some(own) = before.first() {
            let parts = core.scene.objects.iter().flat_map(|o| &o.instances);
            let is_used = parts.clone().any(|part| Arc::ptr_eq(&part.material, own));
            if !is_used && before.iter().all(|other| Arc::ptr_eq(own, other)) {
                core.packed.replace_material(own, &material);
            }
        }
        core.pack_moved(watcher)?;
        self.restart(false, Changed::Virtual, watcher)
    }

    /// Another lens. Nothing is rebuilt but the pilot; the film starts anew.
    ///
    /// # Errors
    /// The new scene does not fit the adapter.
    pub fn set_lens(&mut self, lens: Lens, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        self.core.scene.lens = lens;
        self.core.packed.set_camera(&self.core.scene);
        self.restart(false, Changed::Plan, watcher)
    }

    /// Another camera pose. While it stays near the anchor nothing is rebuilt but the pilot.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_camera_pose(
        &mut self,
        world_from_camera: DMat4,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        self.core.scene.camera.world_from_camera = world_from_camera;
        if self.core.packed.anchor_serves(&self.core.scene) {
            self.core.packed.set_camera(&self.core.scene);
            return self.restart(true, Changed::View, watcher);
        }
        self.core.pack(watcher)?;
        self.restart(true, Changed::All, watcher)
    }

    /// Moves an object of the scene, which then rests there. A virtual one that rested costs its own records and a refit of its tree, one that moved the virtual
    /// BVH, a real one everything.
    ///
    /// # Errors
    /// There is no such object, or as [`Renderer::new`].
    pub fn set_object_transform(
        &mut self,
        object: usize,
        world_from_object: DMat4,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let objects = &mut self.core.scene.objects;
        let entry = objects
            .get_mut(object)
            .ok_or(RenderError::NoSuchObject(object))?;
        let rested = !entry.is_animated();
        entry.world_from_object = world_from_object;
        entry.motion = None;
        for instance in &mut entry.instances {
            instance.animation = None;
            instance.deformation = None;
        }
        match entry.side {
            Side::Virtual if rested => {
                self.core.pack_object(object, watcher)?;
                self.restart(false, Changed::Object, watcher)
            }
            Side::Virtual => {
                self.core.pack_moved(watcher)?;
                self.restart(false, Changed::Virtual, watcher)
            }
            Side::Real => {
                self.core.photo_light = None;
                self.core.pack(watcher)?;
                self.restart(true, Changed::All, watcher)
            }
        }
    }

    /// Another rotation and scale of the environment; nothing changes without one. No tree is built.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_environment(
        &mut self,
        rotation_deg: f64,
        scale: f64,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let Some(environment) = &mut self.core.scene.environment else {
            return Ok(());
        };
        (environment.rotation_deg, environment.scale) = (rotation_deg, scale);
        self.core.packed.set_environment(&self.core.scene);
        self.core.pack_moving(watcher)?;
        let estimates_albedo = !self.core.options.draft;
        self.restart(estimates_albedo, Changed::All, watcher)
    }

    /// Another exposure and depth of paths. No tree is built.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_transport(
        &mut self,
        exposure: Exposure,
        max_bounces: u32,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        self.core.scene.settings.exposure = exposure;
        self.core.scene.settings.max_bounces = max_bounces;
        self.core.packed.set_settings(&self.core.scene);
        self.core.pack_moving(watcher)?;
        let is_exposed = self.expose_draft();
        self.restart(!is_exposed, Changed::All, watcher)
    }

    /// Other camera stages. They work on what is delivered: the film stays, unless another way to show motion traces other rays.
    ///
    /// # Errors
    /// As [`Renderer::set_lens`].
    pub fn set_stages(&mut self, stages: Stages, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        let before = traced_shutter(&self.core.scene);
        self.core.scene.stages = stages;
        match traced_shutter(&self.core.scene) == before {
            true => Ok(()),
            false => self.restart(false, Changed::View, watcher),
        }
    }

    /// Other lights. Real quads are part of the real world, so where they change it is built anew.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_lights(
        &mut self,
        lights: Vec<Light>,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let real_quads = |lights: &[Light]| -> Vec<Light> {
            lights
                .iter()
                .filter(|l| l.side == Side::Real && matches!(l.kind, LightKind::Quad { .. }))
                .cloned()
                .collect()
        };
        let real_world_changes = real_quads(&self.core.scene.lights) != real_quads(&lights);
        self.core.scene.lights = lights;
        self.core.photo_light = None;
        if real_world_changes {
            self.core.pack(watcher)?;
        } else {
            self.core.pack_virtual(watcher)?;
        }
        self.restart(true, Changed::All, watcher)
    }
}
