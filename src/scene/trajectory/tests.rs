//! Every format, against poses worked out by hand, and what each refuses.

use glam::{DMat4, DVec3};

use super::*;

/// A camera at (1, 2, 3) that looks along +X, up +Y: right is +Z, back is -X.
fn pose() -> DMat4 {
    DMat4::from_cols(
        DVec3::Z.extend(0.0),
        DVec3::Y.extend(0.0),
        DVec3::NEG_X.extend(0.0),
        DVec3::new(1.0, 2.0, 3.0).extend(1.0),
    )
}

const ROWS: &str = "[[0, 0, -1, 1], [0, 1, 0, 2], [1, 0, 0, 3], [0, 0, 0, 1]]";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).expect("a writable folder");
        path
    }

    fn read(&self, name: &str, text: &str) -> Result<Trajectory> {
        Trajectory::read(&self.write(name, text))
    }

    fn refused(&self, name: &str, text: &str, part: &str) {
        let message = self.read(name, text).expect_err(text).to_string();
        assert!(message.contains(part), "{message} lacks {part}");
        assert!(message.contains(name), "{message} names no file");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

fn frame(file: Option<&str>, number: u32) -> FrameName {
    FrameName {
        label: "frame".into(),
        file: file.map(str::to_owned),
        number,
        place: number,
        time_secs: file.and_then(|file| Naming::of(std::iter::once(file)).time_secs(file)),
    }
}

/// k1 k2 p1 p2 k3.
fn lens(intrinsics: &Intrinsics) -> [f64; 5] {
    std::array::from_fn(|i| intrinsics.distortion.coefficients[i])
}

fn assert_pose(found: Option<DMat4>, expected: DMat4) {
    let found = found.expect("a pose");
    let off = (found - expected).to_cols_array();
    assert!(off.iter().all(|x| x.abs() < 1e-9), "{found}");
}

#[test]
fn json_of_three_programs_is_one_pose() {
    let folder = Folder::new();
    let own = folder
        .read(
            "own.json",
            &format!(
                r#"{{"frames_per_second": 25, "camera": {{"fx": 500, "fy": 501, "cx": 320, "cy": 240, "width": 640, "height": 480}},
                "frames": [{{"frame": 5, "world_from_camera": {ROWS}, "focus_distance_m": 0.7}}, {{"frame": 6, "world_from_camera": null}}]}}"#
            ),
        )
        .expect("reads");
    let views = Views::new(&own, None, false).expect("no doubles");
    let view = views.of(&frame(Some("f_0005.png"), 5)).expect("is there");
    assert_pose(view.world_from_camera, pose());
    assert_eq!(view.time_secs, Some(0.2));
    assert_eq!(view.focus_distance_m, Some(0.7));
    let intrinsics = view.intrinsics.expect("given");
    assert_eq!(intrinsics.centre, Some([320.0, 240.0]));
    assert_eq!(intrinsics.size, Some((640, 480)));
    assert_eq!(
        views.of(&frame(None, 6)).expect("null").world_from_camera,
        None
    );
    assert!(views.of(&frame(None, 7)).is_err(), "absent");

    let tracked = folder
        .read(
            "tracked.json",
            &format!(
                r#"{{"fx": 500, "fy": 500, "cx": 319.5, "cy": 239.5, "distortion": {{"model": "opencv", "k1": 0.1}}, "nominal_fps": 25,
                "frames": [{{"frame": 0, "camera_to_world_gltf": {ROWS}, "laplacian_variance": 3.0}}]}}"#
            ),
        )
        .expect("reads");
    assert_pose(tracked.entries[0].world_from_camera, pose());
    let intrinsics = tracked.intrinsics.expect("given");
    assert_eq!(intrinsics.centre, Some([320.0, 240.0]), "half a pixel");
    assert_eq!(intrinsics.distortion.coefficients[0], 0.1);

    let nerfstudio = folder
        .read(
            "transforms.json",
            &format!(
                r#"{{"camera_model": "OPENCV", "fl_x": 500.0, "fl_y": 502.0, "cx": 320.0, "cy": 240.0, "w": 640, "h": 480, "k1": 0.05, "p2": 0.01,
                "frames": [{{"file_path": "images/frame_00001.jpg", "transform_matrix": {ROWS}, "colmap_im_id": 1}},
                {{"file_path": "images/frame_00002.jpg", "transform_matrix": null}}]}}"#
            ),
        )
        .expect("reads");
    let intrinsics = nerfstudio.intrinsics.expect("given");
    assert_eq!(lens(&intrinsics), [0.05, 0.0, 0.0, 0.01, 0.0]);
    assert_eq!(intrinsics.focal, Focal::Pixels([500.0, 502.0]));
    assert_eq!(intrinsics.centre, Some([320.0, 240.0]));
    let views = Views::new(&nerfstudio, Some(10.0), false).expect("no doubles");
    let view = views
        .of(&frame(Some("frame_00001.png"), 1))
        .expect("converted");
    assert_pose(view.world_from_camera, pose());
    assert_eq!(view.time_secs, Some(0.1));
    let views = Views::new(&nerfstudio, Some(10.0), true).expect("no doubles");
    let view = views.of(&frame(None, 0)).expect("in order");
    assert_pose(view.world_from_camera, pose());
    assert_eq!(view.time_secs, Some(0.0), "a stream counts from 0");
}

