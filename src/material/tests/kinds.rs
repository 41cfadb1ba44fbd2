//! Surfaces of every kind for the tests of scattering, and how they get into a shader.

use glam::Vec3;

use super::{Random, around};
use crate::material::Surface;
use crate::material::normal::valid_shading_normal;
use crate::packed::{MATERIAL_LAMBERTIAN, MATERIAL_THIN_WALLED, NONE};

/// A surface under test with its normal askew to the axes: white, fully rough dielectric, front.
pub fn plain_surface() -> Surface {
    let normal = Vec3::new(0.36, 0.48, 0.8).normalize();
    Surface {
        position: Vec3::ZERO,
        error: 0.0,
        ng: normal,
        ns: normal,
        coat_ns: normal,
        base_color: Vec3::ONE,
        metallic: 0.0,
        ggx_alpha: 1.0,
        ior: 1.5,
        specular: 1.0,
        specular_color: Vec3::ONE,
        transmission: 0.0,
        clearcoat: 0.0,
        coat_alpha: 0.0,
        emission: Vec3::ZERO,
        coverage: 1.0,
        front: true,
        flags: 0,
        material: 0,
        light: NONE,
        object: 0,
        metal_gain: 0.0,
        glass_gain: 1.0,
    }
}

/// A material of any kind: each share 0, 1 or between.
pub fn draw_material(random: &mut Random, s: &mut Surface) {
    s.base_color = Vec3::from(random.triple());
    let some = |random: &mut Random| [0.0, 1.0, random.uniform()][random.bits() as usize % 3];
    s.metallic = some(random) * some(random);
    s.transmission = some(random);
    s.clearcoat = some(random);
    s.specular = some(random);
    s.specular_color = Vec3::from(random.triple());
    s.ior = random.range(1.1, 2.5);
    s.ggx_alpha = if random.bits().is_multiple_of(5) {
        0.0
    } else {
        random.range(0.1, 1.0)
    };
    s.coat_alpha = if random.bits().is_multiple_of(3) {
        0.0
    } else {
        random.range(0.1, 1.0)
    };
    s.front = random.bits() & 1 == 0;
    s.flags = [0, 0, MATERIAL_THIN_WALLED, MATERIAL_LAMBERTIAN][random.bits() as usize % 4];
}

/// Of [`surface_words`]: two directions, then what `read_surface` of [`READ_SURFACE`] reads.
pub const SURFACE_WORDS: usize = 33;

pub const READ_SURFACE: &str = "
fn read_surface() -> Surface {
    return Surface(input_vec3(6u), 0.0, input_vec3(9u), input_vec3(12u), input_vec3(15u), input_vec3(18u),
        input_f32(21u), input_f32(22u), input_f32(23u), input_f32(24u), input_vec3(25u), input_f32(28u), input_f32(29u),
        input_f32(30u), vec3<f32>(0.0), 1.0, input(31u) != 0u, input(32u), 0u, NONE, 0u, 0.0, 1.0);
}
";

pub fn surface_words(s: &Surface, wo: Vec3, wi: Vec3) -> Vec<u32> {
    let mut words = [wo.to_array(), wi.to_array()].concat();
    for v in [s.position, s.ng, s.ns, s.coat_ns, s.base_color] {
        words.extend(v.to_array());
    }
    words.extend([s.metallic, s.ggx_alpha, s.ior, s.specular]);
    words.extend(s.specular_color.to_array());
    words.extend([s.transmission, s.clearcoat, s.coat_alpha]);
    let mut words: Vec<u32> = words.into_iter().map(f32::to_bits).collect();
    words.extend([u32::from(s.front), s.flags]);
    words
}

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
