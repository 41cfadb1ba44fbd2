//! All families of square markers: tables, and codes that follow a rule.

use std::sync::LazyLock;

use super::family::Family;
use super::matrix::matrix_codes;

/// All families, those that rest on few bits last.
pub static FAMILIES: LazyLock<Vec<Family>> = LazyLock::new(|| {
    let table = |name, cells, corrected, text: &str| Family {
        name,
        cells,
        border: 1.0,
        is_ringed: false,
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
        Family {
            is_ringed: true,
            ..table(
                "apriltag-standard-41h12",
                3,
                2,
                include_str!("families/apriltag_standard_41h12.txt"),
            )
        },
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
    ]
    .into_iter()
    .chain(matrix_codes())
    .collect()
});

impl Family {
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().find(|family| family.name == name)
    }
}

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
        is_ringed: false,
        codes: codes.collect(),
        corrected: 0,
    }
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
                    seen = family.turned_back(seen);
                }
                let mirror = family.find(family.mirrored(*code));
                mirrored_found += usize::from(mirror.is_some_and(|m| m.id == id));
            }
            assert!(mirrored_found * 4 <= family.codes.len(), "{}", family.name);
        }
    }

    fn expected(name: &str) -> usize {
        match name {
            "apriltag-36h11" => 587,
            "apriltag-standard-41h12" => 2115,
            "apriltag-25h9" => 35,
            "apriltag-16h5" => 30,
            "aruco-original" => 1024,
            "square-binary-4x4" => 4096,
            "square-binary-3x3" => 32,
            "artoolkit-3x3" => 64,
            "artoolkit-3x3-parity" | "artoolkit-4x4-bch-13-5-5" => 32,
            "artoolkit-3x3-hamming" => 8,
            "artoolkit-4x4" => 8192,
            "artoolkit-4x4-bch-13-9-3" => 512,
            "artoolkit-5x5-bch-22-12-5" => 4096,
            "artoolkit-5x5-bch-22-7-7" => 128,
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
