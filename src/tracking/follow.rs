//! A running stream: each frame's pose as it comes, from a lens and a board that are known.

use nalgebra::DMatrix;

use super::Flatness;
use super::bundle::Solution;
use super::code::Code;
use super::detector::{Detector, FrameSeen, sighting};
use super::frame_pose::Minima;
use super::half_turn::keep_turn;
use super::known_board::KnownBoard;
use super::lens::{LENS_PARAMETERS, Lens};
use super::light::{Luma, Tone};
use super::options::{Target, TrackOptions};
use super::pose::Pose;
use super::prepare::prepare;
use super::settle::settle;
use super::tracker::{WORST_RMS_PX, minima_of, rms_px};

/// Finds poses frame by frame.
#[derive(Clone, Debug)]
pub struct Follower {
    known: KnownBoard,
    solution: Solution,
    /// `None`: no frame has shown yet of which family the markers are.
    detector: Option<Detector>,
    /// The last frame with a pose: it tells which of two poses is meant, and which end of a chessboard is first.
    before: Option<(FrameSeen, Minima)>,
}

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
        }
    }

    /// Camera from world.
    ///
    /// # Errors
    /// Why the frame has no pose.
    pub fn follow(&mut self, luma: &Luma) -> Result<Pose, String> {
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
        let rms_px = rms_px(&fit, &sighting, &self.solution);
        if rms_px > WORST_RMS_PX {
            return Err(format!("the best pose leaves {rms_px:.1} px"));
        }
        let pose = fit.pose;
        let decided = Minima {
            best: fit,
            other: None,
        };
        self.before = Some((seen, decided));
        Ok(pose)
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
