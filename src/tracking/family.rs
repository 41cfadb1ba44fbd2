//! A family of square markers: which patterns of cells are codes, and which code a pattern is.

/// Square markers whose codes look alike.
#[derive(Debug)]
pub struct Family {
    pub name: &'static str,
    /// Cells on a side of the code, without the border.
    pub cells: usize,
    /// Width of the border, cells.
    pub border: f64,
    /// The border is white in a ring of black, beyond which a ring of the code's cells lies too (AprilTag's standard families); else the border is black.
    pub is_ringed: bool,
    /// By id: cells row by row from the top left, 1 for white, the first cell in the highest bit; before them those of the ring, clockwise from the top left.
    pub codes: Vec<u64>,
    /// Wrong cells that are put right.
    pub corrected: u32,
}

/// A pattern that is a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Match {
    pub id: u32,
    /// Quarter turns, clockwise in the picture, from the marker upright to how it was seen.
    pub turn: usize,
    /// Cells that were wrong.
    pub wrong: u32,
}

impl Family {
    /// Bits of a code.
    pub fn code_cells(&self) -> u32 {
        let inner = (self.cells * self.cells) as u32;
        inner + if self.is_ringed { RING_CELLS } else { 0 }
    }

    /// A pattern after a quarter turn, counter-clockwise in the picture.
    pub fn turned_back(&self, pattern: u64) -> u64 {
        let ring = |ring: u32| ring.rotate_left(RING_CELLS / 4);
        self.with_parts(pattern, ring, turned_back)
    }

    /// A pattern seen in a mirror.
    pub fn mirrored(&self, pattern: u64) -> u64 {
        // The first cell is the upper left one, and the mirror's is the upper right one.
        let ring = |ring: u32| ring.reverse_bits().rotate_right(RING_CELLS / 4 + 1);
        self.with_parts(pattern, ring, mirrored)
    }

    fn with_parts(
        &self,
        pattern: u64,
        ring: impl Fn(u32) -> u32,
        inner: impl Fn(u64, usize) -> u64,
    ) -> u64 {
        if !self.is_ringed {
            return inner(pattern, self.cells);
        }
        let bits = self.cells * self.cells;
        let own = pattern & ((1 << bits) - 1);
        u64::from(ring((pattern >> bits) as u32)) << bits | inner(own, self.cells)
    }

    /// Of the ring around a border of so many cells, upright: whether a cell is white, by its number clockwise from the top left.
    pub fn is_white_in_ring(&self, id: u32, cell: u32) -> bool {
        let code = self.codes.get(id as usize).copied().unwrap_or_default();
        self.is_ringed && code >> (self.code_cells() - 1 - cell) & 1 == 1
    }

    /// Middles of the ring's cells, clockwise from the top left; in cells, from the border's upper left corner.
    pub fn ring(&self) -> impl Iterator<Item = (f64, f64)> {
        let last = self.side_cells() + 1.5;
        let count = if self.is_ringed { RING_CELLS } else { 0 };
        (0..count).map(move |cell| {
            let along = f64::from(cell % (RING_CELLS / 4));
            match cell / (RING_CELLS / 4) {
                0 => (-1.5 + along, -1.5),
                1 => (last, -1.5 + along),
                2 => (last - along, last),
                _ => (-1.5, last - along),
            }
        })
    }

    /// Of the whole marker, border included, in cells.
    pub fn side_cells(&self) -> f64 {
        self.cells as f64 + 2.0 * self.border
    }

    /// The code nearest to a pattern in any of its four turns, if it is near enough and no other is as near.
    pub fn find(&self, pattern: u64) -> Option<Match> {
        let mut turned = pattern;
        let mut best: Option<Match> = None;
        let mut is_alone = true;
        for turn in 0..4 {
            for (id, code) in (0..).zip(&self.codes) {
                let wrong = (code ^ turned).count_ones();
                match best {
                    _ if wrong > self.corrected => {}
                    Some(best) if wrong > best.wrong => {}
                    Some(before) if wrong == before.wrong => {
                        is_alone &= before.id == id && before.turn == turn;
                    }
                    _ => {
                        best = Some(Match { id, turn, wrong });
                        is_alone = true;
                    }
                }
            }
            turned = self.turned_back(turned);
        }
        best.filter(|_| is_alone)
    }

    /// Whether all of its codes are the other's too, under whatever ids.
    pub fn is_part_of(&self, other: &Self) -> bool {
        let is_like = self.cells == other.cells
            && self.border == other.border
            && self.is_ringed == other.is_ringed;
        is_like && self.codes.iter().all(|code| other.codes.contains(code))
    }

    /// Of an id, upright.
    pub fn is_white(&self, id: u32, x: usize, y: usize) -> bool {
        let code = self.codes.get(id as usize).copied().unwrap_or_default();
        code >> (self.cells * self.cells - 1 - (y * self.cells + x)) & 1 == 1
    }

    /// Bits by which a pattern with so many wrong cells is more than chance, among the first `codes` of the family.
    pub fn bits(&self, wrong: u32, codes: usize) -> f64 {
        let cells = self.code_cells();
        let mut patterns = 1.0;
        let mut binomial = 1.0;
        for k in 0..wrong {
            binomial *= f64::from(cells - k) / f64::from(k + 1);
            patterns += binomial;
        }
        f64::from(cells) - (4.0 * codes as f64 * patterns).log2()
    }
}

/// Cells around a border of five cells and a ring of black.
const RING_CELLS: u32 = 32;

/// A pattern after a quarter turn, counter-clockwise in the picture.
fn turned_back(pattern: u64, n: usize) -> u64 {
    let bit = |x: usize, y: usize| pattern >> (n * n - 1 - (y * n + x)) & 1;
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    cells.fold(0, |sum, (x, y)| sum << 1 | bit(n - 1 - y, x))
}

/// A pattern seen in a mirror.
fn mirrored(pattern: u64, n: usize) -> u64 {
    let bit = |x: usize, y: usize| pattern >> (n * n - 1 - (y * n + x)) & 1;
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    cells.fold(0, |sum, (x, y)| sum << 1 | bit(n - 1 - x, y))
}
