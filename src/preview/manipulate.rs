//! What a gesture does to a composition: turns, scales, and the ways of the camera.

use glam::{DQuat, DVec2, DVec3};

use super::composition::{CameraPose, Placement, Rotation, rounded, rounded_m};

/// The camera does not come nearer to its pole, degrees.
const POLE_DEG: f64 = 1.0;

/// An object turned about the vertical through its origin.
pub fn turned(placement: &Placement, degrees: f64) -> Placement {
    let turn = DQuat::from_rotation_y(degrees.to_radians());
    Placement {
        rotation: Rotation::of(turn * placement.rotation.quaternion()),
        ..*placement
    }
}

/// An object scaled about a point of the world that stays where it is: the one that it rests on.
pub fn scaled(placement: &Placement, factor: f64, fixed: DVec3) -> Placement {
    let scale = placement.scale.map(|s| rounded(s * factor, 1e-5));
    let legal = scale.abs().min_element() >= 1e-5;
    let factor = scale.x / placement.scale.x;
    match legal {
        true => Placement {
            translation: rounded_m(fixed + (placement.translation - fixed) * factor),
            scale,
            ..*placement
        },
        false => *placement,
    }
}

/// The camera as a look at a point `distance_m` before it.
fn looking(pose: &CameraPose, distance_m: f64) -> (DVec3, DVec3, DVec3) {
    match *pose {
        CameraPose::LookAt {
            position,
            look_at,
            up,
        } => (position, look_at, up),
        CameraPose::Matrix(matrix) => {
            let position = matrix.w_axis.truncate();
            let backward = matrix.z_axis.truncate();
            (
                position,
                position - backward * distance_m,
                matrix.y_axis.truncate(),
            )
        }
    }
}

/// Around the point looked at, degrees. A camera that was a matrix looks at the point at `distance_m`.
pub fn orbited(pose: &CameraPose, degrees: DVec2, distance_m: f64) -> CameraPose {
    let (position, look_at, up) = looking(pose, distance_m);
    let up = up.normalize();
    let offset = position - look_at;
    let around = DQuat::from_axis_angle(up, -degrees.x.to_radians());
    let from_pole = offset.angle_between(up).to_degrees();
    let steeper = (from_pole - degrees.y).clamp(POLE_DEG, 180.0 - POLE_DEG) - from_pole;
    let right = up.cross(offset).normalize_or_zero();
    let tilt = DQuat::from_axis_angle(right, steeper.to_radians());
    CameraPose::LookAt {
        position: rounded_m(look_at + around * (tilt * offset)),
        look_at: rounded_m(look_at),
        up,
    }
}

/// Across the view, in multiples of the distance to the point looked at: x to the right, y up.
pub fn panned(pose: &CameraPose, shift: DVec2, distance_m: f64) -> CameraPose {
    let (position, look_at, up) = looking(pose, distance_m);
    let matrix = pose.world_from_camera();
    let across = matrix.x_axis.truncate() * shift.x + matrix.y_axis.truncate() * shift.y;
    let moved = across * (position - look_at).length();
    CameraPose::LookAt {
        position: rounded_m(position + moved),
        look_at: rounded_m(look_at + moved),
        up,
    }
}

/// Towards the point looked at: its distance becomes `factor` times as long.
pub fn dollied(pose: &CameraPose, factor: f64, distance_m: f64) -> CameraPose {
    let (position, look_at, up) = looking(pose, distance_m);
    let moved = rounded_m(look_at + (position - look_at) * factor);
    match (moved - look_at).length() > 1e-3 {
        true => CameraPose::LookAt {
            position: moved,
            look_at,
            up,
        },
        false => *pose,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: CameraPose = CameraPose::LookAt {
        position: DVec3::new(0.0, 1.0, 3.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
    };

    fn position(pose: &CameraPose) -> DVec3 {
        pose.world_from_camera().w_axis.truncate()
    }

    #[test]
    fn an_orbit_keeps_its_distance_and_stops_at_the_pole() {
        let moved = orbited(&POSE, DVec2::new(30.0, 10.0), 1.0);
        assert!((position(&moved).length() - 10_f64.sqrt()).abs() < 1e-4);
        assert!(position(&moved).distance(position(&POSE)) > 1.0, "it moved");
        let above = orbited(&POSE, DVec2::new(0.0, 500.0), 1.0);
        assert!(above.world_from_camera().is_finite());
        assert!(position(&above).y > 3.1);
        // A matrix that looks at the same point goes the same way.
        let matrix = CameraPose::Matrix(POSE.world_from_camera());
        let other = orbited(&matrix, DVec2::new(30.0, 0.0), 10_f64.sqrt());
        assert!((position(&other).length() - 10_f64.sqrt()).abs() < 1e-4);
    }

    #[test]
    fn a_dolly_never_reaches_what_it_looks_at() {
        let near = dollied(&POSE, 0.5, 1.0);
        assert!((position(&near).length() - 10_f64.sqrt() / 2.0).abs() < 1e-4);
        assert_eq!(dollied(&POSE, 1e-9, 1.0), POSE);
        let aside = panned(&POSE, DVec2::new(0.1, 0.0), 1.0);
        assert!((position(&aside).x - 0.1 * 10_f64.sqrt()).abs() < 1e-4);
    }

    #[test]
    fn what_is_scaled_keeps_its_foot() {
        let placement = Placement {
            translation: DVec3::new(1.0, 0.5, 0.0),
            ..Placement::IDENTITY
        };
        let foot = DVec3::new(1.0, 0.0, 0.0);
        let larger = scaled(&placement, 2.0, foot);
        assert_eq!(larger.translation, DVec3::new(1.0, 1.0, 0.0));
        assert_eq!(larger.scale, DVec3::splat(2.0));
        assert_eq!(scaled(&placement, 0.0, foot), placement);
        let turned_once = turned(&turned(&placement, 15.0), -15.0);
        assert!((turned_once.rotation.quaternion().w).abs() > 1.0 - 1e-9);
    }
}
