//! glTF loading against the sample models, the Khronos validator's corpus, and files made here.

mod bad_inputs;
mod damaged;
mod models;
mod synthetic;

use glam::{DVec3, Vec3};
use mixray::scene::gltf::GltfScene;
use mixray::scene::{Material, Primitive};

/// What the rest of mixray relies on in whatever was loaded.
fn check_scene(scene: &GltfScene) -> Result<(), String> {
    for instance in &scene.instances {
        let name = &instance.primitive.name;
        let transform = instance.object_from_local;
        if !transform.is_finite() || transform.determinant() == 0.0 {
            return Err(format!("{name}: bad transform"));
        }
        check_primitive(&instance.primitive).map_err(|reason| format!("{name}: {reason}"))?;
        check_material(&instance.material).map_err(|reason| format!("{name}: {reason}"))?;
    }
    for line in &scene.warnings {
        if line.contains('\n') {
            return Err("a warning of several lines".into());
        }
    }
    Ok(())
}

fn check_primitive(primitive: &Primitive) -> Result<(), String> {
    let count = primitive.positions.len();
    let lengths = [
        primitive.tangents.len(),
        primitive.uvs[0].len(),
        primitive.uvs[1].len(),
        primitive.colors.len(),
    ];
    if primitive.normals.len() != count || lengths.iter().any(|&l| l != 0 && l != count) {
        return Err("attributes of unequal length".into());
    }
    let finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
    let all_finite = finite(primitive.positions.as_flattened())
        && finite(primitive.uvs[0].as_flattened())
        && finite(primitive.uvs[1].as_flattened())
        && finite(primitive.tangents.as_flattened());
    if !all_finite {
        return Err("a value that is not finite".into());
    }
    let unit = |normal: &[f32; 3]| (Vec3::from(*normal).length() - 1.0).abs() < 1e-5;
    if !primitive.normals.iter().all(unit) {
        return Err("a normal that is not a unit vector".into());
    }
    if !primitive
        .colors
        .iter()
        .flatten()
        .all(|c| (0.0..=1.0).contains(c))
    {
        return Err("a colour out of range".into());
    }
    if primitive.triangles.is_empty() {
        return Err("no triangles".into());
    }
    for triangle in &primitive.triangles {
        if triangle.iter().any(|&index| index as usize >= count) {
            return Err("an index out of range".into());
        }
        if twice_area(primitive, triangle) == 0.0 {
            return Err("a degenerate triangle".into());
        }
    }
    Ok(())
}

fn twice_area(primitive: &Primitive, triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = corners(primitive, triangle);
    (b - a).cross(c - a).length()
}

fn corners(primitive: &Primitive, triangle: &[u32; 3]) -> [DVec3; 3] {
    triangle.map(|index| Vec3::from(primitive.positions[index as usize]).as_dvec3())
}

fn check_material(material: &Material) -> Result<(), String> {
    let factors = [
        material.metallic,
        material.roughness,
        material.specular,
        material.transmission,
        material.clearcoat,
        material.clearcoat_roughness,
    ];
    if !factors
        .iter()
        .chain(&material.base_color)
        .all(|f| (0.0..=1.0).contains(f))
    {
        return Err("a factor out of range".into());
    }
    if !material.emissive.iter().all(|e| e.is_finite() && *e >= 0.0) {
        return Err("emission out of range".into());
    }
    for reference in material.textures() {
        let texture = &reference.texture;
        if reference.uv_set > 1
            || texture.rgba8.len() != texture.width as usize * texture.height as usize
            || texture.rgba8.is_empty()
        {
            return Err("a broken texture".into());
        }
    }
    Ok(())
}
