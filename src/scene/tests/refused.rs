//! Every class of error: its place, exactly, and its message.

use super::super::SceneError;
use super::{CAMERA, Folder, load_text};

/// Loads `text` without its marker `@@`, and asserts that the error stands where the marker was and says `fragment`.
fn assert_refused(text: &str, fragment: &str) {
    let marker = text.find("@@").expect("a marker");
    let line = text[..marker].split('\n').count();
    let column = text[..marker]
        .split('\n')
        .next_back()
        .map_or(0, |l| l.chars().count())
        + 1;
    let folder = Folder::new();
    let clean = text.replacen("@@", "", 1);
    let message = match folder.load(&clean) {
        Ok(_) => panic!("accepted:\n{clean}"),
        Err(error) => error.to_string(),
    };
    let prefix = format!("{}:{line}:{column}: ", folder.path("scene.toml").display());
    assert!(
        message.starts_with(&prefix),
        "{message}\nnot at {line}:{column} in\n{clean}"
    );
    assert!(message.contains(fragment), "{message}\nlacks: {fragment}");
    assert!(!message.contains('\n'), "{message}");
    assert!(
        message.matches("; ").count() >= 2,
        "no expectation or mend: {message}"
    );
}

/// The same with a valid [camera] before it.
fn assert_refused_with_camera(text: &str, fragment: &str) {
    assert_refused(&format!("{CAMERA}{text}"), fragment);
}

#[test]
fn the_place_is_counted_from_one_in_lines_and_characters() {
    let error = load_text("# é\n[camera]\nwidth = 64\nheight = 48\nfx = -3\n").unwrap_err();
    let SceneError::Invalid {
        line,
        column,
        message,
        ..
    } = &error
    else {
        panic!("{error}")
    };
    assert_eq!((*line, *column), (5, 6));
    assert_eq!(
        message,
        "`fx` is -3; expected a finite number above 0; correct the value"
    );
    // Characters, not bytes, before the place.
    assert_refused_with_camera(
        "[[virtual]]\nshape = \"box\"\nmaterial = { @@\"é\" = 1 }\n",
        "unknown key `é`",
    );
    assert_refused("photo = { image = \"é\", @@y = 1 }\n", "unknown key `y`");
}

#[test]
fn broken_toml() {
    assert_refused("[camera]\nwidth = @@\n", "TOML");
    assert_refused("[camera]\nwidth = 3\n@@width = 4\n", "duplicate");
    assert_refused("[camera@@\nwidth = 3\n", "TOML");
}

#[test]
fn unknown_keys_name_the_nearest() {
    assert_refused("[@@camrea]\nwidth = 3\n", "did you mean `camera`?");
    assert_refused("[camera]\n@@widht = 3\n", "did you mean `width`?");
    assert_refused_with_camera("[lens]\n@@fnumber = 3\n", "did you mean `f_number`?");
    assert_refused_with_camera("[lens]\n@@quux_zorb = 3\n", "remove or rename it");
    assert_refused_with_camera(
        "[[light]]\nkind = \"point\"\n@@direction = [0,1,0]\n",
        "unknown key `direction` in [[light]]",
    );
    assert_refused_with_camera(
        "[[real]]\nshape = \"box\"\n@@segments = 9\n",
        "unknown key `segments`",
    );
    assert_refused_with_camera(
        "[[real]]\nshape = \"box\"\nmaterial = { @@rougness = 1 }\n",
        "did you mean `roughness`?",
    );
    assert_refused_with_camera("[render]\n@@rpp = 1\n", "unknown key `rpp`");
}

#[test]
fn the_first_unknown_key_of_the_file_is_named() {
    assert_refused("[@@zebra]\n[apple]\n", "unknown key `zebra`");
}

