//! The picture in square patches of pixels: where the lens lets each look, and what is certain of a whole patch at once.

use glam::Vec3;
use rayon::prelude::*;

use super::blur::{Blur, FOOTPRINT_MARGIN, Sphere};
use crate::camera::lens::{coefficients, is_wide, lens_undistort};
use crate::camera::shutter::CameraPose;
use crate::distortion::{LENS_FISHEYE, fisheye_direction};
use crate::packed::{FRAME_SHUTTER, Frame};

/// Pixels along a patch's side; a multiple of a block's.
const SIDE_PX: usize = 16;
/// Far above rounding.
const MARGIN: f32 = 1.01;
const LEAST_ANGLE: f32 = 1e-5;

/// Pixels of a picture, and where they look in camera space: right, down and along the axis.
#[derive(Clone, Debug)]
pub struct Patch {
    column: usize,
    row: usize,
    width: usize,
    height: usize,
    /// Of the pixels' corners; length 1 if the lens is wide, else at depth 1.
    corners: Vec<Vec3>,
    /// Of the pixels' centres; length 1 if the lens is a fisheye, else at depth 1.
    centres: Vec<Vec3>,
    /// Of a lens that is no fisheye.
    extent: Option<Extent>,
}

/// Bounds at depth 1.
#[derive(Clone, Copy, Debug)]
struct Extent {
    middle: Vec3,
    /// From the middle to the farthest pixel's centre.
    spread: f32,
    /// From a pixel's centre to its farthest corner.
    footprint: f32,
}

/// What is known of all pixels of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Certainty {
    Never,
    Always,
    /// Each has to be asked.
    Open,
}

impl Certainty {
    /// Of two spheres, either.
    pub fn or(self, other: Self) -> Self {
        match (self, other) {
            (Self::Always, _) | (_, Self::Always) => Self::Always,
            (Self::Never, Self::Never) => Self::Never,
            _ => Self::Open,
        }
    }
}

impl Patch {
    fn count(frame: &Frame) -> usize {
        columns(frame) * (frame.height as usize).div_ceil(SIDE_PX)
    }

    /// `pinhole`: the frame without its aperture.
    fn of(frame: &Frame, pinhole: &Frame, patch: usize) -> Self {
        let columns = columns(frame);
        let (column, row) = (patch % columns * SIDE_PX, patch / columns * SIDE_PX);
        let (width, height) = (
            (frame.width as usize - column).min(SIDE_PX),
            (frame.height as usize - row).min(SIDE_PX),
        );
        let looks = |frame: &Frame, width: usize, height: usize, off: f32| -> Vec<Vec3> {
            let rows = row..row + height;
            rows.flat_map(|y| (column..column + width).map(move |x| (x, y)))
                .map(|(x, y)| look(frame, x as f32 + off, y as f32 + off))
                .collect()
        };
        let mut patch = Self {
            column,
            row,
            width,
            height,
            corners: looks(frame, width + 1, height + 1, 0.0),
            centres: looks(pinhole, width, height, 0.5),
            extent: None,
        };
        if frame.lens_model != LENS_FISHEYE {
            patch.extent = Some(patch.extent());
        }
        patch
    }

    fn extent(&self) -> Extent {
        let middle = self.centres[self.height / 2 * self.width + self.width / 2];
        let far = |from: Vec3, points: &[Vec3]| {
            let distances = points.iter().map(|point| point.distance(from));
            distances.fold(0.0, f32::max)
        };
        let footprints =
            (0..self.centres.len()).map(|at| far(self.centres[at], &self.corners_of(at)));
        Extent {
            middle,
            spread: far(middle, &self.centres),
            footprint: footprints.fold(0.0, f32::max),
        }
    }

    /// The picture's numbers of its pixels, row by row.
    pub fn pixels(&self, frame: &Frame) -> impl Iterator<Item = usize> + use<> {
        let (picture_width, column, width) = (frame.width as usize, self.column, self.width);
        (self.row..self.row + self.height)
            .flat_map(move |y| (column..column + width).map(move |x| y * picture_width + x))
    }

    /// Where a pixel's centre and its corners look; `at`: its place among [`Patch::pixels`].
    pub fn looks(&self, at: usize) -> (Vec3, [Vec3; 4]) {
        (self.centres[at], self.corners_of(at))
    }

