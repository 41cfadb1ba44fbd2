//! Camera noise on what no camera took.
//!
//! `missing` adds noise where and as far as the photograph's own is missing: a pixel with coverage a and real-surface ratio r carries
//! (1-a)^2 r^2 s(Ic)^2 of the camera's noise already, and the Monte Carlo estimate its own variance v, so that
//!
//! ```text
//! max(0, s(If)^2 - (1-a)^2 r^2 s(Ic)^2 - v)
//! ```
//!
//! is added. s comes from the [`NoiseProfile`], by bin of the pixel's intensity; it is measured in encoded
//! values, s_lin = s |d linear / d encoded|. The noise is added to the encoded value, so that it has the measured sigma there however
//! curved the response is.
//!
//! `textures` is the method of J. Fischer, D. Bartz: Handling Photographic Imperfections and Aliasing in Augmented Reality
//! (WSI-2006-03), sections 3.3 to 3.5: one texture of normal deviates a bin, laid over the virtual pixels with a random translation and
//! rotation for every frame.

mod field;
mod gpu;
mod kernel;
mod missing;
mod own_variance;
pub(super) mod settings;
mod stage;
#[cfg(test)]
mod tests;
mod textures;

pub use field::{FieldBand, NoiseField, white_deviates};
pub use kernel::{autocorrelation_of, fit_kernel};
pub use missing::{missing_sigma, sigma_table};
pub use settings::{LAGS, NoiseBin, NoiseMethod, NoiseProfile, NoiseSettings};
pub(super) use stage::STAGE;
pub use textures::{Placement, Texture, Textures};

use std::ops::Range;

use rayon::prelude::*;

use super::curve::{decode_, encode_rgb};
use crate::film::Picture;
use crate::shared::shared;

shared! {
    /// Intensities are shifted by this much before they are sorted into bins, so that no whole code lies on the border of two, where
    /// rounding would decide. DN.
    pub const BIN_SHIFT: f32 = 0.01;
}

/// Rows that one task works on.
const BAND: usize = 32;

/// What the stage knows of the picture beside its values; all row-major and as long as the picture.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoiseInput<'a> {
    /// The photograph, linear. None: nothing in the picture has noise yet.
    pub photo: Option<&'a [[f32; 3]]>,
    /// Coverage by virtual things, 0 to 1. None: 1 everywhere.
    pub mask: Option<&'a [f32]>,
    /// What the photograph was multiplied with. None: 1.
    pub ratio: Option<&'a [[f32; 3]]>,
    /// Variance that the estimate brought in itself, linear. None: 0.
    pub variance: Option<&'a [[f32; 3]]>,
}

impl NoiseInput<'_> {
    /// Pixel `index` is the photograph's own, bit for bit.
    fn is_untouched(&self, index: usize, value: &[f32; 3]) -> bool {
        self.photo
            .is_some_and(|photo| photo[index].map(f32::to_bits) == value.map(f32::to_bits))
    }

    fn coverage(&self, index: usize) -> f32 {
        self.mask.map_or(1.0, |mask| mask[index])
    }
}

/// Noise of one camera, ready for any frame.
#[derive(Clone, Debug)]
pub struct NoiseStage {
    settings: NoiseSettings,
    source: NoiseSource,
}

/// Where the noise comes from.
#[derive(Clone, Debug)]
pub enum NoiseSource {
    Missing(NoiseField),
    Textures(Textures),
}

impl NoiseStage {
    /// `seed` fixes the textures and the noise of every frame.
    pub fn new(settings: &NoiseSettings, seed: u32) -> Self {
        let source = match settings.method {
            NoiseMethod::Missing => NoiseSource::Missing(NoiseField::of(&settings.profile, seed)),
            NoiseMethod::Textures => NoiseSource::Textures(Textures::generate(settings, seed)),
        };
        Self {
            settings: settings.clone(),
            source,
        }
    }

    pub fn settings(&self) -> &NoiseSettings {
        &self.settings
    }

    pub fn source(&self) -> &NoiseSource {
        &self.source
    }

