//! What a sequence is made of and how it is told from others, without a frame rendered.

use std::path::PathBuf;

use super::plan::{Files, in_range};
use super::whole::{Whole, open_source, output_of};
use super::{Event, SequenceError, SequenceOptions};
use crate::scene::Scene;
use crate::scene::trajectory::FrameName;
use crate::video::Taken;

/// A sequence that fits together, as far as is known before its frames are rendered.
#[derive(Debug)]
pub struct Survey {
    /// Of the whole render, which its frames' folder carries.
    pub fingerprint: String,
    /// The scene with the first frame's intrinsics, and without a photograph.
    pub scene: Scene,
    /// The frames of the range, where they are known before they are read, each with its picture file, if it has one of its own.
    pub frames: Option<Vec<(FrameName, Option<PathBuf>)>>,
    /// The files that the poses were read from.
    pub trajectory_files: Vec<PathBuf>,
}

/// Reads everything but the frames after the first.
///
/// # Errors
/// As [`render_sequence`](super::render_sequence) before its first frame; frames that are standard input are not asked.
pub fn survey(
    options: &SequenceOptions,
    hear: &dyn Fn(&Event<'_>),
) -> Result<Survey, SequenceError> {
    let output = output_of(options)?;
    let files = Files::read(options, hear)?;
    let mut source = open_source(options)?;
    let whole = Whole::new(options, output, &files, &source, hear)?;
    let frames = match source.is_stream() {
        true => (whole.names.clone()).map(|names| names.into_iter().map(|n| (n, None)).collect()),
        false => Some(
            (source.pictures().into_iter())
                .filter(|(name, _)| in_range(options, name))
                .map(|(name, path)| (name, Some(path)))
                .collect(),
        ),
    };
    let wanted = |name: &FrameName| in_range(options, name);
    loop {
        let Some((name, taken)) = source.next(&wanted)? else {
            return Err(SequenceError::Unfit(
                "no frame of the range was found; expected at least one; correct --range"
                    .to_owned(),
            ));
        };
        let frame = match taken {
            Taken::Skipped => continue,
            Taken::Whole(frame) => frame,
            Taken::Damaged { problem, .. } if !options.pass_damaged_frames => {
                return Err(problem.into());
            }
            Taken::Damaged { rest: None, .. } => continue,
            Taken::Damaged {
                rest: Some(frame), ..
            } => frame,
        };
        let (scene, _) = whole.scene(&whole.views.of(&name)?, &frame.photo, hear)?;
        return Ok(Survey {
            fingerprint: whole.fingerprint(&scene),
            scene,
            frames,
            trajectory_files: files.trajectory.files.clone(),
        });
    }
}
