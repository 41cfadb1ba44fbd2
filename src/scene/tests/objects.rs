//! Meshes and shapes with their materials: what the loader makes of them.

use glam::DVec3;

use super::super::*;
use super::{CAMERA, Folder, load_with_camera, near, shared_data};

#[test]
fn materials_replace_what_is_given_and_default_the_rest() {
    let scene = load_with_camera(
        r#"
[[virtual]]
shape = "sphere"
name = "dish"
[virtual.material]
base_color = [0.1, 0.2, 0.3, 0.5]
roughness = 0
transmission = 1
ior = 1.33
thin_walled = true
attenuation_color = [0.5, 0.6, 0.7]
attenuation_distance_m = 0.25
clearcoat = 0.5
emissive = [0, 0, 7]
[[virtual]]
shape = "box"
"#,
    );
    let material = &scene.objects[0].instances[0].material;
    assert_eq!(scene.objects[0].name, "dish");
    assert_eq!(material.base_color, [0.1, 0.2, 0.3, 0.5]);
    assert_eq!(material.alpha_mode, AlphaMode::Blend);
    assert_eq!(
        (material.roughness, material.transmission, material.ior),
        (0.0, 1.0, 1.33)
    );
    assert!(material.thin_walled && !material.unlit);
    assert_eq!(material.attenuation_distance_m, 0.25);
    assert_eq!(
        (material.clearcoat, material.clearcoat_roughness),
        (0.5, 0.0)
    );
    assert_eq!((material.metallic, material.specular), (0.0, 1.0));
    assert_eq!(material.emissive, [0.0, 0.0, 7.0]);
    let plain = &scene.objects[1].instances[0].material;
    assert_eq!((plain.base_color, plain.specular), ([1.0; 4], 1.0));
}

#[test]
fn a_proxy_without_material_takes_the_photographs_or_grey() {
    let proxy = "[[real]]\nshape = \"box\"\n";
    let grey = load_with_camera(proxy);
    assert!(!grey.objects[0].albedo_from_photo);
    let material = &grey.objects[0].instances[0].material;
    assert_eq!(
        (material.base_color, material.specular),
        ([0.5, 0.5, 0.5, 1.0], 0.0)
    );

    let folder = Folder::new();
    image::RgbImage::new(4, 3)
        .save(folder.path("photo.png"))
        .unwrap();
    let head = "[photo]\nimage = \"photo.png\"\n[camera]\nfx = 4\n";
    for (object, from_photo, specular) in [
        (proxy, true, 0.0),
        (
            "[[real]]\nshape = \"box\"\nalbedo = \"from-photo\"\n",
            true,
            0.0,
        ),
        ("[[real]]\nshape = \"box\"\nmaterial = {}\n", false, 1.0),
        ("[[virtual]]\nshape = \"box\"\n", false, 1.0),
    ] {
        let scene = folder.load(&format!("{head}{object}")).unwrap();
        assert_eq!(scene.objects[0].albedo_from_photo, from_photo, "{object}");
        assert_eq!(
            scene.objects[0].instances[0].material.specular, specular,
            "{object}"
        );
        assert_eq!((scene.camera.width, scene.camera.height), (4, 3));
    }
}

