//! Arrows and rings on an object: moves along one axis of the world, turns about one.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::composition::{Composition, Placement, Rotation, rounded};
use super::geometry::HalfLine;
use crate::scene::{Camera, Choice};

/// A ring's radius as a share of an arrow's length.
const RING_SHARE: f64 = 0.72;
/// Where an arrow begins, as a share of its length: its middle stays free for the object.
const ARROW_BEGINS: f64 = 0.25;
const RING_SIDES: u32 = 64;
/// An axis that is seen from this near to its end (a sine) cannot be dragged along, a ring from this near to its edge not be turned.
const LEAST_SINE: f64 = 0.05;
/// The same of what is shown at all.
const LEAST_SHOWN_SINE: f64 = 0.12;

/// What can be caught.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    MoveX,
    MoveY,
    MoveZ,
    TurnX,
    TurnY,
    TurnZ,
}

impl Choice for Handle {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("turn-x", Self::TurnX),
        ("turn-y", Self::TurnY),
        ("turn-z", Self::TurnZ),
        ("move-x", Self::MoveX),
        ("move-y", Self::MoveY),
        ("move-z", Self::MoveZ),
    ];
}

impl Handle {
    /// Arrows last: they are drawn over the rings.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::CHOICES.iter().map(|(_, handle)| *handle)
    }

    /// 0 to 2: x, y, z.
    pub fn axis(self) -> usize {
        match self {
            Self::MoveX | Self::TurnX => 0,
            Self::MoveY | Self::TurnY => 1,
            Self::MoveZ | Self::TurnZ => 2,
        }
    }

    pub fn turns(self) -> bool {
        matches!(self, Self::TurnX | Self::TurnY | Self::TurnZ)
    }

    fn direction(self) -> DVec3 {
        DVec3::AXES[self.axis()]
    }
}

/// Where it stands; its size on the screen does not depend on the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gizmo {
    /// The object's origin, world space.
    centre: DVec3,
    /// Of an arrow.
    length_m: f64,
}

impl Gizmo {
    /// `length_px`: of an arrow across the view, photograph pixels. `None` behind the camera.
    pub fn at(
        camera: &Camera,
        composition: &Composition,
        placement: &Placement,
        length_px: f64,
    ) -> Option<Self> {
        let centre = placement.translation;
        let camera_from_world = composition.camera.world_from_camera().inverse();
        let depth_m = -camera_from_world.transform_point3(centre).z;
        (depth_m > 0.0).then(|| Self {
            centre,
            length_m: length_px * depth_m / camera.fx,
        })
    }

    /// The view tells what dragging the handle by a point near it means.
    pub fn is_usable(&self, handle: Handle, eye: DVec3) -> bool {
        let sight = (self.centre - eye).normalize_or_zero();
        let cosine = handle.direction().dot(sight);
        match handle.turns() {
            true => cosine.abs() > LEAST_SHOWN_SINE,
            false => 1.0 - cosine * cosine > LEAST_SHOWN_SINE * LEAST_SHOWN_SINE,
        }
    }

    /// The points that a handle is drawn through, world space: an arrow's two ends, the tip last, or a ring's, the first once more at the end.
    pub fn points(&self, handle: Handle) -> Vec<DVec3> {
        let axis = handle.direction();
        if !handle.turns() {
            let at = |share: f64| self.centre + axis * (share * self.length_m);
            return vec![at(ARROW_BEGINS), at(1.0)];
        }
        let (across, other) = axis.any_orthonormal_pair();
        let radius_m = RING_SHARE * self.length_m;
        let at = |side: u32| {
            let angle = TAU * f64::from(side) / f64::from(RING_SIDES);
            self.centre + radius_m * (angle.cos() * across + angle.sin() * other)
        };
        (0..=RING_SIDES).map(at).collect()
    }
}

