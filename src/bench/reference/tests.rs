use super::*;

/// Matt things: no rare bright path widens the spread of a few scrambles.
fn scene() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room/scene.toml");
    let mut scene = super::super::shrink(crate::scene::load(&path).unwrap(), 10);
    scene.settings.backend = crate::scene::BackendChoice::Cpu;
    scene
}

#[test]
fn mean_and_standard_error_against_hand_computed_ones() {
    let mut scene = scene();
    (scene.camera.width, scene.camera.height) = (1, 1);
    let mut mean = MeanPicture::new(&scene);
    for (x, mask) in [(1.0, 0.0), (2.0, 0.5), (6.0, 1.0)] {
        let picture = Picture {
            width: 1,
            height: 1,
            linear: vec![[x, 2.0, -x]],
        };
        mean.add_picture(&picture, &[mask]);
    }
    // Variance 7 of the values, a third of that of their mean; the constant channel has none.
    assert!((mean.standard_error() - f64::sqrt((7.0 + 0.0 + 7.0) / 3.0 / 3.0)).abs() < 1e-12);
    let truth = mean.truth();
    assert_eq!(truth.picture.linear, [[3.0, 2.0, -3.0]]);
    assert!((truth.standard_error[0][0] - (7.0f32 / 3.0).sqrt()).abs() < 1e-6);
    assert_eq!(truth.standard_error[0][1], 0.0);
    assert_eq!(truth.mask, [0.5]);
}

/// Two references of independent scrambles differ by their stated errors together.
#[test]
fn the_stated_error_is_the_error_and_files_are_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    let source = Source::Folder(folder.path().into());
    let get = |scene: &Scene, goal| {
        reference(
            scene,
            Composite::Additive,
            &source,
            goal,
            &Watcher::none(),
            &mut |_| (),
        )
        .unwrap()
        .unwrap()
    };
    let coarse = ReferenceGoal {
        standard_error: 1.0,
        max_rays_per_pixel: 4096,
    };
    let a = get(&scene, coarse);
    assert_eq!((a.note.source.as_str(), a.note.scrambles), ("made", 16));
    assert_eq!(a.note.rays_per_pixel, 1024);
    assert!(a.note.standard_error > 0.0);

    let again = get(&scene, coarse);
    assert_eq!(again.note.source, "cached");
    assert_eq!(again.truth, a.truth);

    let finer = ReferenceGoal {
        standard_error: 0.7 * a.note.standard_error,
        ..coarse
    };
    let b = get(&scene, finer);
    assert_eq!(b.note.source, "made", "a better one was wanted");
    assert!(b.note.standard_error <= finer.standard_error);
    let stated = a.note.standard_error.hypot(b.note.standard_error);
    let pairs = a.truth.picture.linear.as_flattened().iter();
    let squares: f64 = pairs
        .zip(b.truth.picture.linear.as_flattened())
        .map(|(a, b)| f64::from(a - b).powi(2))
        .sum();
    let apart = (squares / a.truth.standard_error.as_flattened().len() as f64).sqrt();
    assert!((0.8..1.25).contains(&(apart / stated)), "{apart} {stated}");

    let mut moved = scene.clone();
    moved.lens.focus_distance_m *= 1.01;
    assert_eq!(
        get(&moved, coarse).note.source,
        "made",
        "control: another scene"
    );
}
