//! Valid files and what they become.

use std::fmt::Write as _;

use glam::{DMat4, DVec3};

use super::super::*;
use super::{CAMERA, Folder, load_text, load_with_camera, shared_data};

fn near(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from(b)).length() < 1e-12
}

#[test]
fn the_shortest_scene_has_the_stated_defaults() {
    let scene = load_text(CAMERA).unwrap();
    assert!(scene.photo.is_none() && scene.environment.is_none());
    assert!(scene.lights.is_empty() && scene.objects.is_empty() && scene.warnings.is_empty());
    let camera = &scene.camera;
    assert_eq!((camera.cx, camera.cy), (32.0, 24.0));
    // Half the height over the tangent of 22.5 degrees, sqrt(2) - 1.
    assert!((camera.fy - 24.0 / (2.0_f64.sqrt() - 1.0)).abs() < 1e-9);
    assert_eq!(camera.fx, camera.fy);
    assert_eq!(camera.distortion, [0.0; 5]);
    assert_eq!(camera.world_from_camera, DMat4::IDENTITY);
    assert_eq!(
        scene.lens,
        Lens {
            aperture_radius_m: 0.0,
            focus_distance_m: f64::INFINITY,
            aperture: Aperture::Disc,
            blade_rotation_deg: 0.0
        }
    );
    assert_eq!(
        scene.settings,
        Settings {
            rays_per_pixel: 49,
            max_bounces: 4,
            clamp_indirect: f32::INFINITY,
            seed: 0,
            estimator: Estimator::Direct,
            sampler: SamplerKind::Sobol,
            composite: Composite::Additive,
            backend: BackendChoice::Auto,
            exposure: Exposure::Ev(0.0),
        }
    );
}

#[test]
fn the_scene_is_named_after_its_folder() {
    let folder = Folder::new();
    let scene = folder.load(CAMERA).unwrap();
    let name = folder
        .path("")
        .file_name()
        .map(|n| n.to_string_lossy().into_owned());
    assert_eq!(Some(scene.name), name);
}

#[test]
fn lenses() {
    let by_radius = load_with_camera("[lens]\naperture_radius_m = 0.01\nfocus_distance_m = inf\n");
    assert_eq!(by_radius.lens.aperture_radius_m, 0.01);
    assert_eq!(by_radius.lens.focus_distance_m, f64::INFINITY);
    let by_number = load_with_camera(
        "[lens]\nf_number = 2\nfocal_length_mm = 50\nfocus_distance_m = 1.2\naperture = 6\nblade_rotation_deg = 10\n",
    );
    assert_eq!(by_number.lens.aperture_radius_m, 0.0125);
    assert_eq!(by_number.lens.aperture, Aperture::Blades(6));
    assert_eq!(by_number.lens.blade_rotation_deg, 10.0);
    let square = load_with_camera("[lens]\naperture = \"square\"\n");
    assert_eq!(square.lens.aperture, Aperture::Square);
    assert_eq!(square.lens.aperture_radius_m, 0.0);
}

#[test]
fn look_at_points_minus_z_at_the_target_with_up_upward() {
    let scene = load_text(
        "[camera]\nwidth = 4\nheight = 3\nfx = 3\nposition = [1, 2, 3]\nlook_at = [4, 2, 3]\n",
    )
    .unwrap();
    let pose = scene.camera.world_from_camera;
    assert!(near(
        pose.transform_point3(DVec3::new(0.0, 0.0, -3.0)),
        [4.0, 2.0, 3.0]
    ));
    assert!(near(pose.transform_vector3(DVec3::Y), [0.0, 1.0, 0.0]));
    // Looking along +X with +Y up, the right hand points along +Z.
    assert!(near(pose.transform_vector3(DVec3::X), [0.0, 0.0, 1.0]));
}

#[test]
fn poses_printed_with_four_digits_become_exactly_rigid() {
    let scene = load_text(
        "[camera]\nwidth = 4\nheight = 3\nfx = 3\nworld_from_camera = [[0.9987, 0.0501, 0, 1], [-0.0437, 0.8704, 0.4904, 2], [0.0246, -0.4898, 0.8715, 3], [0, 0, 0, 1]]\n",
    )
    .unwrap();
    let pose = scene.camera.world_from_camera;
    let gram = pose.transpose() * pose;
    for axis in [pose.x_axis, pose.y_axis, pose.z_axis] {
        assert!((axis.length() - 1.0).abs() < 1e-15);
    }
    assert!(gram.x_axis.y.abs() < 1e-15 && gram.y_axis.z.abs() < 1e-15);
    assert!((pose.x_axis.x - 0.9987).abs() < 1e-4);
    assert_eq!(pose.w_axis.to_array(), [1.0, 2.0, 3.0, 1.0]);
}

