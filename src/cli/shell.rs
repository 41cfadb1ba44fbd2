//! `mixray completions` and `mixray man`: what shells and readers of manuals want.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Arguments, Failure, Outcome, print, summarize};
use crate::output::check_folder_name;

/// Prints the completions of a shell, for its start-up file
#[derive(Debug, Args)]
pub(super) struct Completions {
    shell: Shell,
}

/// Prints the manual page, or writes the pages of all commands
#[derive(Debug, Args)]
pub(super) struct Manual {
    /// Folder for mixray.1, mixray-render.1 and so on
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub(super) fn completions(arguments: &Completions) -> Result<Outcome, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut Arguments::command(),
        "mixray",
        &mut script,
    );
    // Zsh's has tabs, which are no control characters to a shell.
    print(&String::from_utf8_lossy(&script).replace('\t', "    "))?;
    Ok(Outcome::Done)
}

pub(super) fn manual(arguments: &Manual) -> Result<Outcome, Failure> {
    let command = Arguments::command();
    let Some(folder) = &arguments.output else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page)?;
        print(&String::from_utf8_lossy(&page))?;
        return Ok(Outcome::Done);
    };
    check_folder_name(folder, "a folder")?;
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(command, folder))
        .map_err(|error| {
            Failure(format!(
                "{}: pages cannot be written: {error}; expected a folder with room; name another",
                folder.display()
            ))
        })?;
    summarize(&format!("pages {}\n", folder.display()))?;
    Ok(Outcome::Done)
}
