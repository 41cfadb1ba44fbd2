//! The outer form of JPEG: where its scans and its end are, found without decoding.

use std::ops::Range;

/// Most scans of a picture. Encoders make about ten; each costs a pass over all pixels.
pub(super) const MAX_SCANS: usize = 100;

const START: u8 = 0xd8;
const END: u8 = 0xd9;
const SCAN: u8 = 0xda;

/// What is found between the start and the end of a picture.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Outline {
    pub scans: usize,
    /// After the end-of-image marker; `None`: there is none.
    pub end: Option<usize>,
    /// Where the next picture begins before this one has ended.
    pub next: Option<usize>,
}

/// Walks a picture that begins at `bytes[from]` with its start-of-image marker.
pub(super) fn outline(bytes: &[u8], from: usize) -> Outline {
    let mut outline = Outline::default();
    let mut at = from + 2;
    while let Some(marker) = next_marker(bytes, at) {
        let (place, code) = marker;
        at = place + 2;
        match code {
            END => {
                outline.end = Some(at);
                break;
            }
            START => {
                outline.next = Some(place);
                break;
            }
            SCAN => outline.scans += 1,
            _ => {}
        }
        // Segments may hold anything, a small picture too: their length tells how far to jump.
        if let (0xc0..=0xcf | 0xda..=0xfe, Some(&[high, low])) = (code, bytes.get(at..at + 2)) {
            at += usize::from(u16::from_be_bytes([high, low]));
        }
    }
    outline
}

/// The next ff with something other than a stuffed zero or a fill byte after it.
fn next_marker(bytes: &[u8], from: usize) -> Option<(usize, u8)> {
    let mut at = from;
    loop {
        at += bytes.get(at..)?.iter().position(|byte| *byte == 0xff)?;
        match *bytes.get(at + 1)? {
            0x00 => at += 2,
            0xff => at += 1,
            code => return Some((at, code)),
        }
    }
}

/// Where JPEG pictures begin and end in a run of them. One that is cut off ends where the next begins, or with the bytes.
pub(crate) fn split_jpegs(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut frames = Vec::new();
    let mut at = 0;
    while let Some(begin) = find_start(bytes, at) {
        let outline = outline(bytes, begin);
        at = outline.end.or(outline.next).unwrap_or(bytes.len());
        frames.push(begin..at);
    }
    frames
}

fn find_start(bytes: &[u8], from: usize) -> Option<usize> {
    let rest = bytes.get(from..)?;
    Some(from + rest.windows(2).position(|pair| pair == [0xff, START])?)
}
