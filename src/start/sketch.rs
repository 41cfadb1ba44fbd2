//! The straight lines that a camera was read from, drawn over its photograph: one colour for each axis, grey for what runs elsewhere, and the horizon in
//! white.

use glam::DVec2;

use super::camera::horizon_of_up;
use super::lines::Lines;
use crate::film::Picture;
use crate::scene::srgb::encode8;
use crate::scene::{Camera, Photo};
use crate::tracking::Canvas;

const AXES: [[u8; 3]; 3] = [[255, 40, 40], [40, 220, 40], [60, 120, 255]];
const ELSEWHERE: [u8; 3] = [140, 140, 140];
const HORIZON: [u8; 3] = [255, 255, 255];

/// Of the photograph's size.
pub fn sketch(photo: &Photo, camera: &Camera, lines: &Lines) -> Picture {
    let codes = photo.linear.iter().map(|pixel| pixel.map(encode8));
    let mut canvas = Canvas {
        width: photo.width as usize,
        height: photo.height as usize,
        codes: codes.collect(),
    };
    for (segment, along) in &lines.segments {
        let colour = along.map_or(ELSEWHERE, |axis| AXES[axis]);
        // Two pixels wide.
        for offset in [DVec2::ZERO, DVec2::Y] {
            canvas.line(segment.from + offset, segment.to + offset, colour);
        }
    }
    let size = (photo.width, photo.height);
    if let Some([left, right]) = horizon_of_up(size, camera.fx, lines.up) {
        let ends = [
            DVec2::new(0.0, left),
            DVec2::new(f64::from(photo.width), right),
        ];
        canvas.line(ends[0], ends[1], HORIZON);
    }
    Picture {
        width: photo.width,
        height: photo.height,
        linear: Photo::from_srgb8(photo.width, photo.height, canvas.codes).linear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start::camera::{camera_over_ground, up_of_pitch};
    use crate::start::lines::{Basis, Segment};

    #[test]
    fn lines_and_the_horizon_are_drawn() {
        let photo = Photo::from_srgb8(64, 48, vec![[0; 3]; 64 * 48]);
        let up = up_of_pitch(10.0);
        let camera = camera_over_ground((64, 48), 60.0, up, 1.0);
        let segment = Segment {
            from: DVec2::new(4.5, 40.5),
            to: DVec2::new(60.5, 40.5),
        };
        let lines = Lines {
            focal_px: 60.0,
            focal_sigma: 0.02,
            up,
            up_sigma_deg: 0.5,
            segments: vec![(segment, Some(1))],
            basis: Basis::Lines { rms: 0.5 },
        };
        let picture = sketch(&photo, &camera, &lines);
        let at = |x: usize, y: usize| picture.linear[y * 64 + x];
        assert!(at(30, 40)[1] > 0.5 && at(30, 40)[2] < 0.1);
        let row = (24.0 - 60.0 * 10_f64.to_radians().tan()) as usize;
        assert_eq!(at(30, row), [1.0; 3]);
        assert_eq!(at(30, 30), [0.0; 3], "the photograph");
    }
}
