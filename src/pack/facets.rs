//! Tables for the light that facets of rough metal and glass send to each other.

use crate::material::DELTA_ALPHA;
use crate::material::facets::table_of;
use crate::packed::{
    MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED, MATERIAL_UNLIT, Material, NONE,
    PackedScene,
};
use crate::scene::Scene;

impl PackedScene {
    /// Gives rough metal and glass their tables, if the scene wants them.
    pub(super) fn pack_facets(&mut self, scene: &Scene) {
        for at in 0..self.materials.len() {
            let material = self.materials[at];
            let wanted = scene.settings.multiple_scattering && is_rough(&material);
            self.materials[at].facet_table = if wanted {
                self.facet_table(&material)
            } else {
                NONE
            };
        }
        if self.materials.iter().all(|m| m.facet_table == NONE) {
            self.facet_tables.clear();
            self.facet_table_of.clear();
        }
    }

    /// Where the material's table begins, making it if it is new.
    fn facet_table(&mut self, material: &Material) -> u32 {
        if self.facet_tables.is_empty() {
            self.facet_tables = table_of(None);
        }
        let is_thin = material.flags & MATERIAL_THIN_WALLED != 0;
        if material.transmission == 0.0 || is_thin {
            return 0;
        }
        let ior = material.ior.to_bits();
        let known = self.facet_table_of.iter().find(|(known, _)| *known == ior);
        if let Some(&(_, first)) = known {
            return first;
        }
        let first = self.facet_tables.len() as u32;
        self.facet_tables.extend(table_of(Some(material.ior)));
        self.facet_table_of.push((ior, first));
        first
    }
}

/// Whether it is metal or glass, and rough somewhere.
fn is_rough(m: &Material) -> bool {
    let plain = MATERIAL_LAMBERTIAN | MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT;
    let rough = m.roughness * m.roughness >= DELTA_ALPHA;
    m.flags & plain == 0 && rough && m.metallic.max(m.transmission) > 0.0
}
