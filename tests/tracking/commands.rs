//! `mixray track` on films whose camera is known.

use glam::{DMat4, DVec2, DVec3};
use mixray::tracking::Family;
use serde_json::Value;

use super::film::{Film, INK, View, looking, markers, squares};
use crate::support::{Folder, stderr};

const BOARD: &str =
    "family = \"apriltag-36h11\"\n[grid]\ncolumns = 4\nrows = 3\nside_m = 0.04\ngap_m = 0.02\n";

/// As OpenCV has it, whose pixel centres count from 0.
pub const LENS_OF_THE_FILM: &str = "%YAML:1.0\nimage_width: 480\nimage_height: 360\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 520., 0., 235.5, 0., 519., 183.5, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.2, 0.1, 0., 0., 0. ]\n";

fn tags() -> &'static Family {
    Family::named("apriltag-36h11").unwrap()
}

pub fn pose(frame: &Value) -> DMat4 {
    let number =
        |row: usize, column: usize| frame["world_from_camera"][row][column].as_f64().unwrap();
    DMat4::from_cols_array_2d(&std::array::from_fn(|column| {
        std::array::from_fn(|row| number(row, column))
    }))
}

/// Millimetres between the eyes, degrees between the views.
pub fn off(pose: &DMat4, truth: &View) -> (f64, f64) {
    let eye = -(truth.rotation.transpose() * truth.translation);
    let along = truth.rotation.transpose() * DVec3::Z;
    let own = pose.transform_vector3(DVec3::NEG_Z);
    (
        1e3 * (pose.transform_point3(DVec3::ZERO) - eye).length(),
        own.angle_between(along).to_degrees(),
    )
}

#[test]
fn poses_lens_and_gamma_of_a_known_camera() {
    let folder = Folder::new();
    let film = Film::around();
    film.save(&folder, "film.y4m", &markers(tags(), 4, 3, 0.04, 0.02));
    folder.write("board.toml", BOARD);
    let said = folder.succeed("track film.y4m --board board.toml --board-flatness rigid -o poses.json --report track.json");
    assert!(
        said.contains("apriltag-36h11, 12 ids") && said.contains("8 of 8 with a pose"),
        "{said}"
    );
    let poses = folder.json("poses.json");
    let frames = poses["frames"].as_array().unwrap();
    for (index, (frame, view)) in frames.iter().zip(&film.views).enumerate() {
        let (mm, degrees) = off(&pose(frame), view);
        assert!(
            mm < 1.0 && degrees < 0.1,
            "frame {index}: {mm:.3} mm, {degrees:.4} degrees"
        );
        let (control, _) = off(&pose(frame), &film.views[(index + 1) % 8]);
        assert!(control > 50.0);
    }
    let focal = poses["camera"]["fx"].as_f64().unwrap();
    let report = folder.json("track.json");
    let sigma = report["camera_sigma"]["fx"].as_f64().unwrap();
    assert!(
        (focal - film.lens.focal.x).abs() < 5.0 * sigma && sigma < 1.0,
        "{focal} +- {sigma}"
    );
    let gamma: f64 = report["gamma"].as_str().unwrap().parse().unwrap();
    assert!((gamma - film.gamma).abs() < 0.2, "{gamma}");
    assert!(report["rms_px"].as_f64().unwrap() < 0.08);

    // The calibration is what OpenCV would write, and holds.
    folder.succeed("track film.y4m --board board.toml --intrinsics poses.yaml --fix-intrinsics --gamma 2.2 -o again.json");
    let again = folder.json("again.json");
    assert_eq!(again["camera"]["cx"], poses["camera"]["cx"]);
    let (mm, _) = off(&pose(&again["frames"][0]), &film.views[0]);
    assert!(mm < 1.0, "{mm}");
}

