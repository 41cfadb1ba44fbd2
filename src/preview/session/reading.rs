//! Files on their way to a scene, and what is heard of their changes.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Instant;

use super::{Edited, Loaded, Session};
use crate::preview::composition::{CameraPose, Composition};
use crate::preview::document::Document;
use crate::preview::frames::Frames;
use crate::preview::geometry::Geometry;
use crate::preview::watch::Watch;
use crate::scene::load_text;

/// A text on its way to a scene.
pub(super) struct Reading {
    pub(super) result: Receiver<Result<Box<Loaded>, String>>,
    /// Edits upon it; `None`: as the text has it.
    pub(super) composition: Option<Composition>,
    /// What undo brings back once it is read, by what change; `None`: undo or redo themselves.
    pub(super) change: Option<&'static str>,
    /// It is what the disk holds.
    pub(super) is_saved: bool,
    /// Another scene file, whose place the session takes once it is read.
    pub(super) other: Option<PathBuf>,
}

impl Session {
    pub(super) fn take_up(&mut self, result: Result<Box<Loaded>, String>, now: Instant) {
        let Some(reading) = self.reading.take() else {
            return;
        };
        let loaded = match result {
            Ok(loaded) => loaded,
            Err(problem) => {
                self.problem = Some(problem);
                self.watch_anew();
                return;
            }
        };
        self.problem = None;
        if let Some(path) = reading.other {
            self.leave_for(path, &loaded.text);
        }
        let fits = |composition: &Composition| {
            composition.objects.len() == loaded.base.objects.len()
                && composition.environment.is_some() == loaded.base.environment.is_some()
        };
        let composition = reading.composition.filter(fits);
        let mut edited = Edited {
            text: loaded.text.clone(),
            composition: composition.unwrap_or_else(|| loaded.base.clone()),
        };
        self.keep_frame(&mut edited.composition, &loaded.base);
        if let Some(mut saved) = self.saved.take() {
            self.keep_frame(&mut saved.composition, &loaded.base);
            self.saved = Some(saved);
        }
        if reading.is_saved {
            self.saved = Some(Edited {
                composition: loaded.base.clone(),
                ..edited.clone()
            });
            self.has_conflict = false;
        }
        if let (Some(before), Some(change)) = (self.present.take(), reading.change)
            && before != edited
        {
            self.history.changed(before, change, now);
            self.history.end_gesture();
        }
        self.present = Some(edited);
        self.loaded = Some(loaded);
        self.watch_anew();
        self.want();
    }

    pub(super) fn watch_anew(&mut self) {
        let wake = self.wake.clone();
        let inputs = self
            .loaded
            .as_ref()
            .map(|loaded| loaded.scene.inputs.clone());
        let files = inputs.unwrap_or_else(|| vec![self.path.clone()]);
        match Watch::new(files, move || wake()) {
            Ok(watch) => self.watch = Some(watch),
            Err(error) => {
                self.watch = None;
                self.problem = Some(format!(
                    "changes on disk are not noticed: {error}; use Reload"
                ));
            }
        }
    }

    pub(super) fn files_changed(&mut self, changed: &[PathBuf]) {
        let same = |file: &PathBuf| file.canonicalize().ok() == self.path.canonicalize().ok();
        let disk = std::fs::read_to_string(&self.path).ok();
        let is_other = changed.iter().any(same) && disk.as_deref() != Some(&*self.disk);
        if is_other {
            match self.is_dirty() {
                true => self.has_conflict = true,
                false => self.read_disk(),
            }
        } else if let Some(present) = self.present.clone().filter(|_| !changed.iter().all(same)) {
            // A mesh, or an image.
            self.read(present.text, Some(present.composition), None, false);
        }
    }

    /// Another scene file in the place of this one, whose edits are dropped; one that cannot be read leaves all as it is.
    pub fn switch(&mut self, path: &Path) {
        match std::fs::read(path) {
            Ok(bytes) => {
                let text: Arc<str> = Arc::from(String::from_utf8_lossy(&bytes));
                self.begin_reading(text, Some(path.to_path_buf()), None, None, true);
            }
            Err(error) => self.problem = Some(unreadable(path, &error)),
        }
    }

    /// Forgets the scene file that was there.
    fn leave_for(&mut self, path: PathBuf, text: &Arc<str>) {
        self.discard_autosave();
        self.path = path;
        self.disk = text.clone();
        (self.present, self.saved, self.frames) = (None, None, None);
        self.has_conflict = false;
        self.history.clear();
        self.recovered = std::fs::read_to_string(self.autosave_path()).ok();
    }

    /// Reads the scene file again; what was edited can be brought back by undo.
    pub fn reload(&mut self) {
        self.read_disk();
    }

    pub(super) fn read_disk(&mut self) {
        match std::fs::read(&self.path) {
            // What is no text is refused with its place by the reader.
            Ok(bytes) => {
                let text: Arc<str> = Arc::from(String::from_utf8_lossy(&bytes));
                self.disk = text.clone();
                self.read(text, None, Some("reload"), true);
            }
            Err(error) => self.problem = Some(unreadable(&self.path, &error)),
        }
    }

    pub(super) fn read(
        &mut self,
        text: Arc<str>,
        composition: Option<Composition>,
        change: Option<&'static str>,
        is_saved: bool,
    ) {
        self.begin_reading(text, None, composition, change, is_saved);
    }

    fn begin_reading(
        &mut self,
        text: Arc<str>,
        other: Option<PathBuf>,
        composition: Option<Composition>,
        change: Option<&'static str>,
        is_saved: bool,
    ) {
        self.problem = None;
        let (sender, result) = channel();
        let path = other.clone().unwrap_or_else(|| self.path.clone());
        let wake = self.wake.clone();
        let frames = self.frames.clone().filter(|_| other.is_none());
        let frame = frames.map(|frames| (frames, self.frame));
        thread::spawn(move || {
            // Nobody waits for it if another text came meanwhile.
            let _ = sender.send(load(&path, text, frame));
            wake();
        });
        self.reading = Some(Reading {
            result,
            composition,
            change,
            is_saved,
            other,
        });
    }
}

fn unreadable(path: &Path, error: &std::io::Error) -> String {
    let path = path.display();
    format!("{path}: cannot be read ({error}); expected a scene file; correct the path")
}

/// Reads a text as the scene file of that path.
fn load(
    path: &Path,
    text: Arc<str>,
    frame: Option<(Arc<Frames>, usize)>,
) -> Result<Box<Loaded>, String> {
    let scene = match &frame {
        Some((frames, index)) => frames.scene(*index, path, &text)?,
        None => load_text(path, &text).map_err(|error| error.to_string())?,
    };
    let document = Document::parse(&text).map_err(|error| error.to_string())?;
    let geometry = Geometry::build(&scene).map_err(|error| error.to_string())?;
    let mut base = document.composition(&scene);
    if let Some((frames, index)) = &frame {
        base.camera = CameraPose::Matrix(scene.camera.world_from_camera);
        base.frame = frames.posed()[*index].lead();
    }
    Ok(Box::new(Loaded {
        base,
        scene: Arc::new(scene),
        geometry,
        document,
        text,
    }))
}