/// What a handle is dragged by: metres along its axis, or an angle about it, radians; `None` where the view does not tell.
pub fn measure(handle: Handle, centre: DVec3, pointer: &HalfLine) -> Option<f64> {
    let axis = handle.direction();
    match handle.turns() {
        true => angle_about(axis, centre, pointer),
        false => along(axis, centre, pointer),
    }
}

/// Where the line along `axis` (unit) through `centre` comes nearest to the pointer's, metres from `centre`.
fn along(axis: DVec3, centre: DVec3, pointer: &HalfLine) -> Option<f64> {
    let cosine = axis.dot(pointer.direction);
    let sine_squared = 1.0 - cosine * cosine;
    let from_pointer = centre - pointer.origin;
    let metres = cosine * from_pointer.dot(pointer.direction) - from_pointer.dot(axis);
    (sine_squared > LEAST_SINE * LEAST_SINE).then(|| metres / sine_squared)
}

/// The angle of the point where the pointer meets the plane of the ring.
fn angle_about(axis: DVec3, centre: DVec3, pointer: &HalfLine) -> Option<f64> {
    let cosine = axis.dot(pointer.direction);
    if cosine.abs() < LEAST_SINE {
        return None;
    }
    let distance = (centre - pointer.origin).dot(axis) / cosine;
    if distance <= 0.0 {
        return None;
    }
    let (across, other) = axis.any_orthonormal_pair();
    let from_centre = pointer.origin + pointer.direction * distance - centre;
    Some(from_centre.dot(other).atan2(from_centre.dot(across)))
}

/// The object after a handle was dragged by so much, as [`measure`] has it.
pub fn dragged(handle: Handle, from: &Placement, by: f64) -> Placement {
    let mut placement = *from;
    match handle.turns() {
        true => {
            let turn = DQuat::from_axis_angle(handle.direction(), by);
            placement.rotation = Rotation::of(turn * from.rotation.quaternion());
        }
        false => {
            let coordinate = &mut placement.translation[handle.axis()];
            *coordinate = rounded(*coordinate + by, 1e-5);
        }
    }
    placement
}

/// Radians from -half a turn to half a turn.
pub fn within_half_turn(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_is_followed_where_the_view_tells() {
        // From above and the side; the point (0.3, 0, 0) is looked at.
        let origin = DVec3::new(0.0, 1.0, 2.0);
        let pointer = HalfLine {
            origin,
            direction: (DVec3::new(0.3, 0.0, 0.0) - origin).normalize(),
        };
        let metres = measure(Handle::MoveX, DVec3::new(-0.1, 0.0, 0.0), &pointer).unwrap();
        assert!((metres - 0.4).abs() < 1e-12, "{metres}");
        let end_on = HalfLine {
            origin,
            direction: DVec3::NEG_X,
        };
        assert_eq!(measure(Handle::MoveX, DVec3::ZERO, &end_on), None);
        let angle = |x: f64, z: f64| {
            let at = DVec3::new(x, 0.0, z);
            let direction = (at - origin).normalize();
            measure(Handle::TurnY, DVec3::ZERO, &HalfLine { origin, direction }).unwrap()
        };
        // About +Y from +Z to +X.
        let turned = within_half_turn(angle(1.0, 0.0) - angle(0.0, 1.0));
        assert!((turned - TAU / 4.0).abs() < 1e-12, "{turned}");
    }

    #[test]
    fn a_drag_changes_one_coordinate_or_turns_in_place() {
        let from = Placement {
            translation: DVec3::new(0.1, 0.2, 0.3),
            ..Placement::IDENTITY
        };
        let moved = dragged(Handle::MoveZ, &from, 0.05);
        assert_eq!(moved.translation, DVec3::new(0.1, 0.2, 0.35));
        let turned = dragged(Handle::TurnY, &from, TAU / 12.0);
        assert_eq!(turned.translation, from.translation);
        assert_eq!(
            turned.rotation,
            Rotation::EulerDeg(DVec3::new(0.0, 30.0, 0.0))
        );
    }
}
