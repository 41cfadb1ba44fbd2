//! `scenes/caustics`: what is not a built-in shape.

use std::path::Path;

use crate::glb;
use crate::mesh::{lathe, straight};

const INNER_RADIUS_M: f64 = 0.085;
const OUTER_RADIUS_M: f64 = 0.093;
const HEIGHT_M: f64 = 0.045;

/// A round band that stands on the ground, bright inside and out.
pub fn write_ring(folder: &Path) -> std::io::Result<()> {
    let corners = [
        [OUTER_RADIUS_M, 0.0],
        [OUTER_RADIUS_M, HEIGHT_M],
        [INNER_RADIUS_M, HEIGHT_M],
        [INNER_RADIUS_M, 0.0],
        [OUTER_RADIUS_M, 0.0],
    ];
    let sides: Vec<_> = corners.windows(2).map(straight).collect();
    glb::write(
        &folder.join("ring.glb"),
        &[(&lathe(&sides, 256, HEIGHT_M), None)],
    )
}