#[test]
fn own_toml_is_strict() {
    let folder = Folder::new();
    let text = format!(
        "frames_per_second = 10\n[camera]\nfx = 500\ncx = 320\ncy = 240\n[[frame]]\nframe = 0\nworld_from_camera = {ROWS}\n\
         [[frame]]\nframe = 1\nposition = [1, 2, 3]\nlook_at = [5, 2, 3]\ntime_secs = 0.15\n[[frame]]\nframe = 2\npose = \"null\"\n"
    );
    let own = folder.read("own.toml", &text).expect("reads");
    let views = Views::new(&own, None, false).expect("no doubles");
    for number in [0, 1] {
        assert_pose(
            views
                .of(&frame(None, number))
                .expect("there")
                .world_from_camera,
            pose(),
        );
    }
    assert_eq!(
        views.of(&frame(None, 1)).expect("there").time_secs,
        Some(0.15)
    );
    assert_eq!(
        views.of(&frame(None, 2)).expect("null").world_from_camera,
        None
    );
    let entry = "[[frame]]\nframe = 0\n";
    for (text, part) in [
        (
            format!(
                "{entry}world_from_camera = {}",
                ROWS.replace("[0, 1, 0, 2]", "[0, nan, 0, 2]")
            ),
            ":3:",
        ),
        (entry.to_owned(), "pose is absent"),
        (
            format!(
                "{entry}world_from_camera = {}",
                ROWS.replace("0, 0, -1", "0, 0, -2")
            ),
            "not rigid",
        ),
        (format!("{entry}pose = \"none\""), "null"),
        (format!("{entry}world_from_camra = {ROWS}"), "did you mean"),
        (String::new(), "no pose"),
        (format!("{entry}pose = \"null\""), "every pose is null"),
        ("[[frame]]\npose = \"null\"".to_owned(), "says not which"),
    ] {
        folder.refused("bad.toml", &text, part);
    }
}

