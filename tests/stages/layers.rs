//! Layers of other programs by their own alpha: premultiplied or straight, with the channel names of Nuke and Blender.

use mixray::scene::srgb::decode8;

use super::commands::{layers, save_exr};
use crate::support::Folder;

/// Of `layer.png`'s colour.
const CODE: u8 = 180;

/// Nothing, half, everything.
fn alpha(x: usize) -> f32 {
    match x {
        0..20 => 0.0,
        20..40 => 0.5,
        _ => 1.0,
    }
}

/// A file whose layer has these names for red, green, blue and alpha, colours times alpha where they are `premultiplied`.
fn save_layer(folder: &Folder, name: &str, names: [&str; 4], is_premultiplied: bool) {
    let colour = |x: usize| match is_premultiplied {
        true => alpha(x) * decode8(CODE),
        false => decode8(CODE),
    };
    let [r, g, b, a] = names;
    save_exr(
        folder,
        name,
        &[(r, &colour), (g, &colour), (b, &colour), (a, &alpha)],
    );
}

fn folder() -> Folder {
    let folder = Folder::new();
    layers(&folder);
    let rgba = |x: u32| image::Rgba([CODE, CODE, CODE, (255.0 * alpha(x as usize)).round() as u8]);
    let picture = image::RgbaImage::from_fn(64, 48, |x, _| rgba(x));
    picture.save(folder.path("rgba.png")).expect("saves");
    folder.save("grey.png", 64, 48, |x, _| {
        [(255.0 * alpha(x as usize)).round() as u8; 3]
    });
    folder
}

/// Codes along a row of what `antialias` puts together of these files.
fn row(folder: &Folder, files: &str) -> Vec<u8> {
    folder.succeed(&format!("antialias photo.png {files} -o out.png"));
    let out = folder.open("out.png");
    (0..64).map(|x| out.get_pixel(x, 9).0[0]).collect()
}

fn are_near(a: &[u8], b: &[u8]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1)
}

#[test]
fn layers_bring_their_own_alpha() {
    let folder = folder();
    let expected = row(&folder, "layer.png grey.png");
    assert_eq!(row(&folder, "rgba.png"), expected);
    assert_eq!(row(&folder, "layer.png rgba.png"), expected, "as a mask");
    let photo = folder.open("photo.png");
    assert_eq!(expected[5], photo.get_pixel(5, 9).0[0]);
    assert_eq!(expected[50], CODE);
    for names in [
        ["R", "G", "B", "A"],
        ["rgba.red", "rgba.green", "rgba.blue", "rgba.alpha"],
        [
            "ViewLayer.Combined.R",
            "ViewLayer.Combined.G",
            "ViewLayer.Combined.B",
            "ViewLayer.Combined.A",
        ],
    ] {
        save_layer(&folder, "a.exr", names, true);
        assert!(are_near(&row(&folder, "a.exr"), &expected), "{names:?}");
        assert!(
            are_near(&row(&folder, "layer.png a.exr"), &expected),
            "{names:?} as a mask"
        );
        let twice = row(&folder, "a.exr --straight");
        assert!(!are_near(&twice, &expected), "control");
        save_layer(&folder, "straight.exr", names, false);
        let straight = row(&folder, "straight.exr --straight");
        assert!(are_near(&straight, &expected), "{names:?}");
        // A mask in place of the layer's own alpha: its colours are what they were before.
        let masked = row(&folder, "a.exr mask.png");
        assert_eq!(masked[50], CODE);
        assert_eq!(
            masked[36].abs_diff(CODE),
            0,
            "half there, and whole by the mask"
        );
    }
    let refused = "antialias photo.png layer.png -o out.png";
    folder.refuse(refused, "it has no alpha that tells what is virtual");
    let without_mask = folder.run("antialias photo.png rgba.png -o out.png --depth");
    assert_eq!(without_mask.status.code(), Some(2), "--depth is of MASK");
}

/// What shines and covers nothing is added.
#[test]
fn light_without_coverage_is_added() {
    let folder = folder();
    let none = |_: usize| 0.0;
    let glow = |x: usize| if x < 32 { 0.0 } else { 0.1 };
    let channels: [(&str, &dyn Fn(usize) -> f32); 4] =
        [("R", &glow), ("G", &glow), ("B", &glow), ("A", &none)];
    save_exr(&folder, "glow.exr", &channels);
    let photo = folder.open("photo.png");
    let found = row(&folder, "glow.exr");
    for x in 0..64 {
        let code = photo.get_pixel(x, 9).0[0];
        let light = decode8(code) + glow(x as usize);
        let expected = mixray::scene::srgb::encode8(light);
        assert_eq!(found[x as usize], expected);
        assert_eq!(x < 32, found[x as usize] == code, "control");
    }
}

/// A pane that moves lets through what it let through before.
#[test]
fn a_see_through_layer_stays_so_in_motion() {
    let folder = folder();
    folder.save("photo.png", 64, 48, |_, _| [0; 3]);
    let line =
        |vector: &str| format!("motion-blur photo.png rgba.png --vector {vector} -o out.png");
    let pixel = |vector: &str, x: u32| {
        folder.succeed(&line(vector));
        decode8(folder.open("out.png").get_pixel(x, 20).0[0]) / decode8(CODE)
    };
    let (rests, moves) = (pixel("0,0", 30), pixel("0,8", 30));
    let opaque = pixel("0,8", 55);
    assert!((rests - 0.5).abs() < 0.01, "{rests}");
    assert!((moves - 0.5 * opaque).abs() < 0.01, "{moves}, {opaque}");
    assert!(opaque > 0.9, "control: copies hide what is behind them");
}
