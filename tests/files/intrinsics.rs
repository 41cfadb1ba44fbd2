//! Where a frame's intrinsics come from.

use super::support::{FOCAL_PX, ball, centroid};
use crate::support::Folder;

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", ball(0.2));
    folder.grey_frames(&["f_0000.png"]);
    folder
}

/// Parts of a transforms.json: what is said of all frames, and of the one frame.
fn transforms(folder: &Folder, top: &str, frame: &str) {
    folder.write(
        "transforms.json",
        format!(
            r#"{{{top} "frames": [{{{frame} "file_path": "images/f_0000.png", "transform_matrix": [[1,0,0,0.9],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}}]}}"#
        ),
    );
}

#[test]
fn ns_perframe_dist() {
    let folder = folder();
    let focal = format!(
        r#""w": 64, "h": 48, "fl_x": {FOCAL_PX}, "fl_y": {FOCAL_PX}, "cx": 32.0, "cy": 24.0,"#
    );
    let k1 = r#""k1": 0.8, "k2": 0.0, "p1": 0, "p2": 0, "camera_model": "OPENCV","#;
    let render = |top: &str, frame: &str| {
        transforms(&folder, top, frame);
        folder.sequence_of("frames", "transforms.json", "");
        (folder.ball_at("f_0000.png"), folder.bytes("out/f_0000.png"))
    };
    // x' = x (1 + 0.8 x^2) at x = -0.3 / 1, of the ball's centre: 32 - 65.9 * 0.3 * 1.072.
    let (split, bytes) = render(k1, &focal);
    assert!((split[0] - 10.6).abs() < 0.4, "{split:?}");
    assert_eq!(
        bytes,
        render("", &format!("{k1}{focal}")).1,
        "in the frame alone"
    );
    assert_eq!(
        bytes,
        render(&format!("{k1}{focal}"), "").1,
        "at the top alone"
    );
    let (straight, _) = render("", &focal);
    assert!((straight[0] - 12.2).abs() < 0.4, "control: {straight:?}");
    // The frame's own wins.
    let (own, _) = render(&k1.replace("0.8", "0.3"), &format!(r#""k1": 0.8, {focal}"#));
    assert_eq!(own, split);
}

#[test]
fn fields_of_view_stand_in_for_focal_lengths() {
    let folder = folder();
    let angle = 2.0 * (32.0 / FOCAL_PX).atan();
    let fov = format!(r#""camera_angle_x": {angle},"#);
    let render = |top: &str, frame: &str| {
        transforms(&folder, top, frame);
        folder.sequence_of("frames", "transforms.json", "");
        folder.ball_at("f_0000.png")[0]
    };
    let straight = render(
        "",
        &format!(r#""w": 64, "h": 48, "fl_x": {FOCAL_PX}, "cx": 32.0, "cy": 24.0,"#),
    );
    assert!(
        (render(&fov, "") - straight).abs() < 0.02,
        "no size is told"
    );
    assert!((render(&format!(r#""w": 64, "h": 48,{fov}"#), "") - straight).abs() < 0.02);
    let wider = render(&fov.replace(&angle.to_string(), "1.2"), "");
    assert!((wider - straight).abs() > 1.0, "control: another angle");
    transforms(&folder, r#""k1": 0.1,"#, "");
    folder.refuse_sequence_of("frames", "transforms.json", "lack `fl_x`");
    transforms(&folder, r#""fl_x": 60, "cy": 24,"#, "");
    folder.refuse_sequence_of("frames", "transforms.json", "lack `cx`");
}

/// The rule of this program's own formats too.
#[test]
fn own_formats_take_fields_from_the_top() {
    let folder = folder();
    let pose = "[[1,0,0,0.9],[0,1,0,0],[0,0,1,3],[0,0,0,1]]";
    folder.write(
        "poses.json",
        format!(
            r#"{{"camera": {{"cx": 32, "cy": 24, "distortion": [0.8, 0, 0, 0, 0]}},
            "frames": [{{"frame": 0, "camera": {{"fx": {FOCAL_PX}, "fy": {FOCAL_PX}}}, "world_from_camera": {pose}}}]}}"#
        ),
    );
    folder.write(
        "poses.toml",
        format!(
            "[camera]\ncx = 32\ncy = 24\ndistortion = [0.8, 0, 0, 0, 0]\n[[frame]]\nframe = 0\nworld_from_camera = {pose}\ncamera = {{ fx = {FOCAL_PX} }}\n"
        ),
    );
    for poses in ["poses.json", "poses.toml"] {
        folder.sequence_of("frames", poses, "");
        let x = folder.ball_at("f_0000.png")[0];
        assert!((x - 10.6).abs() < 0.4, "{poses}: {x}");
    }
    let toml = folder.read("poses.toml");
    folder.write("poses.toml", toml.replace("fx =", "fy ="));
    folder.sequence_of("frames", "poses.toml", "");
    folder.write("poses.toml", toml.replace("cx = 32\n", ""));
    folder.refuse_sequence_of("frames", "poses.toml", "lack `cx`");
}

/// A ball 45 degrees to the left: equidistant at 32 - 20 pi / 4, pinhole at 32 - 20.
const EQUIDISTANT: f64 = 32.0 - 5.0 * std::f64::consts::PI;

fn wide_folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", ball(0.4));
    folder.grey_frames(&["f_0000.png"]);
    folder
}

#[test]
fn ngp_fisheye_wide() {
    let folder = wide_folder();
    let transforms = |model: &str| {
        folder.write(
            "transforms.json",
            format!(
                r#"{{{model} "w": 64, "h": 48, "fl_x": 20.0, "fl_y": 20.0, "cx": 32.0, "cy": 24.0, "k1": 0.0, "k2": 0.0,
                "frames": [{{"file_path": "images/f_0000.png", "transform_matrix": [[1,0,0,3],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}}]}}"#
            ),
        );
    };
    for model in [
        r#""is_fisheye": true,"#,
        r#""camera_model": "OPENCV_FISHEYE","#,
        r#""distortion_model": "equidistant","#,
    ] {
        for backend in ["cpu", "gpu"] {
            transforms(model);
            folder.sequence_of("frames", "transforms.json", &format!("--backend {backend}"));
            let x = folder.ball_at("f_0000.png")[0];
            assert!(
                (x - EQUIDISTANT).abs() < 0.5,
                "{model} on the {backend}: {x}"
            );
        }
    }
    transforms("");
    folder.sequence_of("frames", "transforms.json", "");
    let x = folder.ball_at("f_0000.png")[0];
    assert!((x - EQUIDISTANT).abs() > 3.0, "control: a pinhole, {x}");
    transforms(r#""camera_model": "EQUIRECTANGULAR","#);
    folder.refuse_sequence_of("frames", "transforms.json", "EQUIRECTANGULAR");
    transforms(r#""k4": 0.1,"#);
    folder.refuse_sequence_of("frames", "transforms.json", "k4 is 0.1");
}

#[test]
fn cv_ros_fisheye_wide() {
    let folder = wide_folder();
    folder.write("t.txt", "0.0 3 0 -3 0 0 0 1\n");
    let calibration = |model: &str, coefficients: &str| {
        folder.write(
            "calib.yaml",
            format!(
                "image_width: 64\nimage_height: 48\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [20.0, 0, 31.5, 0, 20.0, 23.5, 0, 0, 1]\n\
                 {model}\ndistortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [{coefficients}]\n"
            ),
        );
    };
    let x = || {
        folder.sequence_of("frames", "t.txt", "--intrinsics calib.yaml");
        folder.ball_at("f_0000.png")[0]
    };
    for model in ["distortion_model: equidistant", "fisheye_model: 1"] {
        calibration(model, "0.0, 0.0, 0.0, 0.0");
        let x = x();
        assert!((x - EQUIDISTANT).abs() < 0.5, "{model}: {x}");
    }
    // The first sample of a rational model: at r = 1 the radius is 1.2 / 1.5.
    calibration(
        "distortion_model: rational_polynomial",
        "0.2, 0, 0, 0, 0, 0.5, 0, 0",
    );
    let rational = x();
    assert!((rational - 16.0).abs() < 0.7, "{rational}");
    calibration("distortion_model: plumb_bob", "0.0, 0.0, 0.0, 0.0, 0.0");
    assert!((x() - EQUIDISTANT).abs() > 3.0, "control: a pinhole");
    calibration("distortion_model: unified", "0.0, 0.0, 0.0, 0.0");
    let command =
        "sequence scene.toml --frames frames --trajectory t.txt --intrinsics calib.yaml -o out";
    folder.refuse(command, "unified");
}

#[test]
fn distortion_by_other_names() {
    let folder = folder();
    let focal = format!(
        r#""w": 64, "h": 48, "fl_x": {FOCAL_PX}, "fl_y": {FOCAL_PX}, "cx": 32.0, "cy": 24.0,"#
    );
    let render = |distortion: &str| {
        transforms(&folder, &format!("{focal}{distortion}"), "");
        folder.sequence_of("frames", "transforms.json", "");
        folder.bytes("out/f_0000.png")
    };
    let known = render(r#""k1": 0.8, "k2": 0.1, "p1": 0.01,"#);
    for same in [
        r#""distortion_params": [0.8, 0.1, 0, 0, 0.01, 0],"#,
        r#""distortion_coefficients": [0.8, 0.1, 0.01, 0, 0],"#,
        r#""distortion": {"k1": 0.8, "k2": 0.1, "p1": 0.01},"#,
    ] {
        assert_eq!(render(same), known, "{same}");
    }
    let none = render("");
    assert_ne!(none, known, "control");
    assert_eq!(render(r#""skew": 0, "radial_distortion": null,"#), none);
    for unknown in [
        r#""radial_distortion": [0.8, 0.1],"#,
        r#""K1": 0.8,"#,
        r#""skew": 3,"#,
        r#""distortion_params": [1, 2, 3, 4, 5, 6, 7],"#,
        r#""projection": "equirectangular","#,
    ] {
        transforms(&folder, &format!("{focal}{unknown}"), "");
        let key = unknown.split('"').nth(1).unwrap();
        let part = if key == "projection" {
            "equirectangular is not known"
        } else {
            key
        };
        folder.refuse_sequence_of("frames", "transforms.json", part);
    }
}

/// The model of the distortion says more than that of the camera.
#[test]
fn pinholes_with_the_distortion_of_a_fisheye() {
    let folder = wide_folder();
    let x = |model: &str| {
        folder.write(
            "transforms.json",
            format!(
                r#"{{{model} "w": 64, "h": 48, "fl_x": 20.0, "fl_y": 20.0, "cx": 32.0, "cy": 24.0,
                "frames": [{{"file_path": "images/f_0000.png", "transform_matrix": [[1,0,0,3],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}}]}}"#
            ),
        );
        folder.sequence_of("frames", "transforms.json", "");
        folder.ball_at("f_0000.png")[0]
    };
    for model in [
        r#""camera_model": "PINHOLE", "distortion_model": "equidistant","#,
        r#""distortion_model": "kannala_brandt", "camera_model": "pinhole","#,
        r#""fisheye": "true", "camera_model": "OPENCV","#,
        r#""lens_type": "fisheye", "camera_model": "OPENCV","#,
    ] {
        assert!((x(model) - EQUIDISTANT).abs() < 0.5, "{model}");
    }
    let radial = r#""camera_model": "PINHOLE", "distortion_model": "radtan","#;
    assert!((x(radial) - EQUIDISTANT).abs() > 3.0, "control");
}

/// A camera chain of Kalibr, and a sensor of EuRoC.
#[test]
fn kalibr_camera_chains() {
    let folder = wide_folder();
    folder.write("t.txt", "0.0 3 0 -3 0 0 0 1\n");
    let chain = |models: &str, rest: &str| {
        format!("cam0:\n  cam_overlaps: []\n  {models}\n  {rest}\n  rostopic: /cam0/image_raw\n")
    };
    let lists = "distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  intrinsics: [20.0, 20.0, 31.5, 23.5]\n  resolution: [64, 48]";
    let x = |text: &str| {
        folder.write("calib.yaml", text);
        folder.sequence_of("frames", "t.txt", "--intrinsics calib.yaml");
        folder.ball_at("f_0000.png")[0]
    };
    let equidistant = "camera_model: pinhole\n  distortion_model: equidistant";
    assert!((x(&chain(equidistant, lists)) - EQUIDISTANT).abs() < 0.5);
    let lines = "intrinsics:\n  - 20.0\n  - 20.0\n  - 31.5\n  - 23.5\n  distortion_coeffs:\n  - 0.1\n  - 0.0\n  - 0.0\n  - 0.0";
    let bent = x(&chain(equidistant, lines));
    assert!(bent < EQUIDISTANT - 0.5, "{bent}");
    let radial = "camera_model: pinhole\n  distortion_model: radtan";
    assert!(
        (x(&chain(radial, lists)) - EQUIDISTANT).abs() > 3.0,
        "control"
    );
    let euroc = "sensor_type: camera\nresolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [20.0, 20.0, 31.5, 23.5] #fu, fv, cu, cv\n\
         distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n";
    assert_eq!(x(euroc), x(&chain(radial, lists)));
    let command =
        "sequence scene.toml --frames frames --trajectory t.txt --intrinsics calib.yaml -o out";
    let refuse = |text: &str, part: &str| {
        folder.write("calib.yaml", text);
        folder.refuse(command, part);
    };
    refuse(
        &chain("camera_model: omni\n  distortion_model: radtan", lists),
        "omni",
    );
    refuse(
        &chain("camera_model: pinhole\n  distortion_model: fov", lists),
        "fov",
    );
    refuse(
        &chain(
            radial,
            &lists.replace("intrinsics: [", "intrinsics: [0.9, "),
        ),
        "calib.yaml:6: 5 intrinsics",
    );
    let two = [
        chain(radial, lists),
        chain(radial, lists).replace("cam0:", "cam1:"),
    ]
    .concat();
    refuse(&two, "cam0, cam1");
}

/// In a scene file, and in the picture that a render writes.
#[test]
fn fisheyes_of_scene_files() {
    let folder = Folder::new();
    let scene = |lens: &str| {
        ball(0.4).replace(
            "[camera]\n",
            &format!("[camera]\nwidth = 64\nheight = 48\nfx = 20\nposition = [3, 0, 3]\nlook_at = [3, 0, 0]\n{lens}\n"),
        )
    };
    let x = |lens: &str| {
        folder.write("scene.toml", scene(lens));
        folder.succeed("render scene.toml -o out.png");
        centroid(&folder.open("out.png"))[0]
    };
    assert!((x("lens_model = \"fisheye\"") - EQUIDISTANT).abs() < 0.5);
    let bent = x("lens_model = \"fisheye\"\ndistortion = [0.1, 0, 0, 0]");
    assert!(bent < EQUIDISTANT - 0.5, "{bent}");
    assert!((x("") - EQUIDISTANT).abs() > 3.0, "control");
    let angle = (48.0_f64 / 20.0).to_degrees();
    folder.write(
        "scene.toml",
        scene("lens_model = \"fisheye\"")
            .replace("fx = 20", &format!("vertical_fov_deg = {angle}")),
    );
    folder.succeed("render scene.toml -o out.png");
    let wide = centroid(&folder.open("out.png"))[0];
    assert!((wide - EQUIDISTANT).abs() < 0.5, "{wide}");
    let open = "lens_model = \"fisheye\"\n[lens]\naperture_radius_m = 0.01\nfocus_distance_m = 3";
    folder.write("scene.toml", scene(open));
    folder.refuse("render scene.toml -o out.png", "89 degrees");
    folder.write("scene.toml", scene(open).replace("fx = 20", "fx = 28"));
    folder.succeed("render scene.toml -o out.png");
}

/// Words that other programs have for the projection, the coefficients and the camera matrix.
#[test]
fn words_of_other_programs_for_lens_and_matrix() {
    let folder = wide_folder();
    let focal = r#""fl_x": 20.0, "fl_y": 20.0, "cx": 32.0, "cy": 24.0,"#;
    let transforms = |more: &str| {
        folder.write(
            "transforms.json",
            format!(
                r#"{{{more} "w": 64, "h": 48, "frames": [{{"file_path": "images/f_0000.png", "transform_matrix": [[1,0,0,3],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}}]}}"#
            ),
        );
    };
    let x = |more: &str| {
        transforms(&format!("{focal}{more}"));
        folder.sequence_of("frames", "transforms.json", "");
        folder.ball_at("f_0000.png")[0]
    };
    let pinhole = x("");
    assert!((pinhole - EQUIDISTANT).abs() > 3.0, "control: {pinhole}");
    for more in [
        r#""lens": "fisheye","#,
        r#""projection_type": "equidistant","#,
    ] {
        assert!((x(more) - EQUIDISTANT).abs() < 0.5, "{more}");
    }
    for more in [
        r#""lens": "Sigma 15mm","#,
        r#""latlong": false,"#,
        r#""dist": 3.2,"#,
        r#""K": [[20, 0, 32], [0, 20, 24], [0, 0, 1]],"#,
    ] {
        assert_eq!(x(more), pinhole, "{more}");
    }
    let bent = x(r#""k1": 0.2,"#);
    assert_ne!(bent, pinhole, "control");
    for more in [r#""dist": [0.2, 0, 0, 0],"#, r#""D": [0.2, 0, 0, 0],"#] {
        assert_eq!(x(more), bent, "{more}");
    }
    for (more, part) in [
        (r#""ftheta_p0": 0.1, "ftheta_p1": 0.05,"#, "ftheta_p0"),
        (r#""latlong": true,"#, "latlong"),
        (r#""is_equirectangular": true,"#, "equirectangular"),
        (r#""orthographic": 1,"#, "orthographic"),
    ] {
        transforms(&format!("{focal}{more}"));
        folder.refuse_sequence_of("frames", "transforms.json", part);
    }
    // The scene's own focal length would stand in for what the file says.
    folder.write(
        "scene.toml",
        ball(0.4).replace("[camera]\n", "[camera]\nfx = 20\n"),
    );
    for matrix in ["K", "intrinsics", "camera_matrix"] {
        transforms(&format!(
            r#""{matrix}": [[30, 0, 32], [0, 30, 24], [0, 0, 1]],"#
        ));
        folder.refuse_sequence_of("frames", "transforms.json", &format!("`{matrix}`"));
    }
}
