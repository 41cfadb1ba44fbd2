//! The composite taken apart, for programs that put it together again: `(1 - M) photograph ratio + virtual + change`.

use glam::DVec3;
use rayon::prelude::*;

use super::{Film, Means, PixelSums};
use crate::scene::Composite;

/// Summands and factors of the composite, linear Rec.709, row-major from the top left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts {
    /// M Im: the light of virtual things, premultiplied.
    pub virtual_light: Vec<[f32; 3]>,
    /// M, the fraction of rays that met virtual geometry first.
    pub coverage: Vec<f32>,
    /// What virtual things add to the light of real surfaces and take from it; already weighted by 1 - M.
    pub change: Vec<[f32; 3]>,
    /// What the quotient composite multiplies the photograph with; empty in the additive one.
    pub ratio: Vec<[f32; 3]>,
}

impl Parts {
    /// Of the composite of `film` in this mode.
    pub fn of(film: &Film, mode: Composite) -> Self {
        let pixels: Vec<PixelParts> = (0..film.pixels.len())
            .into_par_iter()
            .map(|pixel| PixelParts::of(&film.sums(pixel), mode))
            .collect();
        let colours = |get: fn(&PixelParts) -> DVec3| -> Vec<[f32; 3]> {
            pixels.iter().map(|p| get(p).as_vec3().to_array()).collect()
        };
        Self {
            virtual_light: colours(|p| p.virtual_light),
            coverage: pixels.iter().map(|p| p.coverage as f32).collect(),
            change: colours(|p| p.change),
            ratio: match mode {
                Composite::Additive => Vec::new(),
                Composite::Quotient => colours(|p| p.ratio),
            },
        }
    }
}

struct PixelParts {
    virtual_light: DVec3,
    coverage: f64,
    change: DVec3,
    ratio: DVec3,
}

impl PixelParts {
    fn of(sums: &PixelSums, mode: Composite) -> Self {
        let means = Means::of(sums);
        let is_quotient = mode == Composite::Quotient && sums.n_real > 0;
        let (change, ratio) = match is_quotient {
            true => (DVec3::ZERO, means.quotient()),
            false => (means.change(), DVec3::ONE),
        };
        Self {
            virtual_light: means.m_im,
            coverage: means.mask,
            change,
            ratio,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::film::{Sample, composite};
    use crate::scene::Photo;

    /// Put together again, the parts are the composite: in pixels that are virtual, real, both, or neither.
    #[test]
    fn parts_add_up_to_the_composite() {
        let mut film = Film::new(4, 1, 0, false);
        for pixel in 0..3 {
            for index in 0..40 {
                let x = ((pixel * 97 + index * 31) as f32 * 0.37).sin();
                let is_virtual = match pixel {
                    0 => true,
                    1 => false,
                    _ => index % 3 == 0,
                };
                film.add(
                    pixel,
                    &Sample {
                        is_virtual,
                        contribution: match is_virtual {
                            true => Vec3::new(0.4 + 0.3 * x, 0.2, 3.0),
                            false => Vec3::new(0.1 * x, -0.05, 0.0),
                        },
                        real: Some(Vec3::splat(0.5 + 0.2 * x)),
                    },
                );
            }
        }
        let photo = Photo::from_srgb8(4, 1, vec![[200, 90, 10]; 4]);
        for mode in [Composite::Additive, Composite::Quotient] {
            let parts = Parts::of(&film, mode);
            let truth = composite(&film, Some(&photo), mode);
            let again = |with_change: bool| {
                let pixels = (0..4).map(|p| {
                    std::array::from_fn(|c| {
                        let ratio = parts.ratio.get(p).map_or(1.0, |ratio| ratio[c]);
                        let change = parts.change[p][c] * f32::from(u8::from(with_change));
                        let shows = (1.0 - parts.coverage[p]) * photo.linear[p][c];
                        shows * ratio + parts.virtual_light[p][c] + change
                    })
                });
                pixels.collect::<Vec<[f32; 3]>>()
            };
            let worst = |found: &[[f32; 3]]| {
                let pairs = found.iter().flatten().zip(truth.linear.iter().flatten());
                pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
            };
            assert!(worst(&again(true)) < 1e-6, "{mode:?}");
            if mode == Composite::Additive {
                assert!(worst(&again(false)) > 0.01, "control");
            } else {
                assert!(parts.ratio[1][1] < 0.95, "control: {:?}", parts.ratio);
            }
        }
    }
}
