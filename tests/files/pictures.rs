//! Colours, orientation, parts and windows of photographs.

use std::io::Cursor;

use exr::prelude::*;
use image::{ExtendedColorType, ImageDecoder, ImageEncoder};
use moxcms::ColorProfile;

use super::support::ball_with_camera;
use crate::support::{Folder, stderr};

/// A scene over `photo` whose ball stands in the middle.
fn folder(photo: &str, more: &str) -> Folder {
    let folder = Folder::new();
    folder.write(
        "scene.toml",
        ball_with_camera().replace(
            "[camera]\n",
            &format!("[photo]\nimage = \"{photo}\"\n{more}[camera]\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n"),
        ),
    );
    folder
}

/// What the program says of a render.
fn render(folder: &Folder) -> String {
    let output = folder.run("render scene.toml -o out.png");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    stderr(&output)
}

/// A picture of one code, with a profile.
fn with_profile(code: [u8; 3], profile: Option<&ColorProfile>) -> Vec<u8> {
    with_icc(
        code,
        profile.map(|profile| profile.encode().expect("encodes")),
    )
}

fn with_icc(code: [u8; 3], icc: Option<Vec<u8>>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    if let Some(icc) = icc {
        encoder.set_icc_profile(icc).expect("is taken");
    }
    let codes = code.repeat(64 * 48);
    encoder
        .write_image(&codes, 64, 48, ExtendedColorType::Rgb8)
        .expect("encodes");
    bytes
}

fn profile_of(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut decoder = image::codecs::png::PngDecoder::new(Cursor::new(bytes)).expect("decodes");
    decoder.icc_profile().expect("reads")
}

#[test]
fn icc_p3() {
    let folder = folder("p.png", "");
    // It holds the time at which it was encoded.
    let p3 = ColorProfile::new_display_p3().encode().expect("encodes");
    folder.write("p.png", with_icc([200, 40, 40], Some(p3.clone())));
    let said = render(&folder);
    assert!(!said.contains("profile"), "{said}");
    let out = folder.open("out.png");
    assert_eq!(out.get_pixel(0, 0).0, [200, 40, 40], "codes are kept");
    assert_eq!(profile_of(&folder.bytes("out.png")), Some(p3));
    // The ball's own colour is written in the photograph's.
    let ball_p3 = out.get_pixel(32, 24).0;
    folder.write("p.png", with_profile([200, 40, 40], None));
    render(&folder);
    let ball_srgb = folder.open("out.png").get_pixel(32, 24).0;
    assert_eq!(profile_of(&folder.bytes("out.png")), None, "control");
    let linear = |code: u8| mixray::scene::srgb::decode(f64::from(code) / 255.0);
    // Display P3 of a Rec.709 colour, by the matrix of their primaries.
    let [r, g, b] = ball_srgb.map(linear);
    let p3 = [
        0.8225 * r + 0.1775 * g,
        0.0332 * r + 0.9668 * g,
        0.0171 * r + 0.0724 * g + 0.9105 * b,
    ];
    for (ours, expected) in ball_p3.iter().zip(p3) {
        let expected = mixray::scene::srgb::encode(expected) * 255.0;
        assert!(
            (f64::from(*ours) - expected).abs() < 3.0,
            "{ball_p3:?} {expected}"
        );
    }
    assert_ne!(ball_p3, ball_srgb, "control");
}

#[test]
fn profiles_of_srgb_adobe_and_gray() {
    let folder = folder("p.png", "");
    for (profile, kept) in [
        (ColorProfile::new_srgb(), false),
        (ColorProfile::new_adobe_rgb(), true),
        (ColorProfile::new_pro_photo_rgb(), true),
    ] {
        folder.write("p.png", with_profile([90, 120, 30], Some(&profile)));
        let said = render(&folder);
        assert!(!said.contains("profile"), "{said}");
        assert_eq!(profile_of(&folder.bytes("out.png")).is_some(), kept);
        assert_eq!(folder.open("out.png").get_pixel(0, 0).0, [90, 120, 30]);
    }
    let gray = ColorProfile::new_gray_with_gamma(1.8);
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    encoder
        .set_icc_profile(gray.encode().expect("encodes"))
        .expect("is taken");
    encoder
        .write_image(&[77; 64 * 48], 64, 48, ExtendedColorType::L8)
        .expect("encodes");
    folder.write("p.png", bytes);
    assert!(!render(&folder).contains("profile"));
    assert_eq!(folder.open("out.png").get_pixel(0, 0).0, [77; 3]);
    assert!(profile_of(&folder.bytes("out.png")).is_some());
    // What is no matrix and curves is told.
    let lab = ColorProfile::new_lab();
    folder.write("p.png", with_profile([90, 120, 30], Some(&lab)));
    let said = render(&folder);
    assert_eq!(said.matches("not understood").count(), 1, "{said}");
}