#[test]
fn barcodes_of_artoolkit_are_told_from_those_that_they_are_part_of() {
    let folder = Folder::new();
    let film = Film::around();
    for name in [
        "artoolkit-3x3-parity",
        "artoolkit-4x4",
        "artoolkit-4x4-bch-13-9-3",
        "artoolkit-5x5-bch-22-7-7",
    ] {
        let family = Family::named(name).unwrap();
        film.save(&folder, "film.y4m", &markers(family, 4, 3, 0.05, 0.01));
        let said = folder.succeed("track film.y4m --marker-size 50mm --gamma 2.2 -o poses.json");
        assert!(said.contains(&format!("{name}, 12 ids")), "{said}");
    }
    // Its words under another name.
    folder.refuse(
        "track film.y4m --marker-size 50mm --family aruco-5x5 -o poses.json",
        "give --family artoolkit-5x5-bch-22-7-7",
    );
}

#[test]
fn markers_are_put_together_where_no_board_is_given() {
    let folder = Folder::new();
    let film = Film::around();
    film.save(&folder, "film.y4m", &markers(tags(), 4, 3, 0.04, 0.02));
    folder
        .succeed("track film.y4m --marker-size 40mm --gamma 2.2 -o poses.json --report track.json");
    let report = folder.json("track.json");
    let point = |id: &str, corner: u64| {
        let first = report["board"]["first_point_of_marker"][id]
            .as_u64()
            .unwrap();
        let numbers = &report["board"]["points_m"][(first + corner) as usize];
        DVec3::new(
            numbers[0].as_f64().unwrap(),
            numbers[1].as_f64().unwrap(),
            numbers[2].as_f64().unwrap(),
        )
    };
    // Markers 0 and 11 lie three columns and two rows apart.
    let expected = 0.06 * DVec2::new(3.0, 2.0).length();
    let found = point("0", 0).distance(point("11", 0));
    assert!((found - expected).abs() < 0.5e-3, "{found}");
    let focal = report["camera"]["fx"].as_f64().unwrap();
    assert!((focal - film.lens.focal.x).abs() < 5.0, "{focal}");
}

#[test]
fn what_cannot_be_tracked_says_what_to_do() {
    let folder = Folder::new();
    let mut film = Film::around();
    folder.write("board.toml", BOARD);
    let print = markers(tags(), 4, 3, 0.04, 0.02);
    film.save(&folder, "film.y4m", &print);
    film.save(&folder, "mirrored.y4m", &|at| {
        print(DVec2::new(-at.x, at.y))
    });
    folder.refuse(
        "track mirrored.y4m --marker-size 40mm -o poses.json",
        "ffmpeg -vf hflip",
    );
    folder.refuse(
        "track film.y4m --marker-size 40mm --family aruco-4x4 -o poses.json",
        "give --family apriltag-36h11",
    );
    for (line, part) in [
        (
            "track film.y4m --family hiro --marker-size 4cm -o poses.json",
            "there is no family hiro",
        ),
        (
            "track film.y4m --marker-size 40 -o poses.json",
            "expected a length with its unit",
        ),
        ("track film.y4m -o poses.json", "--board"),
    ] {
        let output = folder.run(line);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    }
    folder.write("wide.toml", BOARD.replace("gap_m = 0.02", "gap_m = 0.035"));
    folder.refuse(
        "track film.y4m --board wide.toml --gamma 2.2 -o poses.json",
        "measure sides and gaps again",
    );
    // One view, straight on.
    film.views = vec![looking(0.0, 0.01, 0.5, 0.1); 2];
    film.save(&folder, "still.y4m", &print);
    folder.refuse(
        "track still.y4m --board board.toml --gamma 2.2 -o poses.json",
        "do not determine the lens",
    );
    assert!(!folder.path("poses.json").exists());
}

#[test]
fn frames_without_the_board_have_null_poses_that_a_sequence_passes() {
    let folder = Folder::new();
    let mut film = Film::around();
    let away = View {
        translation: DVec3::new(0.0, 9.0, 1.0),
        ..film.views[2]
    };
    film.views.insert(3, away);
    film.save(&folder, "film.y4m", &markers(tags(), 4, 3, 0.04, 0.02));
    folder.write("board.toml", BOARD);
    folder.succeed("track film.y4m --board board.toml --gamma 2.2 -o poses.json");
    let poses = folder.json("poses.json");
    assert!(poses["frames"][3]["world_from_camera"].is_null());
    assert!(
        poses["frames"][3]["why"]
            .as_str()
            .unwrap()
            .contains("nothing of the board")
    );
    folder.write("scene.toml", "[camera]\n[[virtual]]\nshape = \"box\"\nscale = 0.02\n[environment]\nradiance = [1.0, 1.0, 1.0]\n");
    folder.write(
        "points.csv",
        "frame,x_px,y_px,x_m,y_m,z_m\n0,,,0,0,0\n3,,,0,0,0\n",
    );
    let checked = folder.succeed(
        "sequence scene.toml --frames film.y4m --trajectory poses.json --check points.csv",
    );
    assert!(checked.contains("1 in frames without a pose"), "{checked}");
}

