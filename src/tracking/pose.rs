//! A rigid pose and small turns of it.

use glam::{DMat3, DMat4, DQuat, DVec3};

/// Camera from board, OpenCV's axes: x right, y down, z along the view; metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub rotation: DMat3,
    pub translation: DVec3,
}

impl Pose {
    pub fn of(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// First `other`, then this one.
    pub fn after(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.rotation * other.translation + self.translation,
        }
    }

    /// Turned by a rotation vector about the camera's axes, then moved.
    pub fn moved(&self, step: [f64; 6]) -> Self {
        let [a, b, c, x, y, z] = step;
        Self {
            rotation: turn(DVec3::new(a, b, c)) * self.rotation,
            translation: self.translation + DVec3::new(x, y, z),
        }
    }

    /// World from camera as scenes have it: the camera looks along its -Z, Y up.
    pub fn world_from_camera(&self) -> DMat4 {
        let inverse = self.inverse();
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        DMat4::from_mat3_translation(inverse.rotation * flip, inverse.translation)
    }

    pub fn way_to(&self, other: &Self) -> Moved {
        let centre = |pose: &Self| pose.inverse().translation;
        Moved {
            metres: centre(self).distance(centre(other)),
            radians: self.angle_to(other),
        }
    }

    /// Radians between the rotations of both.
    pub fn angle_to(&self, other: &Self) -> f64 {
        let between = self.rotation.transpose() * other.rotation;
        let cosine = 0.5 * (between.x_axis.x + between.y_axis.y + between.z_axis.z - 1.0);
        cosine.clamp(-1.0, 1.0).acos()
    }
}

/// How far two poses are apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// Between the camera's centres.
    pub metres: f64,
    pub radians: f64,
}

/// Of a rotation vector, radians.
pub fn turn(vector: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_scaled_axis(vector))
}
