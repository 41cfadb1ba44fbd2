//! `mixray export-blender`: a scene as a script for Blender.

use std::path::PathBuf;

use clap::Args;

use super::scene_flags::SceneFlags;
use super::{Failure, Outcome, print, say};
use crate::blender::script;
use crate::output::{check_writable, write_bytes, write_text};

/// Writes a Python script that builds the scene in Blender, for a look
///
/// Its meshes, textures and photograph go into a file of numbers beside it. What Blender cannot show is listed.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Script to write, .py
    #[arg(short, long, value_name = "OUT.py")]
    output: PathBuf,
    #[command(flatten)]
    flags: SceneFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let path = &arguments.output;
    let name = path.file_stem().map(|stem| stem.to_string_lossy());
    let (Some(name), true) = (name, path.extension().is_some_and(|ending| ending == "py")) else {
        return Err(Failure(format!(
            "{}: the name must end in .py",
            path.display()
        )));
    };
    let numbers_name = format!("{name}.numbers");
    let numbers_path = path.with_file_name(&numbers_name);
    check_writable(path)?;
    check_writable(&numbers_path)?;
    let scene = arguments.flags.load(&arguments.scene)?;
    for warning in &scene.warnings {
        say("warning", warning);
    }
    let written = script(&scene, &numbers_name);
    write_bytes(&numbers_path, &written.numbers)?;
    write_text(path, &written.script)?;
    for note in &written.notes {
        say("not carried", note);
    }
    print(&format!("script {}\n", path.display()))?;
    Ok(Outcome::Done)
}
