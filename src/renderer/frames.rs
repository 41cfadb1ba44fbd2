//! Frames of a video.

use glam::DVec3;

use super::moving::Moving;
use super::{Driver, RenderError, Renderer};
use crate::film::MergeError;
use crate::gpu::Changed;
use crate::pack::{instants, next_anchor};
use crate::packed::FRAME_SHUTTER;
use crate::scene::trajectory::CameraPath;
use crate::scene::{Camera, Exposure, Instance, Lens, Photo, Scene};
use crate::work::Watcher;

/// The next frame of a video.
#[derive(Clone, Debug)]
pub struct FrameEdit {
    /// Of the camera's size; `None` keeps the one that is there.
    pub photo: Option<Photo>,
    /// Of the size of the frames before.
    pub camera: Camera,
    pub lens: Lens,
    /// The camera's way around the frame's time.
    pub camera_path: CameraPath,
    /// Of the objects' motion, and of the middle of the exposure.
    pub time_secs: f64,
    pub seed: u32,
    /// Where coordinates have their origin, world space, near the camera ([`next_anchor`]); `None`: as few new ones as can be. The last bits of
    /// the picture depend on it, and everything is packed anew for a new one.
    pub anchor: Option<DVec3>,
    /// The sides of what is traced are those of the camera divided by this, 1 or more; pictures are enlarged to the camera's size.
    pub coarseness: u32,
}

impl Renderer {
    /// Goes on to another frame of the same scene. What rests and its trees stay, and what moves unless it has moved; the
    /// film starts anew. An exposure that was fitted to the first photograph is kept.
    ///
    /// # Errors
    /// The frame is of another size, or as [`Renderer::new`].
    pub fn set_frame(&mut self, edit: FrameEdit, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        let core = &mut self.core;
        let camera = &core.scene.camera;
        let size = (camera.width, camera.height);
        let photo_size = edit.photo.as_ref().map_or(size, |p| (p.width, p.height));
        for (width, height) in [(edit.camera.width, edit.camera.height), photo_size] {
            if (width, height) != size {
                return Err(MergeError::Size(size.0, size.1, width, height).into());
            }
        }
        if core.scene.settings.exposure == Exposure::Auto {
            let scale = f64::from(core.packed.frame.exposure_scale);
            core.scene.settings.exposure = Exposure::Ev(scale.log2());
        }
        let traced = edit.camera.coarser(edit.coarseness);
        let traced_size = (traced.width, traced.height);
        let is_resized = traced_size != (core.packed.frame.width, core.packed.frame.height);
        let seen = match edit.photo.is_some() || is_resized {
            true => Changed::Photo,
            false => Changed::View,
        };
        if let Some(photo) = edit.photo {
            core.scene.photo = Some(photo);
        }
        core.coarse_photo = match traced_size == size {
            true => None,
            false => {
                (core.scene.photo.as_ref()).map(|photo| photo.averaged(traced.width, traced.height))
            }
        };
        core.scene.camera = edit.camera;
        core.scene.lens = edit.lens;
        core.scene.camera_path = edit.camera_path;
        core.scene.settings.seed = edit.seed;
        core.packed.frame.seed = edit.seed;
        if let Some(shutter) = &mut core.scene.shutter {
            shutter.time_secs = edit.time_secs;
        }
        core.time_secs = edit.time_secs;
        let placed = |scene: &Scene| -> Vec<_> {
            let objects = scene.objects.iter().filter(|o| o.is_animated());
            objects
                .flat_map(|object| {
                    let parts = object.instances.iter();
                    parts.map(|part| object.world_from_object * part.object_from_local)
                })
                .collect()
        };
        // After moving objects were traced, the virtual world stands at the last instant.
        let stale = matches!(self.driver, Driver::Moving(_));
        let before = placed(&core.scene);
        core.scene.set_time(edit.time_secs);
        let parts = core
            .scene
            .objects
            .iter()
            .flat_map(|object| &object.instances);
        let deforms = parts.clone().any(Instance::deforms);
        let moved = stale || deforms || placed(&core.scene) != before;
        let anchor = edit.anchor.unwrap_or_else(|| {
            let camera = core.scene.camera.world_from_camera.w_axis.truncate();
            next_anchor(Some(DVec3::from(core.packed.anchor_m)), camera)
        });
        if anchor != DVec3::from(core.packed.anchor_m) {
            core.pack_at(anchor, watcher)?;
            core.packed.set_view(&traced, &core.scene.lens);
            return self.restart(true, Changed::All, watcher);
        }
        core.packed.set_view(&traced, &core.scene.lens);
        if moved {
            core.pack_moving(watcher)?;
            return self.restart(true, Changed::Moving, watcher);
        }
        self.restart(true, seen, watcher)
    }

    /// The camera or an object moves while the shutter is open.
    pub fn is_moving(&self) -> bool {
        matches!(self.driver, Driver::Moving(_))
            || self.core.packed.frame.flags & FRAME_SHUTTER != 0
    }

    /// The shutter of the scene as it is now, and who drives it; true if what moves was packed anew.
    pub(super) fn prepare_shutter(&mut self, watcher: &Watcher<'_>) -> Result<bool, RenderError> {
        let core = &mut self.core;
        let instants = instants(&core.scene);
        let objects_move = !instants.is_empty();
        let swept = objects_move || matches!(self.driver, Driver::Moving(_));
        core.packed.sweep(&mut core.scene, &instants, watcher)?;
        core.packed.set_shutter(&core.scene, objects_move);
        self.driver = match objects_move {
            true => Driver::Moving(Moving { instants }),
            false => Driver::Still,
        };
        Ok(swept)
    }
}
