//! Time: the frames of a video behind the scene, or the scene's own keys.

use std::path::PathBuf;
use std::sync::Arc;

use super::Session;
use crate::preview::composition::{Composition, rounded};
use crate::preview::frames::Frames;
use crate::preview::still::Still;
use crate::sequence::SequenceOptions;

impl Session {
    /// The scene is shown as the cameras of these frames see it, from the first on.
    pub fn follow(&mut self, frames: Frames) {
        self.frames = Some(Arc::new(frames));
        self.frame = 0;
        self.read_disk();
    }

    pub fn frames(&self) -> Option<&Frames> {
        self.frames.as_deref()
    }

    /// The frame that is shown or on its way to be, among those with a pose.
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// Shows another frame; nothing happens beyond the last.
    pub fn go_to_frame(&mut self, frame: usize) {
        let count = self.frames().map_or(0, |frames| frames.posed().len());
        if frame == self.frame || frame >= count {
            return;
        }
        self.frame = frame;
        if let Some(present) = self.present.clone() {
            self.read(present.text, Some(present.composition), None, false);
        }
    }

    /// The picture's time among the scene's own keys.
    pub fn set_time(&mut self, time_secs: f64) {
        self.edit("time", |composition| {
            composition.set_time(rounded(time_secs, 1e-4));
        });
    }

    /// The camera goes its own way: by frames, or by keys of the scene.
    pub(super) fn camera_is_led(&self) -> bool {
        let by_keys = |loaded: &super::Loaded| !loaded.scene.camera_path.is_empty();
        self.frames.is_some() || self.loaded.as_deref().is_some_and(by_keys)
    }

    /// What a frame brings is no edit: it is that of the frame which is shown.
    pub(super) fn keep_frame(&self, composition: &mut Composition, of: &Composition) {
        if self.frames.is_none() {
            return;
        }
        (composition.camera, composition.frame) = (of.camera, of.frame);
        if let (Some(shutter), Some(own)) = (&mut composition.shutter, of.shutter) {
            shutter.time_secs = own.time_secs;
        }
    }

    /// Renders frames of the saved scene beside the preview, the end not included.
    pub fn render_range(&mut self, (from, to): (u32, u32), output: PathBuf) {
        let Some(frames) = self.frames.clone() else {
            return;
        };
        if self.is_dirty() {
            let message = "the scene has unsaved edits; expected a saved one, which the frames are rendered from; save it";
            self.problem = Some(message.to_owned());
            return;
        }
        let options = SequenceOptions {
            range: Some((from, to.max(from + 1))),
            ..SequenceOptions::new(&self.path, frames.folder(), frames.trajectory(), output)
        };
        let wake = self.wake.clone();
        self.still = Some(Still::of_range(options, move || wake()));
    }

    /// The command line that renders these frames of the saved scene.
    pub fn range_command(&self, (from, to): (u32, u32), output: &str) -> String {
        let Some(frames) = self.frames() else {
            return self.command();
        };
        let [scene, folder, poses] = [&*self.path, frames.folder(), frames.trajectory()]
            .map(|path| super::quoted(&path.to_string_lossy()));
        let output = super::quoted(output);
        format!(
            "mixray sequence {scene} --frames {folder} --trajectory {poses} --range {from}..{to} -o {output}"
        )
    }
}
