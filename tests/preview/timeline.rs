//! The timeline: each frame as `mixray sequence` renders it, scrubbed, edited and rendered beside the preview.

use mixray::preview::frames::Frames;
use mixray::preview::headless::{self, Failed, Window};
use mixray::preview::script::parse;
use mixray::preview::session::Session;
use mixray::preview::window::App;

use super::{FRAME_TIME, SCENE};
use crate::support::Folder;

const POSES: &str = "\
frames_per_second = 10.0

[[frame]]
frame = 0
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.0, 0.0]

[[frame]]
frame = 1
position = [0.1, 1.0, 3.0]
look_at = [0.0, 0.0, 0.0]
focus_distance_m = 2.5

[[frame]]
frame = 2
position = [0.3, 1.0, 2.9]
look_at = [0.0, 0.0, 0.0]

[[frame]]
frame = 3
pose = \"null\"
";

/// Four frames, the last without a pose.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", SCENE);
    folder.write("poses.toml", POSES);
    folder.create("frames");
    for n in 0..4_u8 {
        let name = format!("frames/frame_{n:04}.png");
        folder.save(&name, 64, 48, |x, y| [x as u8 * 3, y as u8 * 4, 60 * n]);
    }
    folder
}

fn session(folder: &Folder) -> Session {
    let frames = Frames::open(&folder.path("frames"), &folder.path("poses.toml")).unwrap();
    let mut session = Session::open(&folder.path("scene.toml"), FRAME_TIME, || ()).unwrap();
    session.follow(frames);
    session
}

fn run(folder: &Folder, script: &str) -> Result<(), Failed> {
    let steps = parse(script).unwrap();
    headless::run_on(session(folder), &steps, &mut |_| ())
}

fn sequence(folder: &Folder, range: &str, out: &str) {
    folder.succeed(&format!(
        "sequence scene.toml --frames frames --trajectory poses.toml --range {range} -o {out}"
    ));
}

#[test]
fn a_frame_is_shown_as_the_sequence_renders_it() {
    let folder = folder();
    sequence(&folder, "2..3", "out");
    let shown = folder.path("shown.png");
    let other = folder.path("other.png");
    // A sequence's frame has the seed plus its number.
    let script = format!(
        "expect frame 0\nframe 2\nexpect frame 2\nset seed 2\nwait complete\npicture {}\nset seed 3\nwait complete\npicture {}\n",
        shown.display(),
        other.display()
    );
    run(&folder, &script).unwrap();
    let rendered = folder.open("out/frame_0002.png");
    assert_eq!(folder.open("shown.png"), rendered);
    assert_ne!(folder.open("other.png"), rendered, "control: another seed");
}

#[test]
fn edits_outlast_the_frame_and_the_camera_stays_the_frames() {
    let folder = folder();
    run(
        &folder,
        "\
expect saved
frame 1
expect saved
expect focus_distance_m 2.5
set f_number 4
frame 2
expect f_number 4
expect focus_distance_m 3
undo
expect f_number 1.8
expect frame 2
redo
save
",
    )
    .unwrap();
    let text = folder.read("scene.toml");
    assert_eq!(text, SCENE.replace("f_number = 1.8", "f_number = 4.0"));
    let failed = run(&folder, "frame 3").unwrap_err();
    assert!(failed.problem.contains("no frame 3"), "{failed:?}");
}

#[test]
fn a_range_is_rendered_beside_the_preview() {
    let folder = folder();
    sequence(&folder, "0..2", "out");
    let beside = folder.path("beside");
    run(&folder, &format!("range 0 2 {}\n", beside.display())).unwrap();
    for frame in ["frame_0000.png", "frame_0001.png"] {
        let [a, b] = ["out", "beside"].map(|at| folder.open(&format!("{at}/{frame}")));
        assert_eq!(a, b, "{frame}");
    }
    assert!(!folder.path("beside/frame_0002.png").exists());
    let unsaved = "set f_number 4\nrange 0 2 elsewhere\n";
    let failed = run(&folder, unsaved).unwrap_err();
    assert!(failed.problem.contains("unsaved edits"), "{failed:?}");
}

#[test]
fn it_plays_to_the_last_frame_and_names_its_command() {
    let folder = folder();
    let mut window = Window::new(App::new(session(&folder)));
    window.wait_for_scene().unwrap();
    window.press("Play").unwrap();
    let end = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while window.session().frame() < 2 && std::time::Instant::now() < end {
        window.frame();
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(window.session().frame(), 2);
    let command = window.session().range_command((0, 3), "a b");
    assert!(
        command.contains("--range 0..3 -o 'a b'") && command.starts_with("mixray sequence "),
        "{command}"
    );
}

#[test]
fn films_and_poses_of_other_frames_are_refused() {
    let folder = folder();
    let refused = |frames: &str, poses: &str| {
        let opened = Frames::open(&folder.path(frames), &folder.path(poses));
        opened.err().expect("it cannot be used")
    };
    folder.write("others.toml", POSES.replace("frame = ", "frame = 7"));
    assert!(refused("frames", "others.toml").contains("a pose for none"));
    assert!(refused("frames", "nothing.toml").contains("nothing.toml"));
    folder.create("empty");
    assert!(refused("empty", "poses.toml").contains("expected"));
}
