//! What a file has that is left out or mended: warnings, one line a kind.

use std::collections::BTreeMap;

/// Things worth a warning that may occur a thousand times in one file: each kind becomes one line.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Note {
    Degenerate,
    NotTriangles,
    Incomplete,
    ZeroNormals,
    BadTangents,
    Collapsed,
    MissingUv,
    EmptyTexture,
    Clamped,
}

#[derive(Default)]
pub(super) struct Notes {
    counted: BTreeMap<Note, (u64, u64, String)>,
    plain: Vec<String>,
}

impl Notes {
    /// `count` occurrences at one more place.
    pub fn add(&mut self, note: Note, count: u64, place: &str) {
        let entry = self
            .counted
            .entry(note)
            .or_insert_with(|| (0, 0, place.to_string()));
        entry.0 += count;
        entry.1 += 1;
    }

    pub fn plain(&mut self, line: String) {
        if !self.plain.contains(&line) {
            self.plain.push(line);
        }
    }

    pub fn lines(self) -> Vec<String> {
        let counted = self
            .counted
            .into_iter()
            .map(|(note, (count, places, first))| {
                let place = match places {
                    1 => first,
                    _ => format!("{first} and {} more", places - 1),
                };
                match note {
                    Note::Degenerate => format!("dropped {count} degenerate triangles in {place}"),
                    Note::NotTriangles => {
                        format!("points and lines are not drawn: left out {place}")
                    }
                    Note::Incomplete => {
                        format!("left out {count} indices that complete no triangle in {place}")
                    }
                    Note::ZeroNormals => {
                        format!("replaced {count} zero normals by the faces' in {place}")
                    }
                    Note::BadTangents => {
                        format!("derived tangents from the texture coordinates instead of unusable ones in {place}")
                    }
                    Note::Collapsed => {
                        format!("left out what a transform flattens to nothing: {place}")
                    }
                    Note::MissingUv => {
                        format!("a texture refers to texture coordinates that the mesh lacks; they are taken as 0: {place}")
                    }
                    Note::EmptyTexture => format!("a texture without an image was ignored: {place}"),
                    Note::Clamped => format!("clamped {count} material factors to their range in {place}"),
                }
            });
        counted
            .chain(self.plain)
            .map(|line| {
                line.chars()
                    .map(|c| if c.is_control() { ' ' } else { c })
                    .collect()
            })
            .collect()
    }
}
