use super::*;
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
