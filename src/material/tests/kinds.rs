//! Surfaces of every kind for the tests of scattering.

use glam::Vec3;

use super::{around, plain_surface};
use crate::material::Surface;
use crate::material::normal::valid_shading_normal;
use crate::packed::{MATERIAL_LAMBERTIAN, MATERIAL_THIN_WALLED};

pub fn lambertian() -> Surface {
    Surface {
        specular: 0.0,
        flags: MATERIAL_LAMBERTIAN,
        ..plain_surface()
    }
}

pub fn metal(alpha: f32) -> Surface {
    Surface {
        metallic: 1.0,
        ggx_alpha: alpha,
        ..plain_surface()
    }
}

pub fn plastic(alpha: f32) -> Surface {
    Surface {
        base_color: Vec3::new(0.8, 0.5, 0.2),
        ggx_alpha: alpha,
        ..plain_surface()
    }
}

pub fn glass(alpha: f32, front: bool) -> Surface {
    Surface {
        transmission: 1.0,
        ggx_alpha: alpha,
        front,
        ..plain_surface()
    }
}

pub fn sheet(alpha: f32) -> Surface {
    Surface {
        flags: MATERIAL_THIN_WALLED,
        ..glass(alpha, true)
    }
}

pub fn coated(alpha: f32, coat_alpha: f32) -> Surface {
    Surface {
        clearcoat: 0.9,
        coat_alpha,
        ..plastic(alpha)
    }
}

/// Everything at once.
pub fn mixture(front: bool) -> Surface {
    Surface {
        base_color: Vec3::new(0.9, 0.6, 0.3),
        metallic: 0.3,
        transmission: 0.5,
        specular: 0.7,
        specular_color: Vec3::new(1.0, 0.6, 0.8),
        ggx_alpha: 0.3,
        clearcoat: if front { 0.5 } else { 0.0 },
        coat_alpha: 0.1,
        front,
        ..plain_surface()
    }
}

pub fn surfaces() -> Vec<(&'static str, Surface)> {
    let mut list = vec![
        ("lambertian", lambertian()),
        ("mixture", mixture(true)),
        ("mixture from inside", mixture(false)),
        ("coated", coated(0.5, 0.2)),
        ("smooth coat", coated(0.5, 0.0)),
        ("smooth plastic", plastic(0.0)),
        (
            "tinted specular glass",
            Surface {
                specular: 0.5,
                specular_color: Vec3::new(0.2, 0.6, 1.0),
                base_color: Vec3::new(0.7, 0.8, 0.9),
                ..glass(0.2, true)
            },
        ),
        (
            "nearly matched glass",
            Surface {
                ior: 1.000_1,
                ..glass(0.3, true)
            },
        ),
    ];
    for alpha in [0.09, 0.25, 1.0] {
        list.push(("metal", metal(alpha)));
        list.push(("plastic", plastic(alpha)));
        list.push(("glass", glass(alpha, true)));
        list.push(("glass from inside", glass(alpha, false)));
        list.push(("sheet", sheet(alpha)));
    }
    let mut tilted = mixture(true);
    tilted.ns = around(tilted.ng, 0.3, 1.0);
    list.push(("tilted normal", tilted));
    let mut tilted = lambertian();
    tilted.ns = around(tilted.ng, 0.6, 1.0);
    list.push(("tilted lambertian", tilted));
    list
}

/// wo at an angle from the normal, on the side that the surface accepts.
pub fn wo_at(s: &Surface, theta: f64) -> Vec3 {
    around(s.ng, theta, 0.7)
}

/// `s` with the normals that `surface_at` would give it for this direction.
pub fn seen_from(s: &Surface, wo: Vec3) -> Surface {
    let mut seen = *s;
    if s.flags & MATERIAL_LAMBERTIAN == 0 {
        seen.ns = valid_shading_normal(s.ng, s.ns, wo);
        seen.coat_ns = valid_shading_normal(s.ng, s.coat_ns, wo);
    }
    seen
}
