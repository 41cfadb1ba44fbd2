//! Scene files that were damaged at random: whatever is done to a valid file, it loads or is refused in one line with its place.

use super::super::{
    error::Source,
    file::{Given, read_scene},
};
use crate::math::{hash_combine, hash_u32};

const VALID: &str = r#"
[photo]
exposure_ev = 0.5
[camera]
width = 32
height = 24
fx = 30.5
fy = 31
cx = 16.0
distortion = [0.1, -0.02, 0.001, 0.0, 0.0]
position = [0.0, 1.0, 2.0]
look_at = [0, 0, 0]
[lens]
f_number = 2.8
focal_length_mm = 50
focus_distance_m = inf
aperture = 7
[environment]
radiance = [1.0, 0.5, 0.25]
[[light]]
kind = "quad"
corner = [0, 2, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [10, 10, 10]
[[real]]
shape = "quad"
corner = [-1, 0, 1]
edge_u = [2, 0, 0]
edge_v = [0, 0, -2]
material = { base_color = [0.6, 0.6, 0.6], roughness = 1.0 }
[[virtual]]
shape = "sphere"
segments = 16
translation = [0.1, 0.0, -0.2]
rotation_deg = [0, 30, 0]
scale = 0.1
[render]
rays_per_pixel = 49
sampler = "cmj"
"#;

fn read_text(text: &str) -> Result<(), String> {
    let source = Source::new("scene.toml".as_ref(), text.as_bytes().to_vec());
    source
        .and_then(|source| read_scene(&source, Given::default()))
        .map(|_| ())
        .map_err(|error| error.to_string())
}

#[test]
fn the_scene_that_is_mutated_is_valid() {
    assert_eq!(read_text(VALID), Ok(()));
}

/// The same numbers at every run, so that what fails once fails again.
struct Random(u32);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(1);
        hash_u32(self.0)
    }

    /// 0..`end`, or 0 where that is empty.
    fn below(&mut self, end: usize) -> usize {
        self.bits() as usize % end.max(1)
    }
}

const CASES: u32 = 2000;

const PIECES: [&str; 20] = [
    "nan",
    "-",
    "[",
    "]",
    "\"",
    "=",
    "1e999",
    "0",
    "inf",
    "{",
    "}",
    "\n",
    "é",
    "\u{0}",
    "9999999999",
    "[[x]]",
    ".",
    ",",
    "true",
    "\\",
];

/// One to five insertions, deletions, copies, cuts and replacements.
fn mutated(random: &mut Random) -> String {
    let mut text: Vec<char> = VALID.chars().collect();
    for _ in 0..=random.below(5) {
        let place = random.below(text.len());
        let piece = PIECES[random.below(PIECES.len())];
        match random.below(6) {
            0 => {
                text.splice(place..place, piece.chars());
            }
            1 => {
                let end = (place + 1 + random.below(8)).min(text.len());
                text.drain(place..end);
            }
            2 => {
                let from = random.below(text.len());
                let copy = text[from..(from + 30).min(text.len())].to_vec();
                text.splice(place..place, copy);
            }
            3 => text.truncate(place),
            _ => {
                if let (Some(slot), Some(c)) = (text.get_mut(place), piece.chars().next()) {
                    *slot = c;
                }
            }
        }
    }
    text.into_iter().collect()
}

#[test]
fn mutations_never_panic() {
    let mut refused = 0;
    for case in 0..CASES {
        let text = mutated(&mut Random(hash_combine(case, 1)));
        if let Err(message) = read_text(&text) {
            assert!(message.starts_with("scene.toml:"), "{message}\n{text}");
            assert!(!message.contains('\n'), "{message}\n{text}");
            refused += 1;
        }
    }
    // Neither harmless nor all beyond repair.
    assert!((CASES / 2..CASES).contains(&refused), "{refused}");
}

#[test]
fn any_number_anywhere_never_panics() {
    let tokens: Vec<&str> = VALID.split_inclusive([' ', ',', '[', ']', '\n']).collect();
    let is_digit = |c: char| c.is_ascii_digit();
    let numeric: Vec<usize> = (0..tokens.len())
        .filter(|i| tokens[*i].starts_with(is_digit))
        .collect();
    let mut random = Random(7);
    for _ in 0..CASES {
        let target = numeric[random.below(numeric.len())];
        let bits = u64::from(random.bits()) << 32 | u64::from(random.bits());
        let number = format!("{:?}", f64::from_bits(bits)).replace("NaN", "nan");
        let mut changed = tokens.clone();
        let tail = tokens[target].trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        let token = format!("{number}{tail}");
        changed[target] = &token;
        let text = changed.concat();
        if let Err(message) = read_text(&text) {
            assert!(message.starts_with("scene.toml:"), "{message}\n{text}");
        }
    }
}
