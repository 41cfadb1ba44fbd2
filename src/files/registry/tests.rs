use super::*;

fn at(path: &str) -> Option<PathBuf> {
    Some(PathBuf::from(path))
}

#[test]
fn an_output_is_no_input_whichever_comes_first() {
    let mut run = Registry::default();
    run.input("a", at("/a"), None).unwrap();
    assert_eq!(
        run.output("./a", at("/a"), None),
        Err(Conflict::Input {
            output: "./a".into(),
            input: "a".into()
        })
    );
    run.output("b", at("/b"), None).unwrap();
    let late = run.input("x/../b", at("/b"), None).unwrap_err();
    assert_eq!(
        late.to_string(),
        "b: is an input of this run (x/../b) and would be overwritten; give the output another name"
    );
    assert!(
        matches!(run.conflict(), Some(Conflict::Input { output, .. }) if output == "./a"),
        "the first is kept"
    );
    // Controls.
    run.input("a", at("/a"), None).unwrap();
    run.output("c", at("/c"), None).unwrap();
}

#[test]
fn outputs_are_named_once_but_written_often() {
    let mut run = Registry::default();
    run.output("a", at("/a"), None).unwrap();
    run.before_write("a", Some(Path::new("/a")), None).unwrap();
    run.before_write("a", Some(Path::new("/a")), None).unwrap();
    assert!(matches!(
        run.output("a", at("/a"), None),
        Err(Conflict::Twice { .. })
    ));
    run.output("own", at("/own"), None).unwrap();
    run.own(Path::new("/own"));
    run.input("own", at("/own"), None).unwrap();
    run.before_write("own", Some(Path::new("/own")), None)
        .unwrap();
}

#[cfg(unix)]
#[test]
fn hard_links_are_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("a"), "a").unwrap();
    std::fs::hard_link(at("a"), at("b")).unwrap();
    std::fs::copy(at("a"), at("c")).unwrap();
    let mut run = Registry::default();
    let identity = |name: &str| Identity::of_path(&at(name));
    run.input("a", Some(at("a")), identity("a")).unwrap();
    assert!(run.output("b", Some(at("b")), identity("b")).is_err());
    run.output("c", Some(at("c")), identity("c")).unwrap();
}
