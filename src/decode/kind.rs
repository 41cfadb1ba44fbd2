//! What a file is: by how it begins, and where that tells nothing, by the ending of its name.

use std::io::Read;
use std::path::Path;

use crate::files;

/// Kinds that are told apart. Texts without a mark of their own are of no kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileKind {
    /// "a PNG picture".
    Picture(&'static str),
    /// "an MP4 or QuickTime film".
    Film(&'static str),
    Gltf,
    Ply,
    Obj,
    /// "an FBX model": of a format that is not read.
    ForeignModel(&'static str),
}

impl FileKind {
    /// With its article.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture(name) | Self::Film(name) | Self::ForeignModel(name) => name,
            Self::Gltf => "a glTF model",
            Self::Ply => "a PLY mesh",
            Self::Obj => "an OBJ mesh",
        }
    }
}

/// How many bytes tell kinds apart.
const LONGEST_SIGN: u64 = 32;

/// `None`: it is none of them, no regular file, or cannot be read.
pub(crate) fn kind_of(path: &Path) -> Option<FileKind> {
    // Reading of a pipe would take from what follows.
    if !path.is_file() {
        return None;
    }
    let mut begin = Vec::new();
    let file = files::open(path).ok()?;
    file.take(LONGEST_SIGN).read_to_end(&mut begin).ok()?;
    let ending = path.extension().unwrap_or_default();
    of_content(&begin).or_else(|| of_ending(&ending.to_string_lossy().to_ascii_lowercase()))
}

fn of_content(begin: &[u8]) -> Option<FileKind> {
    Some(match begin {
        [0x89, b'P', b'N', b'G', ..] => FileKind::Picture("a PNG picture"),
        [0xff, 0xd8, 0xff, ..] => FileKind::Picture("a JPEG picture"),
        [0x76, 0x2f, 0x31, 0x01, ..] => FileKind::Picture("an OpenEXR picture"),
        [b'#', b'?', b'R', ..] => FileKind::Picture("a Radiance HDR picture"),
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => {
            FileKind::Picture("a TIFF or raw picture")
        }
        [
            b'R',
            b'I',
            b'F',
            b'F',
            _,
            _,
            _,
            _,
            b'W',
            b'E',
            b'B',
            b'P',
            ..,
        ] => FileKind::Picture("a WebP picture"),
        [_, _, _, _, b'f', b't', b'y', b'p', b'h', b'e', b'i', ..]
        | [
            _,
            _,
            _,
            _,
            b'f',
            b't',
            b'y',
            b'p',
            b'm',
            b'i',
            b'f',
            b'1',
            ..,
        ] => FileKind::Picture("a HEIF picture"),
        _ if begin.starts_with(b"YUV4MPEG2") => FileKind::Film("a Y4M film"),
        _ if begin.starts_with(b"glTF") => FileKind::Gltf,
        _ if begin.starts_with(b"ply\n") || begin.starts_with(b"ply\r") => FileKind::Ply,
        _ if begin.starts_with(b"Kaydara FBX Binary") || begin.starts_with(b"; FBX") => {
            FileKind::ForeignModel("an FBX model")
        }
        _ if begin.starts_with(b"PXR-USDC") || begin.starts_with(b"#usda") => {
            FileKind::ForeignModel("a USD model")
        }
        _ if begin.starts_with(b"BLENDER") => FileKind::ForeignModel("a Blender file"),
        _ => FileKind::Film(film_kind(begin)?),
    })
}

/// Of names alone: texts, and containers of anything.
fn of_ending(ending: &str) -> Option<FileKind> {
    Some(match ending {
        "gltf" => FileKind::Gltf,
        "obj" => FileKind::Obj,
        "fbx" => FileKind::ForeignModel("an FBX model"),
        "usd" | "usda" | "usdc" | "usdz" => FileKind::ForeignModel("a USD model"),
        "stl" => FileKind::ForeignModel("an STL mesh"),
        // Newer ones are compressed as a whole.
        "blend" => FileKind::ForeignModel("a Blender file"),
        "dae" => FileKind::ForeignModel("a Collada model"),
        "3ds" | "max" => FileKind::ForeignModel("a 3ds Max model"),
        "abc" => FileKind::ForeignModel("an Alembic file"),
        "c4d" => FileKind::ForeignModel("a Cinema 4D file"),
        _ => return None,
    })
}

/// Of files of other programs that hold films.
pub(crate) fn film_kind(begin: &[u8]) -> Option<&'static str> {
    match begin {
        [_, _, _, _, b'f', b't', b'y', b'p', ..]
        | [_, _, _, _, b'm', b'o', b'o', b'v', ..]
        | [_, _, _, _, b'm', b'd', b'a', b't', ..]
        | [_, _, _, _, b'w', b'i', b'd', b'e', ..] => Some("an MP4 or QuickTime film"),
        [0x30, 0x26, 0xb2, 0x75, ..] => Some("a Windows Media film"),
        [0x1a, 0x45, 0xdf, 0xa3, ..] => Some("a Matroska or WebM film"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'A', b'V', b'I', ..] => Some("an AVI film"),
        [b'O', b'g', b'g', b'S', ..] => Some("an Ogg film"),
        [b'F', b'L', b'V', ..] => Some("a Flash film"),
        [b'G', b'I', b'F', b'8', ..] => Some("a GIF"),
        [0x00, 0x00, 0x00, 0x01, ..] | [0x00, 0x00, 0x01, ..] => Some("an MPEG or H.264 stream"),
        _ => None,
    }
}
