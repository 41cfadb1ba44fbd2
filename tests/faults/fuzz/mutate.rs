//! How a file is damaged.

use serde_json::{Value, json};

/// Deterministic noise (splitmix64).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xd134_2543_de82_ef95))
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0..`end`, or 0 where that is empty.
    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }
}

/// One to five insertions, deletions, copies, cuts, replacements and odd numbers.
pub fn bytes(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(5) {
        let place = random.below(bytes.len());
        let end = (place + 1 + random.below(16)).min(bytes.len());
        match random.below(16) {
            0 => bytes.truncate(place),
            1 => {
                bytes.drain(place..end);
            }
            2 => {
                let piece = bytes[place..end].to_vec();
                let at = random.below(bytes.len());
                bytes.splice(at..at, piece);
            }
            3 => bytes.insert(place, random.next() as u8),
            4..7 => set(&mut bytes, place, &[random.next() as u8]),
            7..10 => {
                let bit = 1 << random.below(8);
                if let Some(byte) = bytes.get_mut(place) {
                    *byte ^= bit;
                }
            }
            10..12 => set(&mut bytes, place, &[random.pick(&[0, 1, 0x7f, 0x80, 0xff])]),
            12 | 13 => {
                let odd = [0, 1, 0x7fff, 0x8000, 0xffff, 4096, 256];
                let number: u16 = random.pick(&odd);
                let big = random.below(2) == 0;
                let number = if big {
                    number.to_be_bytes()
                } else {
                    number.to_le_bytes()
                };
                set(&mut bytes, place, &number);
            }
            _ => {
                let odd = [
                    0,
                    1,
                    0x7fff_ffff,
                    0x8000_0000,
                    u32::MAX,
                    1 << 16,
                    1 << 24,
                    30_000,
                ];
                let number: u32 = random.pick(&odd);
                let big = random.below(2) == 0;
                let number = if big {
                    number.to_be_bytes()
                } else {
                    number.to_le_bytes()
                };
                set(&mut bytes, place, &number);
            }
        }
    }
    bytes
}

fn set(bytes: &mut [u8], place: usize, new: &[u8]) {
    for (byte, new) in bytes.iter_mut().skip(place).zip(new) {
        *byte = *new;
    }
}

/// As [`bytes`], the check sums of a PNG file made right again three times in four: without, no damage would reach a decoder.
pub fn png(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes(whole, random);
    if random.below(4) == 0 {
        return bytes;
    }
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let end = at.saturating_add(8).saturating_add(length);
        if end.saturating_add(4) > bytes.len() {
            break;
        }
        let sum = crc32(&bytes[at + 4..end]).to_be_bytes();
        bytes[end..end + 4].copy_from_slice(&sum);
        at = end + 4;
    }
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
            (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 }
        })
    })
}

const PIECES: [&str; 28] = [
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
    " ",
    "\t",
    "#",
    "1e-320",
    "-1",
    "null",
    "4294967296",
    "\u{feff}",
];