#[test]
fn wrong_types() {
    assert_refused("[camera]\nwidth = @@\"64\"\n", "`width` is a string");
    assert_refused("[camera]\nwidth = @@64.0\n", "whole number");
    assert_refused("camera = @@3\n", "expected a table");
    assert_refused_with_camera(
        "[lens]\naperture_radius_m = @@true\n",
        "`aperture_radius_m` is a truth value",
    );
    assert_refused_with_camera(
        "@@[light]\nkind = \"point\"\n",
        "expected a list of tables: [[light]]",
    );
    assert_refused_with_camera(
        "[[light]]\nkind = \"point\"\nposition = @@[0, 1]\n",
        "has 2 elements",
    );
    assert_refused_with_camera(
        "[[light]]\nkind = \"point\"\nposition = [0, @@\"x\", 1]\n",
        "`position[1]` is a string",
    );
    assert_refused_with_camera("[[light]]\nkind = @@1\n", "string in quotes");
    assert_refused_with_camera(
        "[[real]]\nshape = \"box\"\nmaterial = { unlit = @@1 }\n",
        "true or false",
    );
    assert_refused_with_camera(
        "[[real]]\nshape = \"box\"\nmaterial = @@\"gold\"\n",
        "expected a table",
    );
    assert_refused_with_camera("[render]\nseed = @@2020-01-01\n", "is a date");
}

#[test]
fn missing_keys_point_at_their_table() {
    assert_refused("@@", "no [camera]");
    assert_refused("@@[camera]\nheight = 3\nfx = 3\n", "lacks `width`");
    assert_refused(
        "@@[camera]\nwidth = 3\nheight = 3\n",
        "lacks a focal length",
    );
    assert_refused_with_camera(
        "@@[lens]\naperture_radius_m = 0.01\n",
        "lacks `focus_distance_m`",
    );
    assert_refused_with_camera(
        "@@[lens]\nf_number = 2\nfocus_distance_m = 1\n",
        "without `focal_length_mm`",
    );
    assert_refused_with_camera(
        "@@[lens]\nfocal_length_mm = 50\nfocus_distance_m = 1\n",
        "without `f_number`",
    );
    assert_refused_with_camera("@@[environment]\nscale = 2\n", "lacks `image`");
    assert_refused_with_camera("@@[[light]]\nposition = [0, 1, 0]\n", "lacks `kind`");
    assert_refused_with_camera(
        "@@[[light]]\nkind = \"quad\"\ncorner = [0,0,0]\nedge_u = [1,0,0]\n",
        "lacks `edge_v`",
    );
    assert_refused_with_camera("@@[[virtual]]\nscale = 2\n", "lacks `mesh`");
}

