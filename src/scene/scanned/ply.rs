//! PLY 1.0 (Turk 1994): text, and binary of either byte order. Elements beside `vertex` and `face` are passed over.

use super::{Mesh, Result, fan};

/// Longest header.
const MAX_HEADER_BYTES: usize = 1 << 16;
/// Most corners of a face.
const MAX_CORNERS: usize = 1 << 16;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Text,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

struct Property {
    name: String,
    /// Of the length, for a list.
    list: Option<Type>,
    value: Type,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Type {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Of [`Type::bytes`] bytes, the least significant first.
    fn decode(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Mesh> {
    let (format, elements, body) = read_header(bytes)?;
    let mut body = Body {
        format,
        rest: &bytes[body..],
    };
    let mut mesh = Mesh::default();
    for element in &elements {
        let least = element.properties.iter().map(|property| {
            let first = property.list.unwrap_or(property.value);
            if format == Format::Text {
                1
            } else {
                first.bytes()
            }
        });
        let least = least.sum::<usize>() as u64;
        let there = body.rest.len() as u64;
        if least == 0 || element.count > there / least {
            return Err(format!(
                "it states {} of element `{}`, more than its {there} bytes hold; expected a whole file; is it cut off?",
                element.count, element.name
            ));
        }
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, &mut mesh)?,
            "face" => read_faces(&mut body, element, &mut mesh)?,
            "tristrips" => {
                return Err(
                    "its faces are triangle strips; expected faces; export it with plain triangles"
                        .to_owned(),
                );
            }
            _ => {
                for _ in 0..element.count {
                    body.record(element, |_, _| {})?;
                }
            }
        }
    }
    Ok(mesh)
}

fn malformed(problem: &str) -> String {
    format!("{problem}; expected a PLY 1.0 header; export the mesh again")
}

/// The format, the elements in order, and where their values begin.
fn read_header(bytes: &[u8]) -> Result<(Format, Vec<Element>, usize)> {
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut at = 0;
    loop {
        let rest = &bytes[at..];
        let end = rest
            .iter()
            .take(MAX_HEADER_BYTES)
            .position(|byte| *byte == b'\n');
        let end = end.filter(|_| at < MAX_HEADER_BYTES);
        let end = end.ok_or_else(|| malformed("its header has no end"))?;
        let line = std::str::from_utf8(&rest[..end]).unwrap_or("comment");
        at += end + 1;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] | [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _] => {
                format = Some(match name {
                    "ascii" => Format::Text,
                    "binary_little_endian" => Format::LittleEndian,
                    "binary_big_endian" => Format::BigEndian,
                    _ => return Err(malformed("its format is not known")),
                });
            }
            ["element", name, count] => elements.push(Element {
                name: name.to_owned(),
                count: (count.parse()).map_err(|_| malformed("an element's count is no number"))?,
                properties: Vec::new(),
            }),
            ["property", ..] => {
                let element = elements.last_mut();
                let property = read_property(&words[1..]);
                match element.zip(property) {
                    Some((element, property)) => element.properties.push(property),
                    None => return Err(malformed("a property is not understood")),
                }
            }
            ["end_header"] => break,
            _ => return Err(malformed("a line of its header is not understood")),
        }
    }
    let format = format.ok_or_else(|| malformed("it does not tell its format"))?;
    Ok((format, elements, at))
}

fn read_property(words: &[&str]) -> Option<Property> {
    let (list, value, name) = match words {
        ["list", length, value, name] => (Some(Type::named(length)?), value, name),
        [value, name] => (None, value, name),
        _ => return None,
    };
    Some(Property {
        name: (*name).to_owned(),
        list,
        value: Type::named(value)?,
    })
}

/// The values after the header.
struct Body<'b> {
    format: Format,
    rest: &'b [u8],
}

impl Body<'_> {
    fn number(&mut self, kind: Type) -> Result<f64> {
        let cut =
            || "it ends before its last value; expected a whole file; is it cut off?".to_owned();
        if self.format == Format::Text {
            let blank = |byte: &u8| byte.is_ascii_whitespace();
            let start = self
                .rest
                .iter()
                .position(|byte| !blank(byte))
                .ok_or_else(cut)?;
            let rest = &self.rest[start..];
            let end = rest.iter().position(blank).unwrap_or(rest.len());
            let (word, rest) = rest.split_at(end);
            self.rest = rest;
            let number = std::str::from_utf8(word)
                .ok()
                .and_then(|word| word.parse().ok());
            return number.ok_or_else(|| {
                let word: String = String::from_utf8_lossy(word).chars().take(40).collect();
                format!("`{word}` is no number; expected one; export the mesh again")
            });
        }
        let (value, rest) = self.rest.split_at_checked(kind.bytes()).ok_or_else(cut)?;
        self.rest = rest;
        let mut bytes = [0; 8];
        bytes[..value.len()].copy_from_slice(value);
        if self.format == Format::BigEndian {
            bytes[..value.len()].reverse();
        }
        Ok(kind.decode(bytes))
    }

    /// One of an element; `take` hears each value with the place of its property.
    fn record(&mut self, element: &Element, mut take: impl FnMut(usize, f64)) -> Result<()> {
        for (place, property) in element.properties.iter().enumerate() {
            let length = match property.list {
                Some(kind) => {
                    let length = self.number(kind)?;
                    if !(0.0..=MAX_CORNERS as f64).contains(&length) {
                        return Err(format!(
                            "a list of `{}` has {length} values; expected 0 to {MAX_CORNERS}; repair the mesh",
                            property.name
                        ));
                    }
                    length as usize
                }
                None => 1,
            };
            for _ in 0..length {
                take(place, self.number(property.value)?);
            }
        }
        Ok(())
    }
}

fn read_vertices(body: &mut Body, element: &Element, mesh: &mut Mesh) -> Result<()> {
    let place = |name: &str| {
        let mut properties = element.properties.iter();
        properties.position(|property| property.name == name && property.list.is_none())
    };
    let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(place) else {
        return Err(malformed("its vertices lack x, y or z"));
    };
    let normal = match ["nx", "ny", "nz"].map(place) {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => None,
    };
    for _ in 0..element.count {
        let (mut position, mut direction) = ([0.0; 3], [0.0; 3]);
        body.record(element, |place, value| {
            for axis in 0..3 {
                if place == [x, y, z][axis] {
                    position[axis] = value as f32;
                }
                if normal.is_some_and(|normal| place == normal[axis]) {
                    direction[axis] = value as f32;
                }
            }
        })?;
        mesh.positions.push(position);
        if normal.is_some() {
            mesh.normals.push(direction);
        }
    }
    Ok(())
}

fn read_faces(body: &mut Body, element: &Element, mesh: &mut Mesh) -> Result<()> {
    let mut properties = element.properties.iter();
    let corners_at = properties.position(|property| {
        property.list.is_some() && ["vertex_indices", "vertex_index"].contains(&&*property.name)
    });
    let corners_at =
        corners_at.ok_or_else(|| malformed("its faces lack the list vertex_indices"))?;
    let mut corners = Vec::new();
    for _ in 0..element.count {
        corners.clear();
        body.record(element, |place, value| {
            if place == corners_at {
                // What is no index becomes one that is out of range.
                let is_index = value >= 0.0 && value < f64::from(u32::MAX);
                corners.push(if is_index { value as u32 } else { u32::MAX });
            }
        })?;
        fan(&corners, &mut mesh.triangles);
    }
    Ok(())
}
