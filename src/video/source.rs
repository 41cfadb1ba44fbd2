//! Where frames come from.

use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::y4m::{Header, Y4mReader};
use super::yuv::decode_yuv;
use super::{Place, VideoError};
use crate::decode::{read_stream, split_jpegs};
use crate::files;
use crate::scene::Photo;
use crate::scene::trajectory::{FrameName, trailing_number};

/// The frame numbers to render, the end not included.
pub type FrameRange = Range<u32>;

/// Longest run of JPEG pictures, which is held as a whole.
const MAX_JPEGS_BYTES: u64 = 8 << 30;

const EXTENSIONS: &[&str] = &["png", "jpg", "jpeg", "exr", "hdr"];

/// A frame as it came.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// A picture file.
    File(PathBuf),
    /// The planes of a Y4M frame.
    Planes(Vec<u8>),
    /// A JPEG picture of a run of them.
    Jpeg,
}

#[derive(Clone, Debug)]
pub struct VideoFrame {
    pub photo: Photo,
    pub pixels: Pixels,
    /// Of what in the file is ignored.
    pub warnings: Vec<String>,
}

/// Frames in their order.
pub struct FrameSource {
    kind: Kind,
    /// Frames that were named so far.
    next: u32,
}

enum Kind {
    Folder(Vec<(FrameName, PathBuf)>),
    Y4m(Box<Y4mReader<Box<dyn Read>>>),
    Jpegs {
        bytes: Vec<u8>,
        frames: Vec<Range<usize>>,
        place: Place,
    },
}

impl FrameSource {
    /// A folder of pictures, a Y4M file, `-` for a Y4M stream on standard input, or a file of JPEG pictures one after the other.
    ///
    /// # Errors
    /// Nothing of the kind is there.
    pub fn open(path: &Path) -> Result<Self, VideoError> {
        let kind = if path == Path::new("-") {
            files::standard_input().map_err(|error| Place::Stdin.error(error.to_string()))?;
            let input: Box<dyn Read> = Box::new(BufReader::new(std::io::stdin()));
            Kind::Y4m(Box::new(Y4mReader::new(input, Place::Stdin)?))
        } else if path.is_dir() {
            Kind::Folder(list(path)?)
        } else {
            open_file(path)?
        };
        Ok(Self { kind, next: 0 })
    }

    /// The frames have no names of their own.
    pub fn is_stream(&self) -> bool {
        !matches!(self.kind, Kind::Folder(_))
    }

    /// Of a Y4M stream.
    pub fn header(&self) -> Option<&Header> {
        match &self.kind {
            Kind::Y4m(reader) => Some(reader.header()),
            _ => None,
        }
    }

    /// All frames, where they are known before they are read.
    pub fn names(&self) -> Option<Vec<FrameName>> {
        match &self.kind {
            Kind::Folder(files) => Some(files.iter().map(|(name, _)| name.clone()).collect()),
            Kind::Jpegs { frames, place, .. } => {
                let numbers = 0..frames.len() as u32;
                Some(numbers.map(|number| of_stream(number, place)).collect())
            }
            Kind::Y4m(_) => None,
        }
    }

    /// The next frame, decoded where `wanted` says so; `None` after the last.
    ///
    /// # Errors
    /// It cannot be read or decoded.
    pub fn next(
        &mut self,
        wanted: &dyn Fn(&FrameName) -> bool,
    ) -> Result<Option<(FrameName, Option<VideoFrame>)>, VideoError> {
        let index = self.next;
        self.next += 1;
        match &mut self.kind {
            Kind::Folder(files) => {
                let Some((name, path)) = files.get(index as usize) else {
                    return Ok(None);
                };
                let frame = wanted(name).then(|| read_picture(path)).transpose()?;
                Ok(Some((name.clone(), frame)))
            }
            Kind::Jpegs {
                bytes,
                frames,
                place,
            } => {
                let Some(range) = frames.get(index as usize) else {
                    return Ok(None);
                };
                let name = of_stream(index, place);
                if !wanted(&name) {
                    return Ok(Some((name, None)));
                }
                let decoded = Photo::decode(&bytes[range.clone()]);
                let (photo, warnings) =
                    decoded.map_err(|problem| place.error(format!("frame {index}: {problem}")))?;
                let frame = VideoFrame {
                    photo,
                    pixels: Pixels::Jpeg,
                    warnings,
                };
                Ok(Some((name, Some(frame))))
            }
            Kind::Y4m(reader) => {
                let Some(planes) = reader.next_frame()? else {
                    return Ok(None);
                };
                let name = of_stream(index, reader.place());
                let frame = wanted(&name).then(|| {
                    let header = reader.header();
                    let codes = decode_yuv(header, &planes);
                    VideoFrame {
                        photo: Photo::from_srgb8(header.width, header.height, codes),
                        pixels: Pixels::Planes(planes),
                        warnings: Vec::new(),
                    }
                });
                Ok(Some((name, frame)))
            }
        }
    }
}

