//! What a path stands for: links, spellings, devices and inodes.

use std::fs::File;
use std::path::{Path, PathBuf};

/// Chains of links that are longer are taken for loops, as Linux does.
const MAX_LINKS: usize = 40;

/// A file whatever its names: device and inode. Only where the system has them; elsewhere resolved paths alone tell files apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Identity {
    device: u64,
    inode: u64,
}

#[cfg(unix)]
mod of_unix {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;

    use super::{File, Identity, Path};

    impl Identity {
        fn of(metadata: &std::fs::Metadata) -> Self {
            Self {
                device: metadata.dev(),
                inode: metadata.ino(),
            }
        }

        /// Links followed.
        pub(in super::super) fn of_path(path: &Path) -> Option<Self> {
            Some(Self::of(&path.metadata().ok()?))
        }

        pub(in super::super) fn of_file(file: &File) -> Option<Self> {
            Some(Self::of(&file.metadata().ok()?))
        }

        pub(in super::super) fn of_standard_input() -> Option<Self> {
            Self::of_stream(&std::io::stdin())
        }

        pub(in super::super) fn of_standard_output() -> Option<Self> {
            Self::of_stream(&std::io::stdout())
        }

        /// If a regular file stands behind it.
        fn of_stream(stream: &impl AsFd) -> Option<Self> {
            let file = File::from(stream.as_fd().try_clone_to_owned().ok()?);
            let metadata = file.metadata().ok()?;
            metadata.is_file().then(|| Self::of(&metadata))
        }
    }
}

#[cfg(not(unix))]
impl Identity {
    pub(super) fn of_path(_: &Path) -> Option<Self> {
        None
    }

    pub(super) fn of_file(_: &File) -> Option<Self> {
        None
    }

    pub(super) fn of_standard_input() -> Option<Self> {
        None
    }

    pub(super) fn of_standard_output() -> Option<Self> {
        None
    }
}

/// One path for each file however it is named, for files that do not exist yet too.
pub(crate) fn resolved(path: &Path) -> PathBuf {
    if let Ok(there) = path.canonicalize() {
        return there;
    }
    let target = final_target(path);
    let absolute = std::path::absolute(&target).unwrap_or(target);
    let of_folder = |folder: &Path| {
        let rest = absolute.strip_prefix(folder).ok()?;
        Some(folder.canonicalize().ok()?.join(rest))
    };
    (absolute.ancestors().skip(1))
        .find_map(of_folder)
        .unwrap_or(absolute.clone())
}

/// Where links lead, though nothing may be there yet; of a loop the path itself.
pub(crate) fn final_target(path: &Path) -> PathBuf {
    let mut target = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        match std::fs::read_link(&target) {
            Ok(next) => target = target.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return target,
        }
    }
    path.to_path_buf()
}
