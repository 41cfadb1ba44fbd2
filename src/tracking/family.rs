//! Families of square markers: which patterns of cells are codes, and which code a pattern is.

use std::sync::LazyLock;

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

/// All families, those that rest on few bits last.
pub static FAMILIES: LazyLock<Vec<Family>> = LazyLock::new(|| {
    let table = |name, cells, corrected, text: &str| Family {
        name,
        cells,
        border: 1.0,
        codes: text
            .lines()
            .filter_map(|line| u64::from_str_radix(line, 16).ok())
            .collect(),
        corrected,
    };
    vec![
        table(
            "apriltag-36h11",
            6,
            2,
            include_str!("families/apriltag_36h11.txt"),
        ),
        table("aruco-6x6", 6, 2, include_str!("families/aruco_6x6.txt")),
        table("aruco-5x5", 5, 1, include_str!("families/aruco_5x5.txt")),
        table(
            "apriltag-25h9",
            5,
            1,
            include_str!("families/apriltag_25h9.txt"),
        ),
        table(
            "apriltag-16h5",
            4,
            0,
            include_str!("families/apriltag_16h5.txt"),
        ),
        table(
            "aruco-original",
            5,
            0,
            include_str!("families/aruco_original.txt"),
        ),
        table("aruco-4x4", 4, 0, include_str!("families/aruco_4x4.txt")),
        square_binary("square-binary-4x4", 4),
        square_binary("square-binary-3x3", 3),
        matrix_code("artoolkit-3x3", 3),
    ]
});

/// BoofCV's: the lower left corner is black, the other three are white, the cells between hold the number's bits, 1 for black, from the bottom row's
/// left upwards. Border: a quarter of the marker.
fn square_binary(name: &'static str, cells: usize) -> Family {
    let n = cells;
    let is_corner = |x: usize, y: usize| (x == 0 || x == n - 1) && (y == 0 || y == n - 1);
    let free: Vec<usize> = (0..n)
        .rev()
        .flat_map(|y| (0..n).map(move |x| (x, y)))
        .filter(|(x, y)| !is_corner(*x, *y))
        .map(|(x, y)| y * n + x)
        .collect();
    let lower_left = 1 << (n * n - 1 - (n - 1) * n);
    let all = (1_u64 << (n * n)) - 1;
    let codes = (0..1_u64 << free.len()).map(|id| {
        let black = (0..).zip(&free).filter(|(bit, _)| id >> bit & 1 == 1);
        all & !black.fold(lower_left, |sum, (_, cell)| sum | 1 << (n * n - 1 - cell))
    });
    Family {
        name,
        cells,
        border: 0.5 * n as f64,
        codes: codes.collect(),
        corrected: 0,
    }
}

/// ARToolKit's: the upper and lower left corners are black, the lower right one is white, the others hold the number row by row, 1 for black, the highest
/// bit first. Border: a quarter of the marker.
fn matrix_code(name: &'static str, cells: usize) -> Family {
    let n = cells;
    let fixed = [0, (n - 1) * n, n * n - 1];
    let free: Vec<usize> = (0..n * n).filter(|cell| !fixed.contains(cell)).collect();
    let bit = |cell: usize| 1_u64 << (n * n - 1 - cell);
    let all = (1_u64 << (n * n)) - 1;
    let codes = (0..1_u64 << free.len()).map(|id| {
        let black = free.iter().rev().enumerate();
        let black = black.filter(|(place, _)| id >> place & 1 == 1);
        let corners = bit(fixed[0]) | bit(fixed[1]);
        all & !black.fold(corners, |sum, (_, cell)| sum | bit(*cell))
    });
    Family {
        name,
        cells,
        border: 0.5 * n as f64,
        codes: codes.collect(),
        corrected: 0,
    }
}

impl Family {
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().find(|family| family.name == name)
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
            turned = turned_back(turned, self.cells);
        }
        best.filter(|_| is_alone)
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
fn turned_back(pattern: u64, n: usize) -> u64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_found_in_every_turn_and_no_mirror_image() {
        for family in FAMILIES.iter() {
            assert_eq!(family.codes.len(), expected(family.name), "{}", family.name);
            let mut mirrored_found = 0;
            for (id, code) in (0..).zip(&family.codes).step_by(7) {
                let mut seen = *code;
                // A code of ArUco's first dictionary is one of its own turns.
                if family.name == "aruco-original" && family.find(*code).is_none() {
                    continue;
                }
                for turn in [0, 3, 2, 1] {
                    let found = family
                        .find(seen)
                        .unwrap_or_else(|| panic!("{} {id}", family.name));
                    assert_eq!(
                        (found.id, found.turn, found.wrong),
                        (id, turn, 0),
                        "{}",
                        family.name
                    );
                    seen = turned_back(seen, family.cells);
                }
                let mirror = family.find(mirrored(*code, family.cells));
                mirrored_found += usize::from(mirror.is_some_and(|m| m.id == id));
            }
            assert!(mirrored_found * 4 <= family.codes.len(), "{}", family.name);
        }
    }

    fn expected(name: &str) -> usize {
        match name {
            "apriltag-36h11" => 587,
            "apriltag-25h9" => 35,
            "apriltag-16h5" => 30,
            "aruco-original" => 1024,
            "square-binary-4x4" => 4096,
            "square-binary-3x3" => 32,
            "artoolkit-3x3" => 64,
            _ => 1000,
        }
    }

    #[test]
    fn wrong_cells_are_put_right_up_to_what_the_family_allows() {
        let family = Family::named("apriltag-36h11").unwrap();
        let found = family.find(family.codes[17] ^ 0b1001).unwrap();
        assert_eq!((found.id, found.wrong), (17, 2));
        assert_eq!(family.find(family.codes[17] ^ 0b10_1001), None);
        assert!(family.bits(0, 587) > 24.0 && family.bits(2, 587) < 16.0);
        assert!(Family::named("square-binary-3x3").unwrap().bits(0, 32) < 2.5);
    }
}
