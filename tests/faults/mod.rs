//! What is done to the program that nobody should: damaged files, files without an end, little memory, no threads, small stacks.

mod bombs;
mod decoders;
pub mod fuzz;
mod fuzzed;
mod limits;

use std::path::Path;
use std::process::{Command, Output};

/// A shell command with the program as `$MIXRAY`, run in `folder`.
fn shell(folder: &Path, script: &str) -> Output {
    Command::new("bash")
        .args(["-c", script])
        .current_dir(folder)
        .env("MIXRAY", env!("CARGO_BIN_EXE_mixray"))
        .output()
        .expect("bash")
}

/// That it ended with exit code 2 and one line of an error that holds all `parts`.
#[track_caller]
fn assert_refused(output: &Output, parts: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let errors: Vec<&str> = said.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    for part in parts {
        assert!(errors[0].contains(part), "{said} lacks {part}");
    }
    for word in ["panicked", "RUST_BACKTRACE", "allocation of"] {
        assert!(!said.contains(word), "{said}");
    }
}

#[track_caller]
fn assert_done(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
}

/// A folder with a scene of a small sphere, over `photo` where there is one.
fn folder_of(photo: Option<(&str, &[u8])>, camera: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut scene = String::new();
    if let Some((name, bytes)) = photo {
        std::fs::write(folder.path().join(name), bytes).expect("a writable folder");
        scene += &format!("[photo]\nimage = \"{name}\"\n");
    }
    scene += &format!(
        "[camera]\n{camera}\nvertical_fov_deg = 40\nposition = [0.0, 0.3, 0.7]\nlook_at = [0.0, 0.05, 0.0]\n[environment]\nradiance = [1, 1, 1]\n[[virtual]]\nshape = \"sphere\"\nscale = 0.06\n"
    );
    std::fs::write(folder.path().join("scene.toml"), scene).expect("a writable folder");
    folder
}

const SMALL: &str = "width = 16\nheight = 12";
/// One ray on the CPU: the checks here are of what comes before.
const RENDER: &str = "$MIXRAY render scene.toml --rpp 1 --backend cpu -o out.png";
