//! What the camera says: where it stands, whether objects are in its picture, how large they are in it, and its focal length.

use glam::DVec3;

use super::{Finding, Metres};
use crate::scene::check::Check;
use crate::scene::placing::Foot;
use crate::scene::projection::{project, undistort};
use crate::scene::ray::{HalfLine, nearest};
use crate::scene::{Camera, Object, Scene, Side};

/// An object this many times as large as its distance, or more, is taken for one in other units.
const LARGEST: f64 = 8.0;
/// Or smaller than this share of the picture's height.
const SMALLEST: f64 = 0.01;
/// Vertices of an object that are looked at beside the corners of its boxes.
const VERTICES: usize = 4096;
/// Widths of the sensors of cameras, millimetres: telephones to large format.
const SENSORS_MM: std::ops::RangeInclusive<f64> = 2.5..=130.0;

/// `feet`: of the scene's objects in order, where they are asked for.
pub(super) fn findings(scene: &Scene, feet: &[Option<Foot>]) -> Vec<Finding> {
    let camera = &scene.camera;
    let position = camera.world_from_camera.w_axis.truncate();
    let mut findings = Vec::new();
    for (index, (object, foot)) in scene.objects.iter().zip(feet).enumerate() {
        let is_inside = match object.side {
            Side::Real => is_within(scene, index, position),
            Side::Virtual => is_in_boxes(object, position),
        };
        if is_inside {
            findings.push(inside(object));
        } else if let Some(foot) = foot {
            let of_size = size(camera, position, object, foot);
            findings.extend(of_size.or_else(|| out_of_frame(camera, object)));
        }
    }
    findings.extend(focal_length(scene));
    findings
}

fn inside(object: &Object) -> Finding {
    let name = &object.name;
    let of = match object.side {
        Side::Real => "the closed surface of",
        Side::Virtual => "the box around",
    };
    let message = format!(
        "the camera is inside {of} `{name}`, which hides the picture; move the camera or the object, or correct its scale"
    );
    Finding::new(Check::CameraInside, message)
}

/// Whether a point is in the box around a part of the object.
fn is_in_boxes(object: &Object, point: DVec3) -> bool {
    object.instances.iter().any(|instance| {
        let transform = object.world_from_object * instance.object_from_local;
        in_box(
            &instance.corners(),
            transform.inverse().transform_point3(point),
        )
    })
}

fn in_box(corners: &[DVec3], point: DVec3) -> bool {
    let low = corners.iter().fold(DVec3::INFINITY, |a, p| a.min(*p));
    let high = corners.iter().fold(DVec3::NEG_INFINITY, |a, p| a.max(*p));
    point.cmpgt(low).all() && point.cmplt(high).all()
}

/// Whether a point sees the back of an object in every direction: of a room, whose faces look in, it sees the front.
fn is_within(scene: &Scene, index: usize, point: DVec3) -> bool {
    let object = &scene.objects[index];
    let directions = [DVec3::X, DVec3::Y, DVec3::Z];
    is_in_boxes(object, point)
        && directions
            .iter()
            .flat_map(|axis| [*axis, -axis])
            .all(|direction| {
                // Off the axes, on which edges lie.
                let direction = (direction + DVec3::new(0.011, 0.007, 0.013)).normalize();
                let ray = HalfLine {
                    origin: point,
                    direction,
                };
                let only = |other: &Object| std::ptr::eq(other, object);
                nearest(&scene.objects, &ray, only).is_some_and(|hit| hit.is_back)
            })
}

