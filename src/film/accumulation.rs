//! The film: sums over camera samples, a record a pixel.

use bytemuck::Zeroable;

use crate::film::groups::GroupSums;
use crate::film::splats::{Splat, SplatSums, is_unusable_splat};
use crate::film::sums::{GuideSums, PixelSums, count_unusable};

/// Empties the records, and makes as many as are wanted; memory that is there is used again.
fn make_room<T: Zeroable + Clone>(records: &mut Vec<T>, count: usize) {
    if records.len() == count {
        records.fill(T::zeroed());
    } else {
        *records = bytemuck::zeroed_vec(count);
    }
}

/// What a pixel shows, known from the samples taken so far (design: background M = 0, virtual M = 1, edge between).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelKind {
    Background,
    Edge,
    Virtual,
    /// No sample was taken: nothing virtual can change this pixel.
    Skipped,
}

/// How many pixels are of which kind; the four add up to the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PixelCounts {
    pub background: u64,
    pub edge: u64,
    #[serde(rename = "virtual")]
    pub virtual_: u64,
    pub skipped: u64,
}

#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum MergeError {
    #[error("films of {0}x{1} and {2}x{3} pixels cannot be merged")]
    Size(u32, u32, u32, u32),
    #[error("one film has depth, normal and albedo planes, the other has none")]
    Guides,
    #[error("one film has photons, the other has none; render both alike")]
    Photons,
    #[error(
        "one film has groups of samples, the other has none; render both with the same --combine"
    )]
    Groups,
    #[error(
        "they were planned differently at pixel {0}: with another --no-skip, or by another kind of machine; render both alike"
    )]
    Plan(usize),
    #[error("the sample ranges do not follow one another at pixel {pixel}: {first} and {second}")]
    NotAdjacent {
        pixel: usize,
        /// "0..16"
        first: String,
        second: String,
    },
}

/// Per-pixel sums of everything the composite and the output planes need, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    pub width: u32,
    pub height: u32,
    /// First ray per pixel: above 0 where this film holds a later range of a render's samples.
    pub first_sample: u32,
    pub pixels: Vec<PixelSums>,
    /// Empty unless depth, normal and albedo were asked for.
    pub guides: Vec<GuideSums>,
    /// Empty unless photons are traced.
    pub splats: Vec<SplatSums>,
    /// Empty unless the delivered picture is combined robustly.
    pub groups: Vec<GroupSums>,
}

impl Film {
    /// An empty film. Memory that no sample touches is not committed.
    pub fn new(width: u32, height: u32, first_sample: u32, with_guides: bool) -> Self {
        let count = width as usize * height as usize;
        Self {
            width,
            height,
            first_sample,
            pixels: bytemuck::zeroed_vec(count),
            guides: bytemuck::zeroed_vec(if with_guides { count } else { 0 }),
            splats: Vec::new(),
            groups: Vec::new(),
        }
    }

    /// Makes room for groups of samples, or takes it back; none are kept.
    pub fn set_groups(&mut self, kept: bool) {
        make_room(&mut self.groups, if kept { self.pixels.len() } else { 0 });
    }

    /// Makes room for photons, or takes it back; none are kept.
    pub fn set_photons(&mut self, traced: bool) {
        make_room(&mut self.splats, if traced { self.pixels.len() } else { 0 });
    }

    /// Photons that every pixel has seen traced.
    pub fn photons(&self) -> u64 {
        self.splats.first().map_or(0, |sums| sums.photons)
    }

    /// Adds what `photons` more photons brought.
    pub fn add_splats(&mut self, photons: u64, splats: impl Iterator<Item = Splat>) {
        for splat in splats {
            let pixel = splat.pixel as usize;
            if is_unusable_splat(splat.value) {
                count_unusable(&mut self.pixels[pixel], 0);
            } else {
                self.splats[pixel].add(&splat);
            }
        }
        // Not looked at in vain: a film is large.
        if photons > 0 {
            for sums in &mut self.splats {
                sums.photons += photons;
            }
        }
    }

    /// A pixel's sums, with what photons brought.
    pub fn sums(&self, pixel: usize) -> PixelSums {
        let sums = self.pixels[pixel];
        match self.splats.get(pixel) {
            Some(splats) => splats.folded_into(sums, self.splats.len() as f64),
            None => sums,
        }
    }

    /// Says how many samples each pixel takes for every ray per pixel, before the first of them.
    pub fn set_sample_factors(&mut self, factors: impl Iterator<Item = u32>) {
        for (sums, factor) in self.pixels.iter_mut().zip(factors) {
            sums.sample_factor = factor;
        }
    }

    /// No sample has reached the pixel.
    pub fn is_untouched(&self, pixel: usize) -> bool {
        let sums = &self.pixels[pixel];
        sums.n == 0 && sums.n_real == 0 && sums.non_finite == 0
    }

