//! Films: pictures that are cut off, tables that are left out, colours of high definition.

use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ImageBuffer, Rgb, RgbImage};

use super::support::ball_with_camera;
use crate::support::Folder;

const POSES: &str = "0 0 0 -3 0 0 0 1\n1 0 0 -3 0 0 0 1\n2 0 0 -3 0 0 0 1\n";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", ball_with_camera());
    folder.write("t.txt", POSES);
    folder
}

/// A ramp from 40 to 220 along each row, with detail enough for a cut in the middle to be one.
fn jpeg(quality: u8) -> Vec<u8> {
    let picture = RgbImage::from_fn(64, 48, |x, y| {
        Rgb([(40 + x * 180 / 63) as u8, 100 + (y * x % 50) as u8, 90])
    });
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, quality);
    encoder.encode_image(&picture).expect("encodes");
    bytes
}

/// Without its Huffman tables, as webcams write pictures.
fn without_tables(jpeg: &[u8]) -> Vec<u8> {
    let mut out = jpeg[..2].to_vec();
    let mut at = 2;
    while jpeg[at + 1] != 0xda {
        let length = 2 + usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
        if jpeg[at + 1] != 0xc4 {
            out.extend(&jpeg[at..at + length]);
        }
        at += length;
    }
    out.extend(&jpeg[at..]);
    out
}

#[test]
fn mjpeg_nodht() {
    let folder = folder();
    let whole = jpeg(90);
    let bare = without_tables(&whole);
    assert!(bare.len() < whole.len(), "control: there were tables");
    let mut rendered = Vec::new();
    for picture in [whole, bare] {
        folder.write("in.mjpg", picture.repeat(3));
        folder.sequence_of("in.mjpg", "t.txt", "");
        let frame = folder.open("out/frame_000002.png");
        for (x, code) in [(0, 40), (63, 220)] {
            assert!(frame.get_pixel(x, 0)[0].abs_diff(code) < 12, "{x}");
        }
        rendered.push(folder.bytes("out/frame_000002.png"));
    }
    assert_eq!(rendered[0], rendered[1]);
}

#[test]
fn truncjpg() {
    let folder = folder();
    let whole = jpeg(90);
    let cut = &whole[..whole.len() / 2];
    folder.write("p.jpg", cut);
    let scene = ball_with_camera().replace("[camera]", "[photo]\nimage = \"p.jpg\"\n[camera]");
    folder.write("still.toml", &scene);
    folder.refuse("render still.toml -o still.png", "end-of-image marker");
    folder.write("p.jpg", &whole);
    folder.succeed("render still.toml -o still.png");

    let film = [&whole[..], cut, &whole].concat();
    folder.write("in.mjpg", film);
    folder.refuse_sequence_of("in.mjpg", "t.txt", "frame 1: it cannot be decoded");
    let said = folder.sequence_of("in.mjpg", "t.txt", "--damaged-frames pass");
    assert!(
        said.contains("frame 1") && said.contains("passes through"),
        "{said}"
    );
    let row = |n: u32, y: u32| {
        let frame = folder.open(&format!("out/frame_00000{n}.png"));
        (0..64).map(|x| frame.get_pixel(x, y).0).collect::<Vec<_>>()
    };
    assert_eq!(row(0, 47), row(2, 47), "the frame after the damaged one");
    let passed = folder.open("out/frame_000001.png");
    assert!(passed.get_pixel(63, 0)[0] > 200, "its upper half is there");
    assert_ne!(row(0, 47), row(1, 47), "control");
    // Cut within its tables, which then seem to hold where the next begins.
    folder.write("in.mjpg", [&whole[..], &whole[..30], &whole].concat());
    folder.refuse_sequence_of("in.mjpg", "t.txt", "frame 1: it cannot be decoded");
    let said = folder.sequence_of("in.mjpg", "t.txt", "--damaged-frames pass");
    assert!(said.contains("the frame before stands for it"), "{said}");
    assert_eq!(row(0, 47), row(2, 47), "the frame after it");
}

