//! Frames of a video in and out: folders of pictures, Y4M streams, and runs of JPEG pictures as webcams write them.

mod frame_output;
mod matrix;
mod sink;
mod source;
mod y4m;
mod y4m_file;
mod yuv;

pub use frame_output::{FrameOutput, Pattern, Pictures};
pub use matrix::Matrix;
pub use sink::{FrameSink, SinkPlan, sequence_note};
pub use source::{FrameRange, FrameSource, Pixels, Taken, VideoFrame};
pub use y4m::{Chroma, Header, Y4mReader};
pub use yuv::{decode_yuv, encode_yuv, luma_codes};

use std::path::{Path, PathBuf};

/// Why frames cannot be read or written, in one line.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    #[error("{}: {message}", path.display())]
    File { path: PathBuf, message: String },
    /// A stream on standard input or output.
    #[error("{stream}: {message}")]
    Stream {
        stream: &'static str,
        message: String,
    },
    #[error(transparent)]
    Output(#[from] crate::output::OutputError),
}

/// Where a stream comes from or goes to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    File(PathBuf),
    Stdin,
    Stdout,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Stdin => f.write_str("standard input"),
            Self::Stdout => f.write_str("standard output"),
        }
    }
}

impl Place {
    pub(crate) fn error(&self, message: impl Into<String>) -> VideoError {
        let message = message.into();
        match self {
            Self::File(path) => VideoError::File {
                path: path.clone(),
                message,
            },
            Self::Stdin => VideoError::Stream {
                stream: "standard input",
                message,
            },
            Self::Stdout => VideoError::Stream {
                stream: "standard output",
                message,
            },
        }
    }
}

fn cannot_write(error: &std::io::Error) -> String {
    if error.kind() == std::io::ErrorKind::BrokenPipe {
        return "it was closed before the last frame; expected a reader to the end; see why the program behind the pipe ended".to_owned();
    }
    format!(
        "it cannot be written ({error}); expected room for the frames; make room, then go on with the same command"
    )
}

/// Frames of another render are there. `mark` is what stands with them, where this program leaves its fingerprint.
fn foreign(path: &Path, mark: &str) -> VideoError {
    let place = Place::File(path.into());
    if has_earlier_fingerprint(mark) {
        return place.error("it holds frames written by mixray of an earlier form; expected a new place; render it again, to another or with --overwrite");
    }
    place.error(
        "it holds frames of another render (another scene, trajectory or option, or none of this program's); expected a new place or the same render; name another, or replace them with --overwrite",
    )
}

/// Fingerprints had 16 digits once, and films had them in their headers.
fn has_earlier_fingerprint(mark: &str) -> bool {
    let digits = |rest: &str| rest.chars().take_while(char::is_ascii_hexdigit).count();
    let in_note = mark.split_once("\"fingerprint\": \"");
    in_note.is_some_and(|(_, rest)| digits(rest) == 16) || mark.contains(" XMIXRAY=")
}
