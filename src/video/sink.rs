//! Where frames go: a folder of PNG files, a Y4M file, or a Y4M stream on standard output.
//!
//! What is finished stays: a PNG file is written beside its place and renamed, a Y4M file grows under another name until it is whole.
//! Both carry a fingerprint of the render, so that one that goes on after an interruption takes no other's frames for its own.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::y4m::Header;
use super::yuv::encode_yuv;
use super::{Pixels, Place, VideoError, VideoFrame};
use crate::files::{self, final_target};
use crate::film::Picture;
use crate::output::{
    Format, OutputError, PngBits, Target, check_writable, picture_codes8, write_bytes, write_png,
    write_text,
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
    written: u32,
}

enum Kind {
    Folder(PathBuf),
    Y4mFile {
        file: BufWriter<File>,
        /// Whole frames that were there before.
        there: u32,
        part: PathBuf,
        path: PathBuf,
    },
    /// The file is whole already.
    Whole,
    Stdout(BufWriter<std::io::Stdout>),
}

impl FrameSink {
    /// # Errors
    /// It cannot be written, holds frames of another render, or files that are read.
    pub fn open(plan: SinkPlan<'_>) -> Result<Self, VideoError> {
        let kind = if plan.path == Path::new("-") {
            let mut out = BufWriter::new(std::io::stdout());
            let header = format!("{}\n", plan.header.line);
            let sent = out.write_all(header.as_bytes());
            sent.map_err(|error| Place::Stdout.error(cannot_write(&error)))?;
            Kind::Stdout(out)
        } else if plan.path.extension().is_some_and(|e| e == "y4m") {
            open_y4m(&plan)?
        } else {
            Kind::Folder(open_folder(&plan)?)
        };
        Ok(Self {
            kind,
            png_bits: plan.png_bits,
            header: plan.header,
            written: 0,
        })
    }

    /// The frame, the next in order, is finished from an earlier run. Asked once for each, before it is written.
    ///
    /// # Errors
    /// Its file is one that is read, or that of another frame.
    pub fn has(&mut self, name: &FrameName) -> Result<bool, VideoError> {
        Ok(match &self.kind {
            Kind::Folder(folder) => {
                let path = png_path(folder, name);
                check_writable(&path)?;
                path.is_file()
            }
            Kind::Y4mFile { there, .. } => {
                let has = self.written < *there;
                self.written += u32::from(has);
                has
            }
            Kind::Whole => true,
            Kind::Stdout(_) => false,
        })
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
        let codes = picture_codes8(picture, Some(&frame.photo));
        let before = match (&frame.pixels, &frame.photo.encoded) {
            (Pixels::Planes(planes), EncodedPhoto::Srgb8(codes)) => {
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
            (Kind::Y4mFile { .. } | Kind::Stdout(_), Pixels::Planes(planes)) => {
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

    fn write_planes(&mut self, planes: &[u8]) -> Result<(), VideoError> {
        self.written += 1;
        let (out, place): (&mut dyn Write, Place) = match &mut self.kind {
            Kind::Y4mFile { file, part, .. } => (file, Place::File(part.clone())),
            Kind::Stdout(out) => (out, Place::Stdout),
            Kind::Folder(_) | Kind::Whole => return Ok(()),
        };
        out.write_all(b"FRAME\n")
            .and_then(|()| out.write_all(planes))
            .and_then(|()| out.flush())
            .map_err(|error| place.error(cannot_write(&error)))
    }

    /// All frames are there: a Y4M file gets its name.
    ///
    /// # Errors
    /// It cannot be renamed.
    pub fn finish(self) -> Result<(), VideoError> {
        if let Kind::Y4mFile {
            file, part, path, ..
        } = self.kind
        {
            drop(file);
            std::fs::rename(&part, &path)
                .map_err(|error| Place::File(path).error(cannot_write(&error)))?;
        }
        Ok(())
    }
}

fn cannot_write(error: &std::io::Error) -> String {
    format!(
        "it cannot be written ({error}); expected room for the frames; make room, then go on with the same command"
    )
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

/// Frames of another render are there.
fn foreign(path: &Path) -> VideoError {
    Place::File(path.into()).error(
        "it holds frames of another render (another scene, trajectory or option, or none of this program's); expected a new place or the same render; name another, or replace them with --overwrite",
    )
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
    let note = format!("{{\n  \"fingerprint\": \"{}\"\n}}\n", plan.fingerprint);
    if std::fs::read_to_string(&note_path).is_ok_and(|text| text == note) {
        return Ok(folder);
    }
    let entries = std::fs::read_dir(&folder).map_err(|error| place.error(cannot_write(&error)))?;
    let others: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "png"))
        .collect();
    if !others.is_empty() && !plan.overwrite {
        return Err(foreign(plan.path));
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

/// The fingerprint stands in the header, where other programs pass it by.
fn open_y4m(plan: &SinkPlan<'_>) -> Result<Kind, VideoError> {
    let line = format!("{} XMIXRAY={}", plan.header.line, plan.fingerprint);
    let path = final_target(plan.path);
    let part = path.with_extension("y4m.part");
    check_writable(plan.path)?;
    check_writable(&part)?;
    if path.exists() && !plan.overwrite {
        return match first_line(&path).is_some_and(|first| first == line) {
            true => Ok(Kind::Whole),
            false => Err(foreign(&path)),
        };
    }
    let failed = |error: std::io::Error| Place::File(part.clone()).error(cannot_write(&error));
    if part.exists() && !plan.overwrite && first_line(&part).is_none_or(|first| first != line) {
        return Err(foreign(&part));
    }
    let mut file = (OpenOptions::new().read(true).write(true).create(true))
        .truncate(plan.overwrite)
        .open(&part)
        .map_err(failed)?;
    let begin = line.len() as u64 + 1;
    let frame = plan.header.frame_bytes() as u64 + 6;
    let length = file.metadata().map_err(failed)?.len();
    let there = length.saturating_sub(begin) / frame;
    if length < begin {
        file.set_len(0).map_err(failed)?;
        file.write_all(format!("{line}\n").as_bytes())
            .map_err(failed)?;
    }
    // A frame that was being written when the program ended goes.
    file.set_len(begin + there * frame).map_err(failed)?;
    file.seek(SeekFrom::End(0)).map_err(failed)?;
    Ok(Kind::Y4mFile {
        file: BufWriter::new(file),
        there: there as u32,
        part,
        path,
    })
}

fn first_line(path: &Path) -> Option<String> {
    let mut line = String::new();
    let file = File::open(path).ok()?;
    BufReader::new(file.take(4096)).read_line(&mut line).ok()?;
    Some(line.strip_suffix('\n')?.to_owned())
}
