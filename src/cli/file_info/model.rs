//! glTF, PLY and OBJ.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use glam::DMat4;

use super::Report;
use crate::cli::Failure;
use crate::decode::FileKind;
use crate::scene::placing::extents;
use crate::scene::{Instance, gltf, scanned};

pub(super) fn describe(path: &Path, kind: FileKind, report: &mut Report) -> Result<(), Failure> {
    let model = match kind {
        FileKind::Gltf => gltf::load_gltf(path)?,
        _ => scanned::read(path, kind)
            .map_err(|problem| Failure(format!("{}: {problem}", path.display())))?,
    };
    report.line("file", kind.name());
    report.line("size", extent(&model.instances, DMat4::IDENTITY));
    let triangles: usize = (model.instances.iter())
        .map(|i| i.primitive.triangles.len())
        .sum();
    let parts = model.instances.len();
    report.line("triangles", format!("{triangles} in {parts} parts"));
    let mut seen = BTreeSet::new();
    let materials = model.instances.iter().map(|instance| &instance.material);
    for material in materials.filter(|material| seen.insert(Arc::as_ptr(material))) {
        let mut traits = vec![format!("roughness {:.2}", material.roughness)];
        let has = [
            (material.metallic > 0.0, "metallic"),
            (material.transmission > 0.0, "transmits light"),
            (material.clearcoat > 0.0, "clear coat"),
            (material.emissive.iter().any(|e| *e > 0.0), "emissive"),
            (material.unlit, "unlit"),
            (material.base_color_texture.is_some(), "textured"),
        ];
        traits.extend(
            has.iter()
                .filter(|(has, _)| *has)
                .map(|(_, name)| (*name).to_owned()),
        );
        let name = match (model.has_materials, material.name.as_str()) {
            (false, _) => "none of its own",
            (true, "") => "without a name",
            (true, name) => name,
        };
        report.line("material", format!("{name}: {}", traits.join(", ")));
    }
    if !model.lights.is_empty() {
        report.line("lights", model.lights.len());
    }
    if kind == FileKind::Gltf {
        let animations = gltf::animation_names(path)?;
        if !animations.is_empty() {
            report.line("animations", animations.join(", "));
        }
    }
    report.notes(&model.warnings);
    Ok(())
}

/// Width, height and depth in metres along the axes of the space that `transform` leads to.
pub(super) fn extent(instances: &[Instance], transform: DMat4) -> String {
    match extents(instances, transform) {
        Some(size) => format!("{:.4} x {:.4} x {:.4} m", size.x, size.y, size.z),
        None => "nothing".to_owned(),
    }
}
