//! Where frames go: a folder of PNG files, a Y4M file, or a Y4M stream on standard output.
//!
//! What is finished stays: a PNG file is written beside its place and renamed, a Y4M file grows under another name until it is whole.
//! Both carry a fingerprint of the render, so that one that goes on after an interruption takes no other's frames for its own. What a
//! power cut or a bad disk has damaged does not count as finished.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::y4m::{GREY, Header};
use super::y4m_file::{Paths, Y4mFile, write_frame};
use super::yuv::encode_yuv;
use super::{Pixels, Place, VideoError, VideoFrame, cannot_write, foreign};
use crate::files::{self, final_target};
use crate::film::Picture;
use crate::output::{
    Format, OutputError, PNG_END, PngBits, Target, check_named, check_writable, cut,
    picture_codes8, remove_leftovers, write_bytes, write_png, write_text,
};
use crate::scene::trajectory::FrameName;
use crate::scene::{EncodedPhoto, Photo};

/// The note in a folder of frames.
const NOTE: &str = "mixray-sequence.json";

/// What a sink has to know before the first frame.
pub struct SinkPlan<'a> {
    /// A folder, a file that ends in .y4m, or `-`.
    pub path: &'a Path,
    /// Of everything that the frames depend on.
    pub fingerprint: String,
    /// Of the frames' size; a Y4M source's own.
    pub header: Header,
    pub png_bits: Option<PngBits>,
    /// Frames of another render are replaced.
    pub overwrite: bool,
    /// The frames to come, where they are known.
    pub names: Vec<FrameName>,
}

pub struct FrameSink {
    kind: Kind,
    png_bits: Option<PngBits>,
    header: Header,
    /// Planes of the last frame of a film that this run has written.
    last: Vec<u8>,
}

enum Kind {
    Folder(PathBuf),
    Y4mFile(Y4mFile),
    Stdout(BufWriter<std::io::Stdout>),
}

impl FrameSink {
    /// # Errors
    /// It cannot be written, holds frames of another render, or files that are read.
    pub fn open(plan: SinkPlan<'_>) -> Result<Self, VideoError> {
        let kind = if plan.path == Path::new("-") {
            let mut out = BufWriter::new(std::io::stdout());
            let header = format!("{}\n", plan.header.line);
            // Who reads a running stream need not wait for its first frame.
            let sent = out.write_all(header.as_bytes()).and_then(|()| out.flush());
            sent.map_err(|error| Place::Stdout.error(cannot_write(&error)))?;
            Kind::Stdout(out)
        } else if plan.path.extension().is_some_and(|e| e == "y4m") {
            Kind::Y4mFile(open_y4m(&plan)?)
        } else {
            Kind::Folder(open_folder(&plan)?)
        };
        Ok(Self {
            kind,
            png_bits: plan.png_bits,
            header: plan.header,
            last: Vec::new(),
        })
    }

    /// The colours of a film; `None`: pictures are written.
    pub fn film_colours(&self) -> Option<String> {
        (!matches!(self.kind, Kind::Folder(_))).then(|| self.header.colours())
    }

    /// The frame, the next in order, is finished from an earlier run, and whole. Asked once for each, before it is written; `frame` is what
    /// came in.
    ///
    /// # Errors
    /// Its file is one that is read, or that of another frame.
    pub fn has(&mut self, name: &FrameName, frame: &VideoFrame) -> Result<bool, VideoError> {
        match &mut self.kind {
            Kind::Folder(folder) => {
                let path = png_path(folder, name);
                check_named(&path)?;
                Ok(is_whole(&path, frame))
            }
            Kind::Y4mFile(file) => file.has_next(),
            Kind::Stdout(_) => Ok(false),
        }
    }

    /// Writes a frame whose photograph is `frame`'s.
    ///
    /// # Errors
    /// The disk or the reader refuses.
    pub fn write(
        &mut self,
        name: &FrameName,
        picture: &Picture,
        frame: &VideoFrame,
    ) -> Result<(), VideoError> {
        if let Kind::Folder(folder) = &self.kind {
            let target = Target::named(&png_path(folder, name), Format::Png);
            let photo = Some(&frame.photo);
            let bits = self.png_bits.unwrap_or_else(|| PngBits::for_photo(photo));
            return Ok(write_png(&target, picture, photo, bits)?);
        }
        // A film is sRGB: codes of other colours are not kept.
        let photo = Some(&frame.photo).filter(|photo| photo.tags.profile.is_none());
        let codes = picture_codes8(picture, photo);
        let before = match (&frame.pixels, &frame.photo.encoded) {
            (Pixels::Planes(planes), EncodedPhoto::Codes8(codes)) => {
                Some((codes.as_slice(), planes.as_slice()))
            }
            _ => None,
        };
        let planes = encode_yuv(&self.header, &codes, before);
        self.write_planes(&planes)
    }

    /// Writes a frame as it came.
    ///
    /// # Errors
    /// As [`FrameSink::write`].
    pub fn pass(&mut self, name: &FrameName, frame: &VideoFrame) -> Result<(), VideoError> {
        match (&self.kind, &frame.pixels) {
            (Kind::Folder(folder), Pixels::File(path))
                if path
                    .extension()
                    .is_some_and(|e| e.eq_ignore_ascii_case("png")) =>
            {
                let bytes = std::fs::read(path).map_err(|error| VideoError::File {
                    path: path.clone(),
                    message: format!(
                        "it cannot be read ({error}); expected a picture; check the disk"
                    ),
                })?;
                Ok(write_bytes(&png_path(folder, name), &bytes)?)
            }
            (Kind::Y4mFile(_) | Kind::Stdout(_), Pixels::Planes(planes)) => {
                self.write_planes(planes)
            }
            _ => {
                let Photo { width, height, .. } = frame.photo;
                let linear = frame.photo.linear.clone();
                let picture = Picture {
                    width,
                    height,
                    linear,
                };
                self.write(name, &picture, frame)
            }
        }
    }

