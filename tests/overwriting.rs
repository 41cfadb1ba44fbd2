//! No output replaces what the run reads, whichever command, output, input and name of it; the control is that a free name works.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const SCENE: &str = "\
[photo]
image = \"photo.png\"
[camera]
vertical_fov_deg = 45
[environment]
image = \"env.exr\"
[[real]]
mesh = \"model.gltf\"
translation = [0, 0, -9]
[[virtual]]
shape = \"sphere\"
scale = 0.3
segments = 8
translation = [0, 0, -3]
[noise]
profile = \"noise.toml\"
[render]
rays_per_pixel = 2
backend = \"cpu\"
[check]
allow = [\"uncovered\", \"exposure\"]
";
const MODEL: &str = r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
"meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }], "buffers": [{ "uri": "model.bin", "byteLength": 36 }],
"bufferViews": [{ "buffer": 0, "byteLength": 36 }], "images": [{ "uri": "texture.png" }],
"accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }] }"#;
const POSES: &str = r#"{ "format": "mixray-trajectory", "version": 1, "frames_per_second": 10, "frames": [
{ "frame": 0, "world_from_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]] },
{ "frame": 1, "world_from_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]] }] }"#;
const CALIBRATION: &str = "%YAML:1.0\nimage_width: 24\nimage_height: 16\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 20., 0., 11.5, 0., 20., 7.5, 0., 0., 1. ]\n";

const BOARD: &str = "[chessboard]\ncolumns = 6\nrows = 4\nsquare_m = 0.03\n";

struct Folder(tempfile::TempDir);

impl Folder {
    /// Everything that any command reads.
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        std::fs::create_dir(folder.path("in")).unwrap();
        for (seed, name) in [
            "photo.png",
            "texture.png",
            "layer.png",
            "mask.png",
            "in/f_0000.png",
            "in/f_0001.png",
        ]
        .into_iter()
        .enumerate()
        {
            let picture = image::RgbImage::from_fn(24, 16, |x, y| {
                image::Rgb([(x * 10) as u8, (y * 15) as u8, seed as u8])
            });
            picture.save(folder.path(name)).unwrap();
        }
        let wall = |x: u32, y: u32| [100 + ((x * 7919 + y * y * 104_729) % 31 % 5) as u8; 3];
        let wall = image::RgbImage::from_fn(160, 120, |x, y| image::Rgb(wall(x, y)));
        wall.save(folder.path("wall.png")).unwrap();
        exr::prelude::write_rgb_file(folder.path("env.exr"), 4, 2, |_, _| (1.0f32, 1.0, 1.0))
            .unwrap();
        let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        folder.write(
            "model.bin",
            corners
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<u8>>(),
        );
        folder.write("model.gltf", MODEL);
        folder.write("scene.toml", SCENE);
        folder.write("poses.json", POSES);
        folder.write("calibration.yaml", CALIBRATION);
        folder.write("board.toml", BOARD);
        let mut film = b"YUV4MPEG2 W24 H16 F10:1 Ip A1:1 C420jpeg\n".to_vec();
        for frame in 0..2 {
            film.extend(b"FRAME\n");
            film.extend([100 + frame; 24 * 16 * 3 / 2]);
        }
        folder.write("film.y4m", film);
        folder.succeed("noise calibrate --from 0.02,0.5 -o noise.toml");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mixray"));
        command
            .current_dir(self.0.path())
            .args(arguments.split_whitespace());
        command
    }

    fn succeed(&self, arguments: &str) {
        let output = self.command(arguments).output().unwrap();
        assert_eq!(
            output.status.code(),
            Some(0),
            "{arguments}: {}",
            text(&output)
        );
    }

    /// Every file with its bytes, links as what they lead to.
    fn files(&self) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        fn walk(folder: &Path, files: &mut BTreeMap<PathBuf, Option<Vec<u8>>>) {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() && !path.is_symlink() {
                    walk(&path, files);
                }
                let bytes = std::fs::read(&path).ok();
                files.insert(path, bytes);
            }
        }
        let mut files = BTreeMap::new();
        walk(self.0.path(), &mut files);
        files
    }

    /// Runs what must be refused: exit code 2, one line that names both files, and no file touched.
    fn refused(&self, command: &mut Command, output: &str, input: &str) {
        let before = self.files();
        let ran = command.output().unwrap();
        let message = text(&ran);
        let what = format!("{command:?}: {message}");
        assert_eq!(ran.status.code(), Some(2), "{what}");
        assert!(message.starts_with("error:"), "{what}");
        assert_eq!(message.trim_end().lines().count(), 1, "{what}");
        for part in [output, input, "would be overwritten; give"] {
            assert!(message.contains(part), "{what} lacks {part}");
        }
        assert!(self.files() == before, "{what} changed a file");
    }

    fn remove(&self, name: &str) {
        let path = self.path(name);
        if path.is_dir() {
            std::fs::remove_dir_all(path).unwrap();
        } else {
            std::fs::remove_file(path).unwrap();
        }
    }
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What a command reads and where it writes: `@` in `line` is the output that is tried.
struct Case {
    line: &'static str,
    /// A name that the output may have.
    free: &'static str,
    inputs: &'static [&'static str],
}

