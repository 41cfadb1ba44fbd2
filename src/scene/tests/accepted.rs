//! Valid files and what they become.

use std::fmt::Write as _;

use glam::{DMat4, DVec3};

use super::super::*;
use super::{CAMERA, Folder, load_text, load_with_camera, near, shared_data};

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
    assert!(camera.distortion.is_none());
    assert_eq!(camera.world_from_camera, DMat4::IDENTITY);
    assert_eq!(
        scene.lens,
        Lens {
            aperture_radius_m: 0.0,
            focus_distance_m: f64::INFINITY,
            aperture: Aperture::Disc,
            blade_rotation_deg: 0.0,
            focal_length_m: 0.0
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
            combine: Combine::Robust,
            backend: BackendChoice::Auto,
            multiple_scattering: true,
            exposure: Exposure::Ev(0.0),
            backdrop: Backdrop::Photograph(None),
            upright_photo: false,
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
fn settings_and_flags() {
    let mut settings = load_with_camera(
        "[render]\nrays_per_pixel = 9\nmax_bounces = 1\nclamp_indirect = 2.5\nseed = 4294967295\nestimator = \"paper\"\nsampler = \"jittered\"\ncomposite = \"quotient\"\ncombine = \"mean\"\nbackend = \"cpu\"\n[photo]\nexposure_ev = -1\n",
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
        combine: Combine::Mean,
        backend: BackendChoice::Cpu,
        multiple_scattering: true,
        exposure: Exposure::Ev(-1.0),
        backdrop: Backdrop::Photograph(None),
        upright_photo: false,
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

/// `[sharpness]`: measured, or given by one number or many, and not both.
#[test]
fn sharpness_is_measured_or_given() {
    use crate::scene::{PointSpread, SharpnessSettings};

    let read = |table: &str| {
        load_with_camera(&format!("[sharpness]\n{table}"))
            .stages
            .sharpness
    };
    assert_eq!(load_with_camera("").stages.sharpness, None);
    let measured = SharpnessSettings { given: None };
    assert_eq!(read("from = \"photo\"\n"), Some(measured));
    let given = |spread| {
        Some(SharpnessSettings {
            given: Some(spread),
        })
    };
    assert_eq!(read("sigma_px = 0.8\n"), given(PointSpread::gaussian(0.8)));
    let all = "sigma_px = [0.5, 0.75, 1]\ncorner_sigma_px = 1.5\nsharpening = 2\nsharpening_radius_px = 1.25\nlateral_px = [0.5, -0.25]\n";
    let expected = PointSpread {
        sigma_px: [0.5, 0.75, 1.0],
        corner_sigma_px: [1.5; 3],
        sharpening: 2.0,
        sharpening_radius_px: 1.25,
        lateral_px: [0.5, -0.25],
    };
    assert_eq!(read(all), given(expected));
    for refused in [
        "",
        "from = \"lens\"\n",
        "from = \"photo\"\nsigma_px = 1\n",
        "sigma_px = 6\n",
        "sharpening = 1\n",
    ] {
        let scene = format!("{CAMERA}[sharpness]\n{refused}");
        assert!(Folder::new().load(&scene).is_err(), "{refused}");
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