    /// Adds the noise of frame number `frame`. Pixels that need none keep their values bit for bit.
    pub fn apply(&self, picture: &mut Picture, input: &NoiseInput, frame: u32) {
        let width = picture.width as usize;
        let frame = frame / self.settings.update_delay_frames.max(1);
        match &self.source {
            NoiseSource::Missing(field) => {
                let table = sigma_table(&self.settings.profile);
                picture
                    .linear
                    .par_chunks_mut(BAND * width)
                    .enumerate()
                    .for_each(|(band, values)| {
                        let place = Band {
                            width,
                            first_row: band * BAND,
                        };
                        place.add_missing(values, input, field, &table, self.settings.scale, frame);
                    });
            }
            NoiseSource::Textures(textures) => {
                let placement = textures.placement(frame);
                picture
                    .linear
                    .par_iter_mut()
                    .enumerate()
                    .filter(|(index, _)| input.coverage(*index) >= 0.5)
                    .for_each(|(index, value)| {
                        let (x, y) = ((index % width) as f32, (index / width) as f32);
                        let encoded = encode_rgb(*value);
                        let variation = textures.variation(&placement, encoded, x, y);
                        for c in 0..3 {
                            value[c] = decode_(
                                encoded[c] + self.settings.scale * variation[c] * (1.0 / 255.0),
                            );
                        }
                    });
            }
        }
    }
}

/// Some rows of the picture.
struct Band {
    width: usize,
    first_row: usize,
}

impl Band {
    fn add_missing(
        &self,
        values: &mut [[f32; 3]],
        input: &NoiseInput,
        field: &NoiseField,
        table: &[[f32; 3]],
        scale: f32,
        frame: u32,
    ) {
        let touched = |x: usize, row: usize| {
            let index = (self.first_row + row) * self.width + x;
            !input.is_untouched(index, &values[row * self.width + x])
        };
        let Some((columns, rows)) = bounds(self.width, values.len() / self.width, &touched) else {
            return;
        };
        let (left, right) = (columns.start, columns.end);
        let first_row = self.first_row + rows.start;
        let band = FieldBand::new(field, frame, columns, first_row..self.first_row + rows.end);
        for (row, values) in values.chunks_mut(self.width).enumerate() {
            let y = self.first_row + row;
            let any = (left..right).any(|x| !input.is_untouched(y * self.width + x, &values[x]));
            if !any {
                continue;
            }
            let noise = band.correlated(y);
            for x in left..right {
                let index = y * self.width + x;
                if input.is_untouched(index, &values[x]) {
                    continue;
                }
                let encoded = encode_rgb(values[x]);
                let sigma = missing_sigma(
                    table,
                    encoded,
                    input.photo.map_or([0.0; 3], |photo| photo[index]),
                    if input.photo.is_some() {
                        1.0 - input.coverage(index)
                    } else {
                        0.0
                    },
                    input.ratio.map_or([1.0; 3], |ratio| ratio[index]),
                    input.variance.map_or([0.0; 3], |variance| variance[index]),
                );
                for c in (0..3).filter(|c| sigma[*c] > 0.0) {
                    let noise = noise[c][x - left];
                    values[x][c] = decode_(encoded[c] + scale * sigma[c] * noise * (1.0 / 255.0));
                }
            }
        }
    }
}

/// The smallest columns and rows that hold everything `touched`.
fn bounds(
    width: usize,
    height: usize,
    touched: &dyn Fn(usize, usize) -> bool,
) -> Option<(Range<usize>, Range<usize>)> {
    let mut columns = width..0;
    let mut rows = height..0;
    for row in 0..height {
        if let Some(first) = (0..width).find(|x| touched(*x, row)) {
            let last = (first..width).rev().find(|x| touched(*x, row));
            columns.start = columns.start.min(first);
            columns.end = columns.end.max(last.unwrap_or(first) + 1);
            rows.start = rows.start.min(row);
            rows.end = row + 1;
        }
    }
    (!rows.is_empty()).then_some((columns, rows))
}