    /// In a film the last frame once more, grey before the first; false in a folder.
    ///
    /// # Errors
    /// As [`FrameSink::write`].
    pub fn repeat(&mut self) -> Result<bool, VideoError> {
        let is_there = match &mut self.kind {
            Kind::Folder(_) => return Ok(false),
            Kind::Y4mFile(file) => file.has_next()?,
            Kind::Stdout(_) => false,
        };
        if !is_there {
            let mut planes = std::mem::take(&mut self.last);
            planes.resize(self.header.frame_bytes(), GREY);
            self.write_planes(&planes)?;
        }
        Ok(true)
    }

    fn write_planes(&mut self, planes: &[u8]) -> Result<(), VideoError> {
        self.last = planes.to_vec();
        match &mut self.kind {
            Kind::Y4mFile(file) => file.write(planes),
            Kind::Stdout(out) => {
                write_frame(out, planes).map_err(|error| Place::Stdout.error(cannot_write(&error)))
            }
            Kind::Folder(_) => Ok(()),
        }
    }

    /// All frames are there: a Y4M file gets its name.
    ///
    /// # Errors
    /// It cannot be renamed.
    pub fn finish(self) -> Result<(), VideoError> {
        match self.kind {
            Kind::Y4mFile(file) => file.finish(),
            Kind::Folder(_) | Kind::Stdout(_) => Ok(()),
        }
    }
}

fn png_path(folder: &Path, name: &FrameName) -> PathBuf {
    let stem = match &name.file {
        Some(file) => Path::new(file)
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        None => format!("frame_{:06}", name.number),
    };
    folder.join(format!("{stem}.png"))
}

/// The folder, links resolved.
fn open_folder(plan: &SinkPlan<'_>) -> Result<PathBuf, VideoError> {
    let folder = final_target(plan.path);
    let place = Place::File(plan.path.into());
    files::output(plan.path).map_err(OutputError::from)?;
    for name in &plan.names {
        files::check_output(&png_path(&folder, name)).map_err(OutputError::from)?;
    }
    std::fs::create_dir_all(&folder).map_err(|error| {
        place.error(format!("it cannot be made ({error}); expected a folder for the frames, a file that ends in .y4m, or -; name another"))
    })?;
    let note_path = folder.join(NOTE);
    check_writable(&note_path)?;
    let own: HashSet<OsString> = (plan.names.iter())
        .filter_map(|name| Some(cut(png_path(&folder, name).file_name()?)))
        .collect();
    remove_leftovers(&folder, |output| match own.is_empty() {
        true => is_numbered(output),
        false => own.contains(output),
    });
    let note = format!("{{\n  \"fingerprint\": \"{}\"\n}}\n", plan.fingerprint);
    let found = std::fs::read_to_string(&note_path).unwrap_or_default();
    if found == note {
        return Ok(folder);
    }
    let entries = std::fs::read_dir(&folder).map_err(|error| place.error(cannot_write(&error)))?;
    let others: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "png"))
        .collect();
    if !others.is_empty() && !plan.overwrite {
        return Err(foreign(plan.path, &found));
    }
    for path in &others {
        files::before_write(path).map_err(OutputError::from)?;
    }
    for path in others {
        std::fs::remove_file(&path)
            .map_err(|error| Place::File(path).error(cannot_write(&error)))?;
    }
    write_text(&note_path, &note)?;
    Ok(folder)
}

/// What a frame without a name of its own is called.
fn is_numbered(name: &OsStr) -> bool {
    let number = (name.to_str())
        .and_then(|name| name.strip_prefix("frame_")?.strip_suffix(".png"))
        .and_then(|number| number.parse().ok());
    number.is_some_and(|number: u32| *name == *format!("frame_{number:06}.png"))
}

/// A picture of the frame's size to its last byte, or the frame's own file.
fn is_whole(path: &Path, frame: &VideoFrame) -> bool {
    let Ok(bytes) = std::fs::read(path) else {
        return false;
    };
    let is_own = |own: &PathBuf| std::fs::read(own).is_ok_and(|own| own == bytes);
    if matches!(&frame.pixels, Pixels::File(own) if is_own(own)) {
        return true;
    }
    bytes.ends_with(&PNG_END)
        && Photo::decode(&bytes).is_ok_and(|(photo, _)| {
            (photo.width, photo.height) == (frame.photo.width, frame.photo.height)
        })
}

fn open_y4m(plan: &SinkPlan<'_>) -> Result<Y4mFile, VideoError> {
    let path = final_target(plan.path);
    let part = path.with_extension("y4m.part");
    check_writable(plan.path)?;
    check_writable(&part)?;
    // The fingerprint stands in the header, where other programs pass it by.
    let line = format!("{} XMIXRAY={}", plan.header.line, plan.fingerprint);
    Y4mFile::open(
        Paths { path, part },
        &line,
        plan.header.frame_bytes(),
        plan.names.len() as u32,
        plan.overwrite,
    )
}

#[cfg(test)]
mod tests;