#[test]
fn json_refusals_name_the_frame() {
    let folder = Folder::new();
    let entry = |rest: &str| {
        format!(
            r#"{{"frames": [{{"frame": 0, "world_from_camera": {ROWS}}}, {{"frame": 1{rest}}}]}}"#
        )
    };
    for (text, part) in [
        (entry(""), "frames[1]: its pose is absent"),
        (entry(r#", "world_from_camera": [[NaN, 0, 0, 0]]"#), "NaN"),
        (
            entry(r#", "world_from_camera": [[1, 0, 0, 0]]"#),
            "4 rows of 4",
        ),
        (
            entry(r#", "world_from_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,"x"],[0,0,0,1]]"#),
            "frames[1]",
        ),
        (
            entry(&format!(
                r#", "world_from_camera": {}"#,
                ROWS.replace("1, 0, 0, 3", "1, 0, 0.1, 3")
            )),
            "not rigid",
        ),
        (
            entry(r#", "world_from_camera": [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"#),
            "mirrors",
        ),
        ("{\"frames\": [".to_owned(), "valid JSON"),
        ("{}".to_owned(), "`frames`"),
        (
            r#"{"fl_x": 5, "cx": 1, "cy": 1, "camera_model": "EQUIRECTANGULAR", "frames": []}"#
                .to_owned(),
            "EQUIRECTANGULAR",
        ),
    ] {
        folder.refused("bad.json", &text, part);
    }
    let twice = format!(
        r#"{{"frames": [{{"frame": 3, "world_from_camera": {ROWS}}}, {{"frame": 3, "world_from_camera": null}}]}}"#
    );
    let twice = folder.read("twice.json", &twice).expect("reads");
    let message = Views::new(&twice, None, false)
        .err()
        .expect("doubles")
        .to_string();
    assert!(message.contains("frames[0] and frames[1]"), "{message}");
}

/// OpenCV's axes: a camera that looks along +X has its x along +Z and its y down.
#[test]
fn colmap_and_tum_turn_their_axes() {
    let folder = Folder::new();
    folder.write("cameras.txt", "# cameras\n1 OPENCV 640 480 500 501 320 240 0.1 0.2 0.01 0.02\n2 SIMPLE_RADIAL 640 480 400 320 240 0.1\n");
    folder.write("points3D.txt", "7 4 2 3 255 0 0 0.5 1 0\n");
    // World from camera, OpenCV axes: columns +Z, -Y, +X; a rotation whose quaternion xyzw is (1, 0, 1, 0) / sqrt 2.
    let half = 0.5f64.sqrt();
    let rotation = DMat3::from_cols(DVec3::Z, DVec3::NEG_Y, DVec3::X);
    let quaternion = DQuat::from_mat3(&rotation);
    assert!((quaternion.x.abs() - half).abs() < 1e-12);
    let inverse = quaternion.inverse();
    let t = -(inverse * DVec3::new(1.0, 2.0, 3.0));
    let images = format!(
        "# images\n1 {:.17} {:.17} {:.17} {:.17} {:.17} {:.17} {:.17} 1 left/a 1.png\n320 240 7 10 20 -1\n2 1 0 0 0 0 0 0 2 b.png\n\n",
        inverse.w, inverse.x, inverse.y, inverse.z, t.x, t.y, t.z
    );
    folder.write("images.txt", &images);
    let colmap = Trajectory::read(folder.0.path()).expect("reads");
    assert_eq!(colmap.entries.len(), 2);
    assert_eq!(colmap.entries[0].key, EntryKey::Name("left/a 1.png".into()));
    assert_pose(colmap.entries[0].world_from_camera, pose());
    let intrinsics = colmap.entries[0].intrinsics.expect("given");
    assert_eq!(lens(&intrinsics), [0.1, 0.2, 0.01, 0.02, 0.0]);
    // The point lies straight ahead, and is seen at the principal point.
    assert_eq!(colmap.known_points.len(), 1);
    assert_eq!(colmap.known_points[0].seen, Some([320.0, 240.0]));
    assert_eq!(colmap.known_points[0].world, DVec3::new(4.0, 2.0, 3.0));

    let tum = format!(
        "# timestamp tx ty tz qx qy qz qw\n10.0 1 2 3 {0:.17} {1:.17} {2:.17} {3:.17}\n10.1 3 2 3 {0:.17} {1:.17} {2:.17} {3:.17}\n",
        quaternion.x, quaternion.y, quaternion.z, quaternion.w
    );
    let tum = folder.read("tum.txt", &tum).expect("reads");
    assert_pose(tum.entries[0].world_from_camera, pose());
    let views = Views::new(&tum, None, false).expect("no doubles");
    assert_pose(
        views
            .of(&frame(Some("a.png"), 0))
            .expect("in order")
            .world_from_camera,
        pose(),
    );
    let between = views.of(&frame(Some("10.05.png"), 0)).expect("by time");
    assert!((between.world_from_camera.expect("posed").w_axis.x - 2.0).abs() < 1e-9);
    assert!(
        views.of(&frame(Some("11.05.png"), 0)).is_err(),
        "no pose near"
    );

    // Unix time in nanoseconds, as recorders of robots write it.
    let nano = "1403636579963555584 0 0 0 0 0 0 1\n1403636580013555456 2 0 0 0 0 0 1\n";
    let nano = folder.read("nano.txt", nano).expect("reads");
    let secs = |at: usize| nano.entries[at].time_secs.expect("has one");
    assert!((secs(0) - 1_403_636_579.963_555_6).abs() < 1e-6);
    assert!((secs(1) - secs(0) - 0.05).abs() < 1e-6);
    folder.refused(
        "tum.txt",
        "1e18 0 0 0 0 0 0 1\n",
        "expected a number of at most 1e15",
    );
    folder.refused("tum.txt", "1 0 0 0 0 0 0\n", "complete the line");
    folder.refused("tum.txt", "1 0 0 nan 0 0 0 1\n", "NaN");
    folder.refused("tum.txt", "1 0 0 0 0 0 0 2\n", "length 2");
    folder.refused("tum.txt", "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", ":2:");
    folder.refused("images.txt", "1 1 0 0 0 0 0 nan 1 a.png\n\n", "NaN");
    folder.refused("images.txt", "1 1 0 0 0 0 0 0 9 a.png\n\n", "camera 9");
    folder.write("cameras.txt", "1 FOV 640 480 1 2 3\n");
    let message = Trajectory::read(folder.0.path())
        .expect_err("unknown")
        .to_string();
    assert!(
        message.contains("cameras.txt:1") && message.contains("FOV"),
        "{message}"
    );
}

#[test]
fn opencv_calibrations_are_read() {
    let folder = Folder::new();
    let yaml = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 319.5,\n       0., 501., 239.5, 0., 0., 1. ]\n\
        distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0.1, -0.2, 0.01, 0.02, 0.3 ]\n";
    let intrinsics = read_intrinsics(&folder.write("calib.yml", yaml)).expect("reads");
    assert_eq!(intrinsics.size, Some((640, 480)));
    assert_eq!(intrinsics.centre, Some([320.0, 240.0]));
    assert_eq!(lens(&intrinsics), [0.1, -0.2, 0.01, 0.02, 0.3]);
    for (text, part) in [
        (
            yaml.replace("camera_matrix", "matrix"),
            "lacks `camera_matrix`",
        ),
        (yaml.replace("501.", ".nan"), "calib.yml:5"),
        (yaml.replace("501.", "nan"), "NaN"),
        (yaml.replace("500., 0.", "500., 3."), "no skew"),
        (
            yaml.replace("0.3 ]", "0.3, 0, 0, 0, 0, 0, 0, 0, 0.7 ]"),
            "coefficient 13",
        ),
        (
            yaml.replace("---", "distortion_model: unified"),
            "camera model unified",
        ),
    ] {
        let message = read_intrinsics(&folder.write("calib.yml", &text))
            .expect_err(part)
            .to_string();
        assert!(message.contains(part), "{message} lacks {part}");
    }
}

#[test]
fn the_camera_moves_at_constant_rates_between_poses() {
    let turned = |degrees: f64, x: f64| {
        DMat4::from_translation(DVec3::X * x) * DMat4::from_rotation_y(degrees.to_radians())
    };
    let path = CameraPath::new(vec![(1.0, turned(40.0, 2.0)), (0.0, turned(0.0, 0.0))]);
    assert_pose(path.pose(0.25), turned(10.0, 0.5));
    assert_pose(path.pose(-0.5), turned(-20.0, -1.0));
    assert_eq!(
        path.pose(0.0),
        Some(turned(0.0, 0.0)),
        "a key is itself, to the bit"
    );
    assert_eq!(
        path.around(0.0, 0.5).pose(0.2),
        Some(turned(0.0, 0.0)),
        "no neighbour, no motion"
    );
    let still = CameraPath::new(vec![(0.0, pose()), (1.0, pose())]);
    assert_eq!(still.pose(0.3), Some(pose()));
    assert_eq!(CameraPath::default().pose(0.0), None);
}
