//! A family of square markers: which patterns of cells are codes, and which code a pattern is.

/// Square markers whose codes look alike.
#[derive(Debug)]
pub struct Family {
    pub name: &'static str,
    /// Cells on a side of the code, without the border.
    pub cells: usize,
    /// Width of the black border, cells.
    pub border: f64,
    /// By id: cells row by row from the top left, 1 for white, the first cell in the highest bit.
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
            turned = turned_back(turned, self.cells);
        }
        best.filter(|_| is_alone)
    }

    /// Whether all of its codes are the other's too, under whatever ids.
    pub fn is_part_of(&self, other: &Self) -> bool {
        let is_like = self.cells == other.cells && self.border == other.border;
        is_like && self.codes.iter().all(|code| other.codes.contains(code))
    }

    /// Of an id, upright.
    pub fn is_white(&self, id: u32, x: usize, y: usize) -> bool {
        let code = self.codes.get(id as usize).copied().unwrap_or_default();
        code >> (self.cells * self.cells - 1 - (y * self.cells + x)) & 1 == 1
    }

    /// Bits by which a pattern with so many wrong cells is more than chance, among the first `codes` of the family.
    pub fn bits(&self, wrong: u32, codes: usize) -> f64 {
        let cells = (self.cells * self.cells) as u32;
        let mut patterns = 1.0;
        let mut binomial = 1.0;
        for k in 0..wrong {
            binomial *= f64::from(cells - k) / f64::from(k + 1);
            patterns += binomial;
        }
        f64::from(cells) - (4.0 * codes as f64 * patterns).log2()
    }
}

/// A pattern after a quarter turn, counter-clockwise in the picture.
pub fn turned_back(pattern: u64, n: usize) -> u64 {
    let bit = |x: usize, y: usize| pattern >> (n * n - 1 - (y * n + x)) & 1;
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    cells.fold(0, |sum, (x, y)| sum << 1 | bit(n - 1 - y, x))
}

/// A pattern seen in a mirror.
pub fn mirrored(pattern: u64, n: usize) -> u64 {
    let bit = |x: usize, y: usize| pattern >> (n * n - 1 - (y * n + x)) & 1;
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    cells.fold(0, |sum, (x, y)| sum << 1 | bit(n - 1 - x, y))
}
