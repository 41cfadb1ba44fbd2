//! Frames in and out: what passes, what stays put, what is blurred.

use std::io::Write;
use std::process::Stdio;

use glam::{DMat4, DVec3};
use mixray::renderer::{Budget, FrameEdit, Renderer, RendererOptions, Watcher};
use mixray::scene::projection::project;
use mixray::scene::trajectory::{CameraPath, FrameName, Trajectory, Views};

use super::support::{BALL, sequence, y4m};
use crate::support::{Folder, scene, shared_data};

#[test]
fn null_poses_pass_through_and_are_counted() {
    let folder = Folder::new();
    folder.write("scene.toml", BALL);
    folder.frames(4, 0.02);
    folder.trajectory(4, 0.02, &[0, 2]);
    let said = folder.sequence(&["--frames", "in", "-o", "out"]);
    assert!(
        said.contains("2 rendered") && said.contains("2 passed through"),
        "{said}"
    );
    let (before, after) = (folder.frames_of("in"), folder.frames_of("out"));
    let same: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a == b).collect();
    assert_eq!(same, [true, false, true, false]);
}

/// Through pipes, as ffmpeg would be; frames without a pose keep their bytes, and so does what the ball does not reach.
#[test]
fn y4m_streams_go_in_and_out() {
    let folder = Folder::new();
    folder.write(
        "scene.toml",
        BALL.replace("[[real]]", "[[real]]\nname = \"floor\"")
            .replace("-0.3, 1]", "-9, 1]"),
    );
    folder.trajectory(3, 0.02, &[1]);
    let stream = y4m(48, 36, 3);
    let pipe = |input: &[u8]| {
        let mut child = folder
            .command(&sequence(&["--frames", "-", "-o", "-"]))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        child
            .stdin
            .take()
            .expect("piped")
            .write_all(input)
            .expect("reads it all");
        child.wait_with_output().expect("ends")
    };
    let output = pipe(&stream);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(String::from_utf8_lossy(&output.stderr).contains("1 passed through"));
    let out = output.stdout;
    assert_eq!(out.len(), stream.len());
    let header = stream.iter().position(|b| *b == b'\n').expect("a line") + 1;
    let frame = (stream.len() - header) / 3;
    let of = |bytes: &[u8], number: usize| bytes[header + number * frame..][..frame].to_vec();
    assert_eq!(out[..header], stream[..header]);
    assert_eq!(of(&out, 1), of(&stream, 1), "passed through");
    let (a, b) = (of(&out, 0), of(&stream, 0));
    assert_ne!(a, b, "the ball is there");
    assert_eq!(a[..6 + 48 * 8], b[..6 + 48 * 8], "the sky keeps its bytes");
    let file = folder.path("film.y4m");
    folder.write("in.y4m", &stream);
    folder.sequence(&["--frames", "in.y4m", "-o", "film.y4m"]);
    let written = std::fs::read(&file).expect("is there");
    assert!(
        written.ends_with(&out[header..]),
        "a file holds the same frames"
    );
    // Read again, as any other program would.
    folder.sequence(&["--frames", "film.y4m", "-o", "again"]);
    assert_eq!(folder.frames_of("again").len(), 3);
}

