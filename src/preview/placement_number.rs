//! Numbers of where an object stands, by their names, for scripts.

use glam::DVec3;

use super::composition::{Placement, Rotation};
use crate::scene::Choice;

/// Metres, degrees about the fixed axes X, then Y, then Z, and a factor for all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlacementNumber {
    X,
    Y,
    Z,
    RotationX,
    RotationY,
    RotationZ,
    Scale,
}

impl Choice for PlacementNumber {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("x", Self::X),
        ("y", Self::Y),
        ("z", Self::Z),
        ("rotation_x_deg", Self::RotationX),
        ("rotation_y_deg", Self::RotationY),
        ("rotation_z_deg", Self::RotationZ),
        ("scale", Self::Scale),
    ];
}

impl PlacementNumber {
    /// A scale of 0 changes nothing.
    pub fn set(self, placement: &mut Placement, value: f64) {
        let mut deg = match placement.rotation {
            Rotation::EulerDeg(deg) => deg,
            Rotation::Quaternion(quaternion) => match Rotation::of(quaternion) {
                Rotation::EulerDeg(deg) => deg,
                Rotation::Quaternion(_) => DVec3::ZERO,
            },
        };
        match self {
            Self::X => placement.translation.x = value,
            Self::Y => placement.translation.y = value,
            Self::Z => placement.translation.z = value,
            Self::RotationX => deg.x = value,
            Self::RotationY => deg.y = value,
            Self::RotationZ => deg.z = value,
            Self::Scale if value != 0.0 => placement.scale = DVec3::splat(value),
            Self::Scale => {}
        }
        if matches!(self, Self::RotationX | Self::RotationY | Self::RotationZ) {
            placement.rotation = Rotation::EulerDeg(deg);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_changes_its_own_place() {
        for (index, (name, number)) in PlacementNumber::CHOICES.iter().enumerate() {
            let mut placement = Placement::IDENTITY;
            number.set(&mut placement, 2.0);
            let Rotation::EulerDeg(deg) = placement.rotation else {
                panic!("{name}: in degrees");
            };
            let mut expected = [0.0; 7];
            expected[index] = if index == 6 { 1.0 } else { 2.0 };
            let [x, y, z] = placement.translation.to_array();
            let is = [x, y, z, deg.x, deg.y, deg.z, placement.scale.x - 1.0];
            assert_eq!(is, expected, "{name}");
        }
        let mut placement = Placement::IDENTITY;
        PlacementNumber::Scale.set(&mut placement, 0.0);
        assert_eq!(placement, Placement::IDENTITY, "control");
    }
}
