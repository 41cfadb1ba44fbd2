//! The outer layers of a glTF file: the GLB container, the JSON text, URIs.

use std::io::Read;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::Problem;

/// Larger files are refused: a GLB states its length in 32 bits, and no photograph needs more.
const MAX_FILE_BYTES: u64 = u32::MAX as u64;

/// The JSON text, with whole numbers brought to one form, and the binary chunk of a GLB.
pub(super) struct Container {
    pub json: Value,
    pub bin: Option<Vec<u8>>,
}

pub(super) fn read_container(path: &Path) -> Result<Container, Problem> {
    let bytes = read_file(path, MAX_FILE_BYTES).map_err(Problem::Unreadable)?;
    let (text, bin) = if bytes.starts_with(b"glTF") {
        let (text, bin) = split_glb(&bytes)?;
        (text, bin.map(<[u8]>::to_vec))
    } else {
        (bytes.as_slice(), None)
    };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let mut json: Value = serde_json::from_slice(text)
        .map_err(|error| malformed("JSON", format!("{error}; expected a glTF 2.0 document")))?;
    unify_numbers(&mut json);
    if !json.is_object() {
        return Err(malformed("JSON", "expected an object at the top"));
    }
    Ok(Container { json, bin })
}

/// Reads a regular file of at most `limit` bytes. Devices and pipes are refused because they may never end.
pub(super) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, String> {
    let meta = std::fs::metadata(path).map_err(|error| error.to_string())?;
    if !meta.is_file() {
        return Err("not a regular file".into());
    }
    if meta.len() > limit {
        return Err(format!(
            "{} bytes, more than the {limit} allowed",
            meta.len()
        ));
    }
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    crate::files::open(path)
        .and_then(|file| file.take(limit).read_to_end(&mut bytes))
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// The JSON and BIN chunks of a GLB (glTF 2.0 section 4.4). Unknown chunks are skipped, bytes after the stated length ignored.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Problem> {
    let word = |at: usize| -> Result<u32, Problem> {
        bytes
            .get(at..at.saturating_add(4))
            .and_then(|word| word.try_into().ok())
            .map(u32::from_le_bytes)
            .ok_or_else(|| malformed("GLB", format!("ends inside a header, at byte {at}")))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(malformed(
            "GLB",
            format!("container version {version}; expected 2"),
        ));
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        return Err(malformed(
            "GLB",
            format!(
                "states {length} bytes, but the file has {}; is it cut off?",
                bytes.len()
            ),
        ));
    }
    let (mut json, mut bin) = (None, None);
    let mut at = 12;
    while at < length {
        let size = word(at)? as usize;
        let kind = word(at + 4)?.to_le_bytes();
        let start = at + 8;
        let chunk = start
            .checked_add(size)
            .filter(|end| *end <= length)
            .map(|end| &bytes[start..end])
            .ok_or_else(|| {
                malformed(
                    "GLB",
                    format!("the chunk at byte {at} states {size} bytes, more than are left"),
                )
            })?;
        let slot = match &kind {
            b"JSON" => Some(&mut json),
            b"BIN\0" => Some(&mut bin),
            _ => None,
        };
        if at == 12 && &kind != b"JSON" {
            return Err(malformed("GLB", "the first chunk is not JSON"));
        }
        if let Some(slot) = slot
            && slot.replace(chunk).is_some()
        {
            return Err(malformed("GLB", "has two chunks of one kind"));
        }
        at = start + size;
    }
    json.map(|json| (json, bin))
        .ok_or_else(|| malformed("GLB", "has no JSON chunk"))
}