    /// Takes all samples back for another plan of samples, as [`Film::set_sample_factors`], in the memory that is there; [`Film::set_groups`] and
    /// [`Film::set_photons`] follow.
    pub fn renew(&mut self, factors: impl Iterator<Item = u32>) {
        for (sums, sample_factor) in self.pixels.iter_mut().zip(factors) {
            *sums = PixelSums {
                sample_factor,
                ..PixelSums::default()
            };
        }
        self.guides.fill(GuideSums::default());
    }

    /// Takes all samples back; the plan of samples stays.
    pub fn clear(&mut self) {
        for sums in &mut self.pixels {
            *sums = PixelSums {
                sample_factor: sums.sample_factor,
                ..PixelSums::default()
            };
        }
        self.guides.fill(GuideSums::default());
        self.splats.fill(SplatSums::default());
        self.groups.fill(GroupSums::default());
    }

    /// Index of a pixel's first sample in this film.
    pub fn first_index(&self, pixel: usize) -> u32 {
        self.first_sample * self.pixels[pixel].sample_factor.max(1)
    }

    /// Index after a pixel's last sample, if it takes those of the rays up to `end`.
    pub fn end_index(&self, pixel: usize, end: u32) -> u32 {
        end * self.pixels[pixel].sample_factor.max(1)
    }

    pub fn kind(&self, pixel: usize) -> PixelKind {
        kind(&self.pixels[pixel])
    }

    /// An edge pixel whose real radiance is not known for all its samples; they have to be replayed, from index
    /// `first_index + n_real` on, before its composite is Eq. 4.
    pub fn needs_real(&self, pixel: usize) -> bool {
        let sums = &self.pixels[pixel];
        kind(sums) == PixelKind::Edge && sums.n_real < sums.n
    }

    pub fn counts(&self) -> PixelCounts {
        let mut counts = PixelCounts::default();
        for sums in &self.pixels {
            match kind(sums) {
                PixelKind::Background => counts.background += 1,
                PixelKind::Edge => counts.edge += 1,
                PixelKind::Virtual => counts.virtual_ += 1,
                PixelKind::Skipped => counts.skipped += 1,
            }
        }
        counts
    }

    /// Samples left out because they were not finite.
    pub fn non_finite_samples(&self) -> u64 {
        self.pixels.iter().map(|p| u64::from(p.non_finite)).sum()
    }

    /// Pixel and sample index of the first of them, to render just that one again.
    pub fn first_non_finite(&self) -> Option<(usize, u32)> {
        self.pixels
            .iter()
            .position(|p| p.non_finite > 0)
            .map(|pixel| (pixel, self.pixels[pixel].first_non_finite))
    }

    /// Adds a film that holds the samples just before or just after this one's, of the same render (same scene, seed, sampler
    /// and total). Edge pixels may need real samples replayed afterwards: see [`Film::needs_real`].
    ///
    /// # Errors
    /// If sizes or planes differ, or the ranges leave a gap or overlap; this film is then unchanged.
    pub fn merge(&mut self, other: &Film) -> Result<(), MergeError> {
        if (self.width, self.height) != (other.width, other.height) {
            return Err(MergeError::Size(
                self.width,
                self.height,
                other.width,
                other.height,
            ));
        }
        if self.guides.len() != other.guides.len() {
            return Err(MergeError::Guides);
        }
        if self.splats.len() != other.splats.len() {
            return Err(MergeError::Photons);
        }
        if self.groups.len() != other.groups.len() {
            return Err(MergeError::Groups);
        }
        if other.first_sample < self.first_sample {
            let mut merged = other.clone();
            merged.merge(self)?;
            *self = merged;
            return Ok(());
        }
        for (pixel, (a, b)) in self.pixels.iter().zip(&other.pixels).enumerate() {
            // A pixel without samples in both films is skipped in the whole render.
            let skipped = a.n == 0 && b.n == 0;
            if !skipped && a.sample_factor != b.sample_factor {
                return Err(MergeError::Plan(pixel));
            }
            if !skipped && self.first_index(pixel) + a.n != other.first_index(pixel) {
                let range = |film: &Film, n| {
                    let first = film.first_index(pixel);
                    format!("{first}..{}", first + n)
                };
                return Err(MergeError::NotAdjacent {
                    pixel,
                    first: range(self, a.n),
                    second: range(other, b.n),
                });
            }
        }
        for (a, b) in self.pixels.iter_mut().zip(&other.pixels) {
            a.merge(b);
        }
        for (a, b) in self.guides.iter_mut().zip(&other.guides) {
            a.merge(b);
        }
        for (a, b) in self.splats.iter_mut().zip(&other.splats) {
            a.merge(b);
        }
        for (a, b) in self.groups.iter_mut().zip(&other.groups) {
            a.merge(b);
        }
        Ok(())
    }
}

fn kind(sums: &PixelSums) -> PixelKind {
    match (sums.n, sums.m) {
        (0, _) => PixelKind::Skipped,
        (_, 0) => PixelKind::Background,
        (n, m) if n == m => PixelKind::Virtual,
        _ => PixelKind::Edge,
    }
}

#[cfg(test)]
mod tests;
