//! `[antialias]`.

use crate::scene::error::Result;
use crate::scene::fingerprint::content;
use crate::scene::reader::Table;
use crate::stages::table::{StageSettings, read_into};

/// Blending of virtual border pixels with their real neighbours, for pictures whose mask is binary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntialiasSettings {
    /// Share of the blended colour, 0 to 1; 0 changes nothing.
    pub beta: f32,
}

impl Default for AntialiasSettings {
    fn default() -> Self {
        Self { beta: 0.8 }
    }
}

content! {
    AntialiasSettings { beta }
}

impl StageSettings for AntialiasSettings {
    const KEYS: &'static [&'static str] = &["beta"];

    fn read(table: &Table) -> Result<Self> {
        let mut settings = AntialiasSettings::default();
        read_into(table, "beta", &mut settings.beta, |node| node.unit())?;
        Ok(settings)
    }
}
