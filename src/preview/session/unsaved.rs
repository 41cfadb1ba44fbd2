//! Work that is not saved yet, kept beside the scene file in case of a crash.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use super::Session;
use crate::output::write_text;

/// Unsaved work is kept beside the scene file this often.
pub(super) const AUTOSAVE_EVERY: Duration = Duration::from_secs(2);
/// What it is called: the scene's name and this.
const AUTOSAVE_ENDING: &str = "unsaved";

impl Session {
    pub(super) fn autosave_path(&self) -> PathBuf {
        let mut name = self.path.file_name().unwrap_or_default().to_os_string();
        name.push(".");
        name.push(AUTOSAVE_ENDING);
        self.path.with_file_name(name)
    }

    /// Nothing is kept beside the scene file from now on.
    pub fn keep_no_unsaved_work(&mut self) {
        self.keeps_unsaved_work = false;
    }

    /// Writes what is new, now and then.
    pub(super) fn autosave(&mut self, now: Instant) {
        let is_writing = (self.autosaving.as_ref()).is_some_and(|writing| !writing.is_finished());
        if !self.keeps_unsaved_work || !self.is_dirty() || self.recovered.is_some() || is_writing {
            return;
        }
        let Some(present) = self.present.clone() else {
            return;
        };
        let is_due = (self.autosaved.as_ref()).is_none_or(|(state, at)| {
            *state != present && now.duration_since(*at) >= AUTOSAVE_EVERY
        });
        if let Some(text) = self.text().filter(|_| is_due) {
            self.autosaved = Some((present, now));
            let path = self.autosave_path();
            // Written beside the window, as a disk may take its time; where it cannot be written there is nothing to recover.
            self.autosaving = Some(thread::spawn(move || {
                let _ = write_text(&path, &text);
            }));
        }
    }

    /// Forgets the work that was not saved, this run's and what an earlier one left.
    pub fn discard_autosave(&mut self) {
        // What is still being written would be there again afterwards.
        if let Some(writing) = self.autosaving.take() {
            let _ = writing.join();
        }
        if self.autosaved.take().is_some() || self.recovered.take().is_some() {
            // It may never have been written.
            let _ = std::fs::remove_file(self.autosave_path());
        }
    }

    /// Takes up the work that an earlier run left.
    pub fn recover(&mut self) {
        if let Some(text) = self.recovered.take() {
            self.read(Arc::from(text), None, Some("recover"), false);
        }
    }
}
