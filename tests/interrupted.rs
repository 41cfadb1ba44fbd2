//! Killed, out of room, with a reader that has gone: what is there afterwards is old or whole, and the next run mends the rest.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::support::{Folder, Random, assert_refused, stderr};

const SCENE: &str = "\
[photo]
image = \"photo.png\"
[camera]
vertical_fov_deg = 45
[environment]
radiance = [0.8, 0.9, 1.0]
[[real]]
shape = \"quad\"
corner = [-3, -0.5, 0]
edge_u = [6, 0, 0]
edge_v = [0, 0, -6]
material = { base_color = [0.5, 0.4, 0.3] }
[[virtual]]
shape = \"sphere\"
scale = 0.3
segments = 24
translation = [0, 0, -3]
[render]
backend = \"cpu\"
[check]
allow = [\"floating\", \"exposure\"]
";

/// A scene, two films of it, frames of a video with poses, and frames of noise.
fn folder() -> Folder {
    let folder = Folder::with_scene(SCENE);
    folder.create("in");
    folder.create("noise");
    let mut random = Random(7);
    for number in 0..6u32 {
        folder.save(&format!("in/f_{number}.png"), 24, 16, |x, y| {
            [x * 9, y * 9, number * 20].map(|c| c as u8)
        });
        let codes: Vec<[u8; 3]> = (0..64 * 64)
            .map(|i| {
                [0, 1, 2].map(|_| (40.0 + 40.0 * f64::from(i / 1024) + 4.0 * random.normal()) as u8)
            })
            .collect();
        folder.save(&format!("noise/n_{number}.png"), 64, 64, |x, y| {
            codes[(y * 64 + x) as usize]
        });
    }
    let frames: Vec<String> = (0..6)
        .map(|number| format!(r#"{{"frame": {number}, "world_from_camera": [[1,0,0,0.0{number}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}"#))
        .collect();
    folder.write(
        "poses.json",
        format!(
            r#"{{"frames_per_second": 10, "frames": [{}]}}"#,
            frames.join(", ")
        ),
    );
    for range in ["0..8", "8..16"] {
        folder.succeed(&format!(
            "render scene.toml --rpp 16 --range {range} -o part-{}.exr",
            &range[..1]
        ));
    }
    folder
}

/// Names and bytes of what a command leaves, temporary files and all.
fn left(folder: &Folder) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.path("out")];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(at).expect("reads") {
            let path = entry.expect("reads").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.clone(), std::fs::read(path).expect("reads"));
            }
        }
    }
    files
}

/// Where a command writes is `out/`.
struct Killed {
    line: &'static str,
    /// It writes the same bytes each time; else it is only looked at that its texts are whole.
    repeats: bool,
}

const COMMANDS: &[Killed] = &[
    Killed {
        line: "render scene.toml --rpp 64 -o out/a.png -o out/b.exr",
        repeats: true,
    },
    Killed {
        line: "merge part-0.exr part-8.exr -o out/c.exr -o out/d.png",
        repeats: true,
    },
    Killed {
        line: "sequence scene.toml --frames in --trajectory poses.json --rpp 32 -o out/frames",
        repeats: true,
    },
    Killed {
        line: "sequence scene.toml --frames in --trajectory poses.json --rpp 32 -o out/film.y4m",
        repeats: true,
    },
    Killed {
        line: "noise calibrate noise -o out/noise.toml",
        repeats: true,
    },
    Killed {
        line: "bench scene.toml --backends cpu --estimators direct --rpp 1,4 --repeats 1 --reference-error 0.5 -o out/bench",
        repeats: false,
    },
];