/// What of a PNG file is lost is grey.
#[test]
fn frames_that_are_cut_off_in_folders() {
    let folder = folder();
    folder.create("frames");
    // Noise, so that half of the bytes are half of the rows.
    let code = |x: u32, y: u32, channel: u32| {
        let mixed = u64::from(x * 7919 + y * 104_729 + channel * 31) * 2_654_435_761;
        ((mixed >> 8) % 65_000) as u16
    };
    for number in 0..3 {
        let picture = ImageBuffer::from_fn(64, 48, |x, y| {
            Rgb([0, 1, 2].map(|channel| code(x, y, channel + number)))
        });
        let path = folder.path(&format!("frames/f_{number}.png"));
        match number {
            1 => picture.save(path).expect("saves"),
            _ => DynamicImage::ImageRgb16(picture)
                .into_rgb8()
                .save(path)
                .expect("saves"),
        }
    }
    let wide = |name: &str| image::open(folder.path(name)).expect("opens").into_rgb16();
    let whole = folder.bytes("frames/f_1.png");
    let first_row = wide("frames/f_1.png").into_raw()[..64 * 3].to_vec();
    folder.write("frames/f_1.png", &whole[..whole.len() / 2]);
    folder.refuse_sequence_of("frames", "t.txt", "f_1.png: it cannot be decoded");
    let said = folder.sequence_of("frames", "t.txt", "--damaged-frames pass");
    assert!(
        said.contains("f_1.png") && said.contains("passes through"),
        "{said}"
    );
    assert_eq!(folder.frames_of("out").len(), 3);
    let passed = wide("out/f_1.png").into_raw();
    assert_eq!(passed[..64 * 3], first_row);
    assert!(passed[47 * 64 * 3..].iter().all(|code| *code == 0x8080));
    let next = wide("out/f_2.png").into_raw();
    assert!(
        !next[47 * 64 * 3..].iter().all(|code| *code == 0x8080),
        "control"
    );
}

/// Of which nothing can be decoded: their places are kept, in folders and in films.
#[test]
fn frames_of_which_nothing_is_left() {
    let folder = folder();
    folder.grey_frames(&["f_0.png", "f_1.png", "f_2.png"]);
    let whole = folder.bytes("frames/f_0.png");
    for (lost, word) in [("f_0.png", "grey"), ("f_2.png", "the frame before")] {
        folder.write(&format!("frames/{lost}"), &whole[..10]);
        let said = folder.sequence_of("frames", "t.txt", "--damaged-frames pass");
        assert!(said.contains(&format!("{word} stands for it")), "{said}");
        assert_eq!(folder.frames_of("out").len(), 3, "{lost}");
        let stand_in = folder.bytes(&format!("out/{lost}"));
        assert_eq!(stand_in == folder.bytes("out/f_1.png"), lost == "f_2.png");
        if lost == "f_0.png" {
            let picture = folder.open("out/f_0.png");
            assert!(picture.pixels().all(|pixel| pixel.0 == [128; 3]));
        }
        folder.write(&format!("frames/{lost}"), &whole);
    }
    std::fs::remove_dir_all(folder.path("out")).expect("removes");
    // A film of JPEG pictures whose first is nothing but its marker.
    folder.write(
        "in.mjpg",
        [&[0xff, 0xd8], &jpeg(90)[..], &jpeg(90)].concat(),
    );
    folder.sequence_of("in.mjpg", "t.txt", "--damaged-frames pass");
    assert_eq!(folder.frames_of("out").len(), 3);
    let command = "sequence scene.toml --frames in.mjpg --trajectory t.txt -o out.y4m --overwrite --damaged-frames pass";
    folder.succeed(command);
    let film = folder.bytes("out.y4m");
    let frames = film.windows(6).filter(|at| *at == b"FRAME\n").count();
    assert_eq!(frames, 3);
    assert_eq!(film[film.len() - 3 * (64 * 48 * 3 + 6) + 6], 128, "grey");
    assert_ne!(film[film.len() - 64 * 48 * 3], 128, "control");
}

fn y4m(lost: Option<usize>) -> Vec<u8> {
    let mut bytes = b"YUV4MPEG2 W64 H48 F10:1 Ip A1:1 C444\n".to_vec();
    for frame in 0..3 {
        bytes.extend(b"FRAME\n");
        let size = 64 * 48 * 3;
        let there = match lost {
            Some(lost) if frame == 1 => size - lost,
            _ => size,
        };
        bytes.extend((0..there).map(|i| if i < 64 * 48 { 60 + 40 * frame } else { 90 }));
    }
    bytes
}

