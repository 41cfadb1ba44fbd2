//! Broken and compressed files through the program itself: one line and exit code 2, or a clean picture.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::reference::{picture, rms};
use super::*;
use crate::support::Folder;

const PATIENCE: Duration = Duration::from_secs(60);

#[derive(Debug, PartialEq, Eq)]
enum Outcome {
    Refused,
    Picture,
}

fn run(mut command: Command) -> Result<Output, String> {
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| error.to_string())?;
    let start = Instant::now();
    while child
        .try_wait()
        .map_err(|error| error.to_string())?
        .is_none()
    {
        if start.elapsed() > PATIENCE {
            let _ = child.kill();
            return Err("hangs".into());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.wait_with_output().map_err(|error| error.to_string())
}

/// What the program made of a file, or what is wrong with that.
fn judge(model: &Path, output: &Output, out: &Path) -> Result<Outcome, String> {
    let stderr = String::from_utf8_lossy(&output.stderr);
    let (warnings, rest): (Vec<&str>, Vec<&str>) = stderr
        .lines()
        .partition(|line| line.starts_with("warning: ") || line.starts_with("note: "));
    if warnings.iter().any(|line| line.contains("not finite")) {
        return Err(format!("not finite: {stderr}"));
    }
    match output.status.code() {
        Some(2) => {
            let [line] = rest[..] else {
                return Err(format!("not one line: {stderr}"));
            };
            let name = model.file_name().unwrap_or_default().to_string_lossy();
            if !line.starts_with("error: ") || !line.contains(&*name) {
                return Err(format!("no error about {name}: {line}"));
            }
            if out.exists() || !output.stdout.is_empty() {
                return Err("refused, and yet there is a picture".into());
            }
            Ok(Outcome::Refused)
        }
        Some(0) => {
            let picture = image::open(out).map_err(|error| error.to_string())?;
            if !rest.is_empty() || (picture.width(), picture.height()) != (16, 12) {
                return Err(format!("no clean picture: {stderr}"));
            }
            Ok(Outcome::Picture)
        }
        code => Err(format!("exit code {code:?}: {stderr}")),
    }
}

fn small_scene(model: &Path) -> String {
    scene_text(model, WHITE_SKY)
        .replace("width = 64", "width = 16")
        .replace("height = 48", "height = 12")
}

/// (refused, rendered) of the files of a folder.
fn run_all(folder: &str) -> Option<(usize, usize)> {
    let files = gltf_files(&shared_data(folder)?);
    let temporary = Folder::new();
    let next = Mutex::new(files.iter().enumerate());
    let found = Mutex::new((0, 0));
    let work = || {
        loop {
            let Some((number, model)) = next.lock().unwrap().next() else {
                return;
            };
            let (scene, picture) = (format!("{number}.toml"), format!("{number}.png"));
            temporary.write(&scene, small_scene(model));
            let command =
                temporary.command(&format!("render {scene} -o {picture} --rpp 1 --threads 1"));
            let out = temporary.path(&picture);
            let outcome = run(command).and_then(|output| judge(model, &output, &out));
            match outcome {
                Ok(Outcome::Refused) => found.lock().unwrap().0 += 1,
                Ok(Outcome::Picture) => found.lock().unwrap().1 += 1,
                Err(reason) => panic!("{}: {reason}", model.display()),
            }
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(work);
        scope.spawn(work);
    });
    let counts = *found.lock().unwrap();
    Some(counts)
}

#[test]
fn every_bad_file_is_refused_in_one_line_or_rendered() {
    if let Some((refused, rendered)) = run_all("gltf_bad_inputs") {
        assert!(
            refused > 60 && rendered > 200,
            "{refused} refused, {rendered} rendered"
        );
    }
}

#[test]
fn every_compressed_file_is_refused_in_one_line() {
    if let Some((refused, rendered)) = run_all("gltf_unsupported_extensions") {
        assert_eq!((refused, rendered), (5, 0));
    }
}

/// Negative control: the judge knows what it should not let pass.
#[test]
fn the_judge_notices_bad_endings() {
    let folder = Folder::new();
    let out = folder.path("out.png");
    let ending = |script: &str| {
        let output = Command::new("sh").args(["-c", script]).output().unwrap();
        judge(Path::new("a.gltf"), &output, &out)
    };
    assert_eq!(
        ending("echo 'error: a.gltf: bad' >&2; exit 2"),
        Ok(Outcome::Refused)
    );
    assert!(ending("echo 'error: bad' >&2; exit 2").is_err());
    assert!(ending("printf 'error: a.gltf:\\nbad\\n' >&2; exit 2").is_err());
    assert!(ending("echo 'thread main panicked' >&2; exit 101").is_err());
    assert!(ending("exit 0").is_err(), "no picture");
    image::RgbImage::new(16, 12).save(&out).unwrap();
    assert_eq!(
        ending("echo 'warning: 2 dropped' >&2"),
        Ok(Outcome::Picture)
    );
    assert!(ending("echo 'warning: 2 samples were not finite' >&2").is_err());
    assert!(
        ending("echo 'error: a.gltf: bad' >&2; exit 2").is_err(),
        "a picture beside the error"
    );
}

/// Normals that are not unit vectors do no harm: the box is where it should be, and lit.
#[test]
fn a_box_with_bad_normals_is_a_correct_picture() {
    let Some(root) = shared_data("gltf_bad_inputs") else {
        return;
    };
    let path = root.join("assimp_BoxBadNormals/BoxBadNormals.glb");
    let mut scene = crate::support::scene(&scene_text(&path, WHITE_SKY));
    frame(&mut scene, [0.55, 0.35, 1.0]);
    repaint(&mut scene, grey);
    let expected = picture(&scene, |_, _| DVec3::splat(0.8));
    let shot = shoot(scene);
    let coverage = expected.iter().map(|(_, coverage)| *coverage);
    assert!(rms(coverage, shot.mask.iter().copied()) < 0.03);
    // A convex matt body under an even sky shows its albedo everywhere.
    let radiance = shot.picture.linear.iter().map(|p| f64::from(p[0]));
    let far = rms(expected.iter().map(|(c, _)| c.x), radiance);
    assert!(far < 0.06, "{far}");
}
