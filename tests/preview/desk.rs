//! A first scene: a photograph of a desk with its depth, and a model set down on it.

use mixray::preview::headless;
use mixray::preview::script::parse;

use super::FRAME_TIME;
use crate::support::{Folder, shared_data};

#[test]
fn a_helmet_is_set_down_on_a_photographed_desk() {
    let (Some(desk), Some(models)) = (shared_data("tum_desk_rgbd"), shared_data("gltf_models"))
    else {
        return;
    };
    let folder = Folder::new();
    for (from, name) in [
        (&desk, "photo.png"),
        (&desk, "depth_mm.png"),
        (&models, "DamagedHelmet.glb"),
    ] {
        folder.write(name, std::fs::read(from.join(name)).unwrap());
    }
    folder.succeed("new photo.png -o desk --fov 63.1 --depth depth_mm.png --no-render");
    let [helmet, picture] = ["DamagedHelmet.glb", "picture.png"].map(|name| folder.path(name));
    let script = format!(
        "\
set rays_per_pixel 1
drop {} at 300 360
object DamagedHelmet scale 0.09
object DamagedHelmet rotation_y_deg 25
drag 300 350 to 300 345
expect rests DamagedHelmet within 0.001
save
expect saved
expect no-problem
wait complete
picture {}
",
        helmet.display(),
        picture.display()
    );
    let scene = folder.path("desk/scene.toml");
    headless::run(&scene, &parse(&script).unwrap(), FRAME_TIME, &mut |_| ()).unwrap();
    let text = folder.read("desk/scene.toml");
    assert!(
        text.contains("# Proxy: the depth map.") && text.contains("scale = 0.09"),
        "{text}"
    );
    let [before, after] = ["photo.png", "picture.png"].map(|name| folder.open(name));
    assert_ne!(
        before.get_pixel(300, 330),
        after.get_pixel(300, 330),
        "the helmet"
    );
    let change = |x: u32, y: u32| {
        let [a, b] = [&before, &after].map(|picture| picture.get_pixel(x, y).0);
        (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap()
    };
    assert!(change(620, 20) <= 4, "far from it: {}", change(620, 20));
}