#[test]
fn streams_that_break_off_or_are_noise_end_without_a_panic() {
    let folder = Folder::new();
    let mut film = Film::around();
    film.views.truncate(3);
    film.save(&folder, "film.y4m", &markers(tags(), 4, 3, 0.04, 0.02));
    let whole = folder.bytes("film.y4m");
    folder.write("cut.y4m", &whole[..whole.len() - 4000]);
    let cut = folder.run("track cut.y4m --marker-size 40mm --gamma 2.2 -o poses.json");
    assert!(matches!(cut.status.code(), Some(0 | 2)), "{cut:?}");
    let mut random = crate::support::Random(5);
    let header = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let mut noise = whole[..header].to_vec();
    let frame = (whole.len() - header) / 3;
    for _ in 0..3 {
        noise.extend(b"FRAME\n");
        noise.extend((6..frame).map(|_| random.bits() as u8));
    }
    folder.write("noise.y4m", noise);
    folder.refuse(
        "track noise.y4m --marker-size 40mm -o poses.json",
        "expected black squares",
    );
    let smaller = String::from_utf8_lossy(&whole[..header]).replace("W480", "W240");
    let (first, second) = whole[header..].split_at(frame);
    let changed = [&whole[..header], first, smaller.as_bytes(), second].concat();
    folder.write("changed.y4m", changed);
    folder.refuse(
        "track changed.y4m --marker-size 40mm -o poses.json",
        "expected frames of one size",
    );
    // Damaged anywhere, header and frames' marks included.
    for _ in 0..12 {
        let mut damaged = whole.clone();
        for _ in 0..4 {
            let at = random.bits() as usize % damaged.len();
            let near = match random.bits() % 3 {
                0 => at % header,
                1 => header + at / frame % 3 * frame + at % 6,
                _ => at,
            };
            let end = damaged.len().min(near + 1 + random.bits() as usize % 9);
            damaged[near..end].fill_with(|| random.bits() as u8);
        }
        folder.write("damaged.y4m", damaged);
        let output = folder.run("track damaged.y4m --marker-size 40mm --gamma 2.2 -o poses.json");
        let said = stderr(&output);
        assert!(
            matches!(output.status.code(), Some(0 | 2)) && !said.contains("panicked"),
            "{said}"
        );
    }
}

/// A screen full of dark squares without a code: no pose is invented, whichever families are tried.
#[test]
fn squares_that_are_no_markers_have_no_pose() {
    let folder = Folder::new();
    let mut film = Film::around();
    film.views.truncate(3);
    film.save(
        &folder,
        "film.y4m",
        &squares((7, 5), (0.03, 0.01), |_, _| INK),
    );
    folder.write("board.toml", BOARD);
    for target in ["--marker-size 30mm", "--board board.toml"] {
        folder.refuse(
            &format!("track film.y4m {target} -o poses.json"),
            "expected",
        );
        assert!(!folder.path("poses.json").exists());
    }
}