#[test]
fn transforms_scale_then_rotate_about_x_y_z_then_translate() {
    let scene = load_with_camera(
        "[[virtual]]\nshape = \"box\"\ntranslation = [10, 0, 0]\nrotation_deg = [90, 90, 0]\nscale = [1, 2, 3]\n",
    );
    let world = scene.objects[0].world_from_object;
    // Y scaled to 2; about X it turns to +Z, about Y from there to +X.
    assert!(near(world.transform_point3(DVec3::Y), [12.0, 0.0, 0.0]));
    // X stays under the turn about X and goes to -Z about Y: the other order of turns would leave it at +Y.
    assert!(near(world.transform_point3(DVec3::X), [10.0, 0.0, -1.0]));
    let quaternion = load_with_camera(
        "[[virtual]]\nshape = \"box\"\nrotation = [0, 0.7071067811865476, 0, 0.7071067811865476]\nscale = -2\n",
    );
    let world = quaternion.objects[0].world_from_object;
    assert!(near(world.transform_point3(DVec3::X), [0.0, 0.0, 2.0]));
}

#[test]
fn lights_of_every_kind() {
    let scene = load_with_camera(
        r#"
[[light]]
kind = "point"
position = [1, 2, 3]
intensity = [4, 5, 6]
[[light]]
kind = "spot"
position = [1, 2, 3]
direction = [0, -2, 0]
intensity = [4, 5, 6]
inner_deg = 10
outer_deg = 20
[[light]]
kind = "directional"
direction = [0, 0, -3]
irradiance = [1, 1, 1]
side = "virtual"
[[light]]
kind = "quad"
corner = [0, 2, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [10, 10, 10]
"#,
    );
    let kinds: Vec<LightKind> = scene.lights.iter().map(|light| light.kind).collect();
    assert_eq!(
        kinds,
        [
            LightKind::Point {
                position: [1.0, 2.0, 3.0],
                intensity: [4.0, 5.0, 6.0]
            },
            LightKind::Spot {
                position: [1.0, 2.0, 3.0],
                direction: [0.0, -1.0, 0.0],
                intensity: [4.0, 5.0, 6.0],
                inner_deg: 10.0,
                outer_deg: 20.0
            },
            LightKind::Directional {
                direction: [0.0, 0.0, -1.0],
                irradiance: [1.0; 3]
            },
            LightKind::Quad {
                corner: [0.0, 2.0, 0.0],
                edge_u: [1.0, 0.0, 0.0],
                edge_v: [0.0, 0.0, 1.0],
                radiance: [10.0; 3]
            },
        ]
    );
    let sides: Vec<Side> = scene.lights.iter().map(|light| light.side).collect();
    assert_eq!(sides, [Side::Real, Side::Real, Side::Virtual, Side::Real]);
}

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

#[test]
fn settings_and_flags() {
    let mut settings = load_with_camera(
        "[render]\nrays_per_pixel = 9\nmax_bounces = 1\nclamp_indirect = 2.5\nseed = 4294967295\nestimator = \"paper\"\nsampler = \"jittered\"\ncomposite = \"quotient\"\nbackend = \"cpu\"\n[photo]\nexposure_ev = -1\n",
    )
    .settings;
    let from_file = Settings {
        rays_per_pixel: 9,
        max_bounces: 1,
        clamp_indirect: 2.5,
        seed: u32::MAX,
        estimator: Estimator::Paper,
        sampler: SamplerKind::Jittered,
        composite: Composite::Quotient,
        backend: BackendChoice::Cpu,
        exposure: Exposure::Ev(-1.0),
    };
    assert_eq!(settings, from_file);
    settings.apply(&Overrides::default());
    assert_eq!(settings, from_file);
    settings.apply(&Overrides {
        rays_per_pixel: Some(16),
        sampler: Some(SamplerKind::Cmj),
        ..Overrides::default()
    });
    let expected = Settings {
        rays_per_pixel: 16,
        sampler: SamplerKind::Cmj,
        ..from_file
    };
    assert_eq!(settings, expected);
}

#[test]
fn choices_go_there_and_back_by_name() {
    fn check<T: Choice + std::fmt::Debug>() {
        for (name, choice) in T::CHOICES {
            assert_eq!(choice.name(), *name);
            assert_eq!(T::from_name(name), Some(*choice));
        }
        assert_eq!(T::from_name("Nothing"), None);
    }
    check::<Side>();
    check::<Estimator>();
    check::<SamplerKind>();
    check::<Composite>();
    check::<BackendChoice>();
}

/// The published camera of the desk photograph, through a scene file, against the file's own inverse matrix.
#[test]
fn the_desk_camera() {
    let Some(data) = shared_data("tum_desk_rgbd") else {
        return;
    };
    let text = std::fs::read_to_string(data.join("camera.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |key: &str| json[key].as_f64().unwrap();
    let folder = Folder::new();
    std::fs::copy(data.join("photo.png"), folder.path("photo.png")).unwrap();
    let mut toml =
        String::from("[photo]\nimage = \"photo.png\"\n[camera]\nwidth = 640\nheight = 480\n");
    writeln!(toml, "fx = {}\nfy = {}", number("fx"), number("fy")).unwrap();
    writeln!(
        toml,
        "cx = {}\ncy = {}",
        number("cx") + 0.5,
        number("cy") + 0.5
    )
    .unwrap();
    writeln!(toml, "world_from_camera = {}", json["camera_to_world_gltf"]).unwrap();
    let scene = folder.load(&toml).unwrap();
    let camera = &scene.camera;
    assert_eq!((camera.fx, camera.cx, camera.cy), (520.9, 325.6, 250.2));
    // world_to_camera_opencv times world_from_camera only turns the y and z axes round.
    let mut rows = [[0.0; 4]; 4];
    for (r, row) in rows.iter_mut().enumerate() {
        for (c, cell) in row.iter_mut().enumerate() {
            *cell = json["world_to_camera_opencv"][r][c].as_f64().unwrap();
        }
    }
    let inverse = DMat4::from_cols_array_2d(&rows).transpose();
    let flip = DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0));
    assert!((inverse * camera.world_from_camera).abs_diff_eq(flip, 1e-12));
    // Negative control: the transposed pose does not.
    assert!(!(inverse * camera.world_from_camera.transpose()).abs_diff_eq(flip, 0.1));
    let photo = scene.photo.unwrap();
    assert_eq!((photo.width, photo.height), (640, 480));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
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
        let noise = "proxy: has the noise of a depth camera";
        let said = scene.warnings.iter().filter(|w| w.starts_with(noise));
        assert_eq!(said.count(), 1, "{:?}", scene.warnings);
    }
}

