//! Pictures to files: PNG and multilayer EXR, written beside the target and renamed, so that no broken picture is ever left.

mod channels;
mod cryptomatte;
mod exr_file;
mod exr_header;
mod exr_picture;
mod exr_text;
mod extension;
mod film_file;
mod film_note;
mod kept_codes;
mod layers;
mod metadata;
mod plain;
mod png_file;
mod reference_file;
mod target;
mod temporary;

pub use crate::decode::ChannelFile;
pub use exr_file::write_exr;
pub(crate) use exr_header::is_sealed;
pub use exr_picture::ExrPicture;
pub(crate) use extension::{check_folder_name, extension_among};
#[cfg(feature = "cli")]
pub(crate) use film_file::read_film_if_whole;
pub use film_file::{read_film, write_film};
pub use film_note::FilmNote;
pub use layers::{ExrLayer, ExrLayers};
pub use metadata::Metadata;
pub use plain::{write_composite, write_image};
#[cfg(feature = "preview")]
pub(crate) use png_file::code8;
pub(crate) use png_file::{PNG_END, picture_codes8};
pub use png_file::{PngBits, write_png};
pub use reference_file::write_reference;
#[cfg(feature = "bench")]
pub(crate) use target::quick;
pub use target::{Format, Target, write_bytes, write_text};
pub(crate) use target::{check_named, check_writable, sync_folder};
#[cfg(feature = "cli")]
pub(crate) use target::{check_writable_as, new_beside};
pub(crate) use temporary::{cut, remove_leftovers};

use std::path::PathBuf;

/// A picture or report could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    #[error("{}: the name ends in what cannot be written here; expected {expected}; name it so", path.display())]
    Extension { path: PathBuf, expected: String },
    #[error("{}: its name has no end that tells what it is; expected {expected}; name it so", path.display())]
    NoExtension { path: PathBuf, expected: String },
    #[error("{}: is a folder or another special file; name a file to write", path.display())]
    NotAFile { path: PathBuf },
    #[error(transparent)]
    Conflict(#[from] crate::files::Conflict),
    #[error("{}: cannot be written: {source}", path.display())]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}: cannot be encoded: {message}", path.display())]
    Encode { path: PathBuf, message: String },
}
