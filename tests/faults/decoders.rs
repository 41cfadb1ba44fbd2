//! Pictures and streams that decoders panic at, take long for, or that ask for more memory than they are worth.

use std::path::Path;

use super::fuzz::seeds::model;
use super::{RENDER, SMALL, assert_done, assert_refused, folder_of, shell};

const PALETTE_PNG: &[u8] = include_bytes!("data/palette.png");
const PROGRESSIVE_JPEG: &[u8] = include_bytes!("data/progressive.jpg");

/// One frame, seen from the origin.
const POSE: &str = "[[frame]]\nframe = 0\nworld_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]\n";

/// Where a PNG chunk of this name has its length.
fn chunk(png: &[u8], name: &[u8; 4]) -> usize {
    let at = png.windows(4).position(|window| window == name);
    at.expect("a chunk") - 4
}

/// Without a checksum that fits, a decoder would refuse the chunk before it looks into it.
fn with_chunk(png: &[u8], name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let at = chunk(png, name);
    let length = u32::from_be_bytes(png[at..at + 4].try_into().expect("four bytes")) as usize;
    let crc = |bytes: &[u8]| {
        !bytes.iter().fold(u32::MAX, |sum, byte| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
                (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 }
            })
        })
    };
    let named = [name.as_slice(), data].concat();
    [
        &png[..at],
        &(data.len() as u32).to_be_bytes(),
        &named,
        &crc(&named).to_be_bytes(),
        &png[at + 12 + length..],
    ]
    .concat()
}

#[test]
fn a_palette_that_is_cut_off_is_an_error_that_names_the_picture() {
    for length in [1, 2, 4, 5, 7] {
        let damaged = with_chunk(PALETTE_PNG, b"PLTE", &vec![7; length]);
        let folder = folder_of(Some(("photo.png", &damaged)), "");
        assert_refused(&shell(folder.path(), RENDER), &["photo.png"]);
        let compared = shell(folder.path(), "$MIXRAY compare photo.png photo.png");
        assert_refused(&compared, &["photo.png"]);
    }
    let folder = folder_of(Some(("photo.png", PALETTE_PNG)), "");
    assert_done(&shell(folder.path(), RENDER));
}

#[test]
fn a_palette_that_is_cut_off_is_refused_as_a_frame_and_as_a_texture() {
    let damaged = with_chunk(PALETTE_PNG, b"PLTE", &[7; 4]);
    let folder = folder_of(None, SMALL);
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("t.toml"), POSE).expect("a writable folder");
    std::fs::create_dir(at("in")).expect("a writable folder");
    let sequence =
        "$MIXRAY sequence scene.toml --frames in --trajectory t.toml --rpp 1 --backend cpu -o out";
    std::fs::write(at("in/f_0.png"), &damaged).expect("a writable folder");
    assert_refused(&shell(folder.path(), sequence), &["in/f_0.png"]);
    std::fs::write(at("in/f_0.png"), PALETTE_PNG).expect("a writable folder");
    assert_done(&shell(folder.path(), sequence));

    let scene = std::fs::read_to_string(at("scene.toml")).expect("is there");
    let with_model = scene.replace("shape = \"sphere\"", "mesh = \"model.glb\"");
    std::fs::write(at("scene.toml"), with_model).expect("a writable folder");
    std::fs::write(at("model.glb"), model(&damaged)).expect("a writable folder");
    assert_refused(&shell(folder.path(), RENDER), &["model.glb", "images[0]"]);
    std::fs::write(at("model.glb"), model(PALETTE_PNG)).expect("a writable folder");
    assert_done(&shell(folder.path(), RENDER));
}

#[test]
fn a_picture_that_unpacks_to_more_than_there_is_is_refused_with_the_figures() {
    let header = |side: u32| {
        let mut header = [side.to_be_bytes(), side.to_be_bytes()].concat();
        header.extend([8, 3, 0, 0, 0]);
        header
    };
    let large = with_chunk(PALETTE_PNG, b"IHDR", &header(16384));
    let folder = folder_of(Some(("photo.png", &large)), "");
    let limited = format!("ulimit -v 4000000; {RENDER}");
    assert_refused(
        &shell(folder.path(), &limited),
        &["photo.png", "16384 x 16384", "GB of memory", "ulimit -v"],
    );
    let folder = folder_of(Some(("photo.png", PALETTE_PNG)), "");
    assert_done(&shell(folder.path(), &limited));
}

#[test]
fn a_jpeg_of_hundreds_of_scans_is_refused() {
    // The last scan again and again, before the end of the image.
    let scan = PROGRESSIVE_JPEG
        .windows(2)
        .rposition(|pair| pair == [0xff, 0xda])
        .expect("a scan");
    let end = PROGRESSIVE_JPEG.len() - 2;
    let repeated = |times: usize| {
        let scans = PROGRESSIVE_JPEG[scan..end].repeat(times);
        [&PROGRESSIVE_JPEG[..scan], &scans, &[0xff, 0xd9]].concat()
    };
    let folder = folder_of(Some(("photo.jpg", &repeated(4000))), "");
    assert_refused(
        &shell(folder.path(), RENDER),
        &["photo.jpg", "scans", "at most 100"],
    );
    let folder = folder_of(Some(("photo.jpg", &repeated(1))), "");
    assert_done(&shell(folder.path(), RENDER));
}

