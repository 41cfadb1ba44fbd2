//! How a list of work is cut: into portions of pixels whose sums a device holds at once, and those into batches of samples in flight.

use std::cmp::Reverse;

use super::lanes::Batch;
use crate::cpu::sharing_tile::{BLOCK_SIDE, TILE_STRIDE, tile_of};
use crate::work::PixelWork;
use crate::work::list::TILE_PLACES;

/// Samples of one pixel in a batch at most, so that a batch has pixels enough to sum in parallel.
const MOST_SAMPLES: u32 = 256;

/// The pixels of a list in the order of their slots: pixels that share a batch take equally many samples of it, so that no lanes stay empty, and
/// those of a sharing tile lie together.
pub fn in_order(width: u32, pixels: &[PixelWork]) -> Vec<PixelWork> {
    // Sorted by tile by counting: the list is long, and in the order of the pixels.
    let last = pixels.last().map_or(0, |work| work.pixel);
    let mut next = vec![0u32; most_tiles(width, last) + 1];
    let tiles = tiles(width, pixels);
    for &tile in &tiles {
        next[tile as usize + 1] += 1;
    }
    let mut before = 0;
    for count in &mut next {
        before += *count;
        *count = before;
    }
    let mut sorted = vec![PixelWork::new(0, 0..0); pixels.len()];
    for (work, tile) in pixels.iter().zip(tiles) {
        let slot = &mut next[tile as usize];
        sorted[*slot as usize] = PixelWork { tile, ..*work };
        *slot += 1;
    }
    sorted.sort_by_key(|work| Reverse(work.samples()));
    for members in sorted.chunk_by_mut(|a, b| a.samples() == b.samples() && a.tile == b.tile) {
        let count = members.len() as u32;
        for (place, work) in (0..).zip(members) {
            work.tile = place + TILE_PLACES * count;
        }
    }
    sorted
}

/// [`tile_of`] each pixel; most lie in the row of the one before.
fn tiles(width: u32, pixels: &[PixelWork]) -> Vec<u32> {
    let (mut row, mut first) = (0..width, 0);
    let of_pixel = |work: &PixelWork| {
        if !row.contains(&work.pixel) {
            let begin = work.pixel / width * width;
            (row, first) = (begin..begin + width, tile_of(width, begin));
        }
        let x = work.pixel - row.start;
        first + x / BLOCK_SIDE * (TILE_STRIDE * TILE_STRIDE) + x % TILE_STRIDE
    };
    pixels.iter().map(of_pixel).collect()
}

/// Tiles of the rows down to a pixel, whole blocks of them.
fn most_tiles(width: u32, pixel: u32) -> usize {
    let blocks = width.div_ceil(BLOCK_SIDE) * (pixel / width / BLOCK_SIDE + 1);
    (blocks * TILE_STRIDE * TILE_STRIDE) as usize
}

/// The first pixels of `work`, at most `most` of them: whole tiles, at least one.
pub fn first_tiles(work: &[PixelWork], most: usize) -> usize {
    match work.get(most) {
        Some(&next) => whole_tiles(most, next),
        None => work.len(),
    }
}

/// Of `fitting` pixels and the one after them, those of whole tiles, at least one.
fn whole_tiles(fitting: usize, next: PixelWork) -> usize {
    let (place, count) = (next.tile % TILE_PLACES, next.tile / TILE_PLACES);
    match fitting - place as usize {
        0 => (count as usize).max(1),
        whole_tiles => whole_tiles,
    }
}

/// How far the batches of a portion have come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cursor {
    /// Pixels that have all of their samples.
    pub slot: usize,
    /// The pixels after them whose samples are being taken, and how many samples they have.
    group: usize,
    offset: u32,
    /// Samples of each of them that a batch takes.
    at_once: u32,
}

impl Cursor {
    /// No pixel has a part of its samples.
    pub fn is_between_pixels(&self) -> bool {
        self.group == 0
    }