/// The tables of camera stages: absent is off, empty is the documented defaults, and every key arrives.
#[test]
fn stages_are_off_default_or_as_given() {
    use crate::scene::{AntialiasSettings, CartoonSettings, CartoonStyle, FlowSettings, Stages};
    use crate::scene::{NoiseFit, NoiseMethod, NoiseProfile, NoiseSettings};

    assert_eq!(load_with_camera("").stages, Stages::default());
    let stages = load_with_camera("[cartoon]\n").stages;
    assert_eq!(stages.cartoon, Some(CartoonSettings::default()));
    assert!(stages.noise.is_none() && stages.antialias.is_none());

    let given = load_with_camera(
        "[cartoon]\nstyle = \"flow\"\nshrunk_width = 10\nshrunk_height = 20\niterations = 3\nsigma_p = 0.5\nalpha = 0.25\nbeta = 0.75\n\
         s0 = 0.1\ns1 = 0.2\na0 = 0.4\na1 = 0.5\ntensor_sigma_px = 1.5\nedge_sigma_px = 2\nline_sigma_px = 2.5\ntau = 0.5\nt0 = 0.125\nt1 = 0.25\n",
    );
    let expected = CartoonSettings {
        style: CartoonStyle::Flow,
        shrunk_width: 10,
        shrunk_height: 20,
        iterations: 3,
        sigma_p: 0.5,
        alpha: 0.25,
        beta: 0.75,
        s0: 0.1,
        s1: 0.2,
        a0: 0.4,
        a1: 0.5,
        flow: FlowSettings {
            tensor_sigma_px: 1.5,
            edge_sigma_px: 2.0,
            line_sigma_px: 2.5,
            tau: 0.5,
            t0: 0.125,
            t1: 0.25,
        },
    };
    assert_eq!(given.stages.cartoon, Some(expected));

    let folder = Folder::new();
    let profile = NoiseProfile::from_fit(NoiseFit { a: 0.0, b: 4.0 }, 4);
    std::fs::write(folder.path("noise.toml"), profile.to_toml()).unwrap();
    let load = |tables: &str| folder.load(&format!("{CAMERA}{tables}")).unwrap().stages;
    let stages = load("[noise]\nprofile = \"noise.toml\"\n[antialias]\n");
    assert_eq!(stages.antialias, Some(AntialiasSettings { beta: 0.8 }));
    let noise = stages.noise.unwrap();
    assert_eq!(noise.profile.bins, profile.bins);
    assert_eq!(noise, NoiseSettings::new(noise.profile.clone()));
    let stages = load(
        "[noise]\nprofile = \"noise.toml\"\nmethod = \"textures\"\nscale = 2\ntexture_size = 64\nmagnification = 4\nupdate_delay_frames = 3\n\
         eight_bit = true\n[antialias]\nbeta = 0.5\n",
    );
    assert_eq!(stages.antialias, Some(AntialiasSettings { beta: 0.5 }));
    let expected = NoiseSettings {
        method: NoiseMethod::Textures,
        scale: 2.0,
        texture_size: 64,
        magnification: 4.0,
        update_delay_frames: 3,
        eight_bit: true,
        ..noise
    };
    assert_eq!(stages.noise, Some(expected));
}
