//! The outer form of JPEG: where its scans and its end are, found without decoding.

use std::ops::Range;

/// Most scans of a picture. Encoders make about ten; each costs a pass over all pixels.
pub(super) const MAX_SCANS: usize = 100;

const START: u8 = 0xd8;
const END: u8 = 0xd9;
const SCAN: u8 = 0xda;
const TABLES: u8 = 0xc4;
/// CIPA DC-007: a list of the pictures in a file.
const MULTI_PICTURE: &[u8] = b"MPF\0";

/// What is found between the start and the end of a picture.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Outline {
    pub scans: usize,
    /// Huffman tables are given.
    pub has_tables: bool,
    /// After the end-of-image marker; `None`: there is none.
    pub end: Option<usize>,
    /// Where the next picture begins before this one has ended.
    pub next: Option<usize>,
    /// Height and width, as they stand in the frame header.
    size: Option<[u8; 4]>,
    /// Its camera has put further pictures behind it that belong to it: views, or a map of gains.
    has_attachments: bool,
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
            TABLES => outline.has_tables = true,
            0xc0..=0xcf if !matches!(code, 0xc8 | 0xcc) => {
                let size = bytes.get(at + 3..at + 7);
                outline.size = size.and_then(|size| size.try_into().ok());
            }
            0xe2 => {
                let name = bytes.get(at + 2..at + 6);
                outline.has_attachments |= name == Some(MULTI_PICTURE);
            }
            _ => {}
        }
        // Segments may hold anything, a small picture too: their length tells how far to jump.
        if let (0xc0..=0xcf | 0xda..=0xfe, Some(&[high, low])) = (code, bytes.get(at..at + 2)) {
            let end = at + usize::from(u16::from_be_bytes([high, low]));
            if let Some(next) = start_in_segment(bytes, code, at..end) {
                outline.next = Some(next);
                break;
            }
            at = end;
        }
    }
    outline
}

