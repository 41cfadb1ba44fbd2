//! Frames in linear light. Edges lie where the light is half of both sides: in encoded values half lies elsewhere, by up to half a pixel.

use glam::DVec2;

use crate::scene::{EncodedPhoto, Photo};
use crate::video::{Header, luma_codes};

/// Brightness of a frame as its file encodes it, row-major from the top left.
#[derive(Clone, Debug)]
pub struct Luma {
    pub width: usize,
    pub height: usize,
    pub codes: Vec<u8>,
}

impl Luma {
    /// Of a Y4M stream's frame, without its colours.
    pub fn of_planes(header: &Header, planes: &[u8]) -> Self {
        Self {
            width: header.width as usize,
            height: header.height as usize,
            codes: luma_codes(header, planes),
        }
    }

    /// Weights of BT.601; linear pictures are encoded as sRGB.
    pub fn of(photo: &Photo) -> Self {
        let code = |[r, g, b]: [f32; 3]| (0.299 * r + 0.587 * g + 0.114 * b + 0.5) as u8;
        let codes = match &photo.encoded {
            EncodedPhoto::Codes8(codes) => codes.iter().map(|c| code(c.map(f32::from))).collect(),
            EncodedPhoto::Codes16(codes) => {
                let scaled = codes.iter().map(|c| c.map(|x| f32::from(x) / 257.0));
                scaled.map(code).collect()
            }
            EncodedPhoto::Linear => {
                let scaled = photo.linear.iter();
                let encode = |x: f32| 255.0 * encoded_srgb(x.clamp(0.0, 1.0));
                scaled.map(|c| code(c.map(encode))).collect()
            }
        };
        Self {
            width: photo.width as usize,
            height: photo.height as usize,
            codes,
        }
    }
}

fn encoded_srgb(x: f32) -> f32 {
    match x <= 0.003_130_8 {
        true => 12.92 * x,
        false => 1.055 * x.powf(1.0 / 2.4) - 0.055,
    }
}

/// How codes become light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tone {
    Srgb,
    /// Light is the code to this power.
    Power(f64),
}

impl Tone {
    pub fn light(self, code: u8) -> f32 {
        let x = f64::from(code) / 255.0;
        let light = match self {
            Self::Srgb if x <= 0.040_45 => x / 12.92,
            Self::Srgb => ((x + 0.055) / 1.055).powf(2.4),
            Self::Power(power) => x.powf(power),
        };
        light as f32
    }
}

impl std::fmt::Display for Tone {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Srgb => f.write_str("srgb"),
            Self::Power(power) => write!(f, "{power:.2}"),
        }
    }
}

/// Linear light, 0 to 1, row-major from the top left.
#[derive(Clone, Debug)]
pub struct LightImage {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl LightImage {
    pub fn of(luma: &Luma, tone: Tone) -> Self {
        let table: Vec<f32> = (0..=255).map(|code| tone.light(code)).collect();
        Self {
            width: luma.width,
            height: luma.height,
            values: luma.codes.iter().map(|c| table[usize::from(*c)]).collect(),
        }
    }

    /// Light for dark.
    pub fn negative(&self) -> Self {
        Self {
            values: self.values.iter().map(|light| 1.0 - light).collect(),
            ..*self
        }
    }

    /// Bilinear between pixel centres, the edge's value beyond. Pixels, corner origin.
    pub fn at(&self, place: DVec2) -> f32 {
        let x = (place.x - 0.5).clamp(0.0, self.width as f64 - 1.001);
        let y = (place.y - 0.5).clamp(0.0, self.height as f64 - 1.001);
        let (column, row) = (x as usize, y as usize);
        let (a, b) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let first = row * self.width + column;
        let upper = &self.values[first..first + 2];
        let lower = &self.values[first + self.width..first + self.width + 2];
        (upper[0] * (1.0 - a) + upper[1] * a) * (1.0 - b)
            + (lower[0] * (1.0 - a) + lower[1] * a) * b
    }
}
