//! `mixray live` on films whose camera is known, fed frame by frame.

use std::io::{Read, Write};
use std::process::{Child, Stdio};

use glam::DVec3;
use mixray::tracking::Family;

use crate::support::{Folder, Random, stderr};
use crate::tracking::film::{Film, View, looking, markers};

const BOARD: &str =
    "family = \"apriltag-36h11\"\n[grid]\ncolumns = 4\nrows = 3\nside_m = 0.04\ngap_m = 0.02\n";

const SCENE: &str = "[camera]
fx = 520.0
fy = 519.0
cx = 236.0
cy = 184.0
distortion = [-0.2, 0.1, 0.0, 0.0]
[environment]
radiance = [1.0, 1.0, 1.0]
[[virtual]]
shape = \"box\"
size = [0.04, 0.04, 0.04]
translation = [0.0, 0.0201, 0.0]
";

pub const LIVE: &str = "live scene.toml --board board.toml --gamma 2.2 --backend cpu --rpp 2";

/// Five views, the marker out of sight in the fourth.
fn film() -> Film {
    let mut film = Film::around();
    film.views.truncate(4);
    let away = View {
        translation: DVec3::new(0.0, 9.0, 1.0),
        ..film.views[2]
    };
    film.views.insert(3, away);
    film
}

/// The scene, the board, and the film as the stream's bytes.
pub fn prepared() -> (Folder, Vec<u8>) {
    let folder = Folder::new();
    folder.write("board.toml", BOARD);
    folder.write("scene.toml", SCENE);
    let tags = Family::named("apriltag-36h11").unwrap();
    film().save(&folder, "film.y4m", &markers(tags, 4, 3, 0.04, 0.02));
    let stream = folder.bytes("film.y4m");
    (folder, stream)
}

/// The header with its end, and the frames with their markers.
pub fn parts(stream: &[u8]) -> (&[u8], Vec<&[u8]>) {
    let header = 1 + stream.iter().position(|byte| *byte == b'\n').unwrap();
    let planes = 480 * 360 * 3 / 2;
    let frames = stream[header..].chunks(b"FRAME\n".len() + planes);
    (&stream[..header], frames.collect())
}

fn begin(folder: &Folder, line: &str) -> Child {
    let mut command = folder.command(line);
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    command.stderr(Stdio::piped()).spawn().unwrap()
}

/// Sends each frame once the one before has come back; what came back.
fn in_step(folder: &Folder, line: &str, stream: &[u8]) -> Vec<Vec<u8>> {
    let (header, frames) = parts(stream);
    let mut child = begin(folder, line);
    let (mut to, mut from) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    to.write_all(header).unwrap();
    let mut all = Vec::new();
    for (index, frame) in frames.into_iter().enumerate() {
        to.write_all(frame).unwrap();
        if index == 0 {
            let mut back = vec![0; header.len()];
            from.read_exact(&mut back).unwrap();
            assert_eq!(back, header, "a stream's form is kept");
        }
        let mut back = vec![0; frame.len()];
        from.read_exact(&mut back).unwrap();
        all.push(back);
    }
    drop(to);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    all
}

/// Pixels whose brightness differs.
fn changed(a: &[u8], b: &[u8]) -> usize {
    let luma = b"FRAME\n".len()..480 * 360;
    a[luma.clone()]
        .iter()
        .zip(&b[luma])
        .filter(|(a, b)| a != b)
        .count()
}

#[test]
fn a_frame_goes_out_before_the_next_comes_and_a_lost_marker_keeps_its_pose_for_a_while() {
    let (folder, stream) = prepared();
    let (_, frames) = parts(&stream);
    let held = in_step(
        &folder,
        &format!("{LIVE} --hold 100 --stats stats.json"),
        &stream,
    );
    for (frame, out) in frames.iter().zip(&held) {
        let share = changed(frame, out) as f64 / (480.0 * 360.0);
        assert!((0.002..0.2).contains(&share), "the box covers {share}");
    }
    let counts = folder.json("stats.json")["total"]["frames"].clone();
    assert_eq!(
        (&counts["rendered"], &counts["held"]),
        (&4.into(), &1.into())
    );
    assert_eq!(
        (&counts["arrived"], &counts["dropped"]),
        (&5.into(), &0.into())
    );
    let passed = in_step(&folder, &format!("{LIVE} --hold 0"), &stream);
    assert_eq!(
        passed[3], frames[3],
        "without a pose a frame passes through"
    );
    assert!(changed(frames[2], &passed[2]) > 300);
}

