//! Small files that unpack to hundreds of millions of pixels, wherever a picture is taken, with little memory.

use std::io::Write;

use exr::prelude::{SpecificChannels, WritableImage, f16};

use super::fuzz::seeds::model;
use super::{RENDER, SMALL, assert_done, assert_refused, folder_of, shell};

/// A VP8L picture of 16383 x 16383 pixels of one colour.
const WEBP: &[u8] = b"RIFF\x1e\0\0\0WEBPVP8L\x11\0\0\0\x2f\xfe\xbf\xff\x0f\x07\x50\xbc\x6a\xd5\xb2\xff\x81\x88\xe8\x7f\0\0";
const BASELINE_JPEG: &[u8] = include_bytes!("data/restart.jpg");

/// A black PNG of `side` pixels a side, of this many bits a channel and type of colour.
fn png(side: u32, bits: u8, colour: u8, bits_per_px: u32) -> Vec<u8> {
    let chunk = |name: &[u8], data: &[u8]| {
        let mut crc = flate2::Crc::new();
        crc.update(name);
        crc.update(data);
        let length = (data.len() as u32).to_be_bytes();
        [&length, name, data, &crc.sum().to_be_bytes()].concat()
    };
    let mut header = [side.to_be_bytes(), side.to_be_bytes()].concat();
    header.extend([bits, colour, 0, 0, 0]);
    let row = vec![0; 1 + (side * bits_per_px).div_ceil(8) as usize];
    let mut rows = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    for _ in 0..side {
        rows.write_all(&row).expect("memory");
    }
    [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &header),
        chunk(b"IDAT", &rows.finish().expect("memory")),
        chunk(b"IEND", b""),
    ]
    .concat()
}

/// A JPEG that says it has `side` pixels a side.
fn jpeg(side: u16) -> Vec<u8> {
    let mut bytes = BASELINE_JPEG.to_vec();
    let frame = bytes.windows(2).position(|marker| marker == [0xff, 0xc0]);
    let at = frame.expect("a frame") + 5;
    bytes[at..at + 2].copy_from_slice(&side.to_be_bytes());
    bytes[at + 2..at + 4].copy_from_slice(&side.to_be_bytes());
    bytes
}

/// A black OpenEXR picture of half floats.
fn exr(side: usize) -> Vec<u8> {
    let black = |_| (f16::ZERO, f16::ZERO, f16::ZERO);
    let mut file = std::io::Cursor::new(Vec::new());
    exr::prelude::Image::from_channels((side, side), SpecificChannels::rgb(black))
        .write()
        .to_buffered(&mut file)
        .expect("encodes");
    file.into_inner()
}

#[test]
fn pictures_that_unpack_to_too_much_are_refused_wherever_they_stand() {
    let folder = folder_of(None, SMALL);
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("a writable folder");
    };
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).expect("is there");
    let textured = scene.replace("shape = \"sphere\"", "mesh = \"model.glb\"");
    write("layer.png", &png(16, 8, 6, 32));
    write("small.png", &png(16, 8, 2, 24));
    let limited = |command: &str| shell(folder.path(), &format!("ulimit -v 1000000; {command}"));
    let layer = "$MIXRAY antialias small.png";
    for (name, bytes, size) in [
        ("bits.png", png(16384, 1, 0, 1), "16384 x 16384"),
        ("deep.png", png(16384, 16, 6, 64), "16384 x 16384"),
        ("large.jpg", jpeg(16384), "16384 x 16384"),
        ("flat.webp", WEBP.to_vec(), "16383 x 16383"),
        ("half.exr", exr(8192), "8192 x 8192"),
    ] {
        write(name, &bytes);
        let named = [name, size, "GB of memory"];
        if !name.ends_with(".webp") {
            write(
                "scene.toml",
                format!("[photo]\nimage = \"{name}\"\n{scene}").as_bytes(),
            );
            assert_refused(&limited(RENDER), &named);
            let image = format!("image = \"{name}\"");
            write(
                "scene.toml",
                scene.replace("radiance = [1, 1, 1]", &image).as_bytes(),
            );
            assert_refused(&limited(RENDER), &named);
            let mask = format!("{layer} layer.png {name} -o out.png");
            assert_refused(&limited(&mask), &named);
            assert_refused(&limited(&format!("{layer} {name} -o out.png")), &named);
        }
        if !name.ends_with(".exr") {
            write("scene.toml", textured.as_bytes());
            write("model.glb", &model(&bytes));
            assert_refused(&limited(RENDER), &["model.glb", size, "GB of memory"]);
        }
    }
    write("scene.toml", textured.as_bytes());
    write("model.glb", &model(&png(64, 1, 0, 1)));
    assert_done(&limited(RENDER));
    assert_done(&limited(&format!("{layer} layer.png -o out.png")));
}

/// Whatever the limit: what a picture takes after it is decoded is known before too.
#[test]
fn memory_for_what_is_decoded_is_refused_with_the_figures() {
    let folder = folder_of(None, SMALL);
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("a writable folder");
    };
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).expect("is there");
    write(
        "scene.toml",
        scene
            .replace("shape = \"sphere\"", "mesh = \"model.glb\"")
            .as_bytes(),
    );
    write("model.glb", &model(&png(4096, 1, 0, 1)));
    write("half.exr", &exr(2048));
    let render = format!("{RENDER} --threads 1");
    for (command, refusals) in [
        (
            render.as_str(),
            ["4096 x 4096 pixels needs", "packing the textures needs"].as_slice(),
        ),
        ("$MIXRAY info half.exr", &["2048 x 2048 pixels needs"]),
    ] {
        let mut said = Vec::new();
        for megabytes in (100..480).step_by(20) {
            let script = format!("ulimit -v {}; {command}", megabytes * 1000);
            let output = shell(folder.path(), &script);
            if output.status.code() != Some(0) {
                assert_refused(&output, &["needs", "MB of memory"]);
                said.push(String::from_utf8_lossy(&output.stderr).into_owned());
            }
        }
        for refusal in refusals {
            assert!(
                said.iter().any(|line| line.contains(refusal)),
                "{refusal}: {said:?}"
            );
        }
        assert_done(&shell(folder.path(), command));
    }
    // What threads set aside for heaps of their own, up to 128 MiB each, is nothing that a picture needs.
    assert_done(&shell(
        folder.path(),
        &format!("ulimit -v 250000; {render}"),
    ));
}
