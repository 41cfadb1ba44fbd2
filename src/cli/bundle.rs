//! `mixray bundle`: a scene with all of its files, for another machine.

use std::path::{Path, PathBuf};

use clap::Args;

use super::scene_flags::SceneFlags;
use super::{Failure, Outcome, print, say};
use crate::farm::{Bundle, gather, write_new_folder};
use crate::files;
use crate::scene::{Given, Scene, load_with};

/// Gathers a scene and all files that it names, by relative paths
///
/// The bundle is read back: it must be the same scene, with nothing outside of it used.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// New folder, or .zip file
    #[arg(short, long, value_name = "DIR|FILE.zip")]
    output: PathBuf,
    #[command(flatten)]
    flags: SceneFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let scene = arguments.flags.load(&arguments.scene)?;
    let bundle = gather(&scene)?;
    let output = &arguments.output;
    match output
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("zip"))
    {
        true => write_zip(&bundle, &scene, output)?,
        false => write_new_folder(output, |folder| {
            bundle.write_into(folder)?;
            check(&bundle, &scene, folder)
        })?,
    }
    for warning in &scene.warnings {
        say("warning", warning);
    }
    print(&format!(
        "bundle {} ({} files, scene file {})\n",
        output.display(),
        bundle.len(),
        bundle.scene_file()
    ))?;
    Ok(Outcome::Done)
}

fn write_zip(bundle: &Bundle, scene: &Scene, output: &Path) -> Result<(), Failure> {
    files::output(output)?;
    let unwritable = |error: &dyn std::fmt::Display| {
        Failure(format!("{}: cannot be written: {error}", output.display()))
    };
    let absolute = std::path::absolute(output)?;
    let parent = absolute.parent().unwrap_or(Path::new("/"));
    let unpacked = tempfile::tempdir_in(parent).map_err(|error| unwritable(&error))?;
    bundle.write_into(unpacked.path())?;
    check(bundle, scene, unpacked.path())?;
    let target = crate::output::new_beside(output)?;
    bundle.write_zip(target.as_file(), output)?;
    files::before_write(output)?;
    target.persist(output).map_err(|error| unwritable(&error))?;
    Ok(())
}

/// That the files below `folder` are the scene, and use nothing outside.
pub(super) fn check(bundle: &Bundle, scene: &Scene, folder: &Path) -> Result<(), Failure> {
    let given = Given {
        sandbox: true,
        ..Given::default()
    };
    let copy = load_with(&folder.join(bundle.scene_file()), given)?;
    match copy.fingerprint() == scene.fingerprint() {
        true => Ok(()),
        false => Err(Failure(format!(
            "{}: its bundle is another scene; expected files that do not change meanwhile; try again",
            scene.path.display()
        ))),
    }
}
