//! How scenes are read, for every command that reads one.

use std::path::Path;

use clap::Args;

use crate::scene::{Given, Scene, SceneError, load_with};

#[derive(Clone, Copy, Debug, Args)]
pub(super) struct SceneFlags {
    /// Refuse files outside the scene's folder that the scene names, links followed: for scenes of others
    #[arg(long)]
    pub sandbox: bool,
}

impl SceneFlags {
    pub(super) fn load(self, path: &Path) -> Result<Scene, SceneError> {
        let given = Given {
            sandbox: self.sandbox,
            ..Given::default()
        };
        load_with(path, given)
    }
}
