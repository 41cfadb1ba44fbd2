//! Writes frames: PNG or EXR files, a Y4M file, or a Y4M stream on standard output.
//!
//! What is finished stays: a picture is written beside its place and renamed, a Y4M file grows under another name until it is whole.
//! A note beside them has a fingerprint of the render, so that one that goes on after an interruption takes no other's frames for its own.
//! What a power cut or a bad disk has damaged does not count as finished.

use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use super::frame_output::{FOLDER_NOTE, FrameOutput, Pictures};
use super::y4m::{GREY, Header};
use super::y4m_file::{Paths, Y4mFile, write_frame};
use super::yuv::encode_yuv;
use super::{Pixels, Place, VideoError, VideoFrame, cannot_write, foreign};
use crate::files;
use crate::film::Picture;
use crate::output::{
    ExrLayers, ExrPicture, Format, OutputError, PNG_END, PngBits, Target, check_named,
    check_writable, cut, is_sealed, picture_codes8, remove_leftovers, write_bytes, write_exr,
    write_png, write_text,
};
use crate::scene::trajectory::FrameName;
use crate::scene::{Composite, EncodedPhoto, Photo};

/// The note of a render in its folder: its name, and what it says.
pub fn sequence_note(fingerprint: &str) -> (&'static str, String) {
    (FOLDER_NOTE, note_text(fingerprint))
}

/// What a sink has to know before the first frame.
pub struct SinkPlan<'a> {
    /// As it was named, for messages.
    pub path: &'a Path,
    pub output: FrameOutput,
    /// Of everything that the frames depend on.
    pub fingerprint: String,
    /// Of the frames' size; a Y4M source's own.
    pub header: Header,
    pub png_bits: Option<PngBits>,
    /// Of EXR files.
    pub layers: ExrLayers,
    pub composite: Composite,
    /// Names of the virtual objects, for the layers that tell them apart.
    pub objects: Vec<String>,
    /// Frames of another render are replaced.
    pub overwrite: bool,
    /// The frames to come, where they are known.
    pub names: Vec<FrameName>,
}

pub struct FrameSink {
    kind: Kind,
    png_bits: Option<PngBits>,
    layers: ExrLayers,
    composite: Composite,
    objects: Vec<String>,
    header: Header,
}

enum Kind {
    Pictures {
        pictures: Pictures,
        /// The last frame's file.
        last: Option<PathBuf>,
    },
    Y4mFile(Y4mFile),
    Stdout {
        out: BufWriter<std::io::Stdout>,
        /// Planes of the last frame.
        last: Option<Vec<u8>>,
    },
}

impl FrameSink {
    /// # Errors
    /// It cannot be written, holds frames of another render, or files that are read.
    pub fn open(plan: SinkPlan<'_>) -> Result<Self, VideoError> {
        let kind = match &plan.output {
            FrameOutput::Stdout => {
                let mut out = BufWriter::new(std::io::stdout());
                let header = format!("{}\n", plan.header.line);
                // Who reads a running stream need not wait for its first frame.
                let sent = out.write_all(header.as_bytes()).and_then(|()| out.flush());
                sent.map_err(|error| Place::Stdout.error(cannot_write(&error)))?;
                Kind::Stdout { out, last: None }
            }
            FrameOutput::Y4m(path) => Kind::Y4mFile(open_y4m(&plan, path)?),
            FrameOutput::Pictures(pictures) => {
                open_folder(&plan, pictures)?;
                Kind::Pictures {
                    pictures: pictures.clone(),
                    last: None,
                }
            }
        };
        Ok(Self {
            kind,
            png_bits: plan.png_bits,
            layers: plan.layers,
            composite: plan.composite,
            objects: plan.objects,
            header: plan.header,
        })
    }

    /// The colours of a film; `None`: pictures are written.
    pub fn film_colours(&self) -> Option<String> {
        (!matches!(self.kind, Kind::Pictures { .. })).then(|| self.header.colours())
    }

    /// The frame, the next in order, is finished from an earlier run, and whole. Asked once for each, before it is written; `frame` is what
    /// came in.
    ///
    /// # Errors
    /// Its file is one that is read, or that of another frame.
    pub fn has(&mut self, name: &FrameName, frame: &VideoFrame) -> Result<bool, VideoError> {
        match &mut self.kind {
            Kind::Pictures { pictures, last } => {
                let path = pictures.file_of(name);
                check_named(&path)?;
                Ok(is_whole(last.insert(path), pictures.format, frame))
            }
            Kind::Y4mFile(file) => file.has_next(),
            Kind::Stdout { .. } => Ok(false),
        }
    }