/// A PNG file with chunks before its pixels.
fn with_chunks(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let whole = with_profile([200, 40, 40], None);
    let mut bytes = whole[..33].to_vec();
    for (name, data) in chunks {
        bytes.extend((data.len() as u32).to_be_bytes());
        let body = [&name[..], data].concat();
        bytes.extend(&body);
        bytes.extend(crc32(&body).to_be_bytes());
    }
    bytes.extend(&whole[33..]);
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 * (crc & 1))
        })
    })
}

#[test]
fn gama45455() {
    let folder = folder("p.png", "");
    folder.write("p.png", with_chunks(&[(b"gAMA", &45455_u32.to_be_bytes())]));
    let said = render(&folder);
    assert!(!said.contains("gamma"), "{said}");
    assert_eq!(profile_of(&folder.bytes("out.png")), None);
    folder.write(
        "p.png",
        with_chunks(&[(b"gAMA", &100_000_u32.to_be_bytes())]),
    );
    let said = render(&folder);
    assert!(!said.contains("gamma"), "{said}");
    assert!(profile_of(&folder.bytes("out.png")).is_some(), "control");
    folder.write("p.png", with_chunks(&[(b"gAMA", &[0; 4])]));
    let said = render(&folder);
    assert!(said.contains("gamma"), "control: {said}");
}

#[test]
fn png_cicp() {
    let folder = folder("p.png", "");
    folder.write("p.png", with_chunks(&[(b"cICP", &[12, 13, 0, 1])]));
    assert!(!render(&folder).contains("warning"));
    let profile = profile_of(&folder.bytes("out.png")).expect("Display P3");
    // As libpng asks for, which drops others.
    let length = u32::from_be_bytes([profile[0], profile[1], profile[2], profile[3]]);
    assert_eq!((profile.len() % 4, length as usize), (0, profile.len()));
    assert_eq!(profile[68..72], [0, 0, 0xf6, 0xd6]);
    folder.write("p.png", with_chunks(&[(b"cICP", &[1, 13, 0, 1])]));
    assert!(!render(&folder).contains("warning"));
    assert_eq!(profile_of(&folder.bytes("out.png")), None, "control: sRGB");
    for hdr in [[9, 16, 0, 1], [9, 18, 0, 1]] {
        folder.write("p.png", with_chunks(&[(b"cICP", &hdr)]));
        let said = render(&folder);
        assert!(
            said.contains("PQ or HLG") && said.contains("OpenEXR"),
            "{said}"
        );
    }
}

/// A JPEG whose orientation is 6: to be turned a quarter clockwise.
fn turned_jpeg() -> Vec<u8> {
    let picture = image::RgbImage::from_fn(64, 48, |x, y| match (x < 32, y < 24) {
        (true, true) => image::Rgb([200, 40, 40]),
        _ => image::Rgb([60; 3]),
    });
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95);
    let exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    encoder.set_exif_metadata(exif.to_vec()).expect("is taken");
    encoder.encode_image(&picture).expect("encodes");
    bytes
}

fn orientation_of(bytes: &[u8]) -> u8 {
    let mut decoder = image::codecs::png::PngDecoder::new(Cursor::new(bytes)).expect("decodes");
    decoder.orientation().expect("reads").to_exif()
}

