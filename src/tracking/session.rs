//! A whole video: read once, its pictures forgotten as soon as they have been looked at.

use std::path::Path;

use rayon::prelude::*;

use super::TrackError;
use super::detector::FrameSeen;
use super::half_turn::keep_turn;
use super::light::Luma;
use super::options::TrackOptions;
use super::pose::Moved;
use super::prepare::prepare;
use super::rolling::{Rows, solve_rows};
use super::solved::{Solved, solve};
use super::tracker::Tracked;
use crate::scene::trajectory::FrameName;
use crate::video::{FrameSource, Taken};

/// Pictures that wait for the first decisions, bytes.
const MOST_WAITING: usize = 256 << 20;
/// Pictures looked at together afterwards.
const BATCH: usize = 16;

/// A tracked video.
#[derive(Clone, Debug)]
pub struct Session {
    pub tracked: Tracked,
    /// One for each of the frames.
    pub names: Vec<FrameName>,
    pub frames_per_second: Option<f64>,
    /// `None`: all rows were taken to be of one time.
    pub rows: Option<Rows>,
    /// How far [`Session::smooth`] moved each pose; empty: nothing was smoothed.
    pub moved: Vec<Option<Moved>>,
}

enum Picture {
    Whole(Luma),
    Lost(String),
}

/// Tracks what [`FrameSource`] reads; `progress` hears the number of frames looked at.
///
/// # Errors
/// Nothing can be read, or [`prepare`] or the frames refuse.
pub fn track(
    path: &Path,
    options: &TrackOptions,
    progress: &dyn Fn(usize),
) -> Result<Session, TrackError> {
    let mut source = FrameSource::open(path)?;
    let frames_per_second = source
        .header()
        .and_then(|header| header.frames_per_second());
    let mut names = Vec::new();
    let mut size = None;
    let mut waiting = Vec::new();
    let mut is_over = false;
    while !is_over && waiting_bytes(&waiting) < MOST_WAITING {
        match next(&mut source, &mut size, &mut names)? {
            Some(picture) => waiting.push(picture),
            None => is_over = true,
        }
    }
    let Some((width, height)) = size else {
        return Err(TrackError::input(format!(
            "{}: no frame of it can be read; expected pictures; see what was written",
            path.display()
        )));
    };
    let first: Vec<Luma> = waiting.iter().filter_map(Picture::luma).cloned().collect();
    let (detector, choice) = prepare(options, &first)?;
    drop(first);
    let mut seen = Vec::with_capacity(waiting.len());
    loop {
        let looked = waiting.par_iter().map(|picture| match picture {
            Picture::Whole(luma) => detector.look(luma),
            Picture::Lost(why) => FrameSeen::Lost(why.clone()),
        });
        seen.extend(looked.collect::<Vec<_>>());
        progress(seen.len());
        waiting.clear();
        while !is_over && waiting.len() < BATCH {
            match next(&mut source, &mut size, &mut names)? {
                Some(picture) => waiting.push(picture),
                None => is_over = true,
            }
        }
        if waiting.is_empty() {
            break;
        }
    }
    if let Some((columns, rows)) = detector.chessboard {
        keep_turn(&mut seen, columns * rows);
    }
    let size = (width, height);
    let (solved, rows) = match options.readout {
        None => (solve(options, &seen, size)?, None),
        Some(readout) => {
            let (solved, rows) = solve_rows(options, &seen, size, frames_per_second, readout)?;
            (solved, Some(rows))
        }
    };
    let Solved {
        board,
        solution,
        learnt_from,
        frames,
    } = solved;
    let tracked = Tracked {
        width,
        height,
        board,
        solution,
        choice,
        tone: detector.tone,
        frames,
        learnt_from,
    };
    if tracked.posed() == 0 {
        return Err(TrackError::input(
            "no frame has a pose; expected the board in some; film it nearer and sharper",
        ));
    }
    Ok(Session {
        tracked,
        names,
        frames_per_second,
        rows,
        moved: Vec::new(),
    })
}

impl Picture {
    fn luma(&self) -> Option<&Luma> {
        match self {
            Self::Whole(luma) => Some(luma),
            Self::Lost(_) => None,
        }
    }
}

fn waiting_bytes(waiting: &[Picture]) -> usize {
    waiting
        .iter()
        .filter_map(Picture::luma)
        .map(|luma| luma.codes.len())
        .sum()
}

/// The next frame; the first whole one says of which size all are.
fn next(
    source: &mut FrameSource,
    size: &mut Option<(usize, usize)>,
    names: &mut Vec<FrameName>,
) -> Result<Option<Picture>, TrackError> {
    let taken = source.next_as(
        &|_| true,
        |header, planes| Luma::of_planes(header, &planes),
        |frame| Luma::of(&frame.photo),
    );
    let Some((name, taken)) = taken? else {
        return Ok(None);
    };
    names.push(name);
    let luma = match taken {
        Taken::Whole(luma) => luma,
        Taken::Damaged { problem, .. } => return Ok(Some(Picture::Lost(problem.to_string()))),
        Taken::Skipped => return Ok(Some(Picture::Lost("it was passed over".to_owned()))),
    };
    let own = (luma.width, luma.height);
    let first = *size.get_or_insert(own);
    Ok(Some(match own == first {
        true => Picture::Whole(luma),
        false => Picture::Lost(format!(
            "it has {} x {} pixels where the first has {} x {}",
            own.0, own.1, first.0, first.1
        )),
    }))
}