const OF_SCENE: &[&str] = &[
    "scene.toml",
    "photo.png",
    "env.exr",
    "model.gltf",
    "model.bin",
    "texture.png",
    "noise.toml",
];
const OF_FOLDER: &[&str] = &[
    "scene.toml",
    "photo.png",
    "env.exr",
    "model.gltf",
    "model.bin",
    "texture.png",
    "noise.toml",
    "poses.json",
    "calibration.yaml",
    "in/f_0000.png",
    "in/f_0001.png",
];
const OF_FILM: &[&str] = &[
    "scene.toml",
    "photo.png",
    "env.exr",
    "poses.json",
    "film.y4m",
];
const OF_LAYERS: &[&str] = &["photo.png", "layer.png", "mask.png"];

const CASES: &[Case] = &[
    Case {
        line: "render scene.toml -o @",
        free: "new.png",
        inputs: OF_SCENE,
    },
    Case {
        line: "render scene.toml -o other.png -o @",
        free: "new.exr",
        inputs: OF_SCENE,
    },
    Case {
        line: "render scene.toml -o other.png --stats @",
        free: "new.json",
        inputs: OF_SCENE,
    },
    Case {
        line: "render scene.toml -o other.png --stop-at camera-noise --camera-noise other.toml --rpp 16 --stats @",
        free: "new.json",
        inputs: &["other.toml"],
    },
    Case {
        line: "sequence scene.toml --frames in --trajectory poses.json --intrinsics calibration.yaml -o other --stats @",
        free: "new.json",
        inputs: OF_FOLDER,
    },
    Case {
        line: "sequence scene.toml --frames in --trajectory poses.json --intrinsics calibration.yaml -o @",
        free: "new.y4m",
        inputs: OF_FOLDER,
    },
    Case {
        line: "sequence scene.toml --frames film.y4m --trajectory poses.json --overwrite -o @",
        free: "new.y4m",
        inputs: OF_FILM,
    },
    Case {
        line: "sequence scene.toml --frames film.y4m --trajectory poses.json -o other --stats @",
        free: "new.json",
        inputs: OF_FILM,
    },
    Case {
        line: "merge part.exr -o @",
        free: "new.exr",
        inputs: &[
            "part.exr",
            "scene.toml",
            "photo.png",
            "model.bin",
            "noise.toml",
        ],
    },
    Case {
        line: "merge part.exr --scene scene.toml -o other.png -o @",
        free: "new.png",
        inputs: &["part.exr", "scene.toml", "texture.png"],
    },
    Case {
        line: "noise calibrate in -o @",
        free: "new.toml",
        inputs: &["in/f_0000.png", "in/f_0001.png"],
    },
    Case {
        line: "noise calibrate in/f_0000.png in/f_0001.png -o other.toml --report @",
        free: "new.html",
        inputs: &["in/f_0000.png", "in/f_0001.png"],
    },
    Case {
        line: "noise apply photo.png layer.png mask.png --profile noise.toml -o @",
        free: "new.png",
        inputs: &["photo.png", "layer.png", "mask.png", "noise.toml"],
    },
    Case {
        line: "antialias photo.png layer.png mask.png -o @",
        free: "new.png",
        inputs: OF_LAYERS,
    },
    Case {
        line: "motion-blur photo.png layer.png mask.png --vector 9,0 -o @",
        free: "new.exr",
        inputs: OF_LAYERS,
    },
    Case {
        line: "export-blender scene.toml -o @",
        free: "new.py",
        inputs: OF_SCENE,
    },
    Case {
        line: "bundle scene.toml -o @",
        free: "new.zip",
        inputs: OF_SCENE,
    },
    Case {
        line: "noise estimate wall.png -o @",
        free: "new.toml",
        inputs: &["wall.png"],
    },
    Case {
        line: "track --print-board board.toml -o @",
        free: "new.pdf",
        inputs: &["board.toml"],
    },
    Case {
        line: "live scene.toml --board board.toml --input film.y4m --intrinsics calibration.yaml --overwrite -o @",
        free: "new.y4m",
        inputs: &[
            "scene.toml",
            "photo.png",
            "env.exr",
            "model.bin",
            "texture.png",
            "noise.toml",
            "board.toml",
            "calibration.yaml",
            "film.y4m",
        ],
    },
    Case {
        line: "live scene.toml --board board.toml --input film.y4m -o other.y4m --stats @",
        free: "new.json",
        inputs: &["board.toml", "film.y4m"],
    },
    Case {
        line: "cartoon photo.png @",
        free: "new.png",
        inputs: &["photo.png"],
    },
    Case {
        line: "cartoon photo.png other.png --edges @",
        free: "new.png",
        inputs: &["photo.png"],
    },
];

