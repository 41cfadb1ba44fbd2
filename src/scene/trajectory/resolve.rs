//! Which pose belongs to which frame, and when it was.

use std::collections::HashMap;

use glam::DMat4;

use super::{
    CameraPath, Entry, EntryKey, Intrinsics, Result, Trajectory, TrajectoryError, file_error,
};

/// A frame as its source names it.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameName {
    /// "frame_0012.png", or "frame 12 of standard input".
    pub label: String,
    /// The file's name; `None` in a stream.
    pub file: Option<String>,
    /// The number at the end of the file's name, or the place from 0.
    pub number: u32,
}

/// What a trajectory says of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameView {
    /// Seconds; `None` where neither the file nor a frame rate tells it.
    pub time_secs: Option<f64>,
    /// `None`: the frame passes through unchanged.
    pub world_from_camera: Option<DMat4>,
    pub intrinsics: Option<Intrinsics>,
    pub focus_distance_m: Option<f64>,
}

/// Time stamps of pictures and poses lie this far apart at most, seconds.
const LONGEST_GAP_SECS: f64 = 0.25;

/// A trajectory beside a source of frames.
pub struct Views<'a> {
    trajectory: &'a Trajectory,
    /// Frames a second.
    rate: Option<f64>,
    by_key: HashMap<&'a EntryKey, &'a Entry>,
    /// By file name without extension; `None`: several have it.
    by_stem: HashMap<&'a str, Option<&'a Entry>>,
    /// File names in order; in a stream they stand for its frames.
    names: Vec<&'a str>,
    is_stream: bool,
    path: CameraPath,
}

impl<'a> Views<'a> {
    /// `rate` is frames a second, where the caller knows; else the file's own.
    ///
    /// # Errors
    /// Two entries for one frame.
    pub fn new(trajectory: &'a Trajectory, rate: Option<f64>, is_stream: bool) -> Result<Self> {
        let mut by_key: HashMap<&EntryKey, &Entry> = HashMap::new();
        let mut by_stem = HashMap::new();
        let mut names = Vec::new();
        for entry in &trajectory.entries {
            if entry.key == EntryKey::Time {
                continue;
            }
            if let Some(before) = by_key.insert(&entry.key, entry) {
                return Err(file_error(
                    &trajectory.path,
                    format!(
                        "{} and {} are the same frame; expected one pose for each; remove one",
                        before.place, entry.place
                    ),
                ));
            }
            if let EntryKey::Name(name) = &entry.key {
                names.push(name.as_str());
                (by_stem.entry(stem(name)))
                    .and_modify(|entry| *entry = None)
                    .or_insert(Some(entry));
            }
        }
        names.sort_unstable();
        let mut views = Self {
            trajectory,
            rate: rate.or(trajectory.frames_per_second),
            by_key,
            by_stem,
            names,
            is_stream,
            path: CameraPath::default(),
        };
        let keys = trajectory
            .entries
            .iter()
            .filter_map(|entry| Some((views.time_secs(entry)?, entry.world_from_camera?)));
        views.path = CameraPath::new(keys.collect());
        Ok(views)
    }

    /// The camera's way through all posed entries, whether or not their frames are rendered.
    pub fn path(&self) -> &CameraPath {
        &self.path
    }

    /// Every entry tells its time.
    pub fn have_own_times(&self) -> bool {
        self.trajectory
            .entries
            .iter()
            .all(|entry| entry.time_secs.is_some())
    }

    /// Seconds from one frame to the next, where known.
    pub fn frame_secs(&self) -> Option<f64> {
        self.rate.map(|rate| 1.0 / rate)
    }

    fn time_secs(&self, entry: &Entry) -> Option<f64> {
        let number = || match &entry.key {
            EntryKey::Number(number) => Some(*number),
            EntryKey::Name(name) => (!self.is_stream)
                .then(|| trailing_number(name))
                .flatten()
                .or_else(|| Some(self.names.binary_search(&name.as_str()).ok()? as u32)),
            EntryKey::Time => None,
        };
        entry
            .time_secs
            .or_else(|| Some(f64::from(number()?) / self.rate?))
    }

    /// The view of a frame.
    ///
    /// # Errors
    /// The trajectory has no entry for it.
    pub fn of(&self, frame: &FrameName) -> Result<FrameView> {
        if self.by_key.is_empty() {
            return self.by_time(frame);
        }
        let entry = self.entry(frame).ok_or_else(|| self.absent(frame))?;
        Ok(self.view(entry))
    }

    fn entry(&self, frame: &FrameName) -> Option<&'a Entry> {
        let numbered = EntryKey::Number(frame.number);
        match &frame.file {
            Some(file) => {
                let whole = self.by_key.get(&EntryKey::Name(file.clone())).copied();
                // Frames are often converted after they were tracked.
                let named = whole.or_else(|| self.by_stem.get(stem(file)).copied().flatten());
                named.or_else(|| self.by_key.get(&numbered).copied())
            }
            None => (self.by_key.get(&numbered).copied()).or_else(|| {
                let name = self.names.get(frame.number as usize)?;
                self.by_key
                    .get(&EntryKey::Name((*name).to_owned()))
                    .copied()
            }),
        }
    }

    fn view(&self, entry: &Entry) -> FrameView {
        FrameView {
            time_secs: self.time_secs(entry),
            world_from_camera: entry.world_from_camera,
            intrinsics: entry.intrinsics.or(self.trajectory.intrinsics),
            focus_distance_m: entry.focus_distance_m,
        }
    }

    /// By the time stamp that is the file's name, or else the entry at the frame's place.
    fn by_time(&self, frame: &FrameName) -> Result<FrameView> {
        let stamp = frame.file.as_deref().map(stem);
        let stamp = stamp.filter(|stamp| stamp.contains('.'));
        let Some(time) = stamp.and_then(|stamp| stamp.parse::<f64>().ok()) else {
            let entry = self.trajectory.entries.get(frame.number as usize);
            return Ok(self.view(entry.ok_or_else(|| self.absent(frame))?));
        };
        let near = self.path.around(time, LONGEST_GAP_SECS);
        if !near.covers(time) {
            return Err(self.absent(frame));
        }
        Ok(FrameView {
            time_secs: Some(time),
            world_from_camera: near.pose(time),
            intrinsics: self.trajectory.intrinsics,
            focus_distance_m: None,
        })
    }

    fn absent(&self, frame: &FrameName) -> TrajectoryError {
        file_error(
            &self.trajectory.path,
            format!(
                "it has no pose for {}; expected one for each frame; add it, or null so that the frame passes through, or leave the frame out with --range",
                frame.label
            ),
        )
    }
}

fn stem(file: &str) -> &str {
    match file.rsplit_once('.') {
        Some((stem, extension)) if !extension.bytes().all(|b| b.is_ascii_digit()) => stem,
        _ => file,
    }
}

/// The number at the end of a file name's stem.
pub fn trailing_number(file: &str) -> Option<u32> {
    let stem = stem(file);
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[stem.len() - digits..].parse().ok()
}
