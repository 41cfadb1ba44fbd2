//! A Y4M file that grows under another name until it is whole, and goes on where an ended run has left it.

use std::fs::{File, TryLockError};
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::{Place, VideoError, cannot_write, foreign};
use crate::files;
use crate::output::{OutputError, sync_folder};

const MARKER: &[u8] = b"FRAME\n";

/// Links resolved.
pub(super) struct Paths {
    /// Of the whole file.
    pub path: PathBuf,
    /// Of what grows.
    pub part: PathBuf,
}

pub(super) struct Y4mFile {
    paths: Paths,
    line: String,
    /// Of a frame with its marker.
    frame_bytes: u64,
    /// Whole frames from before.
    there: u32,
    /// Frames that were asked for.
    asked: u32,
    /// What grows; `None`: the file is whole, as far as is known.
    part: Option<BufWriter<File>>,
}

impl Y4mFile {
    /// `count`: of the frames to come, 0 where it is not known; `claim`: nothing that is there is of this render, and this makes it so. It is
    /// called when no other run writes here.
    pub(super) fn open(
        paths: Paths,
        line: &str,
        planes_bytes: usize,
        count: u32,
        claim: Option<&dyn Fn() -> Result<(), VideoError>>,
    ) -> Result<Self, VideoError> {
        let frame_bytes = (MARKER.len() + planes_bytes) as u64;
        let mut file = Self {
            paths,
            line: line.to_owned(),
            frame_bytes,
            there: 0,
            asked: 0,
            part: None,
        };
        if claim.is_none()
            && file.paths.path.exists()
            && let Some(there) = file.look(&file.paths.path)?
        {
            if there.is_all && there.count >= count {
                file.there = there.count;
                return Ok(file);
            }
            if there.count > 0 && !file.paths.part.exists() {
                file.go_on()?;
                return Ok(file);
            }
        }
        file.open_part(claim)?;
        Ok(file)
    }

    /// What there is of this render; `None` if the file is damaged in its first line.
    fn look(&self, path: &Path) -> Result<Option<Frames>, VideoError> {
        let unreadable = |error: io::Error| Place::File(path.into()).error(cannot_write(&error));
        let file = File::open(path).map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        let mut file = BufReader::new(file);
        let mut begin = Vec::new();
        let line = format!("{}\n", self.line);
        (file.by_ref().take(line.len() as u64))
            .read_to_end(&mut begin)
            .map_err(unreadable)?;
        if begin != line.as_bytes() {
            // Ended while the line was written, or lost by a power cut.
            let is_torn = line.as_bytes().starts_with(&begin) || begin.iter().all(|b| *b == 0);
            return match is_torn {
                true => Ok(None),
                false => Err(foreign(path, &String::from_utf8_lossy(&begin))),
            };
        }
        let mut frames = Frames::default();
        let mut at = line.len() as u64;
        let mut marker = [0; MARKER.len()];
        while at + self.frame_bytes <= length {
            file.read_exact(&mut marker).map_err(unreadable)?;
            if marker != MARKER {
                break;
            }
            at += self.frame_bytes;
            frames.count += 1;
            file.seek_relative((self.frame_bytes as usize - MARKER.len()) as i64)
                .map_err(unreadable)?;
        }
        frames.is_all = at == length;
        Ok(Some(frames))
    }

    /// A whole file lacks frames: it grows again.
    fn go_on(&mut self) -> Result<(), VideoError> {
        let Paths { path, part } = &self.paths;
        // One that may not be written keeps its name.
        (File::options().write(true).open(path))
            .and_then(|_| std::fs::rename(path, part))
            .map_err(|error| Place::File(path.clone()).error(cannot_write(&error)))?;
        self.open_part(None)
    }

    fn open_part(
        &mut self,
        claim: Option<&dyn Fn() -> Result<(), VideoError>>,
    ) -> Result<(), VideoError> {
        let part = self.paths.part.clone();
        let failed = |error: io::Error| Place::File(part.clone()).error(cannot_write(&error));
        let mut file = (File::options().read(true).write(true))
            .create(true)
            .truncate(false)
            .open(&part)
            .map_err(failed)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(Place::File(part).error(
                "another run writes it; expected it for this one alone; wait for the other, or name another output",
            ));
        }
        let there = match claim {
            Some(claim) => {
                file.set_len(0).map_err(failed)?;
                claim()?;
                None
            }
            None => self.look(&part)?,
        };
        self.there = there.as_ref().map_or(0, |there| there.count);
        let line = format!("{}\n", self.line);
        if there.is_none() {
            file.set_len(0).map_err(failed)?;
            file.write_all(line.as_bytes()).map_err(failed)?;
        }
        // A frame that was being written when the program ended goes.
        let end = line.len() as u64 + u64::from(self.there) * self.frame_bytes;
        file.set_len(end).map_err(failed)?;
        file.seek(SeekFrom::Start(end)).map_err(failed)?;
        self.part = Some(BufWriter::new(file));
        Ok(())
    }

    /// The next frame is there from before. Asked once for each.
    pub(super) fn has_next(&mut self) -> Result<bool, VideoError> {
        let has = self.asked < self.there;
        self.asked += 1;
        if !has && self.part.is_none() {
            self.go_on()?;
        }
        Ok(has)
    }

    /// Planes of the last frame that is there.
    pub(super) fn last(&mut self) -> Result<Option<Vec<u8>>, VideoError> {
        let Some(part) = &mut self.part else {
            return Ok(None);
        };
        let failed =
            |error: io::Error| Place::File(self.paths.part.clone()).error(cannot_write(&error));
        // Every frame is flushed: the file is all that there is.
        let file = part.get_mut();
        let end = file.stream_position().map_err(failed)?;
        let mut planes = vec![0; self.frame_bytes as usize - MARKER.len()];
        let Some(begin) = end
            .checked_sub(planes.len() as u64)
            .filter(|begin| *begin > self.line.len() as u64)
        else {
            return Ok(None);
        };
        file.seek(SeekFrom::Start(begin))
            .and_then(|_| file.read_exact(&mut planes))
            .map_err(failed)?;
        Ok(Some(planes))
    }

    /// Is on the disk when this ends.
    pub(super) fn write(&mut self, planes: &[u8]) -> Result<(), VideoError> {
        let Some(file) = &mut self.part else {
            return Ok(());
        };
        write_frame(file, planes)
            .and_then(|()| file.get_ref().sync_data())
            .map_err(|error| Place::File(self.paths.part.clone()).error(cannot_write(&error)))
    }

    /// All frames are there: the file gets its name.
    pub(super) fn finish(self) -> Result<(), VideoError> {
        let Some(file) = self.part else {
            return Ok(());
        };
        let Paths { path, part } = self.paths;
        files::before_write(&path).map_err(OutputError::from)?;
        (file.get_ref().sync_all())
            .and_then(|()| std::fs::rename(&part, &path))
            .map_err(|error| Place::File(path.clone()).error(cannot_write(&error)))?;
        sync_folder(&path);
        Ok(())
    }
}

/// Of one file.
#[derive(Default)]
struct Frames {
    /// Whole ones from the beginning.
    count: u32,
    /// Nothing is behind them.
    is_all: bool,
}

pub(super) fn write_frame(out: &mut impl Write, planes: &[u8]) -> io::Result<()> {
    out.write_all(MARKER)?;
    out.write_all(planes)?;
    out.flush()
}
