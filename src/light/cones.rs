//! The cones in which the virtual geometry's bounding spheres are seen from a point. WGSL twin: `shaders/light/cones.wgsl`.
//!
//! A direction that meets virtual geometry lies in at least one cone, so a mixture of uniform distributions over the cones covers all of (b) in
//! docs/estimator.md. A sphere that subtends a wide cone, or contains the point, is replaced by the cosine-weighted hemisphere.

use arrayvec::ArrayVec;
use glam::Vec3;

use crate::math::{PI, cross3, dot3, orthonormal_basis, safe_sqrt, sincos_2pi};
use crate::packed::{Frame, MAX_SPHERES};
use crate::shared::shared;

shared! {
    /// Cones with a squared sine above this are sampled as the hemisphere: uniform sampling would waste what lies below the horizon.
    const WIDE_SIN2: f32 = 0.5;
    /// Widening of a cone, relative to its squared sine and absolute for the rounding of directions: a direction drawn at the rim stays inside.
    const CONE_PADDING: f32 = 1e-5;
    const CONE_PADDING_SIN2: f32 = 1e-9;
    /// Widening of a sphere's squared radius, relative to itself and to the squared distance: (r + e d)^2 <= r^2 (1 + k) + d^2 e^2 (1 + 1 / k)
    /// with k = 1e-3 and e = 4e-7, more than the rounding of the cross product.
    const SPHERE_PADDING: f32 = 1e-3;
    const SPHERE_PADDING_DISTANCE2: f32 = 2e-10;
    /// The largest cosine in a cone is overestimated by more than its rounding, so that no cone that reaches above the horizon counts as below.
    const COSINE_PADDING: f32 = 1e-6;

    /// One sphere seen from a point.
    #[derive(Clone, Copy)]
    value struct Cone {
        /// Unit, to the centre.
        axis: Vec3,
        /// Squared sine of the half-angle.
        sin2: f32,
        /// 1 - cos of the half-angle, without cancellation.
        one_minus_cos: f32,
        wide: bool,
        /// Upper estimate of the cosine-weighted share of the hemisphere that it covers; 0 if it is wholly below the horizon.
        weight: f32,
    }

    /// A direction inside the cones.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct ConeSample {
        pub direction: Vec3,
        /// Per solid angle, of the whole mixture; 0 if nothing virtual is above the horizon.
        pub pdf: f32,
    }
}

fn cone_of(frame: &Frame, i: u32, position: Vec3, ns: Vec3) -> Cone {
    let sphere = frame.spheres[i as usize];
    let to_centre = Vec3::new(sphere[0], sphere[1], sphere[2]) - position;
    let distance_squared = dot3(to_centre, to_centre);
    let radius_squared = sphere[3] * sphere[3];
    if radius_squared >= distance_squared * WIDE_SIN2 {
        return Cone {
            axis: ns,
            sin2: 1.0,
            one_minus_cos: 1.0,
            wide: true,
            weight: 1.0,
        };
    }
    let axis = to_centre / safe_sqrt(distance_squared);
    let sin2 = radius_squared / distance_squared;
    let cos = safe_sqrt(1.0 - sin2);
    let one_minus_cos = sin2 / (1.0 + cos);
    // Largest cosine against ns inside the cone: that of the angle to the axis less the half-angle.
    let cos_axis = dot3(axis, ns).clamp(-1.0, 1.0);
    let mut largest = 1.0;
    if cos_axis < cos {
        largest = cos_axis * cos + safe_sqrt(1.0 - cos_axis * cos_axis) * safe_sqrt(sin2);
    }
    Cone {
        axis,
        sin2,
        one_minus_cos,
        wide: false,
        weight: (2.0 * one_minus_cos * (largest + COSINE_PADDING)).max(0.0),
    }
}

/// All spheres seen from a point, computed once for all that is asked there; by default, none. (The shader sees each anew for each question:
/// it has arithmetic to spare, but no memory.)
#[derive(Default)]
pub struct Cones {
    cones: ArrayVec<Cone, MAX_SPHERES>,
    ns: Vec3,
    /// Of the weights.
    total: f32,
}

