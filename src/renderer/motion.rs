//! Frames of a video, and what moves while the shutter is open.
//!
//! A moving camera is part of each camera ray. Moving objects stand still from one instant to the next: the virtual world is packed anew
//! for each, and every row takes at an instant the samples that fall into it, so that a pixel's samples follow one another in time.

use glam::DVec3;

use super::{Backend, Cancel, Pass, Progress, RenderError, Renderer};
use crate::film::{Film, MergeError};
use crate::gpu::Changed;
use crate::packed::{
    FRAME_SHUTTER, PIXEL_OUT_OF_REACH, PackedScene, PixelInfo, instants, next_anchor, row_ends,
};
use crate::scene::trajectory::CameraPath;
use crate::scene::{Camera, Exposure, Lens, Photo};

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
}

impl Renderer {
    /// Goes on to another frame of the same scene. The real world and its BVH stay, and the virtual ones unless objects have moved; the
    /// film starts anew. An exposure that was fitted to the first photograph is kept.
    ///
    /// # Errors
    /// The frame is of another size, or as [`Renderer::new`].
    pub fn set_frame(&mut self, edit: FrameEdit) -> Result<(), RenderError> {
        let camera = &self.scene.camera;
        let size = (camera.width, camera.height);
        let photo_size = edit.photo.as_ref().map_or(size, |p| (p.width, p.height));
        for (width, height) in [(edit.camera.width, edit.camera.height), photo_size] {
            if (width, height) != size {
                return Err(MergeError::Size(size.0, size.1, width, height).into());
            }
        }
        if self.scene.settings.exposure == Exposure::Auto {
            let scale = f64::from(self.packed.frame.exposure_scale);
            self.scene.settings.exposure = Exposure::Ev(scale.log2());
        }
        if let Some(photo) = edit.photo {
            self.scene.photo = Some(photo);
        }
        self.scene.camera = edit.camera;
        self.scene.lens = edit.lens;
        self.scene.camera_path = edit.camera_path;
        self.scene.settings.seed = edit.seed;
        self.packed.frame.seed = edit.seed;
        if let Some(shutter) = &mut self.scene.shutter {
            shutter.time_secs = edit.time_secs;
        }
        self.time_secs = edit.time_secs;
        let placed = |renderer: &Self| -> Vec<_> {
            let objects = renderer.scene.objects.iter().filter(|o| o.is_animated());
            objects
                .flat_map(|object| {
                    let parts = object.instances.iter();
                    parts.map(|part| object.world_from_object * part.object_from_local)
                })
                .collect()
        };
        // After moving objects were traced, the virtual world stands at the last instant.
        let stale = !self.instants.is_empty();
        let before = placed(self);
        self.scene.set_time(edit.time_secs);
        let moved = stale || placed(self) != before;
        let anchor = edit.anchor.unwrap_or_else(|| {
            let camera = self.scene.camera.world_from_camera.w_axis.truncate();
            next_anchor(Some(DVec3::from(self.packed.anchor_m)), camera)
        });
        if anchor != DVec3::from(self.packed.anchor_m) {
            self.packed = PackedScene::build_at(&self.scene, anchor)?;
            return self.restart(true, Changed::All);
        }
        self.packed.set_camera(&self.scene);
        if moved {
            self.packed.rebuild_virtual(&self.scene)?;
            return self.restart(true, Changed::Virtual);
        }
        self.restart(true, Changed::View)
    }

    /// The camera or an object moves while the shutter is open.
    pub fn is_moving(&self) -> bool {
        !self.instants.is_empty() || self.packed.frame.flags & FRAME_SHUTTER != 0
    }

    /// The shutter of the scene as it is now; true if the virtual world was packed anew.
    pub(super) fn prepare_shutter(&mut self) -> Result<bool, RenderError> {
        let swept_before = !self.instants.is_empty();
        self.instants = instants(&self.scene);
        let swept = swept_before || !self.instants.is_empty();
        self.packed.sweep(&mut self.scene, &self.instants)?;
        self.packed
            .set_shutter(&self.scene, !self.instants.is_empty());
        Ok(swept)
    }

    /// Takes the samples up to `end` (rays per pixel, absolute) instant by instant. With a readout time an instant has samples of other numbers in every
    /// row, so that every instant is asked, whatever was taken before.
    pub(super) fn advance_in_time(
        &mut self,
        end: u32,
        cancelled: &(dyn Fn() -> bool + Sync),
        deadline: Option<std::time::Instant>,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(), RenderError> {
        let start = std::time::Instant::now();
        for instant in 0..self.instants.len() {
            let cancel = Cancel::new(cancelled, deadline);
            if cancel.is_cancelled() {
                break;
            }
            let ends = self.ends_of(instant, end);
            if !has_work(&self.film, &self.packed.pixels, &ends) {
                continue;
            }
            self.stand_at(instant)?;
            self.run_pass(Pass::MainRows { ends: &ends }, &cancel)?;
            if cancel.is_cancelled() {
                break;
            }
            progress(Progress {
                samples: self.samples(),
                samples_total: self.end_sample - self.film.first_sample,
                rays: self.rays,
                elapsed: start.elapsed(),
            });
        }
        self.replay_real()
    }

    pub(super) fn replay_real_in_time(&mut self, everywhere: bool) -> Result<(), RenderError> {
        for instant in 0..self.instants.len() {
            let lacking = (0..self.film.pixels.len()).any(|pixel| {
                let sums = &self.film.pixels[pixel];
                let all = everywhere && sums.m < sums.n && sums.n_real < sums.n;
                all || self.film.needs_real(pixel)
            });
            if !lacking {
                break;
            }
            let ends = self.ends_of(instant, self.scene.settings.rays_per_pixel);
            self.stand_at(instant)?;
            let pass = Pass::RealRows {
                everywhere,
                ends: &ends,
            };
            self.run_pass(pass, &Cancel::new(&|| false, None))?;
        }
        if let Some(shutter) = self.scene.shutter {
            self.scene.set_time(shutter.time_secs);
        }
        Ok(())
    }

    /// By row, the samples before the end of that instant, at most `end`.
    fn ends_of(&self, instant: usize, end: u32) -> Vec<u32> {
        let total = self.scene.settings.rays_per_pixel;
        let ends = row_ends(&self.scene, &self.instants[instant], total);
        ends.into_iter().map(|row| row.min(end)).collect()
    }

    /// Moves the virtual world to where it is at an instant.
    fn stand_at(&mut self, instant: usize) -> Result<(), RenderError> {
        self.scene.set_time(self.instants[instant].time_secs);
        self.packed.rebuild_virtual(&self.scene)?;
        if let Backend::Gpu(gpu) = &mut self.backend {
            gpu.update_scene(&self.packed, Changed::Virtual)?;
        }
        Ok(())
    }
}

/// A pixel within reach has not taken all samples before its row's end.
fn has_work(film: &Film, infos: &[PixelInfo], ends: &[u32]) -> bool {
    let width = film.width as usize;
    (0..film.pixels.len()).any(|pixel| {
        let next = film.first_index(pixel) + film.pixels[pixel].n;
        infos[pixel].flags & PIXEL_OUT_OF_REACH == 0
            && next < film.end_index(pixel, ends[pixel / width])
    })
}
