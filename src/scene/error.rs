//! The one error of scene loading: where, what, what was expected, how to mend it, on one line.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use super::sandbox::Sandbox;

/// Why a scene was refused. Displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file, or a file that it names, cannot be read.
    #[error(
        "{}: the scene file cannot be read ({reason}); expected a TOML file; correct the path",
        path.display()
    )]
    Unreadable { path: PathBuf, reason: String },
    /// Something in the scene file, or in a file that it names, cannot be used. `message` reads "problem; expected ...; how to mend".
    #[error("{}:{line}:{column}: {message}", path.display())]
    Invalid {
        path: PathBuf,
        /// From 1.
        line: usize,
        /// From 1, in characters.
        column: usize,
        message: String,
    },
}

pub(crate) type Result<T> = std::result::Result<T, SceneError>;

/// The text of a scene file, for turning byte offsets into lines and columns.
pub(crate) struct Source {
    pub path: PathBuf,
    pub text: String,
    /// Files that were named and found.
    pub files: RefCell<Vec<PathBuf>>,
    /// Where they have to lie, if anywhere.
    pub sandbox: Option<Sandbox>,
}

impl Source {
    pub fn new(path: &Path, bytes: Vec<u8>) -> Result<Self> {
        let path = path.to_path_buf();
        match String::from_utf8(bytes) {
            Ok(text) => {
                let text = match text.strip_prefix('\u{feff}') {
                    Some(rest) => rest.to_owned(),
                    None => text,
                };
                Ok(Self::of(path, text))
            }
            Err(error) => {
                let end = error.utf8_error().valid_up_to();
                let valid = String::from_utf8_lossy(&error.as_bytes()[..end]).into_owned();
                Err(Self::of(path, valid).error(
                    end,
                    "a byte here is not UTF-8; expected a text file; save the scene file as UTF-8",
                ))
            }
        }
    }

    fn of(path: PathBuf, text: String) -> Self {
        let files = RefCell::new(vec![path.clone()]);
        Self {
            path,
            text,
            files,
            sandbox: None,
        }
    }

    /// An error at a byte offset.
    pub fn error(&self, offset: usize, message: impl AsRef<str>) -> SceneError {
        let before = &self.text[..self.text.floor_char_boundary(offset)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        SceneError::Invalid {
            path: self.path.clone(),
            line: 1 + before.matches('\n').count(),
            column: 1 + before[line_start..].chars().count(),
            message: one_line(message.as_ref()),
        }
    }

    /// A path of the scene file, relative to its folder, made absolute.
    pub fn resolve(&self, relative: &str) -> PathBuf {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let joined = folder.join(relative);
        std::path::absolute(&joined).unwrap_or(joined)
    }
}

/// Messages of other libraries, and names in the file, may hold line breaks and control characters.
fn one_line(message: &str) -> String {
    let mut line = String::with_capacity(message.len());
    for word in message.split(|c: char| c.is_control()) {
        let word = word.trim();
        if !line.is_empty() && !word.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    line
}
