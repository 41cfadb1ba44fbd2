//! The files of a run: what it reads is never written over.
//!
//! Everything that is read is opened here and everything that is written is named here, so that no command can forget the rule. It holds
//! from [`guard_run`] on, to the end of the process; without it nothing is remembered.

mod paths;
mod registry;

pub(crate) use paths::{final_target, resolved};

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Mutex;

use paths::Identity;
use registry::Registry;

pub use registry::Conflict;

static RUN: Mutex<Option<Registry>> = Mutex::new(None);

/// From now on this process is one run: an output that is a file which it reads, or another output, is refused.
pub fn guard_run() {
    let mut run = RUN.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let registry = run.get_or_insert_default();
    // A shell can make standard output a file that is read (`>> scene.toml`).
    if let Some(identity) = Identity::of_standard_output() {
        // The registry is empty.
        let _ = registry.output("standard output", None, Some(identity));
    }
}

/// The first output that was refused, in case that what met it could not say so.
#[cfg(feature = "cli")]
pub(crate) fn conflict() -> Option<Conflict> {
    with(|registry| registry.conflict()).flatten()
}

fn with<T>(act: impl FnOnce(&mut Registry) -> T) -> Option<T> {
    let mut run = RUN.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    run.as_mut().map(act)
}

/// A file of that path is read, or named by what is read.
///
/// # Errors
/// It is an output of this run.
pub(crate) fn input(path: &Path) -> io::Result<()> {
    input_of(path, Identity::of_path(path))
}

fn input_of(path: &Path, identity: Option<Identity>) -> io::Result<()> {
    let note = |registry: &mut Registry| {
        registry.input(&path.to_string_lossy(), Some(resolved(path)), identity)
    };
    with(note).unwrap_or(Ok(())).map_err(io::Error::other)
}

/// Standard input is read, which may be a file.
///
/// # Errors
/// As [`input`].
pub(crate) fn standard_input() -> io::Result<()> {
    let note = |registry: &mut Registry| {
        registry.input("standard input", None, Identity::of_standard_input())
    };
    with(note).unwrap_or(Ok(())).map_err(io::Error::other)
}

/// Opens a file to read it.
///
/// # Errors
/// As [`File::open`] and [`input`].
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let file = File::open(path)?;
    input_of(path, Identity::of_file(&file))?;
    Ok(file)
}

/// Names an output. Each is named once.
///
/// # Errors
/// It is an input, or another output.
pub(crate) fn output(path: &Path) -> Result<(), Conflict> {
    let note = |registry: &mut Registry| {
        registry.output(
            &path.to_string_lossy(),
            Some(resolved(path)),
            Identity::of_path(path),
        )
    };
    with(note).unwrap_or(Ok(()))
}

/// Names a file of the run's own, which it reads and writes: reading it makes it no input.
///
/// # Errors
/// As [`output`].
#[cfg(any(feature = "bench", feature = "start"))]
pub(crate) fn own(path: &Path) -> Result<(), Conflict> {
    output(path)?;
    with(|registry| registry.own(&resolved(path)));
    Ok(())
}

/// Fails if [`output`] would, and names nothing.
///
/// # Errors
/// As [`output`].
pub(crate) fn check_output(path: &Path) -> Result<(), Conflict> {
    let check = |registry: &mut Registry| {
        registry.check_output(
            &path.to_string_lossy(),
            Some(&resolved(path)),
            Identity::of_path(path),
        )
    };
    with(check).unwrap_or(Ok(()))
}

/// Before a file is replaced, whether or not it was named.
///
/// # Errors
/// It is an input.
pub(crate) fn before_write(path: &Path) -> Result<(), Conflict> {
    let check = |registry: &mut Registry| {
        registry.before_write(
            &path.to_string_lossy(),
            Some(&resolved(path)),
            Identity::of_path(path),
        )
    };
    with(check).unwrap_or(Ok(()))
}
