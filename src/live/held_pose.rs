//! The pose of a frame, or the last one for a while where it has none.

use std::time::Duration;

use glam::DMat4;

/// Where the camera is taken to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placed {
    /// World from camera, of this frame.
    Seen(DMat4),
    /// Of an earlier one.
    Held(DMat4),
    Lost,
}

impl Placed {
    pub fn world_from_camera(self) -> Option<DMat4> {
        match self {
            Self::Seen(pose) | Self::Held(pose) => Some(pose),
            Self::Lost => None,
        }
    }
}

/// Remembers the last pose.
#[derive(Clone, Debug)]
pub struct HeldPose {
    longest: Duration,
    /// When it was seen, since the stream began.
    last: Option<(Duration, DMat4)>,
}

impl HeldPose {
    /// A pose is held so long at most.
    pub fn new(longest: Duration) -> Self {
        Self {
            longest,
            last: None,
        }
    }

    /// A frame's pose, if it has one, and when the frame came.
    pub fn place(&mut self, pose: Option<DMat4>, at: Duration) -> Placed {
        if let Some(pose) = pose {
            self.last = Some((at, pose));
            return Placed::Seen(pose);
        }
        match self.last {
            Some((seen, pose)) if at.saturating_sub(seen) <= self.longest => Placed::Held(pose),
            _ => Placed::Lost,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_holds_for_its_time_and_no_longer() {
        let ms = Duration::from_millis;
        let mut held = HeldPose::new(ms(500));
        assert_eq!(held.place(None, ms(0)), Placed::Lost);
        let pose = DMat4::from_translation(glam::DVec3::X);
        assert_eq!(held.place(Some(pose), ms(40)), Placed::Seen(pose));
        assert_eq!(held.place(None, ms(540)), Placed::Held(pose));
        assert_eq!(held.place(None, ms(541)), Placed::Lost);
        assert_eq!(held.place(Some(pose), ms(580)), Placed::Seen(pose));
    }
}