#[test]
fn the_newest_frame_wins_and_the_others_are_counted_in_order() {
    let (folder, stream) = prepared();
    let (_, frames) = parts(&stream);
    let mut long = stream.clone();
    for _ in 0..7 {
        long.extend(frames.concat());
    }
    let mut child = begin(&folder, &format!("{LIVE} --stats stats.json"));
    let mut to = child.stdin.take().unwrap();
    let sent = long.clone();
    let feeding = std::thread::spawn(move || to.write_all(&sent));
    let output = child.wait_with_output().unwrap();
    feeding.join().unwrap().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let (_, out) = parts(&output.stdout);
    let counts = folder.json("stats.json")["total"]["frames"].clone();
    let count = |name: &str| counts[name].as_u64().unwrap();
    let written = count("rendered") + count("held") + count("passed_through");
    assert_eq!(count("arrived"), 40);
    assert_eq!(count("dropped") + written, 40);
    assert_eq!(out.len() as u64, written);
    // The upper left corner is the photograph's, and noise makes each view's its own.
    let corner = |frame: &[u8]| frame[..600].to_vec();
    let view = |frame: &[u8]| frames.iter().position(|own| corner(own) == corner(frame));
    assert!(out.iter().all(|frame| view(frame).is_some()));
    assert_eq!(view(out[out.len() - 1]), Some(4), "the last frame goes out");
}

/// Pixels of a frame whose brightness differs from another's, row-major.
fn differs(a: &[u8], b: &[u8]) -> Vec<bool> {
    let luma = b"FRAME\n".len()..b"FRAME\n".len() + 480 * 360;
    let pairs = a[luma.clone()].iter().zip(&b[luma]);
    pairs.map(|(a, b)| a != b).collect()
}

/// That `changed` holds pixels only where `fine` does, or 12 pixels beside.
fn assert_near(changed: &[bool], fine: &[bool]) {
    let is_near = |pixel: usize| {
        let (x, y) = (pixel % 480, pixel / 480);
        (y.saturating_sub(12)..(y + 13).min(360))
            .any(|y| (x.saturating_sub(12)..(x + 13).min(480)).any(|x| fine[480 * y + x]))
    };
    assert!((0..480 * 360).all(|pixel| !changed[pixel] || is_near(pixel)));
}

/// Where there is no time, pictures are coarser: what they change lies where the whole picture changes the frame or next to it, and all else is the
/// stream's to the bit. Control: the whole picture is another one.
#[test]
fn pictures_that_do_not_fit_into_their_time_are_coarser_and_change_nothing_else() {
    let (folder, stream) = prepared();
    let (_, frames) = parts(&stream);
    let run = |flags: &str| {
        let line = format!("{LIVE} --hold 0 {flags} --stats stats.json");
        let out = in_step(&folder, &line, &stream);
        let total = folder.json("stats.json")["total"].clone();
        let number = |name: &str| total[name].as_f64().unwrap();
        (out, number("coarseness"), number("rays_per_pixel"))
    };
    let (whole, coarseness, rays) = run("--fps 10000 --coarsest 1");
    assert_eq!((coarseness, rays), (1.0, 1.0));
    let (coarse, coarseness, rays) = run("--fps 10000");
    // What two frames take is not known beforehand.
    assert!(coarseness > 2.0 && rays < 0.6, "{coarseness} {rays}");
    let last = frames.len() - 1;
    let (fine, rough) = (
        differs(frames[last], &whole[last]),
        differs(frames[last], &coarse[last]),
    );
    let count = |changed: &[bool]| changed.iter().filter(|changed| **changed).count();
    assert_near(&rough, &fine);
    let share = count(&rough) as f64 / count(&fine) as f64;
    assert!((0.9..2.0).contains(&share), "{share}");
    let between = count(&differs(&whole[last], &coarse[last]));
    assert!(between > 100, "control: {between}");
    assert_eq!(
        coarse[3], frames[3],
        "without a pose a frame passes through"
    );
}

