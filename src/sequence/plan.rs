//! What a sequence is made of, read and checked before the first frame is rendered.

use std::path::Path;

use super::scale::measure;
use super::{Event, SequenceError, SequenceOptions};
use crate::check::{self, Extent};
use crate::scene::trajectory::{
    FrameName, FrameView, Intrinsics, Trajectory, Views, read_intrinsics,
};
use crate::scene::{self, EXPECTED_FOCUS, Given, Lens, Object, Photo, Scene};
use crate::video::FrameSource;

/// Frames a second that stand for an unknown rate, where nothing depends on it but which frame follows which.
const ANY_RATE: f64 = 25.0;

pub(super) struct Files {
    pub trajectory: Trajectory,
    pub intrinsics: Option<Intrinsics>,
}

impl Files {
    pub(super) fn read(
        options: &SequenceOptions,
        hear: &dyn Fn(&Event<'_>),
    ) -> Result<Self, SequenceError> {
        let path = options.intrinsics.as_deref();
        let mut files = Self {
            trajectory: Trajectory::read(&options.trajectory)?,
            intrinsics: path.map(read_intrinsics).transpose()?,
        };
        let trajectory = &files.trajectory;
        let model = trajectory.path.parent();
        if options.trajectory.is_dir() && model != Some(&options.trajectory) {
            hear(&Event::Note(format!(
                "the largest model counts: {}, {} pictures",
                model.unwrap_or(&options.trajectory).display(),
                trajectory.entries.len()
            )));
        }
        if let Some(known) = &options.scale_from {
            let views = views(options, trajectory, None, false)?;
            let scale = measure(&views, &|view| files.intrinsics_of(view), known)?;
            hear(&Event::Note(format!(
                "lengths of the poses are multiplied by {:.5}; lines of sight pass the points by {:.3} degrees",
                scale.factor,
                scale.off_radians.to_degrees()
            )));
            files.trajectory.scale(scale.factor);
        }
        Ok(files)
    }

    /// `None`: the scene file's.
    pub(super) fn intrinsics_of(&self, view: &FrameView) -> Option<Intrinsics> {
        self.intrinsics.or(view.intrinsics)
    }

    /// The scene with a frame for its photograph.
    pub(super) fn scene(
        &self,
        options: &SequenceOptions,
        view: &FrameView,
        photo: Option<Photo>,
        hear: &dyn Fn(&Event<'_>),
    ) -> Result<Scene, SequenceError> {
        let given = Given {
            photo,
            intrinsics: self.intrinsics_of(view),
            sandbox: options.sandbox,
        };
        let mut scene = scene::load_with(&options.scene, given)?;
        scene.settings.apply(&options.overrides);
        for warning in &scene.warnings {
            hear(&Event::Warning(warning.clone()));
        }
        for finding in check::scene(&scene, Extent::WithoutCamera) {
            hear(&Event::Warning(finding.to_string()));
        }
        Ok(scene)
    }
}

/// Frames a second: of the command line, the trajectory or the stream.
pub(super) fn known_rate(
    options: &SequenceOptions,
    trajectory: &Trajectory,
    source: Option<&FrameSource>,
) -> Option<f64> {
    let of_stream = || source?.header()?.frames_per_second();
    options
        .frames_per_second
        .or(trajectory.frames_per_second)
        .or_else(of_stream)
}

pub(super) fn views<'a>(
    options: &SequenceOptions,
    trajectory: &'a Trajectory,
    rate: Option<f64>,
    is_stream: bool,
) -> Result<Views<'a>, SequenceError> {
    Ok(
        Views::new(trajectory, Some(rate.unwrap_or(ANY_RATE)), is_stream)?
            .passing_missing(options.pass_missing_poses),
    )
}

/// The scene depends on time, so that the rate has to be known.
pub(super) fn check_rate(
    scene: &Scene,
    rate: Option<f64>,
    views_have_times: bool,
) -> Result<(), SequenceError> {
    let timed = scene.shutter.is_some() || scene.objects.iter().any(Object::is_animated);
    if timed && rate.is_none() && !views_have_times {
        return Err(SequenceError::Unfit(
            "the scene has [shutter] or moving objects, but nothing tells the frames' times; expected a frame rate; give --fps".to_owned(),
        ));
    }
    Ok(())
}