    /// Place among [`Patch::pixels`], and the picture's number, of the first pixel of each square block.
    pub fn firsts(&self, frame: &Frame, side_px: usize) -> impl Iterator<Item = (usize, usize)> {
        let each = self.pixels(frame).enumerate();
        let width = self.width;
        each.filter(move |(at, _)| {
            (at % width).is_multiple_of(side_px) && (at / width).is_multiple_of(side_px)
        })
    }

    pub fn row_px(&self, at: usize) -> u32 {
        (self.row + at / self.width) as u32
    }

    fn corners_of(&self, at: usize) -> [Vec3; 4] {
        let above = at / self.width * (self.width + 1) + at % self.width;
        let below = above + self.width + 1;
        [above, above + 1, below, below + 1].map(|corner| self.corners[corner])
    }

    /// Whether the beams of its pixels meet a sphere.
    ///
    /// A line through the eye that is turned by an angle comes nearer to a point by no more than that angle times the point's distance.
    pub fn meets_sphere(
        &self,
        frame: &Frame,
        pose: &CameraPose,
        (centre, radius): Sphere,
    ) -> Certainty {
        let Some(extent) = self.extent.filter(|_| frame.flags & FRAME_SHUTTER == 0) else {
            return Certainty::Open;
        };
        let to = centre - pose.position;
        let along = in_world(pose, extent.middle).normalize();
        let off = (to - along * to.dot(along)).length();
        let play = to.length() * (extent.spread * MARGIN + LEAST_ANGLE);
        let z = -to.dot(pose.back);
        if z + radius < -play {
            return Certainty::Never;
        }
        let blur = Blur::of(frame, extent.footprint * FOOTPRINT_MARGIN);
        if off - play > (radius + blur.radius(z - radius, z + radius)) * MARGIN {
            return Certainty::Never;
        }
        if z + radius > play && off + play < radius / MARGIN {
            return Certainty::Always;
        }
        Certainty::Open
    }
}

/// What `f` finds in each patch of the picture, in their order; with a grid of the lens nothing is undistorted.
pub fn each_patch<T: Send>(
    frame: &Frame,
    grid: Option<&LensGrid>,
    f: impl Fn(&Patch) -> T + Sync,
) -> Vec<T> {
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..*frame
    };
    let patches = (0..Patch::count(frame)).into_par_iter();
    patches
        .map(|index| match grid {
            Some(grid) => f(&grid.patches[index]),
            None => f(&Patch::of(frame, &pinhole, index)),
        })
        .collect()
}

fn columns(frame: &Frame) -> usize {
    (frame.width as usize).div_ceil(SIDE_PX)
}

fn look(frame: &Frame, x: f32, y: f32) -> Vec3 {
    let [fx, fy, cx, cy] = frame.intrinsics;
    let (x, y) = ((x - cx) / fx, (y - cy) / fy);
    if is_wide(frame) {
        return Vec3::from(fisheye_direction(&coefficients(frame), [x, y]));
    }
    let [x, y] = lens_undistort(frame, x, y);
    Vec3::new(x, y, 1.0)
}

/// Of the length that it has in camera space.
pub fn in_world(pose: &CameraPose, look: Vec3) -> Vec3 {
    pose.right * look.x - (pose.up * look.y + pose.back * look.z)
}

/// All patches of a lens, for pictures one after the other.
#[derive(Clone, Debug)]
pub struct LensGrid {
    lens: LensKey,
    patches: Vec<Patch>,
}

/// What patches depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LensKey {
    size: [u32; 2],
    intrinsics: [f32; 4],
    model: u32,
    coefficients: [f32; 12],
    is_wide: bool,
}

impl LensKey {
    fn of(frame: &Frame) -> Self {
        Self {
            size: [frame.width, frame.height],
            intrinsics: frame.intrinsics,
            model: frame.lens_model,
            coefficients: coefficients(frame),
            is_wide: is_wide(frame),
        }
    }
}

impl LensGrid {
    pub fn of(frame: &Frame) -> Self {
        Self {
            lens: LensKey::of(frame),
            patches: each_patch(frame, None, Patch::clone),
        }
    }

    pub fn fits(&self, frame: &Frame) -> bool {
        self.lens == LensKey::of(frame)
    }
}

#[cfg(test)]
mod tests;
