use super::*;
use crate::preview::composition::Track;
use crate::scene::load_text;

const TEXT: &str = "\
# my desk
[camera] # from the calibration
width = 32
height = 24
vertical_fov_deg = 40
position = [0, 1, 3] # metres
look_at = [0, 0, 0]

[lens]
f_number = 1.8 # wide open
focal_length_mm = 50
focus_distance_m = 3

[environment]
radiance = [1, 1, 1]

[[virtual]]   # the ball
shape = \"sphere\"
translation = [0.1, 0.05, -0.2] # where it lies
rotation_deg = [0, 30, 0]

[render] # fast
rays_per_pixel = 4
";

#[test]
fn edits_keep_comments_and_read_back_as_the_same_scene() {
    let path = Path::new("scene.toml");
    let scene = load_text(path, TEXT).unwrap();
    let mut document = Document::parse(TEXT).unwrap();
    let was = document.composition(&scene);
    let mut same = document.clone();
    same.write(&was, &was, &scene);
    assert_eq!(same.text(), TEXT, "nothing changed");

    let mut is = was.clone();
    is.lens.opening = Opening::FNumber {
        f_number: 5.6,
        focal_length_mm: 50.0,
    };
    is.lens.focus_distance_m = 2.345;
    is.objects[0].translation.x = 0.123_45;
    is.objects[0].rotation = Rotation::EulerDeg(DVec3::new(0.1, 31.7, 0.0));
    is.camera = CameraPose::LookAt {
        position: DVec3::new(0.3, 1.1, 3.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
    };
    is.environment = Some(EnvironmentForm {
        rotation_deg: 12.5,
        scale: 1.7,
    });
    is.rays_per_pixel = 9;
    document.write(&was, &is, &scene);
    let text = document.text();
    for kept in [
        "# my desk",
        "[camera] # from the calibration",
        "position = [0.3, 1.1, 3.0] # metres",
        "f_number = 5.6 # wide open",
        "[[virtual]]   # the ball",
        "translation = [0.12345, 0.05, -0.2] # where it lies",
        "[render] # fast",
    ] {
        assert!(text.contains(kept), "{kept}:\n{text}");
    }
    let read = load_text(path, &text).unwrap();
    let mut applied = scene.clone();
    is.apply(&mut applied);
    let facts = |scene: &Scene| {
        format!(
            "{:?} {:?} {:?} {:?}",
            scene.camera, scene.lens, scene.objects[0].world_from_object, scene.settings
        )
    };
    assert_eq!(facts(&read), facts(&applied));
    assert_ne!(facts(&read), facts(&scene), "control");
    assert_eq!(document.composition(&read), is);
}

#[test]
fn objects_come_and_go() {
    let mut document = Document::parse(TEXT).unwrap();
    document.add_mesh("knot.glb", &Placement::IDENTITY);
    assert!(
        document.text().contains("[[virtual]]\nmesh = \"knot.glb\""),
        "{}",
        document.text()
    );
    document.remove_virtual(1);
    assert_eq!(document.text(), TEXT);
}

#[test]
fn files_are_named_as_the_scene_sees_them() {
    let name = |file: &str| name_of(Path::new(file), Path::new("/a/scene.toml"));
    assert_eq!(name("/a/b/c.glb"), "b/c.glb");
    assert_eq!(name("/d/c.glb"), "/d/c.glb");
}

const KEYED: &str = "\
[camera]
width = 32
height = 24
vertical_fov_deg = 40

[lens]
focus_distance_m = 3
motion = [{ time_secs = 0, focus_distance_m = 1 }] # one line

[[virtual]] # the ball
shape = \"sphere\"
scale = 0.5

# it comes
[[virtual.motion]]
time_secs = 2 # late
translation = [1, 0, -3] # over there

[[virtual.motion]]
time_secs = 0
translation = [0, 0, -3]

[[virtual]]
shape = \"sphere\"
translation = [0, 1, -3] # at rest

[render]
rays_per_pixel = 4
";

#[test]
fn keys_are_written_with_comments_and_order_kept() {
    let path = Path::new("scene.toml");
    let scene = load_text(path, KEYED).unwrap();
    let document = Document::parse(KEYED).unwrap();
    let was = document.composition(&scene);
    assert_eq!(was.motions[0].times_secs(), [0.0, 2.0]);
    assert_eq!(was.focus_distance_m(), 1.0, "by its key");
    let written = |is: &Composition| {
        let mut document = document.clone();
        document.write(&was, is, &scene);
        document.text()
    };
    assert_eq!(written(&was), KEYED, "nothing changed");

    let mut is = was.clone();
    assert!(is.shift_key(Track::Object(0), 2.0, 1.5));
    is.set_time(1.0);
    is.set_key(Track::Object(1));
    is.place(
        0,
        Placement {
            translation: DVec3::new(0.5, 0.25, -3.0),
            ..is.placement(0)
        },
    );
    is.focus(2.0);
    let text = written(&is);
    for kept in [
        "# it comes\n[[virtual.motion]]\ntime_secs = 1.5 # late\n",
        "# over there",
        "# one line",
    ] {
        assert!(text.contains(kept), "{kept}:\n{text}");
    }
    let order: Vec<&str> = text.lines().filter(|line| line.starts_with("[[")).collect();
    let virtual_motion = "[[virtual.motion]]";
    assert_eq!(
        order,
        [
            "[[virtual]] # the ball",
            virtual_motion,
            virtual_motion,
            virtual_motion,
            "[[virtual]]",
            virtual_motion
        ]
    );
    let again = load_text(path, &text).unwrap();
    let read = Document::parse(&text).unwrap().composition(&again);
    assert_eq!(read.motions[0].times_secs(), [0.0, 1.0, 1.5]);
    assert_eq!(read.motions[1].times_secs(), [1.0]);
    let mut edited = scene.clone();
    is.apply(&mut edited);
    for (index, (a, b)) in again.objects.iter().zip(&edited.objects).enumerate() {
        assert_eq!(a.world_from_object, b.world_from_object, "object {index}");
        assert_eq!(a.motion, b.motion, "object {index}");
    }
    assert_eq!(
        (again.lens, again.focus_path),
        (edited.lens, edited.focus_path)
    );

    // The last key leaves its object where it had it.
    is.delete_key(Track::Object(1));
    assert_eq!(is.objects[1], was.objects[1]);
    let mut without = was.clone();
    without.motions[0] = Keys::default();
    let text = written(&without);
    assert!(
        !text.contains(virtual_motion) && text.contains("# at rest"),
        "{text}"
    );
}

#[test]
fn an_object_turns_about_itself_between_two_keys() {
    let scene = load_text(Path::new("scene.toml"), TEXT).unwrap();
    let mut composition = Document::parse(TEXT).unwrap().composition(&scene);
    let before = composition.placement(0);
    composition.set_key(Track::Object(0));
    assert_eq!(composition.placement(0), before);
    composition.set_time(1.0);
    let turned = Placement {
        rotation: Rotation::EulerDeg(DVec3::new(0.0, 150.0, 0.0)),
        ..before
    };
    composition.place(0, turned);
    composition.set_time(0.5);
    let between = composition.placement(0);
    assert_eq!(between.translation, before.translation);
    assert_eq!(
        between.rotation,
        Rotation::EulerDeg(DVec3::new(0.0, 90.0, 0.0))
    );
}
