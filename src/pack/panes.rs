//! Which materials light goes straight through.

use crate::material::DELTA_ALPHA;
use crate::packed::{
    FRAME_PANES, MATERIAL_PANE, MATERIAL_THIN_WALLED, MATERIAL_UNLIT, Material, NONE, PackedScene,
};

impl PackedScene {
    /// Marks the panes among the materials, and tells the frame whether there are any.
    pub(super) fn mark_panes(&mut self) {
        self.frame.flags &= !FRAME_PANES;
        for material in self.materials.iter_mut().filter(|m| is_pane(m)) {
            material.flags |= MATERIAL_PANE;
            self.frame.flags |= FRAME_PANES;
        }
    }
}

/// Whether light may go straight through somewhere.
fn is_pane(m: &Material) -> bool {
    let smooth_somewhere =
        m.roughness * m.roughness < DELTA_ALPHA || m.metallic_roughness_texture != NONE;
    let thin = m.flags & MATERIAL_THIN_WALLED != 0;
    let straight = (thin && smooth_somewhere) || (!thin && m.ior == 1.0);
    straight && m.transmission > 0.0 && m.flags & MATERIAL_UNLIT == 0
}
