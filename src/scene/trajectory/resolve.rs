//! Which pose belongs to which frame, and when it was.

use std::collections::{BTreeSet, HashMap};

use glam::DMat4;

use super::frame_name::{FrameName, Naming, file_name, stem};
use super::{
    CameraPath, Entry, EntryKey, Intrinsics, Result, Trajectory, TrajectoryError, file_error,
};

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

/// Neighbouring poses tell the motion at a frame if they are at most this many frames away.
const REACH_FRAMES: f64 = 1.5;

/// Time stamps are rounded by as much at most, seconds.
const SLACK_SECS: f64 = 1e-4;

/// A trajectory beside a source of frames.
pub struct Views<'a> {
    trajectory: &'a Trajectory,
    /// Frames a second.
    rate: Option<f64>,
    by_number: HashMap<u32, &'a Entry>,
    /// By file name without folders and extension.
    by_stem: HashMap<&'a str, Vec<&'a Entry>>,
    /// The folders of the names.
    folders: BTreeSet<&'a str>,
    /// Named entries in order; in a stream they stand for its frames.
    named: Vec<&'a Entry>,
    places: HashMap<&'a EntryKey, u32>,
    naming: Naming,
    is_stream: bool,
    /// Frames without an entry have no pose; else they are errors.
    passes_missing: bool,
    path: CameraPath,
}

impl<'a> Views<'a> {
    /// `rate` is frames a second, where the caller knows; else the file's own.
    ///
    /// # Errors
    /// Two entries for one frame.
    pub fn new(trajectory: &'a Trajectory, rate: Option<f64>, is_stream: bool) -> Result<Self> {
        let names = trajectory.entries.iter().filter_map(Entry::name);
        let mut views = Self {
            trajectory,
            rate: rate.or(trajectory.frames_per_second),
            by_number: HashMap::new(),
            by_stem: HashMap::new(),
            folders: names.clone().map(folder).collect(),
            named: Vec::new(),
            places: HashMap::new(),
            naming: Naming::of(names),
            is_stream,
            passes_missing: false,
            path: CameraPath::default(),
        };
        let mut by_key: HashMap<&EntryKey, &Entry> = HashMap::new();
        let mut named = Vec::new();
        for entry in &trajectory.entries {
            match &entry.key {
                EntryKey::Order(_) => {}
                EntryKey::Number(number) => {
                    views.by_number.insert(*number, entry);
                }
                EntryKey::Name(name) => {
                    let stem = stem(file_name(name));
                    views.by_stem.entry(stem).or_default().push(entry);
                    named.push((name.clone(), entry));
                }
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
        }
        views.naming.sort(&mut named);
        for (place, (_, entry)) in named.into_iter().enumerate() {
            views.places.insert(&entry.key, place as u32);
            views.named.push(entry);
        }
        let keys = trajectory
            .entries
            .iter()
            .filter_map(|entry| Some((views.time_secs(entry)?, entry.world_from_camera?)));
        views.path = CameraPath::new(keys.collect());
        Ok(views)
    }

    /// Frames that have no entry among named or numbered ones pass through, if this says so.
    #[must_use]
    pub fn passing_missing(self, passes_missing: bool) -> Self {
        Self {
            passes_missing,
            ..self
        }
    }

    /// The camera's way through all posed entries, whether or not their frames are rendered.
    pub fn path(&self) -> &CameraPath {
        &self.path
    }

    /// The camera's way around a frame's time.
    pub fn path_near(&self, time_secs: f64) -> CameraPath {
        let frame_secs = self.frame_secs().unwrap_or(0.0);
        self.path.around(time_secs, REACH_FRAMES * frame_secs)
    }

    /// Poses, null ones included.
    pub fn len(&self) -> usize {
        self.trajectory.entries.len()
    }

    pub fn is_empty(&self) -> bool {
        self.trajectory.entries.is_empty()
    }

    /// Every entry tells its time.
    pub fn have_own_times(&self) -> bool {
        let tells = |entry: &Entry| {
            entry.time_secs.is_some()
                || (entry.name()).is_some_and(|name| self.naming.time_secs(name).is_some())
        };
        self.trajectory.entries.iter().all(tells)
    }

    /// Poses are given in order alone: without numbers, names, or time stamps that `frames` have too.
    pub fn pairs_in_order(&self, frames: &[FrameName]) -> bool {
        let by_order = |entry: &Entry| matches!(entry.key, EntryKey::Order(_));
        let stamped = frames.iter().all(|frame| frame.time_secs.is_some());
        self.trajectory.entries.iter().all(by_order) && !(stamped && self.have_own_times())
    }

    /// Which of several folders of names these frames take their poses from.
    pub fn folder_of(&self, frames: &[FrameName]) -> Option<&'a str> {
        let file = frames.first()?.file.as_deref()?;
        self.folder_like(folder(file)).ok().flatten()
    }

    /// Seconds from one frame to the next, where known.
    pub fn frame_secs(&self) -> Option<f64> {
        self.rate.map(|rate| 1.0 / rate)
    }