#[test]
fn impossible_numbers() {
    for (text, fragment) in [
        ("[camera]\nwidth = @@-4\n", "`width` is -4"),
        ("[camera]\nwidth = @@0\n", "1 to 32768"),
        ("[camera]\nwidth = @@99999999999999999999999999\n", ""),
        (
            "[camera]\nwidth = 4\nheight = 3\nfx = @@nan\n",
            "`fx` is nan",
        ),
        (
            "[camera]\nwidth = 4\nheight = 3\nfx = @@inf\n",
            "`fx` is inf",
        ),
        ("[camera]\nwidth = 4\nheight = 3\nfx = @@0\n", "above 0"),
        (
            "[camera]\nwidth = 4\nheight = 3\nvertical_fov_deg = @@180\n",
            "below 180",
        ),
        (
            "[camera]\nwidth = 4\nheight = 3\nvertical_fov_deg = @@0\n",
            "above 0",
        ),
        (
            "[camera]\nwidth = 4\nheight = 3\nfx = 3\nvertical_fov_deg = @@60\n",
            "both given",
        ),
        (
            "[camera]\nwidth = 4\nheight = 3\nfx = 3\ncx = @@1e300\n",
            "1e15",
        ),
        (
            "[camera]\nwidth = 4\nheight = 3\nfx = 3\ndistortion = [0, 0, 0, @@nan, 0]\n",
            "`distortion[3]` is nan",
        ),
        (
            "[camera]\nwidth = 400\nheight = 300\nfx = 300\ndistortion = @@[-2, 0, 0, 0, 0]\n",
            "cannot be inverted",
        ),
        (
            "@@[camera]\nwidth = 32768\nheight = 32768\nfx = 3\n",
            "pixels",
        ),
    ] {
        assert_refused(text, fragment);
    }
    for (text, fragment) in [
        ("[lens]\naperture_radius_m = @@-0.1\n", "at least 0"),
        ("[lens]\naperture_radius_m = @@inf\n", "finite"),
        ("[lens]\nfocus_distance_m = @@0\n", "above 0"),
        ("[lens]\nfocus_distance_m = @@nan\n", "above 0"),
        ("[lens]\nf_number = @@0\nfocal_length_mm = 50\n", "above 0"),
        (
            "[lens]\naperture_radius_m = 0.1\nf_number = @@2\n",
            "both given",
        ),
        ("[lens]\naperture = @@2\n", "3 to 64"),
        ("[lens]\naperture = @@\"hexagon\"\n", "\"square\""),
        (
            "[environment]\nradiance = [1, @@-1, 1]\n",
            "`radiance[1]` is -1",
        ),
        (
            "@@[environment]\nradiance = [1e30, 1, 1]\nscale = 10\n",
            "at most 1e30",
        ),
        (
            "[environment]\nradiance = [1, 1, 1]\nscale = @@-1\n",
            "at least 0",
        ),
        (
            "[environment]\nradiance = [1, 1, 1]\nimage = @@\"a.hdr\"\n",
            "both given",
        ),
        ("[render]\nrays_per_pixel = @@0\n", "from 1"),
        ("[render]\nmax_bounces = @@0\n", "from 1"),
        ("[render]\nseed = @@-1\n", "from 0"),
        ("[render]\nsampler = @@\"sobel\"\n", "did you mean `sobol`?"),
        ("[photo]\nexposure_ev = @@1000\n", "from -64 to 64"),
        ("[photo]\nexposure_ev = @@\"fit\"\n", "\"auto\""),
        (
            "[photo]\nexposure_ev = @@\"auto\"\n",
            "without a photograph",
        ),
    ] {
        assert_refused_with_camera(text, fragment);
    }
}

#[test]
fn impossible_poses() {
    let camera = "[camera]\nwidth = 4\nheight = 3\nfx = 3\n";
    for (text, fragment) in [
        (
            "world_from_camera = @@[[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
            "not rigid",
        ),
        (
            "world_from_camera = @@[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
            "it mirrors",
        ),
        (
            "world_from_camera = @@[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]\n",
            "not rigid",
        ),
        (
            "world_from_camera = @@[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]\n",
            "last row",
        ),
        (
            "world_from_camera = @@[[1,0,0,0],[0,1,0,0],[0,0,1,0]]\n",
            "has 3 elements",
        ),
        (
            "world_from_camera = [[1,0,0,@@nan],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
            "[0][3]` is nan",
        ),
        (
            "position = [0,0,0]\nworld_from_camera = @@[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
            "both given",
        ),
        (
            "position = [1,2,3]\nlook_at = @@[1,2,3]\n",
            "`look_at` is `position`",
        ),
        ("position = [1,2,3]\nlook_at = @@[1,9,3]\n", "along `up`"),
        (
            "position = [1,2,3]\nlook_at = [0,0,0]\nup = @@[0,0,0]\n",
            "no length",
        ),
    ] {
        assert_refused(&format!("{camera}{text}"), fragment);
    }
    assert_refused(
        "@@[camera]\nwidth = 4\nheight = 3\nfx = 3\nposition = [1,2,3]\n",
        "lacks `look_at`",
    );
    assert_refused(
        "@@[camera]\nwidth = 4\nheight = 3\nfx = 3\nlook_at = [1,2,3]\n",
        "lacks `position`",
    );
}

