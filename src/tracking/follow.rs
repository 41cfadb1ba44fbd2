//! A running stream: each frame's pose as it comes, from a lens and a board that are known.

use nalgebra::DMatrix;

use super::bundle::Solution;
use super::calibrate::Sighting;
use super::code::Code;
use super::detector::{self, Detector, FrameSeen, sighting};
use super::frame_pose::{self, Fit, Minima};
use super::half_turn::keep_turn;
use super::known_board::KnownBoard;
use super::lens::{LENS_PARAMETERS, Lens};
use super::light::{Luma, Tone};
use super::options::{Target, TrackOptions};
use super::pose::Pose;
use super::prepare::prepare;
use super::rolling::{period_of, share_of};
use super::row_ways::{Around, RowWays};
use super::settle::settle;
use super::tracker::{WORST_RMS_PX, minima_of, rms_px};
use super::{Flatness, TrackError};

/// Finds poses frame by frame.
#[derive(Clone, Debug)]
pub struct Follower {
    known: KnownBoard,
    solution: Solution,
    /// `None`: no frame has shown yet of which family the markers are.
    detector: Option<Detector>,
    /// The last frame with a pose: it tells which of two poses is meant, and which end of a chessboard is first.
    before: Option<(FrameSeen, Minima)>,
    rows: Option<RowTimes>,
    /// Frames with a pose, the newest last, as far as they tell how the camera moves.
    past: Vec<(u32, Pose)>,
}

/// A sensor's rows, in frames.
#[derive(Clone, Copy, Debug)]
struct RowTimes {
    readout: f64,
    /// Poses that are further back tell no motion.
    reach: f64,
}

/// Seconds back to the last pose that still tells how the camera moves.
const LONGEST_MOTION_SECS: f64 = 0.25;
/// Poses before a frame's own whose way is taken to go on.
const PAST: usize = 2;
/// Times that a pose and the ways of the rows are found anew from one another.
const ROUNDS: usize = 3;

impl Follower {
    /// `code` where the board does not tell it; `tone` in place of the board's.
    pub fn new(known: KnownBoard, code: Option<Code>, lens: Lens, tone: Option<Tone>) -> Self {
        let target = Target::Board(known.board.clone());
        let chessboard = target.chessboard();
        let code = code.or(known.board.code.clone());
        let tone = tone.or(known.tone).unwrap_or(Tone::Srgb);
        let detector = (chessboard.is_some() || code.is_some()).then(|| Detector {
            chessboard,
            codes: code.into_iter().collect(),
            charuco: target.charuco(),
            tone,
        });
        let parameters = LENS_PARAMETERS + 3 * known.board.points.len();
        let solution = Solution {
            views: Vec::new(),
            lens,
            points: known.board.points.clone(),
            noise_px: known.noise_px,
            rms_px: known.noise_px,
            covariance: DMatrix::zeros(parameters, parameters),
        };
        Self {
            known: KnownBoard {
                tone: Some(tone),
                ..known
            },
            solution,
            detector,
            before: None,
            rows: None,
            past: Vec::new(),
        }
    }

    /// Rows are read one after the other, in so many seconds (below 0: from the lowest up); poses are then those of the middle row's time.
    ///
    /// # Errors
    /// There is no rate of frames, or the readout is longer than a frame.
    pub fn with_readout(
        self,
        readout_secs: f64,
        frames_per_second: Option<f64>,
    ) -> Result<Self, TrackError> {
        let period = period_of(frames_per_second)?;
        Ok(Self {
            rows: Some(RowTimes {
                readout: share_of(readout_secs, period)?,
                reach: LONGEST_MOTION_SECS / period,
            }),
            ..self
        })
    }

    /// Camera from world; numbers rise from frame to frame, those that are left out counted.
    ///
    /// # Errors
    /// Why the frame has no pose.
    pub fn follow(&mut self, luma: &Luma, number: u32) -> Result<Pose, String> {
        let mut seen = self.look(luma)?;
        if let (Some((columns, rows)), Some((before, _))) = (self.chessboard(), &self.before) {
            let mut both = [before.clone(), seen];
            keep_turn(&mut both, columns * rows);
            [_, seen] = both;
        }
        let (sighting, _) = sighting(&seen, &self.known.board, Some(&self.solution.lens));
        let minima = minima_of(&seen, &sighting, &self.solution)?;
        let settled = match &self.before {
            Some((_, before)) => settle(&[Some(before), Some(&minima)]),
            None => settle(&[Some(&minima)]),
        };
        let (fit, _) = settled.into_iter().next_back().ok_or("no pose")??;
        let (fit, sighting) = self.at_the_middle_row(&seen, (fit, sighting), luma.height, number);
        let rms_px = rms_px(&fit, &sighting, &self.solution);
        if rms_px > WORST_RMS_PX {
            return Err(format!("the best pose leaves {rms_px:.1} px"));
        }
        let pose = fit.pose;
        if self.rows.is_some() {
            self.past.push((number, pose));
        }
        let decided = Minima {
            best: fit,
            other: None,
        };
        self.before = Some((seen, decided));
        Ok(pose)
    }

    /// The pose in the middle of the frame's time, and what is seen then, from the pose of all rows alike. Only what has been tells how the camera moves: a
    /// stream does not wait for the next frame.
    fn at_the_middle_row(
        &mut self,
        seen: &FrameSeen,
        (mut fit, mut sighting): (Fit, Sighting),
        height: usize,
        number: u32,
    ) -> (Fit, Sighting) {
        let Some(rows) = self.rows else {
            return (fit, sighting);
        };
        let after = |past: u32| f64::from(past) - f64::from(number);
        (self.past).retain(|(past, _)| (-rows.reach..0.0).contains(&after(*past)));
        let old = self.past.len().saturating_sub(PAST);
        self.past.drain(..old);
        if self.past.is_empty() {
            return (fit, sighting);
        }
        let ways = RowWays::of(&self.solution, &self.known.board, height);
        for _ in 0..ROUNDS {
            let past = self.past.iter().map(|(past, pose)| (after(*past), *pose));
            let (nodes, poses) = past.chain([(0.0, fit.pose)]).unzip();
            let still = ways.frame_still(seen, &Around { nodes, poses }, rows.readout);
            let (found, _) =
                detector::sighting(&still, &self.known.board, Some(&self.solution.lens));
            let Solution { lens, points, .. } = &self.solution;
            let refitted = frame_pose::fit(
                lens,
                points,
                &found.observations,
                &fit.pose,
                self.solution.noise_px,
            );
            let Some(refitted) = refitted else {
                break;
            };
            (fit, sighting) = (refitted, found);
        }
        (fit, sighting)
    }

    fn chessboard(&self) -> Option<(usize, usize)> {
        self.detector.as_ref()?.chessboard
    }

    fn look(&mut self, luma: &Luma) -> Result<FrameSeen, String> {
        if let Some(detector) = &self.detector {
            return Ok(detector.look(luma));
        }
        let options = TrackOptions {
            target: Target::Board(self.known.board.clone()),
            code: None,
            lens: Some(self.solution.lens),
            fix_lens: true,
            tone: self.known.tone,
            flatness: Flatness::RIGID,
            readout: None,
        };
        let (detector, _) = prepare(&options, std::slice::from_ref(luma))
            .map_err(|_| "no family of markers is recognised yet".to_owned())?;
        Ok(self.detector.insert(detector).look(luma))
    }
}