/// Seen from `position` on a surface with the unit shading normal `ns`.
pub fn cones_at(frame: &Frame, position: Vec3, ns: Vec3) -> Cones {
    let mut seen = Cones {
        ns,
        ..Cones::default()
    };
    for i in 0..frame.sphere_count {
        let cone = cone_of(frame, i, position, ns);
        seen.total += cone.weight;
        seen.cones.push(cone);
    }
    seen
}

/// Draws a direction: `choice` chooses the sphere, `u` the direction.
pub fn cone_sample(cones: &Cones, choice: f32, u: [f32; 2]) -> ConeSample {
    if cones.total <= 0.0 {
        return ConeSample {
            direction: cones.ns,
            pdf: 0.0,
        };
    }
    let mut left = choice * cones.total;
    let mut chosen = cones.cones[0];
    for cone in &cones.cones {
        if cone.weight <= 0.0 {
            continue;
        }
        left -= cone.weight;
        chosen = *cone;
        if left < 0.0 {
            break;
        }
    }
    let mut cos = safe_sqrt(1.0 - u[0]);
    let mut sin = safe_sqrt(u[0]);
    if !chosen.wide {
        let drop = u[0] * chosen.one_minus_cos;
        cos = 1.0 - drop;
        sin = safe_sqrt(drop * (2.0 - drop));
    }
    let (sin_phi, cos_phi) = sincos_2pi(u[1]);
    let (tangent, bitangent) = orthonormal_basis(chosen.axis);
    let direction = tangent * (sin * cos_phi) + bitangent * (sin * sin_phi) + chosen.axis * cos;
    ConeSample {
        direction,
        pdf: cone_pdf(cones, direction),
    }
}

/// Density of [`cone_sample`] in `direction` (unit).
pub fn cone_pdf(cones: &Cones, direction: Vec3) -> f32 {
    let mut sum = 0.0;
    for cone in &cones.cones {
        if cone.wide {
            sum += cone.weight * dot3(direction, cones.ns).max(0.0) * (1.0 / PI);
        } else if inside(cone, direction) {
            sum += cone.weight / (2.0 * PI * cone.one_minus_cos);
        }
    }
    if cones.total > 0.0 {
        sum / cones.total
    } else {
        0.0
    }
}

/// By the cross product, whose relative precision holds for cones of any width.
fn inside(cone: &Cone, direction: Vec3) -> bool {
    let across = cross3(direction, cone.axis);
    dot3(direction, cone.axis) > 0.0
        && dot3(across, across) <= cone.sin2 * (1.0 + CONE_PADDING) + CONE_PADDING_SIN2
}

/// Upper estimate, in 0..1, of the cosine-weighted share of the hemisphere that virtual geometry covers.
pub fn cone_solid_angle_fraction(cones: &Cones) -> f32 {
    cones.total.min(1.0)
}

/// Squared radius of a sphere about which a direction's rounding can say nothing certain.
pub(super) fn padded_radius_squared(radius: f32, distance_squared: f32) -> f32 {
    radius * radius * (1.0 + SPHERE_PADDING) + distance_squared * SPHERE_PADDING_DISTANCE2
}

/// False only if a ray from `position` cannot meet virtual geometry.
pub fn direction_meets_spheres(frame: &Frame, position: Vec3, direction: Vec3) -> bool {
    for i in 0..frame.sphere_count {
        let sphere = frame.spheres[i as usize];
        let to_centre = Vec3::new(sphere[0], sphere[1], sphere[2]) - position;
        let distance_squared = dot3(to_centre, to_centre);
        let radius_squared = padded_radius_squared(sphere[3], distance_squared);
        if distance_squared <= radius_squared {
            return true;
        }
        let across = cross3(direction, to_centre);
        if dot3(direction, to_centre) > 0.0 && dot3(across, across) <= radius_squared {
            return true;
        }
    }
    false
}