/// All numbers of the range are there, and each has its entry, as far as can be known before the frames are read.
pub(super) fn check_frames(
    options: &SequenceOptions,
    source: &FrameSource,
    views: &Views<'_>,
    hear: &dyn Fn(&Event<'_>),
) -> Result<(), SequenceError> {
    let Some(names) = source.names() else {
        return Ok(());
    };
    let frames = options.frames.as_deref().unwrap_or(Path::new("-"));
    let wanted: Vec<&FrameName> = names
        .iter()
        .filter(|name| in_range(options, name))
        .collect();
    if wanted.is_empty() {
        return Err(SequenceError::Unfit(format!(
            "{}: it holds no frame of the range; expected frames numbered {} to {}; correct --range",
            frames.display(),
            names.first().map_or(0, |name| name.number),
            names.last().map_or(0, |name| name.number)
        )));
    };
    check_gaps(options, frames, &wanted)?;
    if let Some(gaps) = gaps_in_time(&wanted).filter(|_| !options.allow_gaps) {
        hear(&Event::Warning(format!("{}: {gaps}", frames.display())));
    }
    if let Some((from, to)) = options.part
        && !wanted.iter().any(|name| in_part(options, name))
    {
        return Err(SequenceError::Unfit(format!(
            "{}: no frame of the range is in the part {from}..{to}; expected numbers from {} to {}; correct --part",
            frames.display(),
            wanted.first().map_or(0, |name| name.number),
            wanted.last().map_or(0, |name| name.number)
        )));
    }
    if views.pairs_in_order(&names) && views.len() > names.len() {
        hear(&Event::Warning(format!(
            "{}: it holds {} poses for {} frames; they are taken in order from the first",
            options.trajectory.display(),
            views.len(),
            names.len()
        )));
    }
    let mut has_pose = false;
    for name in wanted {
        has_pose |= views.of(name)?.world_from_camera.is_some();
    }
    if options.pass_missing_poses && !has_pose {
        return Err(SequenceError::Unfit(format!(
            "{}: it has a pose for none of the frames in {}; expected one at least; look whether their names are the same",
            options.trajectory.display(),
            frames.display()
        )));
    }
    Ok(())
}

/// Numbers follow one another. Time stamps need not, and have places for numbers.
fn check_gaps(
    options: &SequenceOptions,
    frames: &Path,
    wanted: &[&FrameName],
) -> Result<(), SequenceError> {
    let missing = |problem: String| {
        Err(SequenceError::Unfit(format!(
            "{}: {problem}; expected all frames of the range; add what is missing, or say --allow-gaps",
            frames.display()
        )))
    };
    let (Some(first), Some(last), false) = (wanted.first(), wanted.last(), options.allow_gaps)
    else {
        return Ok(());
    };
    let (from, to) = options.range.unwrap_or((first.number, last.number + 1));
    if from < first.number {
        return missing(format!(
            "frame {from} is missing: the first is {}",
            first.label
        ));
    }
    for pair in wanted.windows(2) {
        let next = pair[0].number + 1;
        if pair[1].number != next {
            return missing(format!(
                "frame {next} is missing between {} and {}",
                pair[0].label, pair[1].label
            ));
        }
    }
    match last.number + 1 < to {
        true => missing(format!(
            "frame {} is missing: the last is {}",
            last.number + 1,
            last.label
        )),
        false => Ok(()),
    }
}

/// How much longer than the usual step from one time stamp to the next a gap is.
const GAP_STEPS: f64 = 1.75;
/// Gaps that are named.
const NAMED_GAPS: usize = 3;

/// Where frames with time stamps follow one another later than usual; `None`: nowhere.
fn gaps_in_time(frames: &[&FrameName]) -> Option<String> {
    let times: Option<Vec<f64>> = frames.iter().map(|frame| frame.time_secs).collect();
    let steps: Vec<f64> = times?.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    // The smaller one of two: a single long step is a gap.
    let usual = *sorted.get(sorted.len().checked_sub(1)? / 2)?;
    let gaps: Vec<String> = (steps.iter().zip(frames.windows(2)))
        .filter(|(step, _)| **step > GAP_STEPS * usual)
        .map(|(step, pair)| {
            format!(
                "{step:.4} s between {} and {}",
                pair[0].label, pair[1].label
            )
        })
        .collect();
    let more = match gaps.len().saturating_sub(NAMED_GAPS) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    (!gaps.is_empty()).then(|| {
        format!(
            "frames are missing: the time stamps are {usual:.4} s apart, but {}{more}; the sequence goes on without them (--allow-gaps says no word)",
            gaps[..gaps.len().min(NAMED_GAPS)].join(", ")
        )
    })
}

/// The lens can be focused at all distances that it is pulled to.
pub(super) fn check_focus(
    options: &SequenceOptions,
    trajectory: &Trajectory,
    lens: &Lens,
) -> Result<(), SequenceError> {
    let path = trajectory.path.display();
    let of_frames = trajectory.entries.iter().filter_map(|entry| {
        let focus_m = entry.focus_distance_m?;
        Some((format!("{path}: {}", entry.place), focus_m))
    });
    let pulled = options
        .focus_pull_m
        .map(|(from, to)| [from, to].map(|end| ("--focus-pull".to_owned(), end)));
    for (place, focus_m) in pulled.into_iter().flatten().chain(of_frames) {
        if let Some(problem) = lens.focus_problem(focus_m) {
            return Err(SequenceError::Unfit(format!(
                "{place}: {problem} in [lens]; expected {EXPECTED_FOCUS}; correct one of them"
            )));
        }
    }
    Ok(())
}

pub(super) fn in_range(options: &SequenceOptions, name: &FrameName) -> bool {
    match options.range {
        Some((from, to)) => (from..to).contains(&name.number),
        None => true,
    }
}

/// The frame is one that this run renders and writes.
pub(super) fn in_part(options: &SequenceOptions, name: &FrameName) -> bool {
    let (from, to) = options.part.unwrap_or((0, u32::MAX));
    in_range(options, name) && (from..to).contains(&name.number)
}