#[test]
fn impossible_lights() {
    for (text, fragment) in [
        ("kind = @@\"sport\"\n", "did you mean `spot`?"),
        (
            "kind = \"directional\"\nirradiance = [1,1,1]\ndirection = @@[0,0,0]\n",
            "no length",
        ),
        (
            "kind = \"point\"\nposition = [0,0,0]\nintensity = [1, @@inf, 1]\n",
            "1e30",
        ),
        ("kind = \"spot\"\nouter_deg = @@100\n", "at most 90"),
        (
            "kind = \"spot\"\nouter_deg = 20\ninner_deg = @@20\n",
            "below `outer_deg`",
        ),
        (
            "kind = \"quad\"\ncorner = [0,0,0]\nedge_u = [1,1,1]\nedge_v = @@[2,2,2]\n",
            "parallel",
        ),
        (
            "kind = \"quad\"\ncorner = [0,0,0]\nedge_u = @@[0,0,0]\nedge_v = [2,2,2]\n",
            "no length",
        ),
        (
            "side = @@\"left\"\nkind = \"directional\"\ndirection = [0,1,0]\nirradiance = [1,1,1]\n",
            "\"virtual\"",
        ),
    ] {
        assert_refused_with_camera(&format!("[[light]]\n{text}"), fragment);
    }
}

#[test]
fn impossible_objects() {
    for (text, fragment) in [
        ("shape = @@\"spere\"\n", "did you mean `sphere`?"),
        ("shape = \"box\"\nscale = @@0\n", "other than 0"),
        ("shape = \"box\"\nscale = [1, @@0, 1]\n", "`scale[1]` is 0"),
        ("shape = \"box\"\nscale = @@nan\n", "`scale` is nan"),
        ("shape = \"box\"\nsize = [1, @@-1, 1]\n", "above 0"),
        (
            "shape = \"box\"\nrotation = @@[0, 0, 0, 2]\n",
            "unit quaternion",
        ),
        (
            "shape = \"box\"\nrotation = [0, 0, 0, 1]\nrotation_deg = @@[0, 0, 0]\n",
            "both given",
        ),
        ("shape = \"box\"\nmesh = @@\"a.glb\"\n", "both given"),
        ("shape = \"sphere\"\nsegments = @@3\n", "8 to 1024"),
        (
            "shape = \"box\"\nmaterial = { roughness = @@1.5 }\n",
            "0 to 1",
        ),
        (
            "shape = \"box\"\nmaterial = { base_color = [0, 0, @@2] }\n",
            "0 to 1",
        ),
        ("shape = \"box\"\nmaterial = { ior = @@0.5 }\n", "from 1"),
        (
            "shape = \"box\"\nmaterial = { emissive = [@@-1, 0, 0] }\n",
            "`emissive[0]` is -1",
        ),
        (
            "shape = \"box\"\nmaterial = { attenuation_distance_m = @@0 }\n",
            "or inf",
        ),
        (
            "shape = \"box\"\nmaterial = { attenuation_color = [1, 1, @@0] }\n",
            "1e-6",
        ),
        ("shape = \"box\"\nself_shadow_bias_m = @@-1\n", "at least 0"),
        ("shape = \"box\"\nsmooth_radius_m = @@-1\n", "at least 0"),
        (
            "shape = \"box\"\nalbedo = @@\"from-photo\"\n",
            "without a photograph",
        ),
        ("shape = \"box\"\nalbedo = @@\"grey\"\n", "from-photo"),
        (
            "shape = \"box\"\nalbedo = \"from-photo\"\nmaterial = @@{}\n",
            "both given",
        ),
    ] {
        assert_refused_with_camera(&format!("[[real]]\n{text}"), fragment);
    }
    assert_refused_with_camera(
        "@@[[real]]\nshape = \"box\"\nscale = 1e15\ntranslation = [0, 1e15, 0]\n",
        "from the origin",
    );
    for key in ["albedo", "smooth_radius_m", "self_shadow_bias_m"] {
        assert_refused_with_camera(
            &format!("[[virtual]]\nshape = \"box\"\n@@{key} = 0\n"),
            "in [[real]] only",
        );
    }
}

