//! Where frames come from.

use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::matrix::Matrix;
use super::y4m::{Header, Planes, Y4mReader};
use super::yuv::decode_yuv;
use super::{Place, VideoError};
use crate::decode::{MAX_PICTURE_BYTES, read_file, read_stream, split_jpegs};
use crate::files;
use crate::scene::Photo;
use crate::scene::trajectory::{FrameName, Naming};

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
    /// Nothing but the photograph.
    Decoded,
}

#[derive(Clone, Debug)]
pub struct VideoFrame {
    pub photo: Photo,
    pub pixels: Pixels,
    /// Of what in the file is ignored.
    pub warnings: Vec<String>,
}

/// What [`FrameSource::next`] finds.
#[derive(Debug)]
pub enum Taken<T = VideoFrame> {
    /// Not wanted.
    Skipped,
    Whole(T),
    /// The frame after it is found all the same.
    Damaged {
        problem: VideoError,
        /// What there is of it, if anything can be decoded.
        rest: Option<T>,
    },
}

impl Taken {
    fn map<T>(self, of_frame: impl Fn(VideoFrame) -> T) -> Taken<T> {
        match self {
            Self::Skipped => Taken::Skipped,
            Self::Whole(frame) => Taken::Whole(of_frame(frame)),
            Self::Damaged { problem, rest } => Taken::Damaged {
                problem,
                rest: rest.map(of_frame),
            },
        }
    }
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

    /// Reads a Y4M stream with other colours than its height stands for.
    pub fn set_matrix(&mut self, matrix: Matrix) {
        if let Kind::Y4m(reader) = &mut self.kind {
            reader.set_matrix(matrix);
        }
    }

    /// The pictures of a folder in the frames' order; empty for streams.
    pub fn pictures(&self) -> Vec<(FrameName, PathBuf)> {
        match &self.kind {
            Kind::Folder(files) => files.clone(),
            _ => Vec::new(),
        }
    }

    /// Reads a stream on standard input to its end: the program that writes it is not cut off by a pipe that closes. `is_cancelled` ends it.
    pub fn drain(&mut self, is_cancelled: &dyn Fn() -> bool) {
        if let Kind::Y4m(reader) = &mut self.kind
            && *reader.place() == Place::Stdin
        {
            reader.drain(is_cancelled);
        }
    }

    /// All frames, where they are known before they are read.
    pub fn names(&self) -> Option<Vec<FrameName>> {
        match &self.kind {
            Kind::Folder(files) => Some(files.iter().map(|(name, _)| name.clone()).collect()),
            Kind::Jpegs { frames, place, .. } => {
                let numbers = 0..frames.len() as u32;
                let stream = place.to_string();
                Some(
                    numbers
                        .map(|number| FrameName::of_stream(number, &stream))
                        .collect(),
                )
            }
            Kind::Y4m(_) => None,
        }
    }

    /// The next frame, decoded where `wanted` says so; `None` after the last.
    ///
    /// # Errors
    /// Nothing more can be read.
    pub fn next(
        &mut self,
        wanted: &dyn Fn(&FrameName) -> bool,
    ) -> Result<Option<(FrameName, Taken)>, VideoError> {
        let of_planes = |header: &Header, planes: Vec<u8>| {
            let codes = decode_yuv(header, &planes);
            VideoFrame {
                photo: Photo::from_srgb8(header.width, header.height, codes),
                pixels: Pixels::Planes(planes),
                warnings: header.warning().into_iter().collect(),
            }
        };
        self.next_as(wanted, of_planes, |frame| frame)
    }

    /// The same, for who needs no colours: of the planes of a Y4M stream, or of a photograph.
    ///
    /// # Errors
    /// Nothing more can be read.
    pub fn next_as<T>(
        &mut self,
        wanted: &dyn Fn(&FrameName) -> bool,
        of_planes: impl Fn(&Header, Vec<u8>) -> T,
        of_frame: impl Fn(VideoFrame) -> T,
    ) -> Result<Option<(FrameName, Taken<T>)>, VideoError> {
        let index = self.next;
        self.next += 1;
        match &mut self.kind {
            Kind::Folder(files) => Ok(files.get(index as usize).map(|(name, path)| {
                let taken = match wanted(name) {
                    true => take_picture(path).map(of_frame),
                    false => Taken::Skipped,
                };
                (name.clone(), taken)
            })),
            Kind::Jpegs {
                bytes,
                frames,
                place,
            } => Ok(frames.get(index as usize).map(|range| {
                let name = FrameName::of_stream(index, &place.to_string());
                let taken = match wanted(&name) {
                    true => take_jpeg(&bytes[range.clone()], index, place).map(of_frame),
                    false => Taken::Skipped,
                };
                (name, taken)
            })),
            Kind::Y4m(reader) => {
                let Some(Planes { planes, problem }) = reader.next_frame()? else {
                    return Ok(None);
                };
                let name = FrameName::of_stream(index, &reader.place().to_string());
                let decoded = |planes| of_planes(reader.header(), planes);
                let taken = match (wanted(&name), problem) {
                    (false, _) => Taken::Skipped,
                    (true, None) => Taken::Whole(decoded(planes)),
                    (true, Some(problem)) => Taken::Damaged {
                        problem,
                        rest: Some(decoded(planes)),
                    },
                };
                Ok(Some((name, taken)))
            }
        }
    }
}

