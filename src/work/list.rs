//! Which samples are to be taken, pixel by pixel.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use crate::film::Film;
use crate::packed::{PIXEL_EDGE, PIXEL_OUT_OF_REACH, PixelInfo};
use crate::shared::shared;

/// What is traced for a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// What the estimator brings: the virtual radiance, or the difference.
    Main,
    /// The real radiance of a sample that the main pass took.
    Real,
}

shared! {
    /// Samples `first..end` of a pixel, which are the next ones of its sums.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
    pub struct PixelWork {
        /// Row-major index.
        pub pixel: u32,
        pub first: u32,
        pub end: u32,
        /// On a GPU: the pixel's place among those of its sharing tile that lie together in the list, plus [`TILE_PLACES`] times their number.
        pub tile: u32,
    }

    pub const TILE_PLACES: u32 = 256;
}

impl PixelWork {
    pub fn new(pixel: u32, samples: Range<u32>) -> Self {
        Self {
            pixel,
            first: samples.start,
            end: samples.end,
            tile: 0,
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> u32 {
        self.end.saturating_sub(self.first)
    }
}

/// The samples that a backend is to take in one go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorkList {
    pub pass: Pass,
    /// Each pixel once at the most, in ascending order, none without samples.
    pub pixels: Vec<PixelWork>,
    /// None of the pixels has any sample.
    pub is_first: bool,
}

impl WorkList {
    /// [`WorkList::main`] of a film that has no sample yet and the plan of `infos`: it is large, and not looked at.
    pub fn first(
        infos: &[PixelInfo],
        film: &Film,
        end_of_row: impl Fn(usize) -> u32 + Sync,
    ) -> Self {
        let first_ray = film.first_sample;
        let samples = |pixel: usize, end: u32| {
            let info = &infos[pixel];
            let factor = info.sample_factor.max(1);
            let wanted = info.flags & PIXEL_OUT_OF_REACH == 0;
            wanted.then_some(first_ray * factor..end * factor)
        };
        Self {
            is_first: true,
            ..Self::of(Pass::Main, film, end_of_row, samples)
        }
    }

    /// The samples that every pixel within reach of something virtual still lacks. `end_of_row`: the index, in rays per pixel, before which those
    /// of a row are wanted.
    pub fn main(
        infos: &[PixelInfo],
        film: &Film,
        end_of_row: impl Fn(usize) -> u32 + Sync,
    ) -> Self {
        let wanted = |pixel: usize| infos[pixel].flags & PIXEL_OUT_OF_REACH == 0;
        Self::of(Pass::Main, film, end_of_row, |pixel, end| {
            let next = film.first_index(pixel) + film.pixels[pixel].n;
            wanted(pixel).then_some(next..film.end_index(pixel, end))
        })
    }

    /// The real samples that edge pixels lack; `everywhere`: those of all pixels that are not wholly virtual.
    pub fn real(
        infos: &[PixelInfo],
        film: &Film,
        everywhere: bool,
        end_of_row: impl Fn(usize) -> u32 + Sync,
    ) -> Self {
        Self::of(Pass::Real, film, end_of_row, |pixel, end| {
            let sums = &film.pixels[pixel];
            let known_edge = infos[pixel].flags & PIXEL_EDGE != 0;
            let wanted = known_edge || film.needs_real(pixel) || (everywhere && sums.m < sums.n);
            let first = film.first_index(pixel);
            let end = film.end_index(pixel, end);
            wanted.then_some(first + sums.n_real..end.min(first + sums.n))
        })
    }

    /// `samples`: of a pixel, before so many rays per pixel.
    fn of(
        pass: Pass,
        film: &Film,
        end_of_row: impl Fn(usize) -> u32 + Sync,
        samples: impl Fn(usize, u32) -> Option<Range<u32>> + Sync,
    ) -> Self {
        let width = film.width as usize;
        let of_row = |row: usize| {
            let (samples, end) = (&samples, end_of_row(row));
            (row * width..(row + 1) * width).filter_map(move |pixel| {
                let samples = samples(pixel, end)?;
                (!samples.is_empty()).then(|| PixelWork::new(pixel as u32, samples))
            })
        };
        let rows = (0..film.height as usize).into_par_iter();
        Self {
            pass,
            pixels: rows.flat_map_iter(of_row).collect(),
            is_first: false,
        }
    }

    /// The pixels whose samples the film has not taken: a pixel takes all of its samples of a list or none.
    pub fn left(&self, film: &Film) -> Self {
        let is_left = |work: &&PixelWork| {
            let sums = &film.pixels[work.pixel as usize];
            let taken = match self.pass {
                Pass::Main => sums.n,
                Pass::Real => sums.n_real,
            };
            film.first_index(work.pixel as usize) + taken == work.first
        };
        Self {
            pass: self.pass,
            pixels: self.pixels.iter().filter(is_left).copied().collect(),
            is_first: self.is_first,
        }
    }

    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Samples of all pixels.
    pub fn samples(&self) -> u64 {
        self.pixels.iter().map(|w| u64::from(w.samples())).sum()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::film::Sample;

    #[test]
    fn a_list_asks_for_what_each_pixel_lacks() {
        let mut film = Film::new(4, 1, 10, false);
        for index in 0..3 {
            let sample = |is_virtual| Sample {
                is_virtual,
                contribution: Vec3::ONE,
                real: None,
            };
            film.add(1, &sample(index == 0));
            film.add(2, &sample(false));
        }
        let mut infos = [PixelInfo::uniform(0); 4];
        infos[3].flags = PIXEL_OUT_OF_REACH;
        let work = PixelWork::new;
        let main = |end| WorkList::main(&infos, &film, |_| end);
        assert_eq!(
            main(14).pixels,
            [work(0, 10..14), work(1, 13..14), work(2, 13..14)]
        );
        assert_eq!(main(14).samples(), 6);
        assert_eq!(main(13).pixels, [work(0, 10..13)]);
        assert!(main(10).is_empty());
        let real = |everywhere| WorkList::real(&infos, &film, everywhere, |_| 20);
        assert_eq!(real(false).pixels, [work(1, 10..13)]);
        assert_eq!(real(true).pixels, [work(1, 10..13), work(2, 10..13)]);
        let early = WorkList::real(&infos, &film, true, |_| 12);
        assert_eq!(early.pixels, [work(1, 10..12), work(2, 10..12)]);
    }

    #[test]
    fn each_row_has_its_own_end_and_each_pixel_its_own_factor() {
        let mut film = Film::new(1, 3, 1, false);
        film.set_sample_factors([1, 2, 1].into_iter());
        let infos = [PixelInfo::uniform(0); 3];
        let list = WorkList::main(&infos, &film, |row| [4, 3, 1][row]);
        assert_eq!(
            list.pixels,
            [PixelWork::new(0, 1..4), PixelWork::new(1, 2..6)]
        );
        let planned = [1, 2, 1].map(|sample_factor| PixelInfo {
            sample_factor,
            ..PixelInfo::uniform(0)
        });
        let first = WorkList::first(&planned, &film, |row| [4, 3, 1][row]);
        assert!(first.is_first && !list.is_first);
        assert_eq!(first.pixels, list.pixels);
        film.add(
            1,
            &Sample {
                is_virtual: false,
                contribution: Vec3::ONE,
                real: None,
            },
        );
        let later = WorkList::main(&planned, &film, |row| [4, 3, 1][row]);
        assert_ne!(first.pixels, later.pixels, "control: it has a sample");
    }
}