fn size(camera: &Camera, position: DVec3, object: &Object, foot: &Foot) -> Option<Finding> {
    let name = &object.name;
    let origin = object.world_from_object.w_axis.truncate();
    let distance_m = (foot.point - position)
        .length()
        .min((origin - position).length());
    if !(foot.size_m > 0.0 && distance_m > 0.0) {
        return None;
    }
    let (size, distance) = (Metres(foot.size_m), Metres(distance_m));
    let height = foot.size_m * camera.fy / (distance_m * f64::from(camera.height));
    let (what, likely) = if foot.size_m > LARGEST * distance_m {
        ("large", "millimetres or centimetres")
    } else if height < SMALLEST {
        ("small", "kilometres, or shrunk twice")
    } else {
        return None;
    };
    let message = format!(
        "`{name}` is {size} large at {distance} from the camera: too {what} to be meant, perhaps in {likely}; set `size_m` or `scale`"
    );
    Some(Finding::new(Check::Size, message))
}

fn out_of_frame(camera: &Camera, object: &Object) -> Option<Finding> {
    let camera_from_world = camera.world_from_camera.inverse();
    let mut corners = Vec::new();
    for instance in &object.instances {
        let camera_from_local =
            camera_from_world * object.world_from_object * instance.object_from_local;
        let of_box = instance.corners();
        corners.extend(
            of_box
                .iter()
                .map(|c| camera_from_local.transform_point3(*c)),
        );
        let positions = &instance.primitive.positions;
        let step = positions.len().div_ceil(VERTICES).max(1);
        for position in positions.iter().step_by(step) {
            let world = (object.world_from_object * instance.object_from_local)
                .transform_point3(DVec3::from(position.map(f64::from)));
            if project(camera, world).is_some_and(|seen| is_in_picture(camera, seen)) {
                return None;
            }
        }
    }
    let behind = corners.iter().all(|corner| corner.z >= 0.0);
    // A large face may fill the picture with no vertex in it: then the boxes' corners lie on several sides of it.
    let sides = frame_sides(camera);
    let beside = sides
        .iter()
        .any(|side| corners.iter().all(|corner| corner.dot(*side) > 0.0));
    if !(behind || beside) {
        return None;
    }
    let name = &object.name;
    let place = if behind {
        "behind the camera"
    } else {
        "beside the picture"
    };
    let message = format!(
        "`{name}` is {place}: no part of it is seen; move it (`rest_on = \"real\"` with `pixel`), or turn the camera"
    );
    Some(Finding::new(Check::OutOfFrame, message))
}

fn is_in_picture(camera: &Camera, seen: DVec3) -> bool {
    (0.0..=f64::from(camera.width)).contains(&seen.x)
        && (0.0..=f64::from(camera.height)).contains(&seen.y)
}

/// Normals, pointing out, of planes through the camera that have the picture on one side; camera space.
fn frame_sides(camera: &Camera) -> Vec<DVec3> {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    const STEPS: u32 = 16;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for step in 0..=STEPS {
        let share = f64::from(step) / f64::from(STEPS);
        let (x, y) = (share * width, share * height);
        for (x, y) in [(x, 0.0), (x, height), (0.0, y), (width, y)] {
            let Ok(ideal) = undistort(camera, x, y) else {
                return Vec::new();
            };
            for axis in 0..2 {
                low[axis] = low[axis].min(ideal[axis]);
                high[axis] = high[axis].max(ideal[axis]);
            }
        }
    }
    // Ideal coordinates have y down; the camera looks along -Z.
    vec![
        DVec3::new(1.0, 0.0, high[0]),
        DVec3::new(-1.0, 0.0, -low[0]),
        DVec3::new(0.0, -1.0, high[1]),
        DVec3::new(0.0, 1.0, -low[1]),
    ]
}

fn focal_length(scene: &Scene) -> Option<Finding> {
    let focal_mm = scene.focal_length_mm?;
    let camera = &scene.camera;
    let width_mm = focal_mm * f64::from(camera.width) / camera.fx;
    if SENSORS_MM.contains(&width_mm) {
        return None;
    }
    let message = format!(
        "a focal length of {focal_mm} mm and fx = {:.1} make a sensor {width_mm:.3} mm wide, which no camera has: focal_length_mm is that of the lens itself; correct it, or the field of view",
        camera.fx
    );
    Some(Finding::new(Check::FocalLength, message))
}
