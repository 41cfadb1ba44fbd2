//! `[noise]`.

mod profile;

pub use profile::{
    Autocorrelation, LAGS, MAX_BINS, NOISE_PROFILE_VERSION, NoiseBin, NoiseFit, NoiseProfile,
    WHITE, bin_index,
};

use crate::refusal::Refusal;
use crate::scene::error::Result;
use crate::scene::fingerprint::{content, content_by_name};
use crate::scene::reader::{Choice, Table};
use crate::stages::table::{StageSettings, read_into};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseMethod {
    /// As much as is missing, drawn for each pixel with the measured correlation.
    Missing,
    /// The paper's: noise textures over the virtual pixels.
    Textures,
}

impl Choice for NoiseMethod {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("missing", Self::Missing), ("textures", Self::Textures)];
}

#[derive(Clone, Debug, PartialEq)]
pub struct NoiseSettings {
    pub profile: NoiseProfile,
    pub method: NoiseMethod,
    /// Factor on the noise that is added; 1 is the camera's own.
    pub scale: f32,
    /// Side of the textures, a power of two.
    pub texture_size: u32,
    /// Pixels that one texel covers along each axis.
    pub magnification: f32,
    /// Frames that keep the same noise.
    pub update_delay_frames: u32,
    /// Textures rounded to 8 bits, as the paper's are.
    pub eight_bit: bool,
}

impl NoiseSettings {
    /// Most texels of all bins' textures together: 1 GiB of them.
    pub const MAX_TEXELS: u64 = 1 << 26;
    /// Largest factor on the noise.
    pub const MAX_SCALE: f32 = 1e3;
    /// Largest texture side, texels.
    pub const MAX_TEXTURE_SIZE: u32 = 4096;

    /// Whether the textures are of a size that can be held.
    ///
    /// # Errors
    /// In one line: they are too large together.
    pub fn check_textures(&self) -> std::result::Result<(), Refusal> {
        let texels = u64::from(self.texture_size).pow(2) * self.profile.bins.len() as u64;
        if self.method == NoiseMethod::Textures && texels > Self::MAX_TEXELS {
            return Err(format!(
                "{} textures of {} x {} texels are more than {} texels in all; expected fewer or smaller ones; make texture_size smaller",
                self.profile.bins.len(),
                self.texture_size,
                self.texture_size,
                Self::MAX_TEXELS
            ).into());
        }
        Ok(())
    }

    pub fn new(profile: NoiseProfile) -> Self {
        Self {
            profile,
            method: NoiseMethod::Missing,
            scale: 1.0,
            texture_size: 512,
            magnification: 1.0,
            update_delay_frames: 1,
            eight_bit: false,
        }
    }
}

content! {
    NoiseSettings { profile, method, scale, texture_size, magnification, update_delay_frames, eight_bit }
}

content_by_name! { NoiseMethod }

impl StageSettings for NoiseSettings {
    const KEYS: &'static [&'static str] = &[
        "profile",
        "method",
        "scale",
        "texture_size",
        "magnification",
        "update_delay_frames",
        "eight_bit",
    ];

    fn read(table: &Table) -> Result<Self> {
        let profile = table.required("profile", "profile = \"noise.toml\"", |node| {
            let path = node.existing_file()?;
            NoiseProfile::read(&path).map_err(|problem| node.file_error(&path, problem))
        })?;
        let mut settings = NoiseSettings::new(profile);
        read_into(table, "method", &mut settings.method, |node| node.choice())?;
        read_into(table, "scale", &mut settings.scale, |node| {
            let most = f64::from(NoiseSettings::MAX_SCALE);
            let expected = format!("a number from 0 to {most}");
            Ok(node.number(&expected, |x| (0.0..=most).contains(&x))? as f32)
        })?;
        read_into(table, "texture_size", &mut settings.texture_size, |node| {
            let most = NoiseSettings::MAX_TEXTURE_SIZE;
            let size = node.integer(1, most)?;
            if size.is_power_of_two() {
                Ok(size)
            } else {
                Err(node.impossible(format!("a power of two, at most {most}")))
            }
        })?;
        read_into(
            table,
            "magnification",
            &mut settings.magnification,
            |node| {
                let expected = "a number from 0.01 to 1000";
                Ok(node.number(expected, |x| (0.01..=1e3).contains(&x))? as f32)
            },
        )?;
        let delay = &mut settings.update_delay_frames;
        read_into(table, "update_delay_frames", delay, |node| {
            node.integer(1, u32::MAX)
        })?;
        read_into(table, "eight_bit", &mut settings.eight_bit, |node| {
            node.boolean()
        })?;
        if let Err(problem) = settings.check_textures() {
            read_into(table, "texture_size", &mut settings.texture_size, |node| {
                Err(node.impossible(&problem))
            })?;
        }
        Ok(settings)
    }
}
