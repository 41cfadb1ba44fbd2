//! The real window, on a display of its own: Xvfb, and xdotool at the mouse and the keys. Both are in `.ci/run`'s packages; without them nothing
//! is tested, and said so.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use glam::DVec2;
use mixray::preview::document::Document;
use mixray::scene::load;

use super::{demo, window};
use crate::live::{LIVE, parts, prepared};
use crate::support::Folder;

/// Nothing that is waited for takes longer.
const PATIENCE: Duration = Duration::from_secs(120);
/// Between two things that a hand does.
const PAUSE: Duration = Duration::from_millis(200);

/// Ended with its owner, whatever happens.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Display {
    _server: Running,
    name: String,
}

impl Display {
    /// `None` without Xvfb or xdotool.
    fn open() -> Option<Self> {
        let has_hands = Command::new("xdotool").arg("version").output().is_ok();
        let server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1300x800x24",
                "-nolisten",
                "tcp",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let (true, Ok(mut server)) = (has_hands, server) else {
            eprintln!(
                "the real window is not tested: Xvfb or xdotool is missing; apt-get install xvfb xdotool"
            );
            return None;
        };
        let output = server.stdout.take().unwrap();
        let server = Running(server);
        let mut number = String::new();
        BufReader::new(output).read_line(&mut number).unwrap();
        Some(Self {
            _server: server,
            name: format!(":{}", number.trim()),
        })
    }

    fn hand(&self, arguments: &[&str]) -> String {
        let command = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.name)
            .output();
        String::from_utf8(command.unwrap().stdout).unwrap()
    }

    fn point(&self, [x, y]: [i32; 2]) {
        self.hand(&["mousemove", &x.to_string(), &y.to_string()]);
        sleep(PAUSE);
    }

    fn click(&self, at: [i32; 2]) {
        self.point(at);
        self.hand(&["mousedown", "1"]);
        sleep(PAUSE);
        self.hand(&["mouseup", "1"]);
        sleep(PAUSE);
    }

    fn drag(&self, from: [i32; 2], to: [i32; 2]) {
        self.point(from);
        self.hand(&["mousedown", "1"]);
        sleep(PAUSE);
        for n in 1..=4 {
            self.point([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * n / 4));
        }
        self.hand(&["mouseup", "1"]);
        sleep(PAUSE);
    }
}

/// Saves until the file says so.
fn soon(display: &Display, folder: &Folder, holds: impl Fn(&str) -> bool) -> String {
    let end = Instant::now() + PATIENCE;
    loop {
        display.hand(&["key", "ctrl+s"]);
        sleep(PAUSE);
        let text = folder.read("scene.toml");
        if holds(&text) {
            return text;
        }
        assert!(Instant::now() < end, "it never came:\n{text}");
    }
}

#[test]
fn a_shot_is_composed_in_the_real_window() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = demo();
    let before = folder.read("scene.toml");
    // The same window without a display tells where things stand, and how far away.
    let (at, depth_m) = {
        let window = window(&folder);
        let app = window.app();
        let at = |x: f64, y: f64| {
            let at = app.on_screen(DVec2::new(x, y));
            [at.x.round() as i32, at.y.round() as i32]
        };
        let pick = window.session().pick(DVec2::new(369.5, 204.5)).unwrap();
        ([at(369.5, 204.5), at(300.0, 300.0)], pick.depth_m)
    };
    let program = folder
        .command("preview scene.toml")
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .stderr(Stdio::null())
        .spawn();
    let _program = Running(program.unwrap());
    let end = Instant::now() + PATIENCE;
    let search = ["search", "--onlyvisible", "--name", "mixray preview"];
    let shown = loop {
        let found = display.hand(&search);
        if let Some(id) = found.lines().last() {
            break id.to_owned();
        }
        assert!(Instant::now() < end, "no window appears");
        sleep(PAUSE);
    };
    // Nobody manages the windows of this display.
    display.hand(&["windowfocus", &shown]);

    // A click focuses, once the scene is read.
    let changed = |text: &str| text != before;
    let end = Instant::now() + PATIENCE;
    while !changed(&folder.read("scene.toml")) {
        assert!(Instant::now() < end, "a click does nothing");
        display.click(at[0]);
        display.hand(&["key", "ctrl+s"]);
        sleep(PAUSE);
    }
    let focused = folder.read("scene.toml");
    let focus_m = load(&folder.path("scene.toml"))
        .unwrap()
        .lens
        .focus_distance_m;
    assert!(
        (focus_m / depth_m - 1.0).abs() < 0.01,
        "{focus_m}, expected {depth_m}"
    );

    // A drag moves the knot along the table, on which it rests.
    display.drag(at[0], at[1]);
    let moved = soon(&display, &folder, |text| text != focused);
    let placed = |text: &str| {
        let scene = load(&folder.path("scene.toml")).unwrap();
        let composition = Document::parse(text).unwrap().composition(&scene);
        let knot = scene
            .objects
            .iter()
            .position(|object| object.name == "knot");
        composition.objects[knot.unwrap()].translation
    };
    let [from, to] = [placed(&focused), placed(&moved)];
    assert!((to - from).length() > 0.03, "{from} to {to}");
    assert!((to.y - from.y).abs() < 1e-3, "on the table: {from} to {to}");

    // Undo brings back what was, to the letter.
    display.hand(&["key", "ctrl+z"]);
    soon(&display, &folder, |text| text == focused);
}

/// The newest frames of a stream in a window, until Esc. Control: until then the program goes on.
#[test]
fn a_running_stream_is_shown_in_a_window_until_escape() {
    let Some(display) = Display::open() else {
        return;
    };
    let (folder, stream) = prepared();
    let mut program = folder.command(&format!("{LIVE} --window --summary 0.5 --stats stats.json"));
    let program = program
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut program = Running(program.unwrap());
    let mut to = program.0.stdin.take().unwrap();
    let feeding = std::thread::spawn(move || {
        let (header, frames) = parts(&stream);
        let mut sent = to.write_all(header);
        // Until the program closes its end.
        for frame in frames.into_iter().cycle() {
            if sent.is_err() {
                return;
            }
            sent = to.write_all(frame);
            sleep(PAUSE);
        }
    });
    let mut said = BufReader::new(program.0.stderr.take().unwrap()).lines();
    let goes = said.any(|line| {
        let line = line.unwrap();
        line.starts_with("live: ") && !line.starts_with("live: 0.0 of")
    });
    assert!(goes, "no frame goes out");
    let end = Instant::now() + PATIENCE;
    let shown = loop {
        let found = display.hand(&["search", "--onlyvisible", "--name", "mixray live"]);
        if let Some(id) = found.lines().last() {
            break id.to_owned();
        }
        assert!(Instant::now() < end, "no window appears");
        sleep(PAUSE);
    };
    display.hand(&["windowfocus", &shown]);
    sleep(PAUSE);
    assert_eq!(program.0.try_wait().unwrap(), None, "control");
    let status = loop {
        display.hand(&["key", "Escape"]);
        sleep(PAUSE);
        if let Some(status) = program.0.try_wait().unwrap() {
            break status;
        }
        assert!(Instant::now() < end, "the window stays");
    };
    assert_eq!(status.code(), Some(0));
    feeding.join().unwrap();
    let frames = folder.json("stats.json")["total"]["frames"].clone();
    assert!(frames["rendered"].as_u64().unwrap() > 0, "{frames}");
    let mut written = Vec::new();
    let out = program.0.stdout.take().unwrap();
    BufReader::new(out).read_to_end(&mut written).unwrap();
    assert!(
        written.is_empty(),
        "a stream that is shown is not written as well"
    );
}