fn of_stream(number: u32, place: &Place) -> FrameName {
    FrameName {
        label: format!("frame {number} of {place}"),
        file: None,
        number,
    }
}

fn file_error(path: &Path, message: impl Into<String>) -> VideoError {
    VideoError::File {
        path: path.into(),
        message: message.into(),
    }
}

fn read_picture(path: &Path) -> Result<VideoFrame, VideoError> {
    let (photo, warnings) = Photo::read(path).map_err(|problem| file_error(path, problem))?;
    Ok(VideoFrame {
        photo,
        pixels: Pixels::File(path.into()),
        warnings,
    })
}

/// The pictures of a folder, by the numbers at the ends of their names, or by name where one has none.
fn list(folder: &Path) -> Result<Vec<(FrameName, PathBuf)>, VideoError> {
    let unreadable = |error: std::io::Error| {
        file_error(
            folder,
            format!("it cannot be read ({error}); expected a folder of frames; correct the rights"),
        )
    };
    let mut pictures = Vec::new();
    files::input(folder).map_err(unreadable)?;
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let is_picture = extension
            .and_then(|e| e.to_str().map(|e| EXTENSIONS.contains(&e)))
            .unwrap_or(false);
        let name = path.file_name().unwrap_or_default();
        if !is_picture || name.as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let Some(name) = name.to_str() else {
            let message = "its name is not UTF-8; expected frames whose names are text; rename it";
            return Err(file_error(&path, message));
        };
        files::input(&path).map_err(unreadable)?;
        pictures.push((name.to_owned(), path));
    }
    if pictures.is_empty() {
        return Err(file_error(
            folder,
            "it holds no picture; expected frames as PNG, JPEG, EXR or HDR; name another folder",
        ));
    }
    pictures.sort();
    let numbers: Option<Vec<u32>> = pictures
        .iter()
        .map(|(name, _)| trailing_number(name))
        .collect();
    let mut named: Vec<(FrameName, PathBuf)> = pictures
        .into_iter()
        .enumerate()
        .map(|(index, (name, path))| {
            let number = numbers
                .as_ref()
                .map_or(index as u32, |numbers| numbers[index]);
            let name = FrameName {
                label: name.clone(),
                file: Some(name),
                number,
            };
            (name, path)
        })
        .collect();
    named.sort_by_key(|(name, _)| name.number);
    for pair in named.windows(2) {
        if pair[0].0.number == pair[1].0.number {
            return Err(file_error(
                folder,
                format!(
                    "{} and {} have one number; expected a number of its own at the end of each name; move one away",
                    pair[0].0.label, pair[1].0.label
                ),
            ));
        }
    }
    Ok(named)
}

fn open_file(path: &Path) -> Result<Kind, VideoError> {
    let unreadable = |error: std::io::Error| {
        file_error(
            path,
            format!(
                "it cannot be read ({error}); expected a folder of frames, a Y4M file, or - for a stream; correct the path"
            ),
        )
    };
    let mut file = BufReader::new(files::open(path).map_err(unreadable)?);
    let mut start = Vec::new();
    (&mut file)
        .take(2)
        .read_to_end(&mut start)
        .map_err(unreadable)?;
    if start != [0xff, 0xd8] {
        let whole: Box<dyn Read> = Box::new(std::io::Cursor::new(start).chain(file));
        let place = Place::File(path.into());
        return Ok(Kind::Y4m(Box::new(Y4mReader::new(whole, place)?)));
    }
    let whole = start.as_slice().chain(file);
    let bytes = read_stream(whole, MAX_JPEGS_BYTES).map_err(|reason| {
        file_error(
            path,
            format!(
                "it cannot be read ({reason}); expected a run of JPEG pictures; cut it in parts"
            ),
        )
    })?;
    Ok(Kind::Jpegs {
        frames: split_jpegs(&bytes),
        bytes,
        place: Place::File(path.into()),
    })
}
