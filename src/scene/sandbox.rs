//! Scenes of others: the files that they name lie in their own folder, or are refused.

use std::path::{Path, PathBuf};

use crate::files::resolved;

/// The folder of a scene file or a film, links resolved.
#[derive(Clone, Debug)]
pub(crate) struct Sandbox(PathBuf);

impl Sandbox {
    pub fn around(path: &Path) -> Self {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        Self(resolved(path.parent().unwrap_or(&path)))
    }

    /// Why a file is refused; where there is none, it lies in the folder wherever links lead.
    pub fn refusal(&self, path: &Path) -> Option<String> {
        let target = resolved(path);
        (!target.starts_with(&self.0)).then(|| {
            format!(
                "names {}, which is outside the scene's folder {}; expected files in it, as --sandbox wants; copy it there, or leave out --sandbox",
                target.display(),
                self.0.display()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_in_the_folder_is_admitted() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        std::fs::create_dir_all(at("scene/sub")).unwrap();
        std::fs::write(at("scene/in.png"), "").unwrap();
        std::fs::write(at("out.png"), "").unwrap();
        std::fs::create_dir(at("scene-2")).unwrap();
        std::fs::write(at("scene-2/near.png"), "").unwrap();
        let sandbox = Sandbox::around(&at("scene/scene.toml"));
        let admits = |name: &str| sandbox.refusal(&at(name)).is_none();
        assert!(
            admits("scene/in.png") && admits("scene/sub/../in.png") && admits("scene/absent.png")
        );
        for name in [
            "out.png",
            "scene/../out.png",
            "scene-2/near.png",
            "absent.png",
        ] {
            assert!(!admits(name), "{name}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("../out.png", at("scene/link.png")).unwrap();
            std::os::unix::fs::symlink("in.png", at("scene/own.png")).unwrap();
            assert!(!admits("scene/link.png") && admits("scene/own.png"));
        }
    }
}
