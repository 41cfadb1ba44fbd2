//! Frames of a video in and out: folders of pictures, Y4M streams, and runs of JPEG pictures as webcams write them.

mod sink;
mod source;
mod y4m;
mod y4m_file;
mod yuv;

pub use sink::{FrameSink, SinkPlan};
pub use source::{FrameRange, FrameSource, Pixels, VideoFrame};
pub use y4m::{Chroma, Header, Y4mReader};
pub use yuv::{decode_yuv, encode_yuv};

use std::path::PathBuf;

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