/// A .gltf of one triangle in the XY plane, under a node moved along +X and beside a spot light; with or without a material.
fn write_triangle(folder: &Folder, name: &str, material: bool) {
    let material = if material { r#", "material": 0"# } else { "" };
    let text = format!(
        r#"{{
"asset": {{ "version": "2.0" }},
"extensionsUsed": ["KHR_lights_punctual"],
"extensions": {{ "KHR_lights_punctual": {{ "lights": [
    {{ "type": "spot", "intensity": 7, "spot": {{ "innerConeAngle": 0.1, "outerConeAngle": 0.2 }} }}] }} }},
"scenes": [{{ "nodes": [0, 1] }}],
"nodes": [
    {{ "mesh": 0, "translation": [10, 0, 0] }},
    {{ "translation": [0, 5, 0], "extensions": {{ "KHR_lights_punctual": {{ "light": 0 }} }} }}],
"materials": [{{ "pbrMetallicRoughness": {{ "baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0 }} }}],
"meshes": [{{ "primitives": [{{ "attributes": {{ "POSITION": 0 }}{material} }}] }}],
"accessors": [{{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }}],
"bufferViews": [{{ "buffer": 0, "byteLength": 36 }}],
"buffers": [{{ "byteLength": 36, "uri": "triangle.bin" }}]
}}"#
    );
    std::fs::write(folder.path(name), text).unwrap();
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(folder.path("triangle.bin"), bytes).unwrap();
}

#[test]
fn meshes_are_placed_with_their_lights_and_shared() {
    let folder = Folder::new();
    write_triangle(&folder, "triangle.gltf", true);
    let scene = folder
        .load(&format!(
            "{CAMERA}[[virtual]]\nmesh = \"triangle.gltf\"\nrotation_deg = [0, 90, 0]\ntranslation = [0, 0, 1]\nscale = 2\n\
             [[real]]\nmesh = \"triangle.gltf\"\n[[real]]\nmesh = \"triangle.gltf\"\nmaterial = {{ metallic = 1 }}\n"
        ))
        .unwrap();
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["triangle"; 3]);
    let [own, overridden, added] = &scene.objects[..] else {
        panic!("not three objects")
    };
    assert_eq!((own.side, added.side), (Side::Real, Side::Virtual));
    assert!(Arc::ptr_eq(
        &own.instances[0].primitive,
        &added.instances[0].primitive
    ));
    assert_eq!(own.instances[0].material.base_color, [1.0, 0.0, 0.0, 1.0]);
    assert!(!own.albedo_from_photo);
    assert_eq!(overridden.instances[0].material.metallic, 1.0);
    assert_eq!(overridden.instances[0].material.base_color, [1.0; 4]);
    let world = added.world_from_object * added.instances[0].object_from_local;
    // +X goes to -Z about Y, from (10, 0, 0) twice as far.
    assert!(near(world.transform_point3(DVec3::ZERO), [0.0, 0.0, -19.0]));

    let sides: Vec<Side> = scene.lights.iter().map(|light| light.side).collect();
    assert_eq!(sides, [Side::Real, Side::Real, Side::Virtual]);
    let LightKind::Spot {
        position,
        direction,
        intensity,
        inner_deg,
        outer_deg,
    } = scene.lights[2].kind
    else {
        panic!("not a spot light")
    };
    assert!(near(position.into(), [0.0, 10.0, 1.0]));
    assert!(near(direction.into(), [-1.0, 0.0, 0.0]));
    assert_eq!(intensity, [7.0; 3]);
    assert!((inner_deg - 0.1_f64.to_degrees()).abs() < 1e-5);
    assert!((outer_deg - 0.2_f64.to_degrees()).abs() < 1e-5);
}

#[test]
fn a_scan_without_materials_takes_its_albedo_from_the_photograph() {
    let folder = Folder::new();
    write_triangle(&folder, "bare.gltf", false);
    write_triangle(&folder, "painted.gltf", true);
    image::RgbImage::new(4, 3)
        .save(folder.path("photo.png"))
        .unwrap();
    let scene = folder
        .load(
            "[photo]\nimage = \"photo.png\"\n[camera]\nfx = 4\n[[real]]\nmesh = \"bare.gltf\"\n[[real]]\nmesh = \"painted.gltf\"\n\
             [[real]]\nmesh = \"painted.gltf\"\nalbedo = \"from-photo\"\n[[virtual]]\nmesh = \"bare.gltf\"\n",
        )
        .unwrap();
    let found: Vec<(bool, f32)> = scene
        .objects
        .iter()
        .map(|o| (o.albedo_from_photo, o.instances[0].material.specular))
        .collect();
    assert_eq!(
        found,
        [(true, 0.0), (false, 1.0), (true, 0.0), (false, 1.0)]
    );
}

#[test]
fn smoothing_is_in_world_metres_and_as_asked_for() {
    let Some(data) = shared_data("kinect_basket_rgbd") else {
        return;
    };
    let load = |keys: &str| {
        let mesh = data.join("proxy.glb");
        let scene = load_with_camera(&format!("[[real]]\nmesh = '{}'\n{keys}", mesh.display()));
        let positions = scene.objects[0].instances[0].primitive.positions.clone();
        (
            positions,
            scene.objects[0].self_shadow_bias_m,
            scene.warnings,
        )
    };
    let (raw, bias, warnings) = load("smooth_radius_m = 0\n");
    assert_eq!((bias, warnings.len()), (0.0, 0));
    let (smoothed, bias, warnings) = load("smooth_radius_m = 0.01\nself_shadow_bias_m = 0.002\n");
    assert_eq!((bias, warnings.len()), (0.002, 0));
    assert_ne!(raw, smoothed);
    // Twice the size and twice the radius is the same mesh up to rounding; the same radius (the control) is not.
    let far = |other: &[[f32; 3]]| {
        let pairs = smoothed.iter().flatten().zip(other.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    assert!(far(&load("scale = 2\nsmooth_radius_m = 0.02\n").0) < 1e-6);
    assert!(far(&load("scale = 2\nsmooth_radius_m = 0.01\n").0) > 1e-4);
}

/// The scan of the desk with a helmet on it, and the raw basket photograph through its lens distortion.
#[test]
fn the_measured_scenes() {
    let (Some(desk), Some(basket), Some(helmet)) = (
        shared_data("tum_desk_rgbd"),
        shared_data("kinect_basket_rgbd"),
        shared_data("gltf_models/DamagedHelmet.glb"),
    ) else {
        return;
    };
    for (data, photo, distortion) in [
        (desk, "photo.png", "[0, 0, 0, 0, 0]"),
        (basket, "raw_photo.png", "[0.178894, -0.323012, 0, 0, 0]"),
    ] {
        let text = format!(
            "[photo]\nimage = '{0}/{photo}'\n[camera]\nfx = 525\ncx = 313\ncy = 257\ndistortion = {distortion}\n\
             [[real]]\nmesh = '{0}/proxy.glb'\nalbedo = \"from-photo\"\n[[virtual]]\nmesh = '{1}'\nscale = 0.1\n",
            data.display(),
            helmet.display()
        );
        let scene = Folder::new().load(&text).unwrap();
        let [proxy, helmet] = &scene.objects[..] else {
            panic!("not two objects")
        };
        assert!(proxy.albedo_from_photo && !helmet.albedo_from_photo);
        assert!(proxy.instances[0].primitive.triangles.len() > 100_000);
        assert!(helmet.instances[0].material.base_color_texture.is_some());
        // Only the scan is smoothed, and that is said.
        assert!(proxy.self_shadow_bias_m > 0.0);
        assert_eq!(helmet.self_shadow_bias_m, 0.0);
        let noise = "proxy: smoothed as a depth camera's mesh";
        let said = scene.warnings.iter().filter(|w| w.starts_with(noise));
        assert_eq!(said.count(), 1, "{:?}", scene.warnings);
    }
}