    fn time_secs(&self, entry: &Entry) -> Option<f64> {
        let stamp = || self.naming.time_secs(entry.name()?);
        let number = || match &entry.key {
            EntryKey::Number(number) | EntryKey::Order(number) => Some(*number),
            EntryKey::Name(name) => (!self.is_stream)
                .then(|| self.naming.number(name))
                .flatten()
                .or_else(|| self.places.get(&entry.key).copied()),
        };
        let counted = || Some(f64::from(number()?) / self.rate?);
        entry.time_secs.or_else(stamp).or_else(counted)
    }

    /// The view of a frame.
    ///
    /// # Errors
    /// The trajectory has no entry for it, or several.
    pub fn of(&self, frame: &FrameName) -> Result<FrameView> {
        if self.by_number.is_empty() && self.by_stem.is_empty() {
            return self.in_order(frame);
        }
        let named = match &frame.file {
            Some(file) => self.of_file(file)?,
            None => self.of_stream(frame)?,
        };
        let numbered = || self.by_number.get(&frame.number).copied();
        match named.or_else(numbered) {
            Some(entry) => Ok(self.view(entry)),
            None if self.passes_missing => Ok(FrameView {
                time_secs: None,
                world_from_camera: None,
                // The first frame of a sequence may be one, and the scene wants its lens.
                intrinsics: (self.trajectory.entries.iter())
                    .find_map(|entry| entry.intrinsics)
                    .or(self.trajectory.intrinsics),
                focus_distance_m: None,
            }),
            None => Err(self.absent(frame, "")),
        }
    }

    /// The entry of a file, whose extension may differ: frames are often converted after they were tracked.
    fn of_file(&self, file: &str) -> Result<Option<&'a Entry>> {
        let Some(alike) = self.by_stem.get(stem(file_name(file))) else {
            return Ok(None);
        };
        let own_folder = self.folder_like(folder(file))?;
        let is_own = |name: &str| own_folder.is_none_or(|own| folder(name) == own);
        let candidates: Vec<(&str, &Entry)> = (alike.iter())
            .filter_map(|entry| Some((entry.name()?, *entry)))
            .filter(|(name, _)| is_own(name))
            .collect();
        let whole = |(name, _): &&(&str, &'a Entry)| file_name(name) == file_name(file);
        match (candidates.iter().find(whole), candidates.as_slice()) {
            (Some((_, entry)), _) | (None, [(_, entry)]) => Ok(Some(entry)),
            _ => Ok(None),
        }
    }

    /// Where the names are of several folders, the one that ends most like this; `None`: they are of one.
    fn folder_like(&self, own: &str) -> Result<Option<&'a str>> {
        if self.folders.len() < 2 {
            return Ok(None);
        }
        let alike = |folder: &&str| {
            let parts = |path: &str| path.rsplit('/').map(str::to_owned).collect::<Vec<_>>();
            let pairs = parts(folder).into_iter().zip(parts(own));
            pairs.take_while(|(a, b)| a == b && !a.is_empty()).count()
        };
        let most = self.folders.iter().map(alike).max().unwrap_or(0);
        let mut best = self.folders.iter().filter(|folder| alike(folder) == most);
        match (best.next(), best.next(), most) {
            (Some(folder), None, 1..) => Ok(Some(folder)),
            _ => Err(self.several_folders()),
        }
    }

    fn several_folders(&self) -> TrajectoryError {
        let folders: Vec<&str> = self.folders.iter().copied().collect();
        file_error(
            &self.trajectory.path,
            format!(
                "its frames lie in several folders ({}); expected --frames to be one of them; name it",
                folders.join(", ")
            ),
        )
    }

    fn of_stream(&self, frame: &FrameName) -> Result<Option<&'a Entry>> {
        if self.by_number.contains_key(&frame.number) {
            return Ok(None);
        }
        if self.folders.len() > 1 {
            return Err(self.several_folders());
        }
        Ok(self.named.get(frame.place as usize).copied())
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
    fn in_order(&self, frame: &FrameName) -> Result<FrameView> {
        let Some(time) = frame.time_secs.filter(|_| self.have_own_times()) else {
            let entry = self.trajectory.entries.get(frame.place as usize);
            return Ok(self.view(entry.ok_or_else(|| self.absent(frame, ""))?));
        };
        let near = self.path.around(time, LONGEST_GAP_SECS);
        if ![0.0, SLACK_SECS, -SLACK_SECS]
            .iter()
            .any(|slack| near.covers(time + slack))
        {
            let at = format!(" ({time} s)");
            return Err(self.absent(frame, &at));
        }
        Ok(FrameView {
            time_secs: Some(time),
            world_from_camera: near.pose(time),
            intrinsics: self.trajectory.intrinsics,
            focus_distance_m: None,
        })
    }

    fn absent(&self, frame: &FrameName, at: &str) -> TrajectoryError {
        file_error(
            &self.trajectory.path,
            format!(
                "it has no pose for {}{at}; expected one for each frame; add it, or null so that the frame passes through, or leave the frame out with --range, or let all such frames pass with --missing-poses pass",
                frame.label
            ),
        )
    }
}

impl Entry {
    fn name(&self) -> Option<&str> {
        match &self.key {
            EntryKey::Name(name) => Some(name),
            EntryKey::Number(_) | EntryKey::Order(_) => None,
        }
    }
}

fn folder(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}