/// Hard links, symbolic links and other spellings of every input stand where each output of each command is named.
#[cfg(unix)]
#[test]
fn no_output_of_any_command_replaces_an_input() {
    let folder = Folder::new();
    folder.succeed("noise calibrate --from 0.03,0.5 -o other.toml");
    folder.succeed("render scene.toml --rpp 4 --range 0..2 -o part.exr");
    for case in CASES {
        let extension = Path::new(case.free).extension().unwrap().to_str().unwrap();
        for input in case.inputs {
            let clash = format!("clash.{extension}");
            let line = |output: &str| case.line.replace('@', output);
            std::fs::hard_link(folder.path(input), folder.path(&clash)).unwrap();
            folder.refused(&mut folder.command(&line(&clash)), &clash, input);
            folder.remove(&clash);
            std::os::unix::fs::symlink(input, folder.path(&clash)).unwrap();
            folder.refused(&mut folder.command(&line(&clash)), &clash, input);
            folder.remove(&clash);
            if input.ends_with(extension) {
                let spelled = format!("in/../{input}");
                folder.refused(&mut folder.command(&line(input)), input, input);
                folder.refused(&mut folder.command(&line(&spelled)), &spelled, input);
            }
        }
        // Control: what nobody reads is replaced.
        folder.write(case.free, "old");
        let is_film = case.free.ends_with(".y4m");
        let overwrite = if is_film && !case.line.contains("--overwrite") {
            " --overwrite"
        } else {
            ""
        };
        let inputs: Vec<_> = case
            .inputs
            .iter()
            .map(|input| std::fs::read(folder.path(input)).unwrap())
            .collect();
        folder.succeed(&(case.line.replace('@', case.free) + overwrite));
        let written = std::fs::read(folder.path(case.free)).unwrap();
        assert_ne!(written, b"old", "{}: the output is there", case.line);
        for (input, bytes) in case.inputs.iter().zip(inputs) {
            assert_eq!(std::fs::read(folder.path(input)).unwrap(), bytes, "{input}");
        }
        folder.remove(case.free);
        for other in ["other.png", "other.y4m", "other"] {
            if folder.path(other).exists() {
                folder.remove(other);
            }
        }
    }
}

/// Standard input may be a file that an output names.
#[cfg(unix)]
#[test]
fn the_file_behind_standard_input_is_an_input() {
    let folder = Folder::new();
    let from_film = |line: &str| {
        let film = File::open(folder.path("film.y4m")).unwrap();
        let mut command = folder.command(line);
        command.stdin(Stdio::from(film));
        command
    };
    let common = "sequence scene.toml --frames - --trajectory poses.json";
    std::fs::hard_link(folder.path("film.y4m"), folder.path("film.json")).unwrap();
    for (rest, output) in [
        ("-o film.y4m --overwrite", "film.y4m"),
        ("-o out --stats film.json", "film.json"),
    ] {
        folder.refused(
            &mut from_film(&format!("{common} {rest}")),
            output,
            "standard input",
        );
    }
    let output = from_film(&format!("{common} -o new.y4m")).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "control: {}", text(&output));
    // And so may standard output.
    let append = std::fs::OpenOptions::new()
        .append(true)
        .open(folder.path("scene.toml"))
        .unwrap();
    let mut command = folder.command("render scene.toml -o new.png");
    command.stdout(append);
    folder.refused(&mut command, "standard output", "scene.toml");
}

/// A folder of frames is neither written to as one nor emptied by --overwrite, and no frame that is written is a file that is read.
#[test]
fn folders_of_frames_are_inputs() {
    let folder = Folder::new();
    let common = "sequence scene.toml --trajectory poses.json --overwrite --frames";
    folder.refused(
        &mut folder.command(&format!("{common} in -o in")),
        "in",
        "in",
    );
    folder.refused(
        &mut folder.command(&format!("{common} in -o in/../in")),
        "in/../in",
        "in",
    );
    // The scene's own files among the pictures that --overwrite removes, or under the name of a frame.
    std::fs::create_dir(folder.path("out")).unwrap();
    for name in ["out/texture.png", "out/f_0001.png"] {
        std::fs::copy(folder.path("texture.png"), folder.path(name)).unwrap();
        folder.write("model.gltf", MODEL.replace("texture.png", name));
        folder.refused(
            &mut folder.command(&format!("{common} in -o out")),
            name,
            name,
        );
        folder.remove(name);
    }
    folder.write("model.gltf", MODEL);
    // The part of a film that is not whole yet is an output too.
    std::fs::copy(folder.path("film.y4m"), folder.path("new.y4m.part")).unwrap();
    folder.refused(
        &mut folder.command(&format!("{common} new.y4m.part -o new.y4m")),
        "new.y4m.part",
        "new.y4m.part",
    );
    folder.succeed(&format!("{common} in -o out"));
    folder.succeed(&format!("{common} film.y4m -o new.y4m"));
}

