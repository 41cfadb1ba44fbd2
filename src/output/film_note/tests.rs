use super::*;
use crate::renderer::Skip;

pub(in crate::output) fn note() -> FilmNote {
    FilmNote {
        version: "1.2.3".into(),
        fingerprint: "0123456789abcdef".into(),
        scene: None,
        range: (7, 47),
        total: 100,
        max_bounces: 3,
        seed: u32::MAX,
        estimator: Estimator::Paper,
        sampler: SamplerKind::Cmj,
        composite: Composite::Quotient,
        combine: Combine::Robust,
        without: [Skip::Plan, Skip::LastVertex].into_iter().collect(),
    }
}

/// The note holds the way from the film to the scene; both may move together.
#[test]
fn the_scene_is_looked_for_beside_the_film() {
    let root = tempfile::tempdir().unwrap();
    let (scenes, films) = (root.path().join("ü scenes"), root.path().join("films"));
    for folder in [&scenes, &films] {
        std::fs::create_dir(folder).unwrap();
    }
    let scene = scenes.join("a.toml");
    std::fs::write(&scene, "").unwrap();
    let here = FilmNote {
        scene: scene.canonicalize().ok(),
        ..note()
    };
    let text = here.to_text(&films);
    assert!(!text.contains(&*root.path().to_string_lossy()), "{text}");
    let found = FilmNote::from_text(&text, &films).unwrap().scene.unwrap();
    assert_eq!(found.canonicalize().ok(), here.scene);
    let elsewhere = FilmNote::from_text(&text, Path::new("/moved/films")).unwrap();
    assert_eq!(
        elsewhere.scene,
        Some("/moved/films/../ü scenes/a.toml".into())
    );
    let absolute = text.replace("../ü scenes", "/etc");
    assert_eq!(FilmNote::from_text(&absolute, &films).unwrap().scene, None);
}

#[test]
fn notes_that_this_program_did_not_write_are_refused() {
    let text = note().to_text(Path::new("."));
    let read = |text: &str| FilmNote::from_text(text, Path::new("."));
    assert_eq!(read(&text), Ok(note()), "control");
    for (from, to, part) in [
        ("\"form\":4", "\"form\":3", "form 3; expected form 4"),
        ("\"form\":4,", "", "missing field `form`"),
        ("\"paper\"", "\"papers\"", "\"papers\" is not known"),
        ("plan", "plans", "plans"),
        ("[7,47]", "[47,7]", "rays 47..7 of 100"),
        ("[7,47]", "[7,101]", "rays 7..101 of 100"),
        ("\"seed\":4294967295", "\"seed\":4294967296", "u32"),
    ] {
        assert!(text.contains(from), "{text} lacks {from}");
        let message = read(&text.replace(from, to)).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn every_difference_is_a_mismatch() {
    assert_eq!(note().mismatch(&note()), None);
    type Change = fn(&mut FilmNote);
    let changes: [(&str, Change); 10] = [
        ("version", |n| n.version.push('1')),
        ("rays per pixel", |n| n.total = 99),
        ("seed", |n| n.seed = 0),
        ("path depth", |n| n.max_bounces = 4),
        ("estimator", |n| n.estimator = Estimator::Direct),
        ("sampler", |n| n.sampler = SamplerKind::Sobol),
        ("composite", |n| n.composite = Composite::Additive),
        ("combination", |n| n.combine = Combine::Mean),
        ("--no-skip", |n| n.without = Without::default()),
        ("scenes", |n| n.fingerprint.push('0')),
    ];
    for (word, change) in changes {
        let mut other = note();
        change(&mut other);
        let message = note().mismatch(&other).expect(word);
        assert!(message.contains(word), "{message}");
    }
}