/// Writes `2.0` as `2`, since glTF allows both where a whole number is meant and the typed reader does not; and whole numbers
/// too large for an index as floats, since the typed reader would cut them to 32 bits.
fn unify_numbers(value: &mut Value) {
    match value {
        Value::Number(number) => {
            if let Some(float) = number.as_f64() {
                let index = float.fract() == 0.0 && float.abs() < f64::from(u32::MAX);
                if index && number.is_f64() {
                    *number = serde_json::Number::from(float as i64);
                } else if !index
                    && !number.is_f64()
                    && let Some(wide) = serde_json::Number::from_f64(float)
                {
                    *number = wide;
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(unify_numbers),
        Value::Object(fields) => fields.values_mut().for_each(unify_numbers),
        _ => {}
    }
}

/// The bytes that a URI stands for: a data URI, or a file relative to `folder`, of at most `limit` bytes.
pub(super) fn read_uri(uri: &str, folder: &Path, limit: u64) -> Result<Vec<u8>, String> {
    if let Some(data) = strip_scheme(uri, "data:") {
        let (head, payload) = data
            .split_once(',')
            .ok_or_else(|| "data URI without a comma".to_string())?;
        let bytes = percent_decode(payload)?;
        return if head.ends_with(";base64") {
            base64_decode(&bytes)
        } else {
            Ok(bytes)
        };
    }
    let path = file_of_uri(uri, folder)?.unwrap_or_default();
    read_file(&path, limit).map_err(|reason| format!("{}: {reason}", path.display()))
}

/// The file that a URI names; None for a data URI.
pub(super) fn file_of_uri(uri: &str, folder: &Path) -> Result<Option<PathBuf>, String> {
    if strip_scheme(uri, "data:").is_some() {
        return Ok(None);
    }
    if let Some((scheme, _)) = uri.split_once(':')
        && scheme.len() > 1
        && scheme
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte))
    {
        return Err(format!(
            "the URI scheme `{}:` is not supported; expected a relative path or a data URI",
            clip(scheme)
        ));
    }
    let relative =
        String::from_utf8(percent_decode(uri)?).map_err(|_| "the path is not UTF-8".to_string())?;
    Ok(Some(folder.join(&relative)))
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme)
        .then(|| &uri[scheme.len()..])
}

fn percent_decode(text: &str) -> Result<Vec<u8>, String> {
    let mut out = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(byte) = bytes.next() {
        if byte != b'%' {
            out.push(byte);
            continue;
        }
        let digit = |byte: Option<u8>| byte.and_then(|byte| char::from(byte).to_digit(16));
        match (digit(bytes.next()), digit(bytes.next())) {
            (Some(high), Some(low)) => out.push((high * 16 + low) as u8),
            _ => return Err("a % in the URI is not followed by two hexadecimal digits".into()),
        }
    }
    Ok(out)
}

/// RFC 4648 section 4, padding optional.
fn base64_decode(text: &[u8]) -> Result<Vec<u8>, String> {
    let data = text.trim_ascii();
    let data = data.strip_suffix(b"=").unwrap_or(data);
    let data = data.strip_suffix(b"=").unwrap_or(data);
    let mut out = Vec::with_capacity(data.len() / 4 * 3 + 2);
    let (mut bits, mut held) = (0u32, 0u32);
    for (at, byte) in data.iter().enumerate() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => {
                return Err(format!(
                    "byte {at} of the base64 data is not a base64 digit"
                ));
            }
        };
        bits = (bits << 6) | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    if data.len() % 4 == 1 {
        return Err("the base64 data ends in the middle of a byte".into());
    }
    Ok(out)
}

/// The start of a text that came from the file, so that a message stays one readable line.
pub(super) fn clip(text: &str) -> String {
    const LENGTH: usize = 60;
    if text.chars().count() <= LENGTH {
        return text.to_string();
    }
    text.chars().take(LENGTH).chain("...".chars()).collect()
}

pub(super) fn malformed(at: impl Into<String>, reason: impl Into<String>) -> Problem {
    Problem::Malformed {
        at: at.into(),
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_follows_the_rfc_vectors() {
        for (text, plain) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm8", "fo"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(base64_decode(text.as_bytes()).unwrap(), plain.as_bytes());
        }
        assert!(base64_decode(b"Zm9*").is_err());
        assert!(base64_decode(b"Zm9vY").is_err());
    }

    #[test]
    fn uris_are_decoded_and_foreign_schemes_refused() {
        let read = |uri| read_uri(uri, Path::new("/nonexistent"), 100);
        assert_eq!(read("data:,a%20b").unwrap(), b"a b");
        assert_eq!(read("DATA:x/y;base64,Zm8=").unwrap(), b"fo");
        assert!(read("http://host/x.bin").unwrap_err().contains("http"));
        assert!(read("data:nothing").is_err());
        assert!(read("%zz").is_err());
    }

    #[test]
    fn whole_numbers_take_one_form() {
        let mut value: Value = serde_json::from_str("[2.0, 1e2, 0.5, 4294967299, -3]").unwrap();
        unify_numbers(&mut value);
        assert_eq!(value[0].as_u64(), Some(2));
        assert_eq!(value[1].as_u64(), Some(100));
        assert_eq!(value[2].as_f64(), Some(0.5));
        assert_eq!(value[3].as_u64(), None);
        assert_eq!(value[4].as_i64(), Some(-3));
    }
}
