//! Hears of files that change on disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant, SystemTime};

use notify::{RecommendedWatcher, RecursiveMode, Watcher as _};

/// Programs write a file in several steps: it is looked at once it has rested for so long.
const REST: Duration = Duration::from_millis(200);

/// Watches the files that a scene is made of.
pub struct Watch {
    _watcher: RecommendedWatcher,
    heard: Receiver<()>,
    files: BTreeMap<PathBuf, Option<Stamp>>,
    last: Option<Instant>,
}

/// What a file looks like from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp {
    modified: Option<SystemTime>,
    bytes: u64,
}

fn stamp(path: &Path) -> Option<Stamp> {
    let metadata = std::fs::metadata(path).ok()?;
    Some(Stamp {
        modified: metadata.modified().ok(),
        bytes: metadata.len(),
    })
}

impl Watch {
    /// `wake` is called when something has happened, from another thread.
    ///
    /// # Errors
    /// The system cannot watch.
    pub fn new(
        files: impl IntoIterator<Item = PathBuf>,
        wake: impl Fn() + Send + 'static,
    ) -> notify::Result<Self> {
        let (sender, heard) = channel();
        let mut watcher = notify::recommended_watcher(move |_: notify::Result<notify::Event>| {
            // Nobody hears once the window is closed.
            let _ = sender.send(());
            wake();
        })?;
        let files: BTreeMap<_, _> = (files.into_iter())
            .map(|file| {
                let stamp = stamp(&file);
                (file, stamp)
            })
            .collect();
        // Folders, as a file that is replaced is another file.
        let mut folders: Vec<&Path> = files.keys().filter_map(|file| file.parent()).collect();
        folders.sort_unstable();
        folders.dedup();
        for folder in folders {
            let folder = match folder.as_os_str().is_empty() {
                true => Path::new("."),
                false => folder,
            };
            watcher.watch(folder, RecursiveMode::NonRecursive)?;
        }
        Ok(Self {
            _watcher: watcher,
            heard,
            files,
            last: None,
        })
    }

    /// The files that have changed and have rested since; each is told once.
    pub fn changed(&mut self, now: Instant) -> Vec<PathBuf> {
        if self.heard.try_iter().count() > 0 {
            self.last = Some(now);
        }
        if self.last.is_none_or(|last| now.duration_since(last) < REST) {
            return Vec::new();
        }
        self.last = None;
        let mut changed = Vec::new();
        for (file, before) in &mut self.files {
            let is = stamp(file);
            if is != *before {
                *before = is;
                changed.push(file.clone());
            }
        }
        changed
    }

    /// When to look again, if something has happened that has not rested yet.
    pub fn look_in(&self, now: Instant) -> Option<Duration> {
        self.last
            .map(|last| REST.saturating_sub(now.duration_since(last)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_written_is_told_once() {
        let folder = tempfile::tempdir().unwrap();
        let [watched, other] = ["scene.toml", "other"].map(|name| folder.path().join(name));
        std::fs::write(&watched, "a").unwrap();
        let mut watch = Watch::new([watched.clone()], || ()).unwrap();
        let wait = |watch: &mut Watch| {
            let end = Instant::now() + Duration::from_secs(2);
            while Instant::now() < end {
                let changed = watch.changed(Instant::now());
                if !changed.is_empty() {
                    return changed;
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            Vec::new()
        };
        std::fs::write(&watched, "longer").unwrap();
        std::fs::write(&watched, "longer still").unwrap();
        assert_eq!(wait(&mut watch), [watched]);
        std::fs::write(other, "b").unwrap();
        assert!(wait(&mut watch).is_empty(), "control: another file");
    }
}