/// A camera that rests gets the whole picture, however little time a frame has, while frames go on: that of one frame to the bit. Control: before, they
/// are coarse.
#[test]
fn the_picture_of_a_resting_camera_grows_until_it_is_whole() {
    let (folder, stream) = prepared();
    let (header, frames) = parts(&stream);
    let line = |flags: &str| LIVE.replace("--rpp 2", "--rpp 1 ") + flags;
    let whole = in_step(&folder, &line("--fps 10000 --coarsest 1"), &stream);
    let mut child = begin(&folder, &line("--fps 100"));
    let (mut to, mut from) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    to.write_all(header).unwrap();
    to.write_all(frames[0]).unwrap();
    from.read_exact(&mut vec![0; header.len()]).unwrap();
    let mut next = |is_last: bool| {
        let mut frame = vec![0; frames[0].len()];
        from.read_exact(&mut frame).unwrap();
        if !is_last {
            std::thread::sleep(std::time::Duration::from_millis(20));
            to.write_all(frames[0]).unwrap();
        }
        frame
    };
    // What two frames take is not known beforehand.
    (0..4).for_each(|_| drop(next(false)));
    let coarse = next(false);
    assert!(changed(&coarse, &whole[0]) > 100, "control");
    let grown = (0..2000).any(|_| next(false) == whole[0]);
    assert!(grown, "it does not become the whole picture");
    assert!(next(true) == whole[0], "it stays");
    drop(to);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn streams_that_break_off_change_or_are_noise_end_with_an_error() {
    let (folder, stream) = prepared();
    let fed = |bytes: &[u8]| {
        folder.write("in.y4m", bytes);
        folder.run(&format!("{LIVE} --input in.y4m"))
    };
    let (header, frames) = parts(&stream);
    let refused = |bytes: &[u8], part: &str| {
        let output = fed(bytes);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    };
    refused(&stream[..stream.len() - 4000], "truncated");
    let smaller = String::from_utf8_lossy(header).replace("W480", "W240");
    let change = [header, frames[0], smaller.as_bytes(), frames[1]].concat();
    refused(&change, "expected frames of one size");
    refused(b"no stream\n", "YUV4MPEG2");
    let mut random = Random(5);
    let mut noise = [header, b"FRAME\n"].concat();
    noise.extend((0..480 * 360 * 3 / 2).map(|_| random.bits() as u8));
    let output = fed(&noise);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(parts(&output.stdout).1, [&noise[header.len()..]]);
    refused(
        &[&noise[..], &noise[header.len() + 6..]].concat(),
        "does not begin with FRAME",
    );
    folder.refuse(
        "live scene.toml --board board.toml --input in.y4m -o out.png",
        ".y4m file",
    );
    folder.refuse(
        "live scene.toml --board absent.toml --input in.y4m",
        "cannot be read",
    );
    for (time, part) in [
        ("50ms", "a frame takes 40.0 ms"),
        ("solve", "mixray track --readout-time solve"),
    ] {
        folder.write("in.y4m", &stream);
        let line = format!("{LIVE} --input in.y4m --readout-time {time}");
        let output = folder.run(&line);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    }
}

#[test]
fn a_board_is_taken_over_as_it_was_learnt() {
    let (folder, stream) = prepared();
    folder.succeed("track film.y4m --board board.toml --board-flatness rigid -o poses.json --report track.json");
    let line =
        "live scene.toml --board track.json --intrinsics poses.yaml --backend cpu --rpp 1 --hold 0";
    let (_, frames) = parts(&stream);
    let out = in_step(&folder, line, &stream);
    assert!(changed(frames[0], &out[0]) > 300);
    assert_eq!(changed(frames[3], &out[3]), 0);
    folder.write("wrong.json", "{ \"gamma\": \"srgb\" }");
    folder.write("film.y4m", &stream);
    folder.refuse(
        "live scene.toml --board wrong.json --input film.y4m",
        "--report",
    );
}

const ONE_MARKER: &str =
    "family = \"apriltag-36h11\"\n[grid]\ncolumns = 1\nrows = 1\nside_m = 0.09\ngap_m = 0.02\n";

/// A marker that moves by 30 pixels, is covered by a hand, is found again 100 pixels further, and then hardly moves.
fn covered() -> (Folder, Vec<u8>) {
    let folder = Folder::new();
    folder.write("board.toml", ONE_MARKER);
    let tags = Family::named("apriltag-36h11").unwrap();
    let begin = looking(0.6, 0.5, 0.45, 0.1);
    let aside = |x_m: f64| View {
        translation: begin.translation + DVec3::new(x_m, 0.0, 0.0),
        ..begin
    };
    let film = Film {
        views: [0.04, 0.014, 0.014, -0.075, -0.076].map(aside).to_vec(),
        ..Film::around()
    };
    film.save(&folder, "film.y4m", &markers(tags, 1, 1, 0.09, 0.02));
    let mut stream = folder.bytes("film.y4m");
    let header = parts(&stream).0.len();
    let frame = b"FRAME\n".len() + 480 * 360 * 3 / 2;
    let luma = header + 2 * frame + b"FRAME\n".len();
    for row in 0..180 {
        // Over half of the marker.
        stream[luma + 480 * row..][..480].fill(90);
    }
    (folder, stream)
}

/// The paper's blur: along the way from one pose to the next, if it is neither too short nor too long. What the tracking of one marker throws out,
/// which is the way to where it is found again after it was covered, is no blur. Control: without the two thresholds it is.
#[test]
fn blur_is_of_ways_between_both_thresholds_and_not_of_a_covered_marker() {
    let (folder, stream) = covered();
    let run = |thresholds: Option<[f32; 2]>| {
        let blur = thresholds.map_or(String::new(), |[min, max]| {
            format!(
                "[motion_blur]\nmethod = \"copies\"\nmin_length_px = {min}\nmax_length_px = {max}\n"
            )
        });
        folder.write("scene.toml", format!("{SCENE}{blur}"));
        // Runs that are compared are of one size, whatever time they have.
        let line = "live scene.toml --board board.toml --gamma 2.2 --backend cpu --rpp 1 --coarsest 1 --hold 100 --stats stats.json";
        in_step(&folder, line, &stream)
    };
    let sharp = run(None);
    let counts = folder.json("stats.json")["total"]["frames"].clone();
    assert_eq!(
        (&counts["rendered"], &counts["held"]),
        (&4.into(), &1.into())
    );
    let blurred = |frames: Vec<Vec<u8>>| -> Vec<bool> {
        let pairs = frames.iter().zip(&sharp);
        pairs
            .map(|(frame, sharp)| changed(frame, sharp) > 200)
            .collect()
    };
    assert_eq!(
        blurred(run(Some([5.0, 60.0]))),
        [false, true, false, false, false]
    );
    assert_eq!(
        blurred(run(Some([0.2, 1000.0]))),
        [false, true, false, true, true]
    );
}
