//! Whether a light can be hidden by virtual geometry at all, asked before a point on it is drawn. The CPU's alone: threads of a shader wait for
//! one another, so that one of them gains nothing by skipping what the others do.

use glam::{Vec3, Vec4};

use super::cones::padded_radius_squared;
use crate::math::dot3;
use crate::packed::{Frame, LIGHT_QUAD, Light};

/// False only if no direction from `position` to a quad light meets a sphere (each lies outside one of the four planes through the point and
/// an edge of the quad) or the quad shines to the other side. True for other lights. Costs a fraction of drawing a point on the light, which must then be turned down.
pub fn light_may_be_blocked(frame: &Frame, light: &Light, position: Vec3) -> bool {
    if light.kind != LIGHT_QUAD {
        return true;
    }
    let [u, v] = [light.axis_u, light.axis_v].map(|[x, y, z, _]| Vec3::new(x, y, z));
    let [x, y, z, _] = light.position;
    let a = Vec3::new(x, y, z) - position;
    // Outward normals, one plane a lane.
    let (from, to) = ([a, a + u, a + u + v, a + v], [u, v, -u, -v]);
    let lanes = |corners: [Vec3; 4], axis: usize| Vec4::from(corners.map(|c| c[axis]));
    let [ax, ay, az] = [0, 1, 2].map(|axis| lanes(from, axis));
    let [bx, by, bz] = [0, 1, 2].map(|axis| lanes(to, axis));
    let (nx, ny, nz) = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    let normals_squared = nx * nx + ny * ny + nz * nz;
    frame.spheres[..frame.sphere_count as usize]
        .iter()
        .any(|&[x, y, z, radius]| {
            let to_centre = Vec3::new(x, y, z) - position;
            let radius_squared = padded_radius_squared(radius, dot3(to_centre, to_centre));
            let height = nx * to_centre.x + ny * to_centre.y + nz * to_centre.z;
            let outside = height.cmpgt(Vec4::ZERO)
                & (height * height).cmpgt(normals_squared * radius_squared);
            !outside.any()
        })
}