/// A text in which words, characters and numbers are changed.
pub fn text(whole: &[u8], random: &mut Random) -> Vec<u8> {
    match random.below(8) {
        0 => return bytes(whole, random),
        1 | 2 => return another_number(whole, random),
        _ => {}
    }
    let mut text: Vec<char> = String::from_utf8_lossy(whole).chars().collect();
    for _ in 0..=random.below(5) {
        let place = random.below(text.len());
        let piece = random.pick(&PIECES);
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
    text.into_iter().collect::<String>().into_bytes()
}

/// One number of a text becomes any other.
fn another_number(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let text = String::from_utf8_lossy(whole);
    let mut tokens: Vec<&str> = text.split_inclusive([' ', ',', '[', ']', '\n']).collect();
    let numeric: Vec<usize> = (0..tokens.len())
        .filter(|i| tokens[*i].starts_with(|c: char| c.is_ascii_digit()))
        .collect();
    if numeric.is_empty() {
        return bytes(whole, random);
    }
    let target = numeric[random.below(numeric.len())];
    let number = match random.below(3) {
        0 => format!("{:?}", f64::from_bits(random.next())).replace("NaN", "nan"),
        1 => format!("{}", random.next() as i64 >> random.below(64)),
        _ => format!("{:e}", (random.below(2000) as f64 - 1000.0) * 1e-2),
    };
    let tail = tokens[target].trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    let token = format!("{number}{tail}");
    tokens[target] = &token;
    tokens.concat().into_bytes()
}

/// Where the JSON of a GLB ends.
fn json_end(glb: &[u8]) -> usize {
    20 + u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize
}

/// Up to four bytes, digits of the JSON half of the time: there the counts, offsets and indices stand.
pub fn glb_bytes(glb: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = glb.to_vec();
    let anywhere = random.below(2) == 0;
    for _ in 0..=random.below(4) {
        let at = if anywhere {
            random.below(bytes.len())
        } else {
            20 + random.below(json_end(glb) - 20)
        };
        if bytes[at].is_ascii_digit() {
            bytes[at] = b'0' + random.below(10) as u8;
        } else if anywhere {
            bytes[at] = random.next() as u8;
        }
    }
    if random.below(50) == 0 {
        bytes.truncate(random.below(bytes.len()));
    }
    bytes
}

/// A GLB with other bytes or another value.
pub fn glb(whole: &[u8], random: &mut Random) -> Vec<u8> {
    match random.below(3) {
        0 => glb_bytes(whole, random),
        1 => bytes(whole, random),
        _ => glb_value(whole, random),
    }
}

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(fields) => fields.values().map(count).sum(),
        _ => 0,
    }
}

/// The `index`-th value of a walk through `value`, parents first.
fn at<'v>(value: &'v mut Value, index: &mut usize) -> Option<&'v mut Value> {
    if *index == 0 {
        return Some(value);
    }
    *index -= 1;
    match value {
        Value::Array(items) => items.iter_mut().find_map(|item| at(item, index)),
        Value::Object(fields) => fields.values_mut().find_map(|field| at(field, index)),
        _ => None,
    }
}

/// One value of a GLB's JSON replaced, scaled, or robbed of a part: still well-formed, so that the damage reaches what interprets it.
pub fn glb_value(glb: &[u8], random: &mut Random) -> Vec<u8> {
    let odd = json!([
        null,
        -1,
        0,
        1,
        3,
        255,
        5121,
        5125,
        5126,
        4294967295_u64,
        9007199254740993_u64,
        0.5,
        1e-38,
        1e20,
        -1e300,
        "",
        "x",
        "VEC2",
        "SCALAR",
        "BLEND",
        "data:,a",
        "/dev/zero",
        true,
        [],
        [1, 2, 3],
        [0, 0, 0, 0],
        {}
    ]);
    let end = json_end(glb);
    let mut json: Value = serde_json::from_slice(&glb[20..end]).expect("a valid model");
    let mut index = 1 + random.below(count(&json) - 1);
    let choice = random.below(6);
    if let Some(value) = at(&mut json, &mut index) {
        match value {
            Value::Array(items) if choice == 0 && !items.is_empty() => {
                items.remove(random.below(items.len()));
            }
            Value::Array(items) if choice == 1 && !items.is_empty() => {
                items.push(items[random.below(items.len())].clone());
            }
            Value::Object(fields) if choice < 2 && !fields.is_empty() => {
                let name = fields.keys().nth(random.below(fields.len())).cloned();
                fields.remove(&name.unwrap_or_default());
            }
            Value::Number(number) if choice < 3 => {
                let factor = random.pick(&[-1.0, 0.5, 2.0, 1e6, 1e18]);
                *value = json!(number.as_f64().unwrap_or(1.0) * factor);
            }
            _ => *value = odd[random.below(27)].clone(),
        }
    }
    super::seeds::glb_of(&json, &glb[end..])
}
