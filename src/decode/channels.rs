//! OpenEXR channels and the text that stands beside them.

use std::collections::BTreeMap;
use std::path::Path;

use super::exr::read_channels;
use super::file::{MAX_PICTURE_BYTES, read_file};
use super::{broken, guarded};

/// The first part of an OpenEXR file: 16- and 32-bit float and 32-bit whole channels by name, row-major, and its text attributes.
#[derive(Debug, Default)]
pub struct ChannelFile {
    pub width: u32,
    pub height: u32,
    pub floats: BTreeMap<String, Vec<f32>>,
    pub counts: BTreeMap<String, Vec<u32>>,
    pub texts: BTreeMap<String, String>,
}

impl ChannelFile {
    /// # Errors
    /// Why it cannot be read, in one line that begins with the path.
    pub fn read(path: &Path) -> Result<Self, String> {
        let read = || {
            let bytes = read_file(path, MAX_PICTURE_BYTES).map_err(|reason| {
                format!("it cannot be read ({reason}); expected an .exr file; correct the path or the rights")
            })?;
            Self::decode(&bytes)
        };
        read().map_err(|problem| format!("{}: {problem}", path.display()))
    }

    /// Decodes the bytes of an OpenEXR file.
    ///
    /// # Errors
    /// Why they cannot be used, in one line.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        if !bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            return Err("it is no OpenEXR file; expected .exr; convert it".to_owned());
        }
        guarded(|| read_channels(bytes)).unwrap_or_else(|thrown| Err(broken(thrown)))
    }

    /// Three channels of one layer; `None` if one is missing.
    pub fn rgb(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = names.map(|name| self.floats.get(name));
        let (r, g, b) = (r?, g?, b?);
        Some((0..r.len()).map(|i| [r[i], g[i], b[i]]).collect())
    }
}
