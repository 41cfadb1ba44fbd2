//! What the lines of a picture say of its camera.

use glam::DVec3;

use super::segments::Segment;

/// Nothing is claimed that is less sure.
const MOST_FOCAL_SIGMA: f64 = 0.08;
const MOST_UP_SIGMA_DEG: f64 = 2.5;

/// What was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Basis {
    /// Straight lines at right angles, by how many of their standard deviations they are off, rms.
    Lines { rms: f64 },
    /// Equal squares in one plane: corners, and by how many pixels they are off.
    Squares { corners: usize, off_px: f64 },
}

/// What the lines say.
#[derive(Clone, Debug)]
pub struct Lines {
    pub focal_px: f64,
    /// Standard deviation, as a share of the focal length.
    pub focal_sigma: f64,
    /// Camera space (x right, y up, z back), unit length.
    pub up: DVec3,
    /// Root mean square of the angle by which it is off.
    pub up_sigma_deg: f64,
    /// With the axis that each runs along; `None`: elsewhere.
    pub segments: Vec<(Segment, Option<usize>)>,
    pub basis: Basis,
}

impl Lines {
    pub fn is_sure(&self, focal_is_known: bool) -> bool {
        (focal_is_known || self.focal_sigma < MOST_FOCAL_SIGMA)
            && self.up_sigma_deg < MOST_UP_SIGMA_DEG
    }

    /// As unsure as `other`, found in the same picture, differs from it.
    pub fn doubted_by(&mut self, focal_px: f64, up: DVec3) {
        let focal = (focal_px / self.focal_px).ln().abs();
        let up_deg = up.dot(self.up).clamp(-1.0, 1.0).acos().to_degrees();
        self.focal_sigma = self.focal_sigma.max(focal);
        self.up_sigma_deg = self.up_sigma_deg.max(up_deg);
    }
}