    /// The next batch of the portion, of about so many lanes, and how many samples it takes; `None` at the end.
    pub fn next(&mut self, work: &[PixelWork], lanes: usize) -> Option<(Batch, u64)> {
        let rest = &work[self.slot..];
        let longest = rest.first()?.samples();
        if self.group == 0 {
            self.group = pixels_that_fit(rest, lanes);
            self.at_once = (lanes / self.group).clamp(1, MOST_SAMPLES as usize) as u32;
            self.offset = 0;
        }
        let group = &rest[..self.group];
        let sample_count = self.at_once.min(longest - self.offset);
        let batch = Batch {
            first_slot: self.slot as u32,
            pixel_count: self.group as u32,
            lane_count: self.group as u32 * sample_count,
            sample_offset: self.offset,
            sample_count,
            ..Batch::default()
        };
        let of_pixel = |work: &PixelWork| {
            let left = work.samples().saturating_sub(self.offset);
            u64::from(left.min(sample_count))
        };
        let samples = group.iter().map(of_pixel).sum();
        self.offset += sample_count;
        if self.offset == longest {
            *self = Self {
                slot: self.slot + self.group,
                ..Self::default()
            };
        }
        Some((batch, samples))
    }
}

/// How many of the first pixels of `work` take their samples, or [`MOST_SAMPLES`] of them, in one batch of `lanes`; whole tiles, at least one.
fn pixels_that_fit(work: &[PixelWork], lanes: usize) -> usize {
    let longest = work.first().map_or(1, PixelWork::samples);
    let fitting = lanes / longest.clamp(1, MOST_SAMPLES) as usize;
    first_tiles(work, fitting)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_of_equal_samples_lie_by_tiles() {
        let list: Vec<PixelWork> = (0..37 * 21)
            .filter(|pixel| pixel % 5 != 1)
            .map(|pixel| PixelWork::new(pixel, 1..2 + pixel % 3))
            .collect();
        let sorted = in_order(37, &list);
        let key = |work: &PixelWork| (Reverse(work.samples()), tile_of(37, work.pixel), work.pixel);
        assert!(sorted.is_sorted_by_key(key));
        assert!(!list.is_sorted_by_key(key), "control");
        let mut pixels: Vec<u32> = sorted.iter().map(|work| work.pixel).collect();
        pixels.sort_unstable();
        assert!(pixels.iter().eq(list.iter().map(|work| &work.pixel)));
        assert!(in_order(37, &[]).is_empty());
        let of_each = |pixel: &PixelWork| tile_of(37, pixel.pixel);
        assert!(tiles(37, &list).into_iter().eq(list.iter().map(of_each)));
    }

    #[test]
    fn batches_take_every_sample_once_and_whole_tiles_together() {
        let list: Vec<PixelWork> = (0..40 * 24)
            .map(|pixel| PixelWork::new(pixel, 3..3 + [2, 5, 600][(pixel % 96 / 32) as usize]))
            .collect();
        let work = in_order(40, &list);
        for lanes in [1, 100, 4096, 1 << 20] {
            let mut taken = vec![0u64; work.len()];
            let mut cursor = Cursor::default();
            while let Some((batch, samples)) = cursor.next(&work, lanes) {
                let first = batch.first_slot as usize;
                let slots = first..first + batch.pixel_count as usize;
                let before: u64 = taken[slots.clone()].iter().sum();
                for slot in slots.clone() {
                    let all = work[slot].samples();
                    let left = u64::from(all) - taken[slot];
                    assert_eq!(taken[slot], u64::from(all.min(batch.sample_offset)));
                    taken[slot] += left.min(u64::from(batch.sample_count));
                }
                assert_eq!(taken[slots.clone()].iter().sum::<u64>() - before, samples);
                let ends_a_tile = |slot: usize| {
                    let (place, count) =
                        (work[slot].tile % TILE_PLACES, work[slot].tile / TILE_PLACES);
                    place + 1 == count
                };
                assert!(ends_a_tile(slots.end - 1), "{lanes} lanes");
                let whole =
                    batch.pixel_count as usize == work[first].tile as usize / TILE_PLACES as usize;
                assert!(whole || batch.lane_count as usize <= lanes, "{batch:?}");
            }
            assert!(cursor.is_between_pixels() && cursor.slot == work.len());
            let all: Vec<u64> = work.iter().map(|work| u64::from(work.samples())).collect();
            assert_eq!(taken, all, "{lanes} lanes");
        }
    }
}
