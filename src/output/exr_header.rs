//! One order for the attributes of an OpenEXR header: the `exr` crate writes them in that of a hash map, which changes from run to run.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

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