/// Where the next picture begins in what should be a segment, but is cut off.
fn start_in_segment(bytes: &[u8], code: u8, range: Range<usize>) -> Option<usize> {
    let may_hold_pictures = matches!(code, 0xe0..=0xef | 0xfe);
    // Behind a segment stands a marker, but for a scan's codes.
    let is_whole = code == SCAN || bytes.get(range.end) == Some(&0xff);
    if may_hold_pictures && is_whole {
        return None;
    }
    let held = bytes.get(range.start..)?;
    let held = &held[..held.len().min(range.len())];
    let start = held.windows(3).position(|w| w == [0xff, START, 0xff])?;
    Some(range.start + start)
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

/// Pictures of a film of JPEG pictures, one after the other and of one size; `None`: it is a picture, whatever its camera has put behind it.
pub(crate) fn jpegs_of_film(bytes: &[u8]) -> Option<Vec<Range<usize>>> {
    let first = outline(bytes, 0);
    let begin = find_start(bytes, first.end?)?;
    let is_film =
        first.size.is_some() && first.size == outline(bytes, begin).size && !first.has_attachments;
    is_film.then(|| split_jpegs(bytes))
}

fn find_start(bytes: &[u8], from: usize) -> Option<usize> {
    let rest = bytes.get(from..)?;
    Some(from + rest.windows(2).position(|pair| pair == [0xff, START])?)
}

/// The picture with the tables of ISO 10918-1 K.3 before everything else: cameras that write a run of pictures leave them out.
pub(super) fn with_standard_tables(bytes: &[u8]) -> Vec<u8> {
    let segment: Vec<u8> = STANDARD_TABLES
        .iter()
        .flat_map(|(class, counts, values)| {
            std::iter::once(*class)
                .chain(counts.iter().copied())
                .chain(values.iter().copied())
        })
        .collect();
    let length = (segment.len() as u16 + 2).to_be_bytes();
    [&bytes[..2], &[0xff, TABLES], &length, &segment, &bytes[2..]].concat()
}

const DC_VALUES: &[u8] = &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

/// Class and number of a table, its codes of 1 to 16 bits, and their values: luma and colour, DC and AC.
const STANDARD_TABLES: [(u8, [u8; 16], &[u8]); 4] = [
    (
        0x00,
        [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0],
        DC_VALUES,
    ),
    (
        0x10,
        [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7d],
        &[
            0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51,
            0x61, 0x07, 0x22, 0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1,
            0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18,
            0x19, 0x1a, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39,
            0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57,
            0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75,
            0x76, 0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92,
            0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7,
            0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3,
            0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8,
            0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2,
            0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
        ],
    ),
    (
        0x01,
        [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0],
        DC_VALUES,
    ),
    (
        0x11,
        [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77],
        &[
            0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07,
            0x61, 0x71, 0x13, 0x22, 0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09,
            0x23, 0x33, 0x52, 0xf0, 0x15, 0x62, 0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25,
            0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x35, 0x36, 0x37, 0x38,
            0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56,
            0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74,
            0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89,
            0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5,
            0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba,
            0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6,
            0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf2,
            0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
        ],
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Start, a segment that holds a whole small picture, one scan, end.
    const PICTURE: &[u8] = &[
        0xff, 0xd8, 0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9, 0xff, 0xda, 0, 3, 1, 5, 0xff, 0,
        0xff, 0xd0, 7, 0xff, 0xd9,
    ];

    #[test]
    fn pictures_of_a_run_end_at_their_marker_or_where_the_next_begins() {
        let n = PICTURE.len();
        let whole = outline(PICTURE, 0);
        assert_eq!((whole.scans, whole.end, whole.next), (1, Some(n), None));
        let two = [PICTURE, PICTURE].concat();
        assert_eq!(split_jpegs(&two), [0..n, n..2 * n]);
        let cut = [&PICTURE[..n - 2], PICTURE, &[0, 0], PICTURE].concat();
        let (a, b) = (n - 2, 2 * n - 2);
        assert_eq!(split_jpegs(&cut), [0..a, a..b, b + 2..b + 2 + n]);
        let in_tables = [&[0xff, 0xd8, 0xff, 0xdb, 0, 67, 1][..], PICTURE, PICTURE].concat();
        assert_eq!(split_jpegs(&in_tables), [0..7, 7..7 + n, 7 + n..7 + 2 * n]);
        let in_a_note = [&[0xff, 0xd8, 0xff, 0xe0, 0, 16, 1][..], PICTURE].concat();
        assert_eq!(split_jpegs(&in_a_note), [0..7, 7..7 + n]);
        assert_eq!(
            split_jpegs(&PICTURE[..n - 1]),
            std::slice::from_ref(&(0..n - 1)),
            "the last is cut off"
        );
    }

    #[test]
    fn a_picture_with_others_behind_it_is_no_film() {
        let picture = |side: u8, note: &[u8]| {
            let size = [0xff, 0xc0, 0, 7, 8, 0, side, 0, side];
            let scan = [0xff, 0xda, 0, 3, 1, 5, 0xff, 0xd9];
            [&[0xff, 0xd8][..], note, &size, &scan].concat()
        };
        let views = [&[0xff, 0xe2, 0, 6][..], MULTI_PICTURE].concat();
        let count = |bytes: &[u8]| jpegs_of_film(bytes).map(|film| film.len());
        assert_eq!(count(&picture(9, &[]).repeat(3)), Some(3));
        assert_eq!(count(&picture(9, &[])), None);
        assert_eq!(count(&picture(9, &views).repeat(2)), None, "two views");
        let map = [picture(9, &[]), picture(2, &[])].concat();
        assert_eq!(count(&map), None, "of another size");
    }

    #[test]
    fn the_standard_tables_are_whole() {
        for (class, counts, values) in STANDARD_TABLES {
            let codes: usize = counts.iter().map(|count| usize::from(*count)).sum();
            assert_eq!(codes, values.len(), "{class:x}");
        }
        let with = with_standard_tables(PICTURE);
        assert!(outline(&with, 0).has_tables);
        assert!(!outline(PICTURE, 0).has_tables, "control");
    }
}