/// Kills each command that often at random moments of its time. Whatever has its name is whole, and the run after is as if nothing had been.
fn kill(commands: &[Killed], times: u32) {
    let mut random = Random(11);
    for Killed { line, repeats } in commands {
        let folder = folder();
        folder.create("out");
        let begin = Instant::now();
        folder.succeed(*line);
        let takes = begin.elapsed();
        let whole = left(&folder);
        assert!(!whole.is_empty(), "{line}");
        std::fs::remove_dir_all(folder.path("out")).expect("removes");
        folder.create("out");
        for _ in 0..times {
            let mut child = folder
                .command(*line)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("starts");
            std::thread::sleep(takes.mul_f64(1.1 * random.uniform()));
            let ended = child.try_wait().expect("waits").is_some();
            child.kill().expect("is killed");
            child.wait().expect("ends");
            for (path, bytes) in left(&folder) {
                let name = path
                    .file_name()
                    .expect("a name")
                    .to_string_lossy()
                    .into_owned();
                if name.ends_with(".tmp") || name.ends_with(".part") {
                    continue;
                }
                match repeats {
                    true => assert!(whole[&path] == bytes, "{line}: {name}"),
                    false => {
                        assert!(!bytes.is_empty(), "{line}: {name}");
                        if name.ends_with(".json") {
                            serde_json::from_slice::<serde_json::Value>(&bytes)
                                .expect("whole JSON");
                        }
                    }
                }
            }
            // Once it came to its end there is nothing left to kill.
            if ended {
                std::fs::remove_dir_all(folder.path("out")).expect("removes");
                folder.create("out");
            }
        }
        folder.succeed(*line);
        let after = left(&folder);
        assert!(after.keys().eq(whole.keys()), "{line}: {:?}", after.keys());
        assert!(!repeats || after == whole, "{line}");
    }
}

#[test]
fn killed_two_hundred_times() {
    kill(COMMANDS, 34);
}

/// A file that may not grow is a failed write: one line, exit code 2, and what was there stays.
#[cfg(unix)]
#[test]
fn file_limits_and_full_disks_are_one_line() {
    let folder = folder();
    folder.create("out");
    folder.write("out/old.exr", "old");
    let limited = |line: &str| {
        let script = format!("ulimit -f 1; exec \"$0\" {line}");
        let mut command = Command::new("sh");
        command
            .current_dir(folder.root())
            .args(["-c", &script, env!("CARGO_BIN_EXE_mixray")]);
        command.output().expect("runs")
    };
    for line in [
        "render scene.toml --rpp 4 -o out/old.exr",
        "merge part-0.exr part-8.exr -o out/old.exr",
        "sequence scene.toml --frames in --trajectory poses.json --rpp 1 -o out/film.y4m",
    ] {
        let output = limited(line);
        assert_refused(&output, "out/");
        assert!(stderr(&output).contains("too large"), "{}", stderr(&output));
        assert_eq!(folder.read("out/old.exr"), "old");
    }
    let names: Vec<PathBuf> = left(&folder).into_keys().collect();
    assert_eq!(
        names,
        [
            "out/film.y4m.mixray-sequence.json",
            "out/film.y4m.part",
            "out/old.exr"
        ]
        .map(|name| folder.path(name)),
        "no temporary file is left"
    );
    folder
        .succeed("sequence scene.toml --frames in --trajectory poses.json --rpp 1 -o out/film.y4m");
    assert!(
        !folder.path("out/film.y4m.part").exists(),
        "control: without the limit it goes on"
    );
    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let to = |line: &str| {
            folder
                .command(line)
                .stdout(full.try_clone().expect("clones"))
                .output()
                .expect("runs")
        };
        let output = to("compare photo.png photo.png");
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(
            stderr(&output).contains("standard output"),
            "{}",
            stderr(&output)
        );
        let output = to("sequence scene.toml --frames in --trajectory poses.json --rpp 1 -o -");
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(
            stderr(&output).contains("standard output"),
            "{}",
            stderr(&output)
        );
    }
}

/// A result that nobody reads to its end is no failure; a film is one, and is told as what it is.
#[test]
fn a_closed_pipe_is_called_one() {
    let folder = folder();
    let closed = |line: &str| {
        let mut child = folder
            .command(line)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        drop(child.stdout.take());
        child.wait_with_output().expect("ends")
    };
    let output = closed("sequence scene.toml --frames in --trajectory poses.json --rpp 1 -o -");
    assert_refused(
        &output,
        "standard output: it was closed before the last frame",
    );
    assert!(!stderr(&output).contains("room"), "{}", stderr(&output));
    for line in [
        "compare photo.png photo.png",
        "--help",
        "render scene.toml --rpp 1 -o a.png",
    ] {
        let output = closed(line);
        assert_eq!(output.status.code(), Some(0), "{line}: {}", stderr(&output));
        assert_eq!(stderr(&output), "", "{line}");
    }
}