#[test]
fn exif6() {
    let kept = folder("p.jpg", "");
    kept.write("p.jpg", turned_jpeg());
    let said = render(&kept);
    assert_eq!(
        said.matches("orientation").count(),
        2,
        "one warning, with the key: {said}"
    );
    assert_eq!(orientation_of(&kept.bytes("out.png")), 6);
    assert_eq!(kept.open("out.png").dimensions(), (64, 48));
    assert!(kept.open("out.png").get_pixel(2, 2)[0] > 150, "as stored");

    let applied = folder("p.jpg", "orientation = \"apply\"\n");
    applied.write("p.jpg", turned_jpeg());
    let said = render(&applied);
    assert!(!said.contains("orientation"), "{said}");
    let out = applied.open("out.png");
    assert_eq!(orientation_of(&applied.bytes("out.png")), 1);
    assert_eq!(out.dimensions(), (48, 64));
    assert!(out.get_pixel(45, 2)[0] > 150 && out.get_pixel(2, 2)[0] < 100);
}

/// One warning for a film, and frames that are turned alike.
#[test]
fn exif6_in_a_sequence() {
    for (key, size) in [("", (64, 48)), ("orientation = \"apply\"\n", (48, 64))] {
        let folder = folder("p.jpg", key);
        folder.write("p.jpg", turned_jpeg());
        folder.create("frames");
        for number in 0..3 {
            folder.write(&format!("frames/f_{number}.jpg"), turned_jpeg());
        }
        folder.write(
            "t.txt",
            "0 0 0 -3 0 0 0 1\n1 0 0 -3 0 0 0 1\n2 0 0 -3 0 0 0 1\n",
        );
        let said = folder.sequence_of("frames", "t.txt", "");
        let warnings = said.matches("warning").count();
        assert_eq!(warnings, usize::from(key.is_empty()), "{said}");
        assert_eq!(folder.open("out/f_2.png").dimensions(), size);
    }
}

type Part = Layer<AnyChannels<FlatSamples>>;

/// A part of one value a channel, by channel names.
fn part(name: Option<&str>, channels: &[(&str, f32)], size: (usize, usize)) -> Part {
    let channels = channels.iter().map(|(name, value)| {
        AnyChannel::new(*name, FlatSamples::F32(vec![*value; size.0 * size.1]))
    });
    Layer::new(
        size,
        LayerAttributes {
            layer_name: name.map(Text::from),
            ..LayerAttributes::default()
        },
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    )
}

fn exr(parts: Vec<Part>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let window = IntegerBounds::from_dimensions((64, 48));
    let image = Image::from_layers(ImageAttributes::new(window), parts);
    image.write().to_buffered(&mut bytes).expect("encodes");
    bytes.into_inner()
}

fn rgb(prefix: &str, value: f32) -> Vec<(String, f32)> {
    ["R", "G", "B"]
        .map(|c| (format!("{prefix}{c}"), value))
        .to_vec()
}

fn borrowed(channels: &[(String, f32)]) -> Vec<(&str, f32)> {
    channels
        .iter()
        .map(|(name, value)| (name.as_str(), *value))
        .collect()
}

fn corner(folder: &Folder) -> u8 {
    render(folder);
    folder.open("out.png").get_pixel(0, 0)[0]
}

#[test]
fn exr_multipart() {
    let folder = folder("p.exr", "");
    let size = (64, 48);
    let colours = |value: f32| rgb("", value);
    let parts = vec![
        part(Some("depth"), &[("Z", 3.0)], size),
        part(Some("albedo"), &borrowed(&colours(0.9)), size),
        part(Some("rgba"), &borrowed(&colours(0.05)), size),
    ];
    folder.write("p.exr", exr(parts.clone()));
    assert_eq!(corner(&folder), 63, "0.05");
    let scene = folder.read("scene.toml");
    folder.write("scene.toml", scene.replace("p.exr", "p.exr#albedo"));
    assert_eq!(corner(&folder), 243, "0.9");
    folder.write("scene.toml", scene.replace("p.exr", "p.exr#normal"));
    folder.refuse(
        "render scene.toml -o out.png",
        "one of \"albedo\", \"rgba\"",
    );
    folder.write("scene.toml", scene);
    let two = vec![
        part(Some("albedo"), &borrowed(&colours(0.9)), size),
        part(Some("diffuse"), &borrowed(&colours(0.05)), size),
    ];
    folder.write("p.exr", exr(two));
    folder.refuse(
        "render scene.toml -o out.png",
        "several pictures (albedo, diffuse)",
    );
}

