//! A film cut into tiles that threads fill by themselves, and their work into blocks of pixels that are rendered together.

use crate::film::{Film, GroupSums, GuideSums, PixelSums};
use crate::work::PixelWork;

/// Sides of a block, whose pixels are rendered together, pixels.
const BLOCK_PX: usize = 8;
/// Blocks of a tile, side by side: rendered before cancellation is looked for.
const BLOCKS: usize = 8;

/// A rectangle of a film's sums.
pub struct Tile<'a> {
    film_width: usize,
    /// Of the first pixel.
    column: usize,
    row: usize,
    /// By row; guides and groups are empty where the film has none.
    sums: Vec<&'a mut [PixelSums]>,
    guides: Vec<&'a mut [GuideSums]>,
    groups: Vec<&'a mut [GroupSums]>,
}

impl Tile<'_> {
    /// Of a pixel of the film, by its row-major index.
    pub fn sums(&mut self, pixel: u32) -> &mut PixelSums {
        let (row, column) = self.place(pixel);
        &mut self.sums[row][column]
    }

    /// Of a pixel of the film, if it has guides.
    pub fn guide(&mut self, pixel: u32) -> Option<&mut GuideSums> {
        let (row, column) = self.place(pixel);
        self.guides.get_mut(row)?.get_mut(column)
    }

    /// Of a pixel of the film, if it has groups.
    pub fn groups(&mut self, pixel: u32) -> Option<&mut GroupSums> {
        let (row, column) = self.place(pixel);
        self.groups.get_mut(row)?.get_mut(column)
    }

    fn place(&self, pixel: u32) -> (usize, usize) {
        let pixel = pixel as usize;
        (
            pixel / self.film_width - self.row,
            pixel % self.film_width - self.column,
        )
    }
}

/// Work of one tile, block by block.
pub struct TileWork {
    film_width: usize,
    pixels: Vec<PixelWork>,
}

impl TileWork {
    /// The work of each block that has any, its pixels in ascending order.
    pub fn blocks(&self) -> impl Iterator<Item = &[PixelWork]> {
        let column = |work: &PixelWork| work.pixel as usize % self.film_width / BLOCK_PX;
        self.pixels.chunk_by(move |a, b| column(a) == column(b))
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.pixels
            .iter()
            .map(|work| u64::from(work.samples()))
            .sum()
    }
}

/// The tiles that have work, with it; `work` in ascending order of pixels.
pub fn tiles<'a>(film: &'a mut Film, work: &[PixelWork]) -> Vec<(Tile<'a>, TileWork)> {
    let film_width = film.width as usize;
    let mut rest = work;
    let mut guides = film.guides.chunks_mut(BLOCK_PX * film_width);
    let mut groups = film.groups.chunks_mut(BLOCK_PX * film_width);
    let mut tiles = Vec::new();
    for (band, sums) in film.pixels.chunks_mut(BLOCK_PX * film_width).enumerate() {
        let row = band * BLOCK_PX;
        let end = row * film_width + sums.len();
        let (now, later) = rest.split_at(rest.partition_point(|w| (w.pixel as usize) < end));
        rest = later;
        let band = Band {
            row,
            sums,
            guides: guides.next().unwrap_or_default(),
            groups: groups.next().unwrap_or_default(),
        };
        if !now.is_empty() {
            tiles.extend(tiles_of_band(film_width, band, now));
        }
    }
    tiles
}

/// [`BLOCK_PX`] rows of a film from `row` on.
struct Band<'a> {
    row: usize,
    sums: &'a mut [PixelSums],
    guides: &'a mut [GuideSums],
    groups: &'a mut [GroupSums],
}

fn tiles_of_band<'a>(
    film_width: usize,
    band: Band<'a>,
    work: &[PixelWork],
) -> impl Iterator<Item = (Tile<'a>, TileWork)> {
    let side = BLOCK_PX * BLOCKS;
    let mut tiles: Vec<_> = (0..film_width)
        .step_by(side)
        .map(|column| {
            let tile = Tile {
                film_width,
                column,
                row: band.row,
                sums: Vec::new(),
                guides: Vec::new(),
                groups: Vec::new(),
            };
            let pixels = Vec::new();
            (tile, TileWork { film_width, pixels })
        })
        .collect();
    for row in band.sums.chunks_mut(film_width) {
        for ((tile, _), part) in tiles.iter_mut().zip(row.chunks_mut(side)) {
            tile.sums.push(part);
        }
    }
    for row in band.guides.chunks_mut(film_width) {
        for ((tile, _), part) in tiles.iter_mut().zip(row.chunks_mut(side)) {
            tile.guides.push(part);
        }
    }
    for row in band.groups.chunks_mut(film_width) {
        for ((tile, _), part) in tiles.iter_mut().zip(row.chunks_mut(side)) {
            tile.groups.push(part);
        }
    }
    for pixel in work {
        let column = pixel.pixel as usize % film_width;
        tiles[column / side].1.pixels.push(*pixel);
    }
    for (_, work) in &mut tiles {
        // Stable: the pixels of a block stay in their order.
        (work.pixels).sort_by_key(|work| work.pixel as usize % film_width / BLOCK_PX);
    }
    tiles
        .into_iter()
        .filter(|(_, work)| !work.pixels.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_lies_in_one_block_and_is_found_in_its_tile() {
        let (width, height) = (141, 21);
        let mut film = Film::new(width, height, 0, true);
        film.set_groups(true);
        let taken = |pixel: u32| pixel % 7 != 3;
        let work: Vec<_> = (0..width * height)
            .filter(|&pixel| taken(pixel))
            .map(|pixel| PixelWork::new(pixel, 0..pixel + 1))
            .collect();
        let mut samples = 0;
        for (mut tile, work) in tiles(&mut film, &work) {
            samples += work.samples();
            for block in work.blocks() {
                let corner = |w: &PixelWork| (w.pixel % width / 8, w.pixel / width / 8);
                assert!(block.iter().all(|w| corner(w) == corner(&block[0])));
                assert!(block.is_sorted_by_key(|w| w.pixel));
                for work in block {
                    tile.sums(work.pixel).n += work.end;
                    tile.guide(work.pixel).expect("has guides").hits += work.end;
                    tile.groups(work.pixel).expect("has groups").diff[0].hi[0] += work.end as f32;
                }
            }
        }
        assert_eq!(
            samples,
            work.iter().map(|w| u64::from(w.samples())).sum::<u64>()
        );
        for pixel in 0..width * height {
            let n = if taken(pixel) { pixel + 1 } else { 0 };
            let at = pixel as usize;
            assert_eq!((film.pixels[at].n, film.guides[at].hits), (n, n));
            assert_eq!(film.groups[at].diff[0].hi[0], n as f32);
        }
    }

    #[test]
    fn a_film_without_guides_and_groups_has_tiles_without() {
        let mut film = Film::new(9, 9, 0, false);
        let work = [PixelWork::new(80, 0..1)];
        let mut tiles = tiles(&mut film, &work);
        assert_eq!(tiles.len(), 1);
        assert!(tiles[0].0.guide(80).is_none() && tiles[0].0.groups(80).is_none());
    }
}