#[test]
fn two_outputs_are_never_one_file() {
    let folder = Folder::new();
    folder.write("there.png", "there");
    let mut lines = vec![
        ("render scene.toml -o new.png -o in/../new.png".to_owned(), "new.png"),
        ("render scene.toml -o new.png --stats new.png".to_owned(), "new.png"),
        ("cartoon photo.png new.png --edges new.png".to_owned(), "new.png"),
        ("noise calibrate in -o new.toml --report new.toml".to_owned(), "new.toml"),
        ("sequence scene.toml --frames in --trajectory poses.json -o out --stats out/mixray-sequence.json".to_owned(), "mixray-sequence.json"),
        ("sequence scene.toml --frames in --trajectory poses.json -o new.y4m --stats new.y4m.mixray-sequence.json".to_owned(), "new.y4m.mixray-sequence.json"),
    ];
    std::fs::create_dir(folder.path("out")).unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("new.png", folder.path("dangling.png")).unwrap();
        std::fs::hard_link(folder.path("there.png"), folder.path("same.png")).unwrap();
        lines.push((
            "render scene.toml -o new.png -o dangling.png".to_owned(),
            "dangling.png",
        ));
        lines.push((
            "render scene.toml -o there.png -o same.png".to_owned(),
            "same.png",
        ));
    }
    for (line, name) in lines {
        let before = folder.files();
        let output = folder.command(&line).output().unwrap();
        let message = text(&output);
        assert_eq!(output.status.code(), Some(2), "{line}: {message}");
        assert!(
            message.contains(name) && message.contains("named for two outputs"),
            "{line}: {message}"
        );
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert!(folder.files() == before, "{line}");
    }
    folder.succeed("render scene.toml -o new.png -o there.png --stats s.json");
}

/// A link that leads nowhere as an output makes what it leads to.
#[cfg(unix)]
#[test]
fn dangling_links_make_their_targets() {
    use std::os::unix::fs::symlink;
    let folder = Folder::new();
    symlink("in/../made.png", folder.path("link.png")).unwrap();
    symlink("made", folder.path("link")).unwrap();
    symlink("made.y4m", folder.path("link.y4m")).unwrap();
    folder.succeed("render scene.toml -o link.png");
    let sequence = "sequence scene.toml --frames in --trajectory poses.json -o";
    folder.succeed(&format!("{sequence} link"));
    folder.succeed(&format!("{sequence} link.y4m"));
    for name in ["link.png", "link", "link.y4m"] {
        assert!(folder.path(name).is_symlink(), "{name} stays a link");
    }
    assert!(
        folder.path("made.png").is_file()
            && folder.path("made/f_0001.png").is_file()
            && folder.path("made.y4m").is_file()
    );
    symlink("loop.png", folder.path("loop.png")).unwrap();
    let output = folder
        .command("render scene.toml -o loop.png")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
}

/// What a benchmark compares with, is told of in a page, or measures, is not what it writes.
#[test]
fn benchmarks_keep_what_they_read() {
    let folder = Folder::new();
    let bench = "bench scene.toml --backends cpu --estimators direct --rpp 1 --repeats 1 --reference-error 0.5";
    folder.succeed(&format!("{bench} -o out"));
    folder.refused(
        &mut folder.command(&format!("{bench} -o out --against out/results.json")),
        "results.json",
        "out/results.json",
    );
    let section = "# <!-- bench -->\n# <!-- end -->\n";
    folder.write("scene.toml", SCENE.to_owned() + section);
    std::fs::hard_link(folder.path("scene.toml"), folder.path("scene.md")).unwrap();
    folder.refused(
        &mut folder.command(&format!("{bench} -o out --write-docs scene.md")),
        "scene.md",
        "scene.toml",
    );
    folder.remove("scene.md");
    folder.write("page.md", section);
    folder.succeed(&format!(
        "{bench} -o new --against out/results.json --write-docs page.md --tolerance 1e9"
    ));
    assert!(
        std::fs::read_to_string(folder.path("page.md"))
            .unwrap()
            .len()
            > section.len()
    );
    let before = folder.files();
    let output = folder
        .command(&format!("{bench} -o out --write-docs out/results.json"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(folder.files() == before);
}