/// Two runs of one command write one file.
#[test]
fn the_same_run_writes_the_same_bytes() {
    let folder = folder();
    let render = |name: &str, seed: u32| {
        folder.succeed(&format!(
            "render scene.toml --rpp 4 --seed {seed} -o {name}.exr -o {name}.png"
        ));
        [
            folder.bytes(&format!("{name}.exr")),
            folder.bytes(&format!("{name}.png")),
        ]
    };
    let first = render("a", 1);
    for name in ["b", "c"] {
        assert!(render(name, 1) == first);
    }
    let other = render("d", 2);
    assert!(other[0] != first[0] && other[1] != first[1], "control");
    let merge = |name: &str| {
        folder.succeed(&format!("merge part-0.exr part-8.exr -o {name}"));
        folder.bytes(name)
    };
    assert!(merge("e.exr") == merge("f.exr"));
    // A picture without a render behind it.
    let cartoon = |name: &str| {
        folder.succeed(&format!("cartoon photo.png {name}"));
        folder.bytes(name)
    };
    assert!(cartoon("g.exr") == cartoon("h.exr"));
}

/// What files hold and are called reaches the terminal as text.
#[cfg(unix)]
#[test]
fn names_and_texts_do_not_command_the_terminal() {
    let folder = folder();
    let escape = "a\u{1b}[31m\u{7}b";
    folder.write("poses.txt", format!("1.0 {escape} 2 3 4 5 6 7\n\0\n"));
    folder.write(&format!("{escape}.toml"), "[camera\u{1b}]\n");
    folder.write("keys.toml", SCENE.replace("[render]", "[\"ren\u{1b}der\"]"));
    std::fs::copy(
        folder.path("photo.png"),
        folder.path(&format!("{escape}.png")),
    )
    .expect("copies");
    folder.save("small.png", 4, 4, |_, _| [0; 3]);
    let long = "x".repeat(5000);
    let scene = format!("{escape}.toml");
    let picture = format!("{escape}.png");
    let lines: [(&[&str], i32); 8] = [
        (
            &[
                "sequence",
                "scene.toml",
                "--frames",
                "in",
                "--trajectory",
                "poses.txt",
                "-o",
                "out",
            ],
            2,
        ),
        (&["render", &scene, "-o", "x.png"], 2),
        (&["render", "keys.toml", "-o", "x.png"], 2),
        (&["render", "scene.toml", "--rpp", "1", "-o", &picture], 0),
        (&["compare", &picture, "small.png"], 2),
        (&["compare", "photo.png", "photo.png", &picture], 2),
        (&["render", &long], 2),
        (&["render", "scene.toml", "-o", &long], 2),
    ];
    for (line, code) in lines {
        let output = folder.run(&line.to_vec());
        let (said, told) = (
            stderr(&output),
            String::from_utf8_lossy(&output.stdout).into_owned(),
        );
        assert_eq!(output.status.code(), Some(code), "{line:?}: {said}");
        for text in [&said, &told] {
            assert!(
                !text.chars().any(|c| c.is_control() && c != '\n'),
                "{text:?}"
            );
            assert!(text.len() < 1500, "{text}");
        }
        if line.contains(&picture.as_str()) {
            assert!(
                (said + &told).contains(r"a\u{1b}[31m\u{7}b.png"),
                "it is named"
            );
        }
    }
    let fps = [
        "sequence",
        "scene.toml",
        "--frames",
        "in",
        "--trajectory",
        "poses.json",
        "-o",
        "out",
        "--fps",
        "1e308",
    ];
    let said = stderr(&folder.run(&fps));
    assert!(said.contains("at most 1000000"), "{said}");
}