fn take_jpeg(bytes: &[u8], index: u32, place: &Place) -> Taken {
    let frame = |photo, warnings| VideoFrame {
        photo,
        pixels: Pixels::Decoded,
        warnings,
    };
    match Photo::decode(bytes) {
        Ok((photo, warnings)) => Taken::Whole(frame(photo, warnings)),
        Err(problem) => Taken::Damaged {
            problem: place.error(format!("frame {index}: {problem}")),
            rest: Photo::decode_cut(bytes).map(|photo| frame(photo, Vec::new())),
        },
    }
}

fn file_error(path: &Path, message: impl Into<String>) -> VideoError {
    VideoError::File {
        path: path.into(),
        message: message.into(),
    }
}

fn take_picture(path: &Path) -> Taken {
    match Photo::read(path) {
        Ok((photo, warnings)) => Taken::Whole(VideoFrame {
            photo,
            pixels: Pixels::File(path.into()),
            warnings,
        }),
        Err(problem) => {
            let bytes = read_file(path, MAX_PICTURE_BYTES).unwrap_or_default();
            Taken::Damaged {
                problem: file_error(path, problem),
                rest: Photo::decode_cut(&bytes).map(|photo| VideoFrame {
                    photo,
                    pixels: Pixels::Decoded,
                    warnings: Vec::new(),
                }),
            }
        }
    }
}

/// The pictures of a folder in the order that [`Naming`] finds.
fn list(folder: &Path) -> Result<Vec<(FrameName, PathBuf)>, VideoError> {
    let unreadable = |error: std::io::Error| {
        file_error(
            folder,
            format!("it cannot be read ({error}); expected a folder of frames; correct the rights"),
        )
    };
    let (mut pictures, mut folders) = (Vec::new(), Vec::new());
    files::input(folder).map_err(unreadable)?;
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let is_picture = extension
            .and_then(|e| e.to_str().map(|e| EXTENSIONS.contains(&e)))
            .unwrap_or(false);
        let name = path.file_name().unwrap_or_default();
        if path.is_dir() {
            folders.push(name.to_string_lossy().into_owned());
        }
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
        folders.sort();
        return Err(file_error(folder, nothing_there(&folders)));
    }
    let naming = Naming::of(pictures.iter().map(|(name, _)| name.as_str()));
    naming.sort(&mut pictures);
    let above = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let named: Vec<(FrameName, PathBuf)> = (0..)
        .zip(pictures)
        .map(|(place, (name, path))| {
            let file = above.join(&name).to_string_lossy().replace('\\', "/");
            let frame = FrameName {
                file: Some(file),
                number: naming.number(&name).unwrap_or(place),
                place,
                time_secs: naming.time_secs(&name),
                label: name,
            };
            (frame, path)
        })
        .collect();
    for pair in named.windows(2) {
        let [(a, a_path), (b, b_path)] = pair else {
            continue;
        };
        let same_time = a.time_secs.is_some() && a.time_secs == b.time_secs;
        if a.number == b.number || same_time || a_path.file_stem() == b_path.file_stem() {
            return Err(file_error(
                folder,
                format!(
                    "{} and {} have one number; expected a number or a name of its own for each frame; move one away",
                    a.label, b.label
                ),
            ));
        }
    }
    Ok(named)
}

/// Frames of several cameras are several sequences.
fn nothing_there(folders: &[String]) -> String {
    let expected = "expected frames as PNG, JPEG, EXR or HDR";
    match folders {
        [] => format!("it holds no picture; {expected}; name another folder"),
        _ => format!(
            "it holds no picture but the folders {}; {expected}, of one camera; name one of them",
            folders.join(", ")
        ),
    }
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