    /// The layers of EXR files, which [`FrameSink::write_exr`] writes; `None`: frames are pictures alone.
    pub fn layers(&self) -> Option<&ExrLayers> {
        match &self.kind {
            Kind::Pictures { pictures, .. } if pictures.format == Format::Exr => Some(&self.layers),
            _ => None,
        }
    }

    /// Writes a frame as an EXR file.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn write_exr(&mut self, name: &FrameName, exr: &ExrPicture) -> Result<(), VideoError> {
        if let Kind::Pictures { pictures, .. } = &self.kind {
            let target = Target::named(&pictures.file_of(name), Format::Exr);
            write_exr(&target, exr)?;
        }
        Ok(())
    }

    fn untouched(&self, photo: &Photo) -> ExrPicture {
        ExrPicture::untouched(photo, self.composite, &self.layers, &self.objects)
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
        if let Kind::Pictures { pictures, .. } = &self.kind {
            let target = Target::named(&pictures.file_of(name), Format::Png);
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
        if self.layers().is_some() {
            let exr = self.untouched(&frame.photo);
            return self.write_exr(name, &exr);
        }
        match (&self.kind, &frame.pixels) {
            (Kind::Pictures { pictures, .. }, Pixels::File(path))
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
                Ok(write_bytes(&pictures.file_of(name), &bytes)?)
            }
            (Kind::Y4mFile(_) | Kind::Stdout { .. }, Pixels::Planes(planes)) => {
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

    /// The frame before once more in place of one of which nothing is left; grey before the first.
    ///
    /// # Errors
    /// As [`FrameSink::has`] and [`FrameSink::write`].
    pub fn stand_in(&mut self, name: &FrameName) -> Result<(), VideoError> {
        let before = match &mut self.kind {
            Kind::Pictures { pictures, last } => {
                let path = pictures.file_of(name);
                check_named(&path)?;
                let before = last.as_ref().map(std::fs::read).transpose();
                let before = before
                    .map_err(|error| Place::File(path.clone()).error(cannot_write(&error)))?;
                match before {
                    Some(bytes) => write_bytes(&path, &bytes)?,
                    None if pictures.format == Format::Exr => {
                        let photo = grey_photo(&self.header);
                        let exr = self.untouched(&photo);
                        self.write_exr(name, &exr)?;
                    }
                    None => {
                        let target = Target::named(&path, Format::Png);
                        let photo = grey_photo(&self.header);
                        let picture = Picture {
                            width: photo.width,
                            height: photo.height,
                            linear: photo.linear,
                        };
                        write_png(&target, &picture, None, PngBits::Eight)?;
                    }
                }
                return Ok(());
            }
            Kind::Y4mFile(file) => match file.has_next()? {
                true => return Ok(()),
                false => file.last()?,
            },
            Kind::Stdout { last, .. } => last.take(),
        };
        self.write_planes(&before.unwrap_or_else(|| vec![GREY; self.header.frame_bytes()]))
    }

    fn write_planes(&mut self, planes: &[u8]) -> Result<(), VideoError> {
        match &mut self.kind {
            Kind::Y4mFile(file) => file.write(planes),
            Kind::Stdout { out, last } => {
                *last = Some(planes.to_vec());
                write_frame(out, planes).map_err(|error| Place::Stdout.error(cannot_write(&error)))
            }
            Kind::Pictures { .. } => Ok(()),
        }
    }

    /// All frames are there: a Y4M file gets its name.
    ///
    /// # Errors
    /// It cannot be renamed.
    pub fn finish(self) -> Result<(), VideoError> {
        match self.kind {
            Kind::Y4mFile(file) => file.finish(),
            Kind::Pictures { .. } | Kind::Stdout { .. } => Ok(()),
        }
    }
}

/// A photograph of nothing.
fn grey_photo(header: &Header) -> Photo {
    let (width, height) = (header.width, header.height);
    Photo::from_srgb8(
        width,
        height,
        vec![[GREY; 3]; width as usize * height as usize],
    )
}

/// What stands beside the frames.
fn note_text(fingerprint: &str) -> String {
    format!("{{\n  \"fingerprint\": \"{fingerprint}\"\n}}\n")
}

fn open_folder(plan: &SinkPlan<'_>, pictures: &Pictures) -> Result<(), VideoError> {
    let folder = &pictures.folder;
    let place = Place::File(plan.path.into());
    // Of a pattern the folder may hold anything.
    if pictures.pattern.is_none() {
        files::output(plan.path).map_err(OutputError::from)?;
    }
    for name in &plan.names {
        files::check_output(&pictures.file_of(name)).map_err(OutputError::from)?;
    }
    std::fs::create_dir_all(folder).map_err(|error| {
        place.error(format!("it cannot be made ({error}); expected a folder for the frames, a file that ends in .y4m, or -; name another"))
    })?;
    let note_path = pictures.note();
    check_writable(&note_path)?;
    let own: HashSet<OsString> = (plan.names.iter())
        .filter_map(|name| Some(cut(pictures.file_of(name).file_name()?)))
        .collect();
    remove_leftovers(folder, |output| match own.is_empty() {
        true => pictures.is_numbered(output),
        false => own.contains(output),
    });
    let note = note_text(&plan.fingerprint);
    let found = std::fs::read_to_string(&note_path).unwrap_or_default();
    if found == note {
        return Ok(());
    }
    let entries = std::fs::read_dir(folder).map_err(|error| place.error(cannot_write(&error)))?;
    let others: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| pictures.may_be_frame(path))
        .collect();
    if !others.is_empty() {
        // Another run of the same render may have begun since: its note is there before its first frame.
        let found = std::fs::read_to_string(&note_path).unwrap_or_default();
        if found == note {
            return Ok(());
        }
        if !plan.overwrite {
            return Err(foreign(plan.path, &found));
        }
    }
    for path in &others {
        files::before_write(path).map_err(OutputError::from)?;
    }
    for path in others {
        std::fs::remove_file(&path)
            .map_err(|error| Place::File(path).error(cannot_write(&error)))?;
    }
    Ok(write_text(&note_path, &note)?)
}

/// A picture of the frame's size to its last byte, or the frame's own file.
fn is_whole(path: &Path, format: Format, frame: &VideoFrame) -> bool {
    let Ok(bytes) = std::fs::read(path) else {
        return false;
    };
    let is_own = |own: &PathBuf| std::fs::read(own).is_ok_and(|own| own == bytes);
    if format == Format::Png && matches!(&frame.pixels, Pixels::File(own) if is_own(own)) {
        return true;
    }
    let is_to_its_end = match format {
        Format::Png => bytes.ends_with(&PNG_END),
        Format::Exr => is_sealed(&bytes),
    };
    is_to_its_end
        && Photo::decode(&bytes).is_ok_and(|(photo, _)| {
            (photo.width, photo.height) == (frame.photo.width, frame.photo.height)
        })
}

fn open_y4m(plan: &SinkPlan<'_>, path: &Path) -> Result<Y4mFile, VideoError> {
    let beside = |extension: &str| path.with_extension(extension);
    let (part, note_path) = (beside("y4m.part"), beside("y4m.mixray-sequence.json"));
    check_writable(plan.path)?;
    check_writable(&part)?;
    check_writable(&note_path)?;
    let note = note_text(&plan.fingerprint);
    let found = std::fs::read_to_string(&note_path).unwrap_or_default();
    let is_ours = found == note;
    let holds = |path: &Path| path.metadata().is_ok_and(|file| file.len() > 0);
    if !is_ours && !plan.overwrite {
        for there in [path, &part] {
            if holds(there) {
                return Err(foreign(plan.path, &(found + &begin_of(there))));
            }
        }
    }
    // The whole file of another render goes before the note says that what is there is of this one.
    let claim = || {
        if path.exists() {
            files::before_write(path).map_err(OutputError::from)?;
            std::fs::remove_file(path)
                .map_err(|error| Place::File(path.into()).error(cannot_write(&error)))?;
        }
        Ok(write_text(&note_path, &note)?)
    };
    Y4mFile::open(
        Paths {
            path: path.into(),
            part: part.clone(),
        },
        &plan.header.line,
        plan.header.frame_bytes(),
        plan.names.len() as u32,
        (plan.overwrite || !is_ours).then_some(&claim),
    )
}

/// What a film says of itself.
fn begin_of(path: &Path) -> String {
    let mut begin = Vec::new();
    let read = File::open(path).and_then(|file| file.take(256).read_to_end(&mut begin));
    // Only for a better message.
    let _ = read;
    String::from_utf8_lossy(&begin).into_owned()
}

#[cfg(test)]
mod tests;
