//! OpenEXR channels and the text that stands beside them.

use std::collections::BTreeMap;

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
    /// Three channels of one layer; `None` if one is missing.
    pub fn rgb(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = names.map(|name| self.floats.get(name));
        let (r, g, b) = (r?, g?, b?);
        Some((0..r.len()).map(|i| [r[i], g[i], b[i]]).collect())
    }
}
