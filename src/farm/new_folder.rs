//! Folders that are there as a whole, or not.

use std::path::Path;

use super::FarmError;
use super::bundle::failed;
use crate::files;

/// Lets `fill` write into a new folder, which gets its name once all is there.
///
/// # Errors
/// Something other than an empty folder is there already, it cannot be made, or `fill` fails.
pub fn write_new_folder<T, E: From<FarmError>>(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    let unfit = |problem: String| FarmError::Unfit(format!("{}: {problem}", path.display()));
    files::output(path).map_err(|conflict| FarmError::Unfit(conflict.to_string()))?;
    let is_free = match std::fs::read_dir(path) {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) => std::fs::symlink_metadata(path).is_err(),
    };
    if !is_free {
        return Err(E::from(unfit(
            "is there already; expected a new folder or an empty one; name another, or remove it"
                .to_owned(),
        )));
    }
    let absolute = std::path::absolute(path).map_err(failed(path, "cannot be made"))?;
    let parent = absolute.parent().unwrap_or(Path::new("/"));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".mixray-");
    #[cfg(unix)]
    {
        // tempfile's default of 0700 would keep the hosts of a farm out; the umask still applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o777));
    }
    let folder = (builder.tempdir_in(parent)).map_err(failed(path, "cannot be made"))?;
    let filled = fill(folder.path())?;
    // An empty folder of that name makes way; where there is none, nothing does.
    let _ = std::fs::remove_dir(path);
    std::fs::rename(folder.path(), path).map_err(failed(path, "cannot be made"))?;
    // It is no temporary folder any longer.
    let _ = folder.keep();
    Ok(filled)
}
