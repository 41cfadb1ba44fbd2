//! Reading whole files, none of which may be without an end.

use std::io::Read;
use std::path::Path;

use crate::files;
use crate::memory::{Bytes, ensure};

/// Longest text: a scene, a noise profile, a table.
pub(crate) const MAX_TEXT_BYTES: u64 = 16 << 20;
/// Longest list of poses: those of structure from motion hold the points of every picture too.
pub(crate) const MAX_POSES_BYTES: u64 = 256 << 20;
/// Longest picture.
pub(crate) const MAX_PICTURE_BYTES: u64 = 16 << 30;
/// Longest file whose length is not known before it is read: a pipe or a device.
const MAX_UNKNOWN_BYTES: u64 = 1 << 30;

/// The bytes of a file of at most `limit` bytes: a regular file, or a pipe.
///
/// # Errors
/// The reason, without the path.
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, String> {
    let file = files::open(path).map_err(|error| error.to_string())?;
    let meta = file.metadata().map_err(|error| error.to_string())?;
    if meta.is_file() {
        if meta.len() > limit {
            return Err(too_long(meta.len(), limit));
        }
        ensure(meta.len(), "the file").map_err(|shortage| shortage.to_string())?;
    }
    let limit = match meta.is_file() {
        true => limit,
        false => limit.min(MAX_UNKNOWN_BYTES),
    };
    read_stream(file, limit)
}

/// The bytes of a stream of at most `limit` bytes.
///
/// # Errors
/// The reason.
pub(crate) fn read_stream(stream: impl Read, limit: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    stream
        .take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| error.to_string())?;
    match bytes.len() as u64 > limit {
        true => Err(too_long(limit + 1, limit)),
        false => Ok(bytes),
    }
}

/// The text of a file of at most `limit` bytes.
///
/// # Errors
/// The reason, without the path.
pub(crate) fn read_text(path: &Path, limit: u64) -> Result<String, String> {
    text_of(read_file(path, limit)?).ok_or_else(|| "it is no UTF-8 text".to_owned())
}

/// UTF-8 without the mark that editors of Windows begin it with.
pub(crate) fn text_of(bytes: Vec<u8>) -> Option<String> {
    let text = String::from_utf8(bytes).ok()?;
    Some(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}

fn too_long(length: u64, limit: u64) -> String {
    format!(
        "it has {length} bytes or more, and at most {limit} ({}) are read",
        Bytes(limit)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_longer_than_the_limit_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"12345").unwrap();
        assert_eq!(read_file(&path, 5).unwrap(), b"12345", "control");
        assert!(read_file(&path, 4).unwrap_err().contains("at most 4"));
        assert!(read_stream(&b"12345"[..], 4).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_file_without_an_end_is_refused() {
        let refused = read_text(Path::new("/dev/zero"), MAX_TEXT_BYTES).unwrap_err();
        assert!(refused.contains("16777216"), "{refused}");
    }
}