/// The centre of a small ball in the film lies where the pose puts it.
#[test]
fn an_object_stays_where_the_poses_put_it() {
    let text = "[camera]\nwidth = 160\nheight = 120\nfx = 130\nfy = 131\ncx = 82\ncy = 58\ndistortion = [-0.2, 0.05, 0.001, -0.002, 0]\n[environment]\nradiance = [1, 1, 1]\n\
        [[virtual]]\nshape = \"sphere\"\nscale = 0.04\ntranslation = [0.1, 0.05, -1]\nmaterial = { base_color = [1, 1, 1], unlit = true }\n[render]\nrays_per_pixel = 256\nbackend = \"cpu\"\n";
    let scene = scene(text);
    let centre = DVec3::new(0.1, 0.05, -1.0);
    let mut renderer =
        Renderer::new(scene.clone(), RendererOptions::default(), &Watcher::none()).expect("fits");
    for number in 0..5 {
        let along = f64::from(number);
        let pose = DMat4::from_translation(DVec3::new(0.05 * along, -0.02 * along, 0.4 * along))
            * DMat4::from_rotation_z(0.1 * along)
            * DMat4::from_rotation_y(0.03 * along);
        let mut camera = scene.camera.clone();
        camera.world_from_camera = pose;
        let edit = FrameEdit {
            photo: None,
            camera: camera.clone(),
            lens: scene.lens,
            camera_path: CameraPath::default(),
            time_secs: 0.0,
            seed: number,
            anchor: None,
            coarseness: 1,
        };
        renderer.set_frame(edit, &Watcher::none()).expect("fits");
        renderer
            .advance(Budget::Complete, &Watcher::none())
            .expect("renders");
        let film = renderer.film();
        let mut sums = DVec3::ZERO;
        for (pixel, p) in film.pixels.iter().enumerate() {
            let m = f64::from(p.m) / f64::from(p.n.max(1));
            let (x, y) = (pixel as u32 % film.width, pixel as u32 / film.width);
            sums += m * DVec3::new(f64::from(x) + 0.5, f64::from(y) + 0.5, 1.0);
        }
        // The centre of a ball's picture is not the picture of its centre: the mean over its outline is.
        let outline: Vec<DVec3> = outline(pose.w_axis.truncate(), centre, 0.04);
        let mut expected = DVec3::ZERO;
        let points: Vec<DVec3> = outline
            .iter()
            .map(|p| project(&camera, *p).expect("in front"))
            .collect();
        for (a, b) in points.iter().zip(points.iter().cycle().skip(1)) {
            let area = a.x * b.y - b.x * a.y;
            expected += area * DVec3::new((a.x + b.x) / 3.0, (a.y + b.y) / 3.0, 1.0);
        }
        let off = (sums.truncate() / sums.z - expected.truncate() / expected.z).length();
        assert!(off < 0.01, "frame {number}: {off} px");
        let ahead = project(&scene.camera, centre).expect("in front");
        assert!(
            number == 0 || (sums.truncate() / sums.z - ahead.truncate()).length() > 1.0,
            "control: it moves"
        );
    }
}

/// Where the rays from `eye` touch a sphere.
fn outline(eye: DVec3, centre: DVec3, radius: f64) -> Vec<DVec3> {
    let to = centre - eye;
    let distance = to.length();
    let axis = to / distance;
    let side = axis.any_orthonormal_vector();
    let up = axis.cross(side);
    let sin = radius / distance;
    let middle = centre - axis * radius * sin;
    let reach = radius * (1.0 - sin * sin).sqrt();
    (0..2000)
        .map(|i| {
            let (s, c) = (f64::from(i) * std::f64::consts::TAU / 2000.0).sin_cos();
            middle + (side * c + up * s) * reach
        })
        .collect()
}

