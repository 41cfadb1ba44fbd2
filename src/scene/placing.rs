//! Placing an object by what it stands on, how large it is and where it faces, in place of numbers for its transform.

use glam::{DMat4, DQuat, DVec2, DVec3};

use super::error::Result;
use super::pose::read_placement;
use super::ray::{HalfLine, nearest, pixel_ray};
use super::reader::{Node, Table};
use super::{Camera, Instance, Object};

/// Of any object.
pub(super) const KEYS: &[&str] = &["size_m"];
/// Of virtual objects.
pub(super) const VIRTUAL_KEYS: &[&str] = &["rest_on", "pixel", "look_at"];

/// Surfaces steeper than this carry nothing: the cosine of 66 degrees.
pub const LEAST_UPRIGHT: f64 = 0.4;

/// Points that are higher than the lowest by less than this share of the height belong to the foot.
const FOOT: f64 = 1e-3;

/// What is there when an object is placed.
#[derive(Clone, Copy)]
pub(super) struct Surroundings<'s> {
    /// At the picture's time.
    pub camera: &'s Camera,
    pub real: &'s [Object],
}

/// World-from-object: `translation`, `rotation_deg` or `rotation`, and `scale`, or what stands in their place.
pub(super) fn read_placed(
    table: &Table,
    instances: &[Instance],
    around: Surroundings,
) -> Result<DMat4> {
    for key in ["scale", "pixel"] {
        let other = if key == "scale" {
            "size_m"
        } else {
            "translation"
        };
        table.refuse_both(key, other)?;
    }
    for key in ["rotation", "rotation_deg"] {
        table.refuse_both("look_at", key)?;
    }
    let (mut scale, mut rotation, mut translation) = read_placement(table)?;
    if let Some(size_m) = table.optional("size_m", Node::positive)? {
        let (low, high) = bounds(points(instances, DMat4::IDENTITY)).unwrap_or_default();
        let largest = (high - low).max_element();
        let factor = size_m / largest;
        if !(1e-12..=1e15).contains(&factor) {
            return Err(table.error(
                format!("`size_m` is {size_m} of an object that is {largest} m large"),
                "an object with an extent",
                "give `scale`, or another mesh",
            ));
        }
        scale = DVec3::splat(factor);
    }
    let is_resting = table.optional("rest_on", read_support)?.is_some();
    let pixel = table.optional("pixel", |node| read_pixel(node, around.camera))?;
    if pixel.is_some() && !is_resting {
        return Err(table.error(
            "`pixel` without `rest_on`",
            "both: `rest_on = \"real\"` says what the object stands on there",
            "add it",
        ));
    }
    let support = pixel
        .map(|pixel| support_under(table, pixel, around))
        .transpose()?;
    if let Some(target) = table.optional("look_at", |node| read_target(node, around.camera))? {
        rotation = facing(table, target - support.unwrap_or(translation))?;
    }
    if is_resting {
        let turned = DMat4::from_scale_rotation_translation(scale, rotation, translation);
        let foot = foot(instances, turned).ok_or_else(|| {
            table.error("an object without triangles", "a foot", "give another mesh")
        })?;
        translation += match support {
            Some(support) => support - foot.point,
            None => fall(table, &foot, around.real)?,
        };
    }
    Ok(DMat4::from_scale_rotation_translation(
        scale,
        rotation,
        translation,
    ))
}

fn read_support(node: &Node) -> Result<()> {
    match node.string()? {
        "real" => Ok(()),
        _ => Err(node.impossible("\"real\": the proxy")),
    }
}

/// Pixels, corner origin.
fn read_pixel(node: &Node, camera: &Camera) -> Result<DVec2> {
    let pixel = DVec2::from(node.vector::<2>()?);
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    if pixel.cmplt(DVec2::ZERO).any() || pixel.cmpgt(size).any() {
        return Err(node.error(
            format!("`pixel` is [{}, {}]", pixel.x, pixel.y),
            format!("a place in the picture of {} x {} pixels", size.x, size.y),
            "correct it",
        ));
    }
    Ok(pixel)
}

/// "camera", or a point.
fn read_target(node: &Node, camera: &Camera) -> Result<DVec3> {
    if !node.is_string() {
        return Ok(node.vector::<3>()?.into());
    }
    match node.string()? {
        "camera" => Ok(camera.world_from_camera.w_axis.truncate()),
        _ => Err(node.impossible("a point [x, y, z], or \"camera\"")),
    }
}

