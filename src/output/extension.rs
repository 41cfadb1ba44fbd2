//! What the end of an output's name promises, in all commands: a name that ends in what the command cannot write is refused.

use std::path::Path;

use super::OutputError;

/// Ends that promise a file of a kind. What a folder is called ends in none of them.
const OF_FILES: &[&str] = &[
    "png", "exr", "jpg", "jpeg", "tif", "tiff", "dpx", "hdr", "webp", "bmp", "gif", "tga", "y4m",
    "mp4", "m4v", "mov", "mkv", "avi", "webm", "mxf", "ogv", "json", "toml", "csv", "yaml", "yml",
    "html", "md", "svg", "txt", "zip",
];

/// Which of `expected`, all without their point and in small letters, the name ends in; `None`: it has no end.
///
/// # Errors
/// It ends in something else.
pub(crate) fn extension_among(
    path: &Path,
    expected: &[&'static str],
) -> Result<Option<&'static str>, OutputError> {
    let Some(extension) = path.extension() else {
        return Ok(None);
    };
    let found = (expected.iter()).find(|known| extension.eq_ignore_ascii_case(known));
    match found {
        Some(known) => Ok(Some(known)),
        None => Err(OutputError::Extension {
            path: path.into(),
            expected: listed(expected),
        }),
    }
}

/// The name of a folder to write into, unless it ends as that of a file does.
///
/// # Errors
/// It promises a file; `expected` is what the command can be given.
pub(crate) fn check_folder_name(path: &Path, expected: &str) -> Result<(), OutputError> {
    let promises = path.extension().is_some_and(|extension| {
        (OF_FILES.iter()).any(|known| extension.eq_ignore_ascii_case(known))
    });
    match promises {
        true => Err(OutputError::Extension {
            path: path.into(),
            expected: expected.to_owned(),
        }),
        false => Ok(()),
    }
}

/// ".png or .exr".
fn listed(extensions: &[&str]) -> String {
    let ends: Vec<String> = extensions.iter().map(|end| format!(".{end}")).collect();
    match ends.as_slice() {
        [rest @ .., last] if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        ends => ends.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_known_or_refused() {
        let among = |name: &str| extension_among(Path::new(name), &["png", "exr"]);
        assert_eq!(among("a/b.EXR").unwrap(), Some("exr"));
        assert_eq!(among("a.d/b").unwrap(), None);
        let message = among("b.jpg").unwrap_err().to_string();
        assert_eq!(
            message,
            "b.jpg: the name ends in what cannot be written here; expected .png or .exr; name it so"
        );
        let folder = |name: &str| check_folder_name(Path::new(name), "a folder").is_ok();
        assert!(folder("take.01") && folder("out") && folder("v1.2/"));
        assert!(!folder("out.exr") && !folder("out.MP4") && !folder("out.exr/"));
    }
}
