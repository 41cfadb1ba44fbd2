//! Glass whose shadows come out black, to be told.

use crate::material::transmits_unblurred;
use crate::packed::{
    LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT, MATERIAL_PANE, MATERIAL_THIN_WALLED,
    MATERIAL_UNLIT, Material, PackedScene,
};

impl PackedScene {
    /// What to say of glass that bends light and blocks all of it that comes from lights without size: no path meets such a light by chance, and
    /// photons go through virtual glass alone.
    pub fn black_shadows(&self, photons: bool) -> Option<String> {
        let without_size = [LIGHT_POINT, LIGHT_SPOT, LIGHT_DIRECTIONAL];
        if !self.lights.iter().any(|l| without_size.contains(&l.kind)) {
            return None;
        }
        let first_virtual = self.frame.real_triangle_count as usize;
        let (real, added) = self.triangles.split_at(first_virtual);
        let bends = |triangles: &[crate::packed::Triangle]| {
            (triangles.iter()).any(|t| bends_smoothly(&self.materials[t.material as usize]))
        };
        let (of, why) = match (bends(real), bends(added) && !photons) {
            (true, _) => ("real", "photons go through virtual objects only"),
            (_, true) => ("virtual", "no photons are traced"),
            _ => return None,
        };
        Some(format!(
            "warning: smooth {of} glass casts black shadows under point, spot and directional lights, as {why}; make it thin_walled, or \
             light the scene by quads or an environment"
        ))
    }
}

fn bends_smoothly(m: &Material) -> bool {
    let straight = m.flags & (MATERIAL_PANE | MATERIAL_THIN_WALLED | MATERIAL_UNLIT) != 0;
    m.transmission > 0.0 && !straight && transmits_unblurred(m.roughness * m.roughness, m.ior)
}