/// The proxy's point that the camera shows at a pixel.
fn support_under(table: &Table, pixel: DVec2, around: Surroundings) -> Result<DVec3> {
    let error = |problem: String| {
        table.error(
            problem,
            "a pixel that shows something of the proxy that an object can stand on",
            "choose another (`mixray pick SCENE X Y` tells what is there), or extend the proxy",
        )
    };
    let (x, y) = (pixel.x, pixel.y);
    let hit = pixel_ray(around.camera, pixel)
        .and_then(|ray| nearest(around.real, &ray, |_| true))
        .ok_or_else(|| error(format!("`pixel` [{x}, {y}] shows nothing of the proxy")))?;
    if hit.normal.y < LEAST_UPRIGHT {
        let slope = hit.normal.y.clamp(-1.0, 1.0).acos().to_degrees();
        let name = &around.real[hit.object].name;
        return Err(error(format!(
            "`{name}` is {slope:.0} degrees steep at `pixel` [{x}, {y}]"
        )));
    }
    Ok(hit.point)
}

/// About the vertical, so that +Z, which is a glTF model's front, looks along `towards`.
fn facing(table: &Table, towards: DVec3) -> Result<DQuat> {
    if towards.x.hypot(towards.z) < 1e-9 {
        return Err(table.error(
            "`look_at` is straight above or below the object",
            "a point beside it: the object is turned about the vertical",
            "move one of them",
        ));
    }
    Ok(DQuat::from_rotation_y(towards.x.atan2(towards.z)))
}

/// The way down (or up, from within) to the proxy under the foot.
fn fall(table: &Table, foot: &Foot, real: &[Object]) -> Result<DVec3> {
    let above = DVec3::Y * (0.5 * foot.size_m);
    let ray = HalfLine {
        origin: foot.point + above,
        direction: DVec3::NEG_Y,
    };
    let hit = nearest(real, &ray, |_| true).ok_or_else(|| {
        table.error(
            "`rest_on` finds nothing of the proxy under the object",
            "a proxy that reaches under it",
            "move the object by `translation` or `pixel`, or extend the proxy",
        )
    })?;
    Ok(hit.point - foot.point)
}

/// What an object stands on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The middle of its lowest points, world space.
    pub point: DVec3,
    /// The object's largest extent along the axes of the world.
    pub size_m: f64,
    /// Its largest extent across the vertical.
    pub width_m: f64,
}

/// `None` without vertices.
pub fn foot(instances: &[Instance], world_from_object: DMat4) -> Option<Foot> {
    let (low, high) = bounds(points(instances, world_from_object))?;
    let limit = low.y + FOOT * (high.y - low.y);
    let lowest = points(instances, world_from_object).filter(|point| point.y <= limit);
    let (foot_low, foot_high) = bounds(lowest)?;
    let middle = 0.5 * (foot_low + foot_high);
    Some(Foot {
        point: DVec3::new(middle.x, low.y, middle.z),
        size_m: (high - low).max_element(),
        width_m: (high.x - low.x).max(high.z - low.z),
    })
}

/// The triangles' vertices, each once, in the space that `transform` leads to from the object's.
fn points(instances: &[Instance], transform: DMat4) -> impl Iterator<Item = DVec3> {
    instances.iter().flat_map(move |instance| {
        let transform = transform * instance.object_from_local;
        let primitive = &instance.primitive;
        let mut is_used = vec![false; primitive.positions.len()];
        for vertex in primitive.triangles.iter().flatten() {
            is_used[*vertex as usize] = true;
        }
        let positions = primitive.positions.iter().zip(is_used);
        let used = positions.filter_map(|(position, is_used)| is_used.then_some(position));
        used.map(move |p| transform.transform_point3(DVec3::from(p.map(f64::from))))
    })
}

/// Sides of the box around the vertices along the axes of the space that `transform` leads to from the object's; `None` without vertices.
pub fn extents(instances: &[Instance], transform: DMat4) -> Option<DVec3> {
    bounds(points(instances, transform)).map(|(low, high)| high - low)
}

/// Least and greatest corner.
pub fn bounds(points: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    points.fold(None, |bounds, p| {
        let (lo, hi) = bounds.unwrap_or((p, p));
        Some((lo.min(p), hi.max(p)))
    })
}
