//! Objects placed by pixel, size and direction stand where `mixray pick` and the closed form say.

use std::path::Path;

use mixray::scene::placing::foot;
use mixray::scene::projection::project;
use mixray::scene::{self, Scene};

use super::TABLE;
use crate::support::{Folder, shared_data};

fn load(object: &str) -> Scene {
    let text = format!("{TABLE}[[virtual]]\n{object}");
    scene::load_text(Path::new("scene.toml"), &text).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(object: &str) -> String {
    let text = format!("{TABLE}[[virtual]]\n{object}");
    let error = scene::load_text(Path::new("scene.toml"), &text);
    error.expect_err("is refused").to_string()
}

#[test]
fn an_object_stands_on_the_proxy_under_its_pixel() {
    for object in [
        "shape = \"sphere\"\nscale = 0.2",
        "shape = \"box\"\nsize = [0.3, 0.1, 0.2]\nrotation_deg = [0, 40, 0]",
        "shape = \"box\"\nrotation_deg = [20, 40, 10]\nsize_m = 0.4",
    ] {
        let at = |pixel: &str| {
            let scene = load(&format!("{object}\nrest_on = \"real\"\npixel = {pixel}\n"));
            let object = &scene.objects[1];
            let foot = foot(&object.instances, object.world_from_object).expect("has triangles");
            (
                foot.point,
                project(&scene.camera, foot.point).expect("is seen"),
            )
        };
        let (point, seen) = at("[40.5, 30.25]");
        assert!(point.y.abs() < 1e-6, "{object}: {point}");
        assert!(
            (seen.x - 40.5).abs() < 1e-3 && (seen.y - 30.25).abs() < 1e-3,
            "{object}: {seen}"
        );
        let (other, _) = at("[20, 30]");
        assert!(point.distance(other) > 0.1, "control");
    }
}

#[test]
fn without_a_pixel_it_falls_or_rises_to_the_proxy() {
    for height in [0.5, 0.05] {
        let ball = format!(
            "shape = \"sphere\"\nscale = 0.2\nrest_on = \"real\"\ntranslation = [0.3, {height}, 0.1]\n"
        );
        let place = load(&ball).objects[1].world_from_object.w_axis.truncate();
        let wanted = glam::DVec3::new(0.3, 0.2, 0.1);
        assert!(place.distance(wanted) < 1e-5, "{place}");
    }
}

#[test]
fn a_size_in_metres_is_that_of_the_largest_side() {
    let scene = load(
        "shape = \"box\"\nsize = [3, 1, 2]\nrotation_deg = [0, 45, 0]\nsize_m = 0.6\ntranslation = [0, 1, 0]",
    );
    let transform = scene.objects[1].world_from_object;
    for axis in [transform.x_axis, transform.y_axis, transform.z_axis] {
        assert!((axis.length() - 0.2).abs() < 1e-9, "{transform}");
    }
}

#[test]
fn an_object_turns_its_front_to_a_point_or_the_camera() {
    let front = |object: &str| {
        let z = load(object).objects[1].world_from_object.z_axis;
        z.truncate().normalize()
    };
    let to = front("shape = \"box\"\ntranslation = [1, 0.5, 0]\nlook_at = [1, 7, -3]\n");
    assert!(to.distance(glam::DVec3::NEG_Z) < 1e-9, "{to}");
    let to = front("shape = \"box\"\nrest_on = \"real\"\npixel = [50, 30]\nlook_at = \"camera\"\n");
    let scene = load("shape = \"sphere\"\nscale = 0.01\nrest_on = \"real\"\npixel = [50, 30]\n");
    let at = scene.objects[1].world_from_object.w_axis.truncate();
    let wanted = (glam::DVec3::new(0.0, at.y, 3.0) - at).normalize();
    assert!(to.distance(wanted) < 1e-6, "{to} {wanted}");
    assert!(to.distance(glam::DVec3::Z) > 0.05, "control: it is turned");
}

#[test]
fn what_cannot_be_placed_is_refused() {
    for (object, part) in [
        (
            "shape = \"box\"\npixel = [1, 1]",
            "`pixel` without `rest_on`",
        ),
        (
            "shape = \"box\"\nrest_on = \"real\"\npixel = [1, 1]",
            "shows nothing of the proxy",
        ),
        (
            "shape = \"box\"\nrest_on = \"real\"\npixel = [64.5, 1]",
            "a place in the picture of 64 x 48",
        ),
        (
            "shape = \"box\"\nrest_on = \"real\"\npixel = [9, 40]\ntranslation = [0, 0, 0]",
            "both given",
        ),
        ("shape = \"box\"\nrest_on = \"reel\"", "\"real\": the proxy"),
        (
            "shape = \"box\"\nrest_on = \"real\"\ntranslation = [0, 0, 9]",
            "finds nothing of the proxy under",
        ),
        ("shape = \"box\"\nscale = 2\nsize_m = 2", "both given"),
        ("shape = \"box\"\nsize_m = 0", "above 0"),
        (
            "shape = \"box\"\nlook_at = [0, 5, 0]",
            "straight above or below",
        ),
        ("shape = \"box\"\nlook_at = \"me\"", "\"camera\""),
        (
            "shape = \"box\"\nlook_at = [0, 0, 1]\nrotation_deg = [0, 1, 0]",
            "both given",
        ),
    ] {
        let error = refused(object);
        assert!(error.contains(part), "{object}: {error}");
    }
    let wall = TABLE.replace("edge_v = [0, 0, -4]", "edge_v = [0, 4, 0]");
    let text = format!("{wall}[[virtual]]\nshape = \"box\"\nrest_on = \"real\"\npixel = [32, 30]");
    let error = scene::load_text(
        Path::new("scene.toml"),
        &text.replace("[-2, 0, 2]", "[-2, -1, 0]"),
    );
    let error = error.expect_err("is steep").to_string();
    assert!(error.contains("`table` is 90 degrees steep"), "{error}");
    let real = TABLE.replace("shape = \"quad\"", "rest_on = \"real\"\nshape = \"quad\"");
    let error = scene::load_text(Path::new("scene.toml"), &real).expect_err("is refused");
    assert!(
        error.to_string().contains("`rest_on` in [[real]]"),
        "{error}"
    );
}

#[test]
fn pick_tells_what_stands_at_a_pixel() {
    let folder = Folder::new();
    let ball = "[[virtual]]\nname = \"ball\"\nshape = \"sphere\"\nscale = 0.2\nrest_on = \"real\"\npixel = [32, 28]\nmaterial = { metallic = 1.0 }\n";
    folder.write("scene.toml", format!("{TABLE}{ball}"));
    let table = folder.succeed("pick scene.toml 5 44");
    assert!(
        table.starts_with("object    table (real, quad)\n"),
        "{table}"
    );
    assert!(table.contains("normal    [0, 1, 0]\n"), "{table}");
    assert!(table.contains(", 0, "), "the height: {table}");
    let both = folder.succeed("pick scene.toml 32 26");
    assert!(
        both.starts_with("object    ball (virtual, sphere)\n"),
        "{both}"
    );
    assert!(both.contains("behind it\nobject    table"), "{both}");
    assert!(folder.succeed("pick scene.toml 1 1").starts_with("nothing"));
    folder.refuse("pick scene.toml 65 1", "not in the picture");
}

/// A scan of a desk: what is put down at a pixel touches the scan there.
#[test]
fn things_rest_on_a_scanned_desk() {
    let Some(data) = shared_data("tum_desk_rgbd") else {
        return;
    };
    let data = data.display();
    let text = |more: &str| {
        format!(
            "[photo]\nimage = \"{data}/photo.png\"\n[camera]\nfile = \"{data}/camera.json\"\n{more}\n[environment]\nradiance = [1, 1, 1]\n\
             [[real]]\nmesh = \"{data}/proxy.glb\"\n[[virtual]]\nshape = \"sphere\"\nsize_m = 0.1\nrest_on = \"real\"\npixel = [330, 330]\n"
        )
    };
    let load = |more: &str| {
        scene::load_text(Path::new("scene.toml"), &text(more)).unwrap_or_else(|e| panic!("{e}"))
    };
    let scene = load("pixel_origin = \"centre\"");
    let ball = scene.objects[1].world_from_object.w_axis.truncate();
    // The white desk is the plane y = 0, to 3.6 mm.
    assert!((ball.y - 0.05).abs() < 0.012, "{ball}");
    assert!((scene.camera.cx - 325.6).abs() < 1e-9);
    let told = |scene: &Scene| {
        scene
            .warnings
            .iter()
            .any(|line| line.contains("half a pixel"))
    };
    assert!(
        !told(&scene) && told(&load("")),
        "the half pixel is told where it is not said"
    );
}
