//! Output files, checked before the work begins and replaced whole at the end.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::OutputError;
use super::temporary::{self, cut, remove_leftovers};
use crate::files;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Png,
    Exr,
}

/// A picture file that can be written, as far as can be known without writing it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    format: Format,
}

impl Target {
    /// Checks the extension and that a file can be made in the folder, and names it as an output of the run.
    ///
    /// # Errors
    /// Another extension, a missing or read-only folder, a target that is no regular file, an input or another output.
    pub fn picture(path: &Path) -> Result<Self, OutputError> {
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let format = match extension.as_ref().and_then(|e| e.to_str()) {
            Some("png") => Format::Png,
            Some("exr") => Format::Exr,
            _ => {
                return Err(OutputError::Extension { path: path.into() });
            }
        };
        check_writable(path)?;
        Ok(Self {
            path: path.into(),
            format,
        })
    }

    /// A picture file that is checked and named already.
    pub(crate) fn named(path: &Path, format: Format) -> Self {
        Self {
            path: path.into(),
            format,
        }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn format(&self) -> Format {
        self.format
    }
}

/// Names the output, removes what ended runs have left of it, and fails now if [`write_atomically`] would fail later.
pub(crate) fn check_writable(path: &Path) -> Result<(), OutputError> {
    let (folder, name) = folder_and_name(&check_named(path)?)?;
    remove_leftovers(&folder, |output| output == cut(&name));
    Ok(())
}

/// [`check_writable`], and leaves leftovers to the caller.
pub(crate) fn check_named(path: &Path) -> Result<PathBuf, OutputError> {
    files::output(path)?;
    let (_, target) = temporary_beside(path)?;
    Ok(target)
}

/// Replaces the file at `path` by `text`.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    write_bytes(path, text.as_bytes())
}

/// Replaces the file at `path` by `bytes`.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_atomically(path, |file| {
        file.write_all(bytes)
            .map_err(|source| io_error(path, source))
    })
}

/// As their namesakes, but no power cut is waited for: of what can be measured or drawn again.
#[cfg(feature = "bench")]
pub(crate) mod quick {
    use super::{OutputError, Path, Write, io_error, replace};

    pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
        write_bytes(path, text.as_bytes())
    }

    pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
        let write = |file: &mut std::io::BufWriter<&std::fs::File>| {
            file.write_all(bytes)
                .map_err(|source| io_error(path, source))
        };
        replace(path, write, |_| Ok(()))?;
        Ok(())
    }
}

/// Lets `write` fill a temporary file in the same folder, then renames it to `path`. The file is on the disk before it has its name, and
/// its name is before this ends.
pub(super) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let target = replace(path, write, File::sync_all)?;
    sync_folder(&target);
    Ok(())
}

/// Gives what the file is called, links resolved.
fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), OutputError>,
    settle: impl FnOnce(&File) -> io::Result<()>,
) -> Result<PathBuf, OutputError> {
    files::before_write(path)?;
    let (temporary, target) = temporary_beside(path)?;
    let mut writer = BufWriter::new(temporary.as_file());
    write(&mut writer)?;
    writer.flush().map_err(|source| io_error(path, source))?;
    drop(writer);
    settle(temporary.as_file()).map_err(|source| io_error(path, source))?;
    temporary
        .persist(&target)
        .map_err(|e| io_error(path, e.error))?;
    Ok(target)
}

/// The names in the folder of a file that was renamed are on the disk, where the system can say so.
pub(crate) fn sync_folder(target: &Path) {
    #[cfg(unix)]
    if let Ok((folder, _)) = folder_and_name(target)
        && let Ok(folder) = File::open(folder)
    {
        // Some file systems cannot; the file itself is there.
        let _ = folder.sync_all();
    }
}

fn io_error(path: &Path, source: io::Error) -> OutputError {
    OutputError::Io {
        path: path.into(),
        source,
    }
}

fn folder_and_name(target: &Path) -> Result<(PathBuf, OsString), OutputError> {
    let Some(name) = target.file_name() else {
        return Err(OutputError::NotAFile {
            path: target.into(),
        });
    };
    let folder = match target.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    Ok((folder.into(), name.into()))
}

/// An empty file beside `path`, to be renamed to it.
///
/// # Errors
/// `path` cannot be written.
#[cfg(feature = "cli")]
pub(crate) fn new_beside(path: &Path) -> Result<tempfile::NamedTempFile, OutputError> {
    Ok(temporary_beside(path)?.0)
}

/// An empty temporary file in the folder of `path`, and the path to rename it to (links resolved, so that they stay links).
fn temporary_beside(path: &Path) -> Result<(tempfile::NamedTempFile, PathBuf), OutputError> {
    let target = match path.metadata() {
        Ok(metadata) if !metadata.is_file() => {
            return Err(OutputError::NotAFile { path: path.into() });
        }
        Ok(_) => path.canonicalize().map_err(|e| io_error(path, e))?,
        Err(e) if e.kind() == io::ErrorKind::NotFound => files::final_target(path),
        Err(e) => return Err(io_error(path, e)),
    };
    let (folder, name) = folder_and_name(&target)?;
    let temporary = temporary::make(&folder, &name).map_err(|source| io_error(path, source))?;
    Ok((temporary, target))
}

#[cfg(test)]
mod tests;
