//! Reading OpenEXR channels and the text that stands beside them.

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{AttributeValue, FlatSamples};

/// The first part of an OpenEXR file: 16- and 32-bit float and 32-bit whole channels by name, row-major, and its text attributes.
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
        let problem = |reason: &str| format!("{}: {reason}", path.display());
        let unreadable = |error: &dyn std::fmt::Display| {
            problem(&format!(
                "cannot be read as OpenEXR ({error}); expected an .exr file that is whole; correct the path or write the file again"
            ))
        };
        crate::files::input(path).map_err(|error| unreadable(&error))?;
        let image = exr::prelude::read_first_flat_layer_from_file(path)
            .map_err(|error| unreadable(&error))?;
        let layer = image.layer_data;
        let mut file = Self {
            width: layer.size.x() as u32,
            height: layer.size.y() as u32,
            floats: BTreeMap::new(),
            counts: BTreeMap::new(),
            texts: BTreeMap::new(),
        };
        for channel in layer.channel_data.list {
            let name = channel.name.to_string();
            match channel.sample_data {
                FlatSamples::U32(samples) => {
                    file.counts.insert(name, samples);
                }
                FlatSamples::F32(samples) => {
                    file.floats.insert(name, samples);
                }
                FlatSamples::F16(samples) => {
                    let wide = samples.iter().map(|s| s.to_f32()).collect();
                    file.floats.insert(name, wide);
                }
            }
        }
        for (name, value) in layer.attributes.other {
            if let AttributeValue::Text(text) = value {
                file.texts.insert(name.to_string(), text.to_string());
            }
        }
        Ok(file)
    }

    /// Three channels of one layer; `None` if one is missing.
    pub fn rgb(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = names.map(|name| self.floats.get(name));
        let (r, g, b) = (r?, g?, b?);
        Some((0..r.len()).map(|i| [r[i], g[i], b[i]]).collect())
    }
}