#[test]
fn a_first_object_stands_on_the_board() {
    let folder = Folder::new();
    let mut film = Film::around();
    film.views.truncate(4);
    film.save(&folder, "film.y4m", &markers(tags(), 4, 3, 0.04, 0.02));
    folder.write("board.toml", BOARD);
    folder.succeed("track film.y4m --board board.toml --gamma 2.2 -o poses.json --scene scene.toml --overlay check.y4m --sheet check.png");
    folder.succeed("info scene.toml");
    let sheet = folder.open("check.png");
    assert_eq!((sheet.width(), sheet.height()), (4 * 240, 3 * 180));
    // Four frames with green sides; the rest of the sheet is empty.
    let green = |x: u32, y: u32| {
        let [r, g, b] = sheet.get_pixel(x, y).0.map(i32::from);
        g > r + 40 && g > b + 40
    };
    let count = |rows: std::ops::Range<u32>| {
        rows.flat_map(|y| (0..960).map(move |x| (x, y)))
            .filter(|(x, y)| green(*x, *y))
            .count()
    };
    assert!(count(0..180) > 1000 && count(180..540) == 0);
    let film_bytes = folder.bytes("check.y4m");
    let header = film_bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    assert_eq!(film_bytes.len(), header + 4 * (6 + 3 * 480 * 360));

    folder.succeed(
        "sequence scene.toml --frames film.y4m --trajectory poses.json --range 0..1 --rpp 4 -o out",
    );
    let mut written = std::fs::read_dir(folder.path("out")).unwrap();
    let picture = written.find_map(|entry| {
        let path = entry.unwrap().path();
        path.extension()
            .is_some_and(|e| e == "png")
            .then(|| image::open(path).unwrap().to_rgb8())
    });
    let picture = picture.expect("a picture");
    let view = &film.views[0];
    let at = view.rotation * DVec3::new(0.0, 0.025, 0.0) + view.translation;
    let pixel = film.lens.pixel_of(DVec2::new(at.x, at.y) / at.z);
    let [r, g, b] = picture
        .get_pixel(pixel.x as u32, pixel.y as u32)
        .0
        .map(i32::from);
    assert!(r > g + 20 && r > b + 20, "{r} {g} {b}");
}

#[test]
fn boards_to_print() {
    let folder = Folder::new();
    folder.write("board.toml", BOARD);
    folder.succeed("track --print-board board.toml -o board.svg");
    let svg = folder.read("board.svg");
    assert!(svg.starts_with("<svg") && svg.contains("100 mm"));
    folder.succeed("track --print-board board.toml -o board.pdf");
    assert!(folder.bytes("board.pdf").starts_with(b"%PDF-"));
    folder.refuse("track --print-board board.toml -o board.png", "svg");
    folder.write(
        "nameless.toml",
        BOARD.replace("family = \"apriltag-36h11\"\n", ""),
    );
    folder.refuse(
        "track --print-board nameless.toml -o other.svg",
        "expected `family`",
    );
}

#[test]
fn poses_are_smoothed_within_their_covariances_where_that_is_asked_for() {
    let folder = Folder::new();
    let mut film = Film::around();
    film.views = (0..8)
        .map(|index| {
            looking(
                0.05 * f64::from(index),
                0.5,
                0.5 + 0.004 * f64::from(index * index),
                0.1,
            )
        })
        .collect();
    film.save(&folder, "film.y4m", &markers(tags(), 4, 3, 0.04, 0.02));
    folder.write("board.toml", BOARD);
    folder.write("lens.yaml", LENS_OF_THE_FILM);
    let line = "track film.y4m --board board.toml --board-flatness rigid --gamma 2.2 --intrinsics lens.yaml --fix-intrinsics";
    folder.succeed(&format!("{line} -o own.json"));
    let said = folder.succeed(&format!("{line} --smooth -o smooth.json"));
    assert!(said.contains("smooth:  8 poses moved"), "{said}");
    let (own, smooth) = (folder.json("own.json"), folder.json("smooth.json"));
    let mut errors = [0.0; 2];
    for (index, view) in film.views.iter().enumerate() {
        for (error, poses) in errors.iter_mut().zip([&own, &smooth]) {
            *error += off(&pose(&poses["frames"][index]), view).0.powi(2);
        }
        let moved_mm = 1e3 * smooth["frames"][index]["smoothed_by_m"].as_f64().unwrap();
        assert!(moved_mm > 0.0 && moved_mm < 1.0, "{moved_mm}");
        assert!(own["frames"][index]["smoothed_by_m"].is_null());
    }
    assert!(errors[1] < 1.05 * errors[0], "{errors:?}");
}
