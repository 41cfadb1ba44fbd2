//! ARToolKit's barcode markers ("matrix codes"). Border: a quarter of the marker.
//!
//! Of the cells the upper and lower left corners are black and the lower right one is white; the others hold a word row by row, 1 for black, its highest bit
//! first. A word is a number, or one of a code that keeps numbers apart, as ARToolKit 5 defines them (`arPattGetID.c`; LGPL-3.0, nothing of it is used but
//! the definitions): a parity bit, a Hamming code, and shortened BCH codes.

use super::family::Family;

/// Generators as tables have them (octal 23, 721, 3551, 107657; Lin and Costello 2004), of codes of 15 and of 31 bits, which are cut short.
const BCH_13_9: u64 = 0b1_0011;
const BCH_13_5: u64 = 0b1_1101_0001;
const BCH_22_12: u64 = 0b111_0110_1001;
const BCH_22_7: u64 = 0b1000_1111_1010_1111;

/// All of them. Fewer cells are put right than the codes allow: what is seen by chance would often be a code else.
pub fn matrix_codes() -> [Family; 8] {
    [
        family("artoolkit-5x5-bch-22-7-7", 5, bch(7, BCH_22_7), 2),
        family("artoolkit-5x5-bch-22-12-5", 5, bch(12, BCH_22_12), 1),
        family("artoolkit-4x4-bch-13-5-5", 4, bch(5, BCH_13_5), 1),
        family("artoolkit-4x4-bch-13-9-3", 4, bch(9, BCH_13_9), 0),
        family("artoolkit-4x4", 4, (0..1 << 13).collect(), 0),
        family("artoolkit-3x3-hamming", 3, hamming(), 0),
        family("artoolkit-3x3-parity", 3, parity(), 0),
        family("artoolkit-3x3", 3, (0..1 << 6).collect(), 0),
    ]
}

/// `words` by id.
fn family(name: &'static str, cells: usize, words: Vec<u64>, corrected: u32) -> Family {
    let n = cells;
    let fixed = [0, (n - 1) * n, n * n - 1];
    let free: Vec<usize> = (0..n * n).filter(|cell| !fixed.contains(cell)).collect();
    let bit = |cell: usize| 1_u64 << (n * n - 1 - cell);
    let all = (1_u64 << (n * n)) - 1;
    let codes = words.into_iter().map(|word| {
        let black = free.iter().rev().enumerate();
        let black = black.filter(|(place, _)| word >> place & 1 == 1);
        let corners = bit(fixed[0]) | bit(fixed[1]);
        all & !black.fold(corners, |sum, (_, cell)| sum | bit(*cell))
    });
    Family {
        name,
        cells,
        border: 0.5 * n as f64,
        is_ringed: false,
        codes: codes.collect(),
        corrected,
    }
}

/// Numbers of `bits` bits, each followed by the remainder that makes it a multiple of the generator polynomial, whose lowest term is the lowest bit.
fn bch(bits: u32, generator: u64) -> Vec<u64> {
    let checks = generator.ilog2();
    let word = |number: u64| {
        let shifted = number << checks;
        let rest =
            (checks..checks + bits)
                .rev()
                .fold(shifted, |rest, place| match rest >> place & 1 {
                    1 => rest ^ generator << (place - checks),
                    _ => rest,
                });
        shifted | rest
    };
    (0..1 << bits).map(word).collect()
}

/// Three bits in six, any two words three bits apart.
fn hamming() -> Vec<u64> {
    let rows = [0b00_0111, 0b01_1001, 0b10_1010];
    let word = |number: u64| {
        let own = (0..)
            .zip(rows)
            .filter(|(place, _)| number >> place & 1 == 1);
        own.fold(0, |sum, (_, row)| sum ^ row)
    };
    (0..8).map(word).collect()
}

/// Five bits, before them one that makes the number of ones even.
fn parity() -> Vec<u64> {
    let word = |number: u64| u64::from(number.count_ones() & 1) << 5 | number;
    (0..32).map(word).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn least_distance(words: &[u64]) -> u32 {
        let pairs = words.iter().enumerate();
        let distances =
            pairs.flat_map(|(k, a)| words[..k].iter().map(move |b| (a ^ b).count_ones()));
        distances.min().unwrap()
    }

    #[test]
    fn words_are_as_far_apart_as_their_codes_say() {
        assert_eq!(least_distance(&parity()), 2);
        assert_eq!(least_distance(&hamming()), 3);
        assert_eq!(least_distance(&bch(9, BCH_13_9)), 3);
        assert_eq!(least_distance(&bch(5, BCH_13_5)), 5);
        assert_eq!(least_distance(&bch(12, BCH_22_12)), 5);
        assert_eq!(least_distance(&bch(7, BCH_22_7)), 7);
        assert!(bch(12, BCH_22_12).iter().all(|word| *word < 1 << 22));
        // Control: another polynomial of the same degree keeps less apart.
        assert!(least_distance(&bch(5, 0b1_0000_0001)) < 5);
    }

    #[test]
    fn words_are_those_of_artoolkit() {
        // Its tables of both short codes.
        assert_eq!(hamming(), [0, 7, 25, 30, 42, 45, 51, 52]);
        assert_eq!(parity()[..8], [0, 33, 34, 3, 36, 5, 6, 39]);
        // The number stands in the highest bits, and marker 1 of BCH (13, 9, 3) ends in the polynomial itself.
        assert_eq!(bch(9, BCH_13_9)[..3], [0, 0b1_0011, 0b10_0110]);
    }

    #[test]
    fn parts_are_known() {
        let named = |name: &str| Family::named(name).unwrap();
        let plain = named("artoolkit-4x4");
        for part in ["artoolkit-4x4-bch-13-5-5", "artoolkit-4x4-bch-13-9-3"] {
            assert!(named(part).is_part_of(plain) && !plain.is_part_of(named(part)));
        }
        assert!(!named("square-binary-4x4").is_part_of(plain));
    }
}