#[test]
fn missing_files_are_named_with_the_resolved_path() {
    let folder = Folder::new();
    for (text, name) in [
        ("[photo]\nimage = \"no.png\"\n", "no.png"),
        ("[photo]\nimage = \"..\"\n", ".."),
        ("[photo]\nimage = \"\"\n", ""),
    ] {
        let message = folder.load(text).unwrap_err().to_string();
        let resolved = folder.path(name);
        assert!(
            message.contains(&resolved.display().to_string()),
            "{message}"
        );
        assert!(
            message.contains("scene.toml:2:9: `image` names no file"),
            "{message}"
        );
    }
    assert_refused_with_camera("[environment]\nimage = @@\"no.hdr\"\n", "names no file");
    assert_refused_with_camera("[[virtual]]\nmesh = @@\"no.glb\"\n", "names no file");
}

#[test]
fn meshes_that_cannot_be_read() {
    let folder = Folder::new();
    std::fs::write(folder.path("broken.gltf"), "{ \"asset\":\n").unwrap();
    let draco = r#"{ "asset": { "version": "2.0" }, "extensionsUsed": ["KHR_draco_mesh_compression"], "extensionsRequired": ["KHR_draco_mesh_compression"] }"#;
    std::fs::write(folder.path("draco.gltf"), draco).unwrap();
    for (name, fragment) in [
        ("broken.gltf", "expected valid glTF 2.0"),
        ("draco.gltf", "KHR_draco_mesh_compression"),
    ] {
        let text = format!("{CAMERA}[[virtual]]\nmesh = \"{name}\"\n");
        let message = folder.load(&text).unwrap_err().to_string();
        assert!(message.contains("scene.toml:6:8: `mesh` /"), "{message}");
        assert!(message.contains(fragment), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn motion() {
    for (text, part) in [
        ("@@[shutter]\n", "lacks `exposure_secs`"),
        ("[shutter]\nexposure_secs = @@-1\n", "from 0 to 1e6"),
        ("[shutter]\nexposure_secs = @@nan\n", "from 0 to 1e6"),
        ("[shutter]\nexposure_secs = 1\nsamples = @@0\n", "from 1"),
        (
            "[motion_blur]\nmethod = @@\"copy\"\n",
            "did you mean `copies`",
        ),
        ("[motion_blur]\nstep_px = @@0\n", "0.1 to 1000"),
        (
            "[[virtual]]\nshape = \"sphere\"\n@@[[virtual.motion]]\n",
            "lacks `time_secs`",
        ),
        (
            "[[virtual]]\nshape = \"sphere\"\n[[virtual.motion]]\ntime_secs = 0\nscale = @@0\n",
            "other than 0",
        ),
        (
            "[lens]\n@@[[lens.motion]]\ntime_secs = 0\n",
            "lacks `focus_distance_m`",
        ),
        (
            "[lens]\n[[lens.motion]]\ntime_secs = 0\nfocus_distance_m = @@0\n",
            "above 0",
        ),
        (
            "[lens]\nf_number = 2\nfocal_length_mm = 50\nfocus_distance_m = 1\n[[lens.motion]]\ntime_secs = 0\nfocus_distance_m = @@0.04\n",
            "nearer than the focal length",
        ),
        (
            "[[real]]\nshape = \"sphere\"\n[[real.@@motion]]\ntime_secs = 0\n",
            "[[virtual]] only",
        ),
    ] {
        assert_refused_with_camera(text, part);
    }
}

#[test]
fn a_scene_file_that_cannot_be_read() {
    let folder = Folder::new();
    let missing = super::load(&folder.path("none.toml")).unwrap_err();
    assert!(
        matches!(missing, SceneError::Unreadable { .. }),
        "{missing}"
    );
    assert!(missing.to_string().contains("none.toml: "), "{missing}");
    let directory = super::load(&folder.path("")).unwrap_err();
    assert!(
        matches!(directory, SceneError::Unreadable { .. }),
        "{directory}"
    );
    std::fs::write(folder.path("latin1.toml"), b"a = 1\n# caf\xe9\n").unwrap();
    let latin1 = super::load(&folder.path("latin1.toml"))
        .unwrap_err()
        .to_string();
    assert!(latin1.contains("latin1.toml:2:6: "), "{latin1}");
}