/// The renderer's own arithmetic sees known points of the webcam videos where their poses do.
#[test]
fn known_points_of_the_webcam_videos_are_where_the_poses_put_them() {
    for (name, posed) in [
        ("webcam_chessboard_video", 109),
        ("webcam_marker_grid_video", 325),
    ] {
        let Some(path) = shared_data(&format!("{name}/trajectory.json")) else {
            return;
        };
        let folder = Folder::new();
        let trajectory = Trajectory::read(&path).expect("reads");
        let views = Views::new(&trajectory, None, true).expect("no doubles");
        let mut table = String::from("frame,x_px,y_px,x_m,y_m,z_m\n");
        let mut frames = 0;
        for number in 0..trajectory.entries.len() as u32 {
            let name = FrameName::of_stream(number, "video");
            let view = views.of(&name).expect("is there");
            frames += u32::from(view.world_from_camera.is_some());
            for (x, z) in [(0.0, 0.0), (0.075, 0.045), (-0.06, 0.03)] {
                table += &format!("{number},,,{x},0,{z}\n");
            }
        }
        assert_eq!(frames, posed);
        folder.write("points.csv", table);
        folder.write("scene.toml", "[camera]\n");
        let path = path.to_string_lossy().into_owned();
        let check = |more: &[&str]| {
            let mut arguments = vec![
                "sequence",
                "scene.toml",
                "--trajectory",
                &path,
                "--check",
                "points.csv",
            ];
            arguments.extend(more);
            folder.run(&arguments)
        };
        let output = check(&[]);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(
            output.status.code(),
            Some(0),
            "{said}{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let worst = said
            .split("at most ")
            .nth(1)
            .and_then(|rest| rest.split(' ').next());
        let worst: f64 = worst.and_then(|x| x.parse().ok()).expect("a number");
        assert!(worst < 0.01, "{said}");
        eprintln!("{name}: {}", said.trim());
        let seen: Vec<String> = (0..trajectory.entries.len())
            .map(|number| format!("{number},10,10,0,0,0\n"))
            .collect();
        folder.write("points.csv", seen.concat());
        assert_eq!(
            check(&["--stats", "check.json"]).status.code(),
            Some(1),
            "control: points that were seen elsewhere"
        );
        let told = folder.json("check.json");
        assert_eq!(told["points"], posed, "{told:#}");
        let worst = |key: &str| told[key].as_f64().expect("a number");
        assert!(
            worst("largest_px") > 2.0 && worst("own_px") < 0.01,
            "{told:#}"
        );
        assert_eq!(
            told["frames"].as_array().map(Vec::len),
            Some(posed as usize)
        );
    }
}

#[test]
fn the_focus_is_pulled_over_the_range() {
    let folder = Folder::new();
    folder.write(
        "scene.toml",
        format!("{BALL}[lens]\naperture_radius_m = 0.1\nfocus_distance_m = 2\n"),
    );
    folder.frames(3, 0.0);
    let pull = ["--frames", "in", "--focus-pull", "0.8..1.75", "-o"];
    folder.sequence(&[&pull[..], &["pulled"]].concat());
    folder.sequence(&["--frames", "in", "-o", "fixed"]);
    // The ball's front stands at 1.7 m: its edge sharpens from frame to frame.
    let width = |frames: &[(String, Vec<u8>)], number: usize| {
        let image = image::load_from_memory(&frames[number].1)
            .expect("decodes")
            .into_rgb8();
        let before = image::open(folder.path(&format!("in/f_{number:04}.png")))
            .expect("opens")
            .into_rgb8();
        image
            .pixels()
            .zip(before.pixels())
            .filter(|(a, b)| a != b)
            .count()
    };
    let (pulled, fixed) = (folder.frames_of("pulled"), folder.frames_of("fixed"));
    assert_ne!(pulled[0].1, fixed[0].1);
    assert!(width(&pulled, 0) != width(&pulled, 2));
}

/// Memory and the time for a frame do not grow with the number of frames.
#[test]
fn memory_stays_flat() {
    let peak = |count: u32| -> Option<f64> {
        let folder = Folder::new();
        let ball = BALL.replace("rays_per_pixel = 4", "rays_per_pixel = 1");
        folder.write(
            "scene.toml",
            format!("{ball}[shutter]\nexposure_secs = 0.05\nsamples = 1\n"),
        );
        folder.trajectory(count, 0.01, &[]);
        folder.write("in.y4m", y4m(32, 24, count));
        folder.sequence(&[
            "--frames",
            "in.y4m",
            "-o",
            "out.y4m",
            "--stats",
            "stats.json",
        ]);
        let stats = std::fs::read_to_string(folder.path("stats.json")).expect("is there");
        let stats: serde_json::Value = serde_json::from_str(&stats).expect("parses");
        assert_eq!(stats["frames"]["rendered"], count);
        stats["peak_memory_mib"].as_f64()
    };
    let (Some(few), Some(many)) = (peak(10), peak(150)) else {
        eprintln!("SKIPPED: this system does not tell a process's peak memory");
        return;
    };
    eprintln!("peak memory: {few:.1} MiB after 10 frames, {many:.1} MiB after 150");
    assert!(many < few + 4.0, "{few} MiB, {many} MiB");
}

/// The trajectory alone brings the lens. Control: a frame without a pose is an error unless such frames may pass.
#[test]
fn the_first_frame_may_be_one_that_has_no_pose() {
    let folder = Folder::new();
    folder.write("scene.toml", BALL.replace("fx = 40", ""));
    folder.frames(3, 0.1);
    let frames: Vec<String> = (1..3)
        .map(|number| {
            format!(
                r#"{{"file_path": "f_{number:04}.png", "fl_x": 40, "fl_y": 40, "cx": 24, "cy": 18, "w": 48, "h": 36, "camera_model": "PINHOLE", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}"#
            )
        })
        .collect();
    folder.write(
        "poses.json",
        format!("{{\"frames\": [{}]}}", frames.join(", ")),
    );
    folder.refuse_sequence(&["--frames", "in", "-o", "out"], "it has no pose for");
    folder.sequence(&["--frames", "in", "--missing-poses", "pass", "-o", "out"]);
    let (before, after) = (folder.frames_of("in"), folder.frames_of("out"));
    let same: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a.1 == b.1).collect();
    assert_eq!(same, [true, false, false]);
}
