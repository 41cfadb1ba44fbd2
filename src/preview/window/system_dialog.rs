//! The system's dialog for a file to open, where there is one.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

#[cfg(target_os = "linux")]
use crate::preview::session::TAKEN_ENDINGS;

/// No hand closes a dialog sooner: nobody has shown one.
const TOO_SOON: Duration = Duration::from_millis(400);

/// What has become of a dialog.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Answer {
    Open,
    Chosen(PathBuf),
    Closed,
    /// The system has none.
    Missing,
}

/// A dialog on a thread of its own.
pub(super) struct SystemDialog {
    chosen: Receiver<Option<PathBuf>>,
    begin: Instant,
}

impl SystemDialog {
    /// `pick` shows it and waits; `wake` is called once it is closed.
    pub fn show(
        pick: impl FnOnce() -> Option<PathBuf> + Send + 'static,
        wake: impl FnOnce() + Send + 'static,
    ) -> Self {
        let (sender, chosen) = channel();
        thread::spawn(move || {
            // Nobody waits for it once the window is closed.
            let _ = sender.send(pick());
            wake();
        });
        Self {
            chosen,
            begin: Instant::now(),
        }
    }

    pub fn answer(&self) -> Answer {
        match self.chosen.try_recv() {
            Ok(Some(file)) => Answer::Chosen(file),
            Ok(None) if self.begin.elapsed() > TOO_SOON => Answer::Closed,
            // A thread that threw has shown nothing.
            Ok(None) | Err(TryRecvError::Disconnected) => Answer::Missing,
            Err(TryRecvError::Empty) => Answer::Open,
        }
    }
}

/// Shows the desktop's dialog and waits for it; `None`: nothing was chosen, or there is none.
#[cfg(target_os = "linux")]
pub(super) fn picked_file(folder: &Path) -> Option<PathBuf> {
    rfd::FileDialog::new()
        .set_directory(folder)
        .add_filter("scenes, meshes, pictures", &TAKEN_ENDINGS)
        .pick_file()
}

/// Elsewhere a dialog wants the window's own thread.
#[cfg(not(target_os = "linux"))]
pub(super) fn picked_file(_folder: &Path) -> Option<PathBuf> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer_of(pick: impl FnOnce() -> Option<PathBuf> + Send + 'static) -> Answer {
        let (sender, closed) = channel();
        let dialog = SystemDialog::show(pick, move || sender.send(()).unwrap());
        closed.recv().unwrap();
        dialog.answer()
    }

    #[test]
    fn a_dialog_that_nobody_shows_is_told_from_one_that_is_closed() {
        let file = PathBuf::from("scene.toml");
        let chosen = file.clone();
        assert_eq!(answer_of(move || Some(chosen)), Answer::Chosen(file));
        assert_eq!(answer_of(|| None), Answer::Missing);
        let closed = answer_of(|| {
            thread::sleep(TOO_SOON + Duration::from_millis(50));
            None
        });
        assert_eq!(closed, Answer::Closed);
        let (go_on, waits) = channel();
        let dialog = SystemDialog::show(move || waits.recv().ok(), || ());
        assert_eq!(
            dialog.answer(),
            Answer::Open,
            "the window waits for nothing"
        );
        go_on.send(PathBuf::new()).unwrap();
    }
}