#[test]
fn exr_blender() {
    let folder = folder("p.exr", "");
    let mut channels = rgb("ViewLayer.Albedo.", 0.9);
    channels.extend(rgb("ViewLayer.Combined.", 0.05));
    folder.write(
        "p.exr",
        exr(vec![part(None, &borrowed(&channels), (64, 48))]),
    );
    assert_eq!(corner(&folder), 63);
    let scene = folder.read("scene.toml");
    folder.write("scene.toml", scene.replace("p.exr", "p.exr#Albedo"));
    assert_eq!(corner(&folder), 243, "control: the other layer");
}

#[test]
fn exr_crop() {
    let folder = folder("p.exr", "");
    let colours = rgb("", 0.9);
    let mut cropped = part(None, &borrowed(&colours), (48, 36));
    cropped.attributes.layer_position = Vec2(8, 4);
    folder.write("p.exr", exr(vec![cropped]));
    assert!(render(&folder).contains("the rest is black"));
    let out = folder.open("out.png");
    for (at, code) in [
        ((7, 4), 0),
        ((8, 3), 0),
        ((8, 4), 243),
        ((55, 39), 243),
        ((56, 39), 0),
    ] {
        assert_eq!(out.get_pixel(at.0, at.1)[0], code, "{at:?}");
    }
}

#[test]
fn layers() {
    let folder = Folder::new();
    folder.save("photo.png", 32, 24, |_, _| [60; 3]);
    let square = |x: u32, y: u32| (8..24).contains(&x) && (6..18).contains(&y);
    let layer = image::RgbaImage::from_fn(32, 24, |x, y| {
        image::Rgba([200, 50, 50, 255 * u8::from(square(x, y))])
    });
    layer.save(folder.path("layer.png")).expect("saves");
    folder.save("mask.png", 32, 24, |x, y| [255 * u8::from(square(x, y)); 3]);
    for mask in ["layer.png", "mask.png"] {
        folder.succeed(&format!("antialias photo.png layer.png {mask} -o out.png"));
        let out = folder.open("out.png");
        assert_eq!(out.get_pixel(16, 12).0, [200, 50, 50], "{mask}");
        assert_eq!(out.get_pixel(0, 0).0, [60; 3], "control: {mask}");
    }
}

/// Houdini's, RenderMan's and Unreal's names of the picture; pixels that are not square.
#[test]
fn exr_of_other_programs() {
    let folder = folder("p.exr", "");
    let file = |layer: &str| {
        let mut channels = rgb("albedo.", 0.9);
        channels.extend(rgb(layer, 0.05));
        exr(vec![part(None, &borrowed(&channels), (64, 48))])
    };
    for layer in ["C.", "Ci.", "FinalImage.", "beauty.", "RGBA."] {
        folder.write("p.exr", file(layer));
        assert_eq!(corner(&folder), 63, "{layer}");
    }
    folder.write("p.exr", file("diffuse."));
    folder.refuse("render scene.toml -o out.png", "several pictures");

    let mut image = Image::from_layers(
        ImageAttributes::new(IntegerBounds::from_dimensions((64, 48))),
        vec![part(None, &borrowed(&rgb("", 0.05)), (64, 48))],
    );
    for (aspect, is_told) in [(1.0, false), (2.0, true)] {
        image.attributes.pixel_aspect = aspect;
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).expect("encodes");
        folder.write("p.exr", bytes.into_inner());
        let said = render(&folder);
        assert_eq!(said.contains("2 times as wide as high"), is_told, "{said}");
    }
}

#[test]
fn profiles_that_cannot_be_unpacked_are_told() {
    let folder = folder("p.png", "");
    folder.write("p.png", with_chunks(&[(b"iCCP", b"x\0\0no zlib stream")]));
    let said = render(&folder);
    assert!(
        said.contains("its colour profile is not understood"),
        "{said}"
    );
    folder.write("p.png", with_chunks(&[(b"tEXt", b"x\0\0no zlib stream")]));
    assert!(!render(&folder).contains("profile"), "control");
}
