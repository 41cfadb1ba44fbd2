//! Temporary files beside an output: named after it, and locked for as long as somebody writes them, so that a later run can tell what an
//! ended one has left.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::path::Path;

use tempfile::NamedTempFile;

const PREFIX: &str = ".mixray-";
const SUFFIX: &str = ".tmp";
/// Letters and digits that tempfile puts between prefix and suffix.
const RANDOM_BYTES: usize = 6;
/// Longer output names are cut here: a file's name has at most 255 bytes.
const MAX_NAME_BYTES: usize = 200;
/// Tries until a file stays: each fails only if another run cleans up between its making and its locking.
const TRIES: usize = 100;

/// An empty file in the folder, for the output of that name.
pub(super) fn make(folder: &Path, output: &OsStr) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    let prefix = prefix(output);
    (builder.prefix(&prefix).suffix(SUFFIX)).rand_bytes(RANDOM_BYTES);
    #[cfg(unix)]
    {
        // tempfile's default of 0600 would leave the picture unreadable for others; the umask still applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    for _ in 0..TRIES {
        let file = builder.tempfile_in(folder)?;
        // Where the file system has no locks nothing is ever cleaned up either.
        if file.as_file().lock().is_err() || file.path().exists() {
            return Ok(file);
        }
    }
    Err(io::Error::other("other runs remove its temporary files"))
}

/// Removes what ended runs have left in the folder for outputs whose names `is_own` knows.
pub(crate) fn remove_leftovers(folder: &Path, is_own: impl Fn(&OsStr) -> bool) {
    // What cannot be listed or removed is in nobody's way.
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        if !output_of(&entry.file_name()).is_some_and(|output| is_own(&output)) {
            continue;
        }
        // Removed under the lock: whoever has just made it sees that it is gone.
        if let Ok(file) = File::options().write(true).open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

fn prefix(output: &OsStr) -> OsString {
    let mut prefix = OsString::from(PREFIX);
    prefix.push(cut(output));
    prefix.push("-");
    prefix
}

/// As much of an output's name as stands in those of its temporary files.
pub(crate) fn cut(output: &OsStr) -> OsString {
    let bytes = output.as_encoded_bytes();
    match bytes.len() <= MAX_NAME_BYTES {
        true => output.to_owned(),
        false => {
            let name = output.to_string_lossy();
            OsString::from(&name[..name.floor_char_boundary(MAX_NAME_BYTES)])
        }
    }
}

/// What a temporary file stands for, as [`cut`] has it.
fn output_of(name: &OsStr) -> Option<OsString> {
    let bytes = name.as_encoded_bytes();
    let rest = bytes.strip_prefix(PREFIX.as_bytes())?;
    let rest = rest.strip_suffix(SUFFIX.as_bytes())?;
    let (output, random) = rest.split_at_checked(rest.len().checked_sub(RANDOM_BYTES + 1)?)?;
    let is_random = random[0] == b'-' && random[1..].iter().all(u8::is_ascii_alphanumeric);
    is_random.then(|| OsString::from(String::from_utf8_lossy(output).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn only_what_nobody_writes_and_what_is_ours_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let name = OsStr::new("a.png");
        let (_, dead) = make(folder, name).unwrap().keep().unwrap();
        let alive = make(folder, name).unwrap();
        let (_, other) = make(folder, OsStr::new("b.png")).unwrap().keep().unwrap();
        for foreign in [".mixray-a.png-short.tmp", ".mixray-a.png", "a.png"] {
            std::fs::write(folder.join(foreign), "").unwrap();
        }
        assert_eq!(left(folder), 6);
        remove_leftovers(folder, |output| output == name);
        assert!(!dead.exists() && alive.path().exists() && other.exists());
        assert_eq!(left(folder), 5, "nothing else is removed");
        drop(alive);
        assert_eq!(left(folder), 4);
    }

    #[test]
    fn long_names_have_temporary_files_too() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["x".repeat(251) + ".png", "\u{e9}".repeat(125) + ".png"] {
            let name = OsStr::new(&name);
            let (_, path) = make(folder.path(), name).unwrap().keep().unwrap();
            assert_eq!(output_of(path.file_name().unwrap()), Some(cut(name)));
            remove_leftovers(folder.path(), |output| output == cut(name));
            assert!(!path.exists());
        }
    }
}
