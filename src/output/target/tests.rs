use super::*;

fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    write_text(&path, "old").unwrap();
    let failed = write_atomically(&path, |file| {
        file.write_all(b"half a pict").unwrap();
        file.flush().unwrap();
        assert_eq!(
            entries(folder.path()).len(),
            2,
            "control: the half-written file is there"
        );
        Err(OutputError::Encode {
            path: path.clone(),
            message: "stop".into(),
        })
    });
    assert!(failed.is_err());
    assert_eq!(entries(folder.path()), ["a.png"]);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    write_text(&path, "new").unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
}

#[test]
fn bad_targets_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert!(matches!(
        Target::picture(&at("a.jpg")),
        Err(OutputError::Extension { .. })
    ));
    assert!(matches!(
        Target::picture(&at("missing/a.png")),
        Err(OutputError::Io { .. })
    ));
    std::fs::create_dir(at("b.exr")).unwrap();
    assert!(matches!(
        Target::picture(&at("b.exr")),
        Err(OutputError::NotAFile { .. })
    ));
    assert_eq!(Target::picture(&at("A.PNG")).unwrap().format(), Format::Png);
    assert_eq!(entries(folder.path()), ["b.exr"]);
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let (real, link) = (
        folder.path().join("real.png"),
        folder.path().join("link.png"),
    );
    write_text(&real, "old").unwrap();
    std::os::unix::fs::symlink("real.png", &link).unwrap();
    write_text(&link, "new").unwrap();
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(std::fs::read_to_string(&real).unwrap(), "new");
    std::fs::remove_file(&real).unwrap();
    write_text(&link, "made").unwrap();
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(std::fs::read_to_string(&real).unwrap(), "made");
}