#[test]
fn a_jpeg_that_ends_early_is_an_error() {
    let half = &PROGRESSIVE_JPEG[..PROGRESSIVE_JPEG.len() / 2];
    let folder = folder_of(Some(("photo.jpg", half)), "");
    assert_refused(
        &shell(folder.path(), RENDER),
        &["photo.jpg", "end-of-image"],
    );
}

/// An EXR mask as large as the smallest photograph here.
fn mask(folder: &Path) -> Vec<u8> {
    let path = folder.join("mask.exr");
    exr::prelude::write_rgb_file(&path, 16, 12, |x, _| (x as f32 / 16.0, 0.5_f32, 0.5_f32))
        .expect("a writable folder");
    std::fs::read(path).expect("was written")
}

#[test]
fn an_exr_whose_data_window_is_not_true_is_refused_before_memory_is_taken() {
    let folder = folder_of(Some(("photo.png", PALETTE_PNG)), "");
    let commands = [
        "$MIXRAY antialias photo.png photo.png mask.exr -o o.png",
        "$MIXRAY noise apply --profile noise.toml photo.png photo.png mask.exr -o o.png",
        "$MIXRAY noise apply --depth --profile noise.toml photo.png photo.png mask.exr -o o.png",
        "$MIXRAY motion-blur --vector 20,0 photo.png photo.png mask.exr -o o.png",
        "$MIXRAY merge mask.exr -o o.png",
        "$MIXRAY compare mask.exr mask.exr",
    ];
    let whole = mask(folder.path());
    let path = folder.path().join("mask.exr");
    let calibrate = "$MIXRAY noise calibrate --from 0.02,0.5 -o noise.toml";
    for command in [calibrate, "$MIXRAY compare mask.exr mask.exr"] {
        assert_done(&shell(folder.path(), command));
    }
    let name = b"dataWindow\0box2i\0";
    let at = whole
        .windows(name.len())
        .position(|w| w == name)
        .expect("is there")
        + name.len()
        + 4;
    // Each byte of the right and the lower end.
    for byte in at + 8..at + 16 {
        let mut damaged = whole.clone();
        damaged[byte] ^= 0x40;
        std::fs::write(&path, &damaged).expect("a writable folder");
        for command in commands {
            let limited = format!("ulimit -v 6291456; {command}");
            assert_refused(&shell(folder.path(), &limited), &["mask.exr"]);
        }
    }
}

#[test]
fn a_header_word_of_a_stream_that_is_not_ascii_is_read_as_any_other() {
    let folder = folder_of(None, SMALL);
    std::fs::write(folder.path().join("t.toml"), POSE).expect("a writable folder");
    let stream = |word: &[u8]| {
        let head = [b"YUV4MPEG2 W16 H12 F25:1 C444 ", word, b"\nFRAME\n"].concat();
        [head, vec![128; 16 * 12 * 3]].concat()
    };
    let run = |word: &[u8], how: &str| {
        std::fs::write(folder.path().join("in.y4m"), stream(word)).expect("a writable folder");
        let options = "--trajectory t.toml --rpp 1 --backend cpu -o o.y4m --overwrite";
        shell(
            folder.path(),
            &format!("$MIXRAY sequence scene.toml {how} {options}"),
        )
    };
    for how in ["--frames in.y4m", "--frames - < in.y4m"] {
        assert_done(&run(b"Ip", how));
        let word = run("é444".as_bytes(), how);
        assert!([Some(0), Some(2)].contains(&word.status.code()), "{word:?}");
        let bytes = run(&[0xff, 0xfe, b'1'], how);
        assert!(
            [Some(0), Some(2)].contains(&bytes.status.code()),
            "{bytes:?}"
        );
        assert_refused(&run("Wé".as_bytes(), how), &["Wé"]);
    }
}

#[test]
fn a_frame_of_a_stream_is_named_with_its_stream() {
    let folder = folder_of(None, SMALL);
    std::fs::write(folder.path().join("t.toml"), POSE).expect("a writable folder");
    let frame = [b"FRAME\n".as_slice(), &[128; 16 * 12 * 3]].concat();
    let head = b"YUV4MPEG2 W16 H12 F25:1 C444\n";
    let half = &PROGRESSIVE_JPEG[..PROGRESSIVE_JPEG.len() / 2];
    for (name, bytes) in [
        ("two.y4m", [head.as_slice(), &frame, &frame].concat()),
        ("cut.y4m", [head.as_slice(), &frame, &frame[..99]].concat()),
        ("two.mjpeg", PROGRESSIVE_JPEG.repeat(2)),
        ("cut.mjpeg", [half, PROGRESSIVE_JPEG].concat()),
    ] {
        std::fs::write(folder.path().join(name), bytes).expect("a writable folder");
    }
    // The second frame has no pose, or the frame is damaged.
    for (frames, frame, stream) in [
        ("two.y4m", "frame 1", "two.y4m"),
        ("- < two.y4m", "frame 1", "standard input"),
        ("cut.y4m", "frame 1", "cut.y4m"),
        ("- < cut.y4m", "frame 1", "standard input"),
        ("two.mjpeg", "frame 1", "two.mjpeg"),
        ("cut.mjpeg --range 0..1", "frame 0", "cut.mjpeg"),
    ] {
        let script = format!(
            "$MIXRAY sequence scene.toml --trajectory t.toml --rpp 1 --backend cpu --overwrite -o o.y4m --frames {frames}"
        );
        assert_refused(&shell(folder.path(), &script), &[frame, stream]);
    }
}