/// The frame after one that lacks bytes is found, and keeps its number.
#[test]
fn y4m_frames_that_are_cut_off() {
    let folder = folder();
    folder.write("in.y4m", y4m(None));
    folder.sequence_of("in.y4m", "t.txt", "");
    let whole = folder.frames_of("out");
    // Frames of the same render would be kept.
    std::fs::remove_dir_all(folder.path("out")).expect("removes");
    folder.write("in.y4m", y4m(Some(1000)));
    folder.refuse_sequence_of("in.y4m", "t.txt", "frame 1 has 8216 of 9216 bytes");
    let said = folder.sequence_of("in.y4m", "t.txt", "--damaged-frames pass");
    assert!(said.contains("frame 1 has"), "{said}");
    let passed = folder.frames_of("out");
    assert_eq!(whole[2], passed[2]);
    assert_ne!(whole[1], passed[1], "control");
}

#[test]
fn y4m_pixels_that_are_not_square_are_told() {
    let folder = folder();
    for (aspect, is_told) in [("A1:1", false), ("A0:0", false), ("A64:45", true)] {
        let film = y4m(None);
        let (head, frames) = film.split_at(film.iter().position(|b| *b == b'\n').expect("a line"));
        let head = String::from_utf8_lossy(head).replace("A1:1", aspect);
        folder.write("in.y4m", [head.as_bytes(), frames].concat());
        let said = folder.sequence_of("in.y4m", "t.txt", "");
        assert_eq!(
            said.matches("64:45 as wide as high").count(),
            usize::from(is_told),
            "{said}"
        );
    }
}

/// As network cameras send their pictures.
#[test]
fn jpegs_with_mime_headers_are_told_their_name() {
    let folder = folder();
    let head = "--frame\r\nContent-Type: image/jpeg\r\nContent-Length: 4\r\n\r\n";
    folder.write("in.mjpeg", head);
    folder.refuse_sequence_of("in.mjpeg", "t.txt", "with MIME headers");
    folder.write("in.mjpeg", "-frame\r\n");
    folder.refuse_sequence_of("in.mjpeg", "t.txt", "does not begin with YUV4MPEG2");
}

#[test]
fn y4m_bt709() {
    let folder = folder();
    folder.write("in.y4m", y4m(None));
    let code = |matrix: &str| {
        let command = format!(
            "sequence scene.toml --frames in.y4m --trajectory t.txt -o out.y4m --overwrite {matrix}"
        );
        let said = folder.succeed(&command);
        let film = folder.bytes("out.y4m");
        let frame = &film[film.len() - 64 * 48 * 3..];
        let at = 24 * 64 + 32;
        let yuv = [0, 1, 2].map(|plane| f64::from(frame[plane * 64 * 48 + at]));
        (said, yuv)
    };
    // As a player of BT.709 shows it, by the standard's own equations; the ball's red is (244, 89, 89) in sRGB.
    let shown = |[y, cb, cr]: [f64; 3]| {
        let (y, cb, cr) = (
            (y - 16.0) / 219.0,
            (cb - 128.0) / 224.0,
            (cr - 128.0) / 224.0,
        );
        [
            y + 1.5748 * cr,
            y - 0.1873 * cb - 0.4681 * cr,
            y + 1.8556 * cb,
        ]
        .map(|x| x * 255.0)
    };
    let near = |rgb: [f64; 3]| {
        let off = rgb
            .iter()
            .zip([244.0, 89.0, 89.0])
            .map(|(a, b)| (a - b).abs());
        off.fold(0.0, f64::max) < 4.0
    };
    let (said, yuv) = code("--matrix 709");
    assert!(said.contains("BT.709, limited range"), "{said}");
    assert!(near(shown(yuv)), "{:?}", shown(yuv));
    let (said, yuv) = code("");
    assert!(said.contains("BT.601"), "{said}");
    assert!(!near(shown(yuv)), "control: {:?}", shown(yuv));
}
