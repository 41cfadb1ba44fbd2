//! One order for the attributes of an OpenEXR header, and a seal over the file.
//!
//! The `exr` crate writes attributes in the order of a hash map, which changes from run to run. Blocks that are stored as they are have no
//! checksum: the seal tells a damaged file from a whole one.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

use exr::prelude::Text;
use exr::prelude::attribute::AttributeValue;

use super::exr_text::text_value;

/// Magic number and version.
const BEFORE_HEADER_BYTES: u64 = 8;

/// Sorts the attributes of a file of one part by name, as the OpenEXR library does. Nothing moves behind the header.
pub(super) fn sort_attributes(file: &mut (impl Read + Write + Seek)) -> io::Result<()> {
    file.seek(SeekFrom::Start(BEFORE_HEADER_BYTES))?;
    let mut header = BufReader::new(&mut *file);
    let mut attributes = Vec::new();
    while let Some(attribute) = read_attribute(&mut header)? {
        attributes.push(attribute);
    }
    // Each begins with its name.
    attributes.sort();
    file.seek(SeekFrom::Start(BEFORE_HEADER_BYTES))?;
    file.write_all(&attributes.concat())
}

/// Name and type, each ended by a zero byte, the value's length in four bytes, the value; `None` where the header ends.
fn read_attribute(header: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    header.read_until(0, &mut bytes)?;
    match bytes.as_slice() {
        [0] => return Ok(None),
        [.., 0] => {}
        _ => return Err(io::ErrorKind::UnexpectedEof.into()),
    }
    header.read_until(0, &mut bytes)?;
    let mut length = [0; 4];
    header.read_exact(&mut length)?;
    bytes.extend(length);
    let begin = bytes.len();
    let length = u32::from_le_bytes(length) as usize;
    header.take(length as u64).read_to_end(&mut bytes)?;
    match bytes.len() - begin == length {
        true => Ok(Some(bytes)),
        false => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}

/// The attribute that holds the seal: a hash of the file in which the seal's digits are zeros.
const SEAL: &str = "mixray.seal";
/// Of [`blake3`], in hexadecimal digits.
const SEAL_DIGITS: usize = 64;

/// The attribute as it is before [`seal`].
pub(super) fn unsealed() -> (Text, AttributeValue) {
    (Text::from(SEAL), text_value(&"0".repeat(SEAL_DIGITS)))
}

/// Seals a file that has [`unsealed`].
pub(super) fn seal(file: &mut [u8]) {
    if let Some(at) = seal_at(file) {
        let digits = blake3::hash(file).to_hex();
        file[at..at + SEAL_DIGITS].copy_from_slice(digits.as_bytes());
    }
}

/// No byte has changed since the file was sealed.
pub(crate) fn is_sealed(file: &[u8]) -> bool {
    let Some(at) = seal_at(file) else {
        return false;
    };
    let mut hash = blake3::Hasher::new();
    hash.update(&file[..at]);
    hash.update(&[b'0'; SEAL_DIGITS]);
    hash.update(&file[at + SEAL_DIGITS..]);
    hash.finalize().to_hex().as_bytes() == &file[at..at + SEAL_DIGITS]
}

/// The file was sealed once, and some byte has changed since.
pub(super) fn is_seal_broken(file: &[u8]) -> bool {
    seal_at(file).is_some() && !is_sealed(file)
}

/// Where the digits stand. The zero bytes of name and type are in no text before them.
fn seal_at(file: &[u8]) -> Option<usize> {
    let head = [SEAL.as_bytes(), b"\0string\0"].concat();
    let begin = file.windows(head.len()).position(|bytes| bytes == head)?;
    let at = begin + head.len() + size_of::<u32>();
    (at + SEAL_DIGITS <= file.len()).then_some(at)
}
