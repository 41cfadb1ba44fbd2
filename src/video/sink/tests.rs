use super::*;

fn frame(codes: [u8; 3], pixels: Pixels) -> VideoFrame {
    VideoFrame {
        photo: Photo::from_srgb8(5, 4, vec![codes; 20]),
        pixels,
        warnings: Vec::new(),
    }
}

#[test]
fn frames_of_an_earlier_form_are_told() {
    for (mark, earlier) in [
        ("{\n  \"fingerprint\": \"0123456789abcdef\"\n}\n", true),
        ("YUV4MPEG2 W48 H36 F10:1 XMIXRAY=0123456789abcdef\n", true),
        (
            "YUV4MPEG2 W48 H36 XMIXRAY=0123456789abcdef0123456789abcdef\n",
            true,
        ),
        (
            "{\n  \"fingerprint\": \"0123456789abcdef0123456789abcdef\"\n}\n",
            false,
        ),
        ("YUV4MPEG2 W48 H36 F10:1\n", false),
        ("", false),
    ] {
        let message = foreign(Path::new("out"), mark).to_string();
        assert_eq!(message.contains("of an earlier form"), earlier, "{message}");
    }
}

/// No byte of a finished frame can be lost or changed unseen.
#[test]
fn every_damage_to_a_frame_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f.png");
    let frame = frame([9, 8, 7], Pixels::Decoded);
    let picture = Picture {
        width: 5,
        height: 4,
        linear: frame.photo.linear.clone(),
    };
    let target = Target::named(&path, Format::Png);
    for bits in [PngBits::Eight, PngBits::Sixteen] {
        write_png(&target, &picture, None, bits).unwrap();
        assert!(is_whole(&path, Format::Png, &frame), "control");
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(!is_whole(&path, Format::Png, &frame), "{length} bytes");
        }
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, bytes).unwrap();
            assert!(!is_whole(&path, Format::Png, &frame), "bit {bit}");
        }
    }
    std::fs::remove_file(&path).unwrap();
    assert!(!is_whole(&path, Format::Png, &frame));
}

/// A frame that was passed through may be any file that its reader takes.
#[test]
fn a_copy_of_the_frame_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let frame = frame([9, 8, 7], Pixels::File(at("in.png")));
    std::fs::write(at("in.png"), "bytes and some more").unwrap();
    std::fs::write(at("out.png"), "bytes and some more").unwrap();
    assert!(is_whole(&at("out.png"), Format::Png, &frame));
    std::fs::write(at("out.png"), "bytes and some").unwrap();
    assert!(!is_whole(&at("out.png"), Format::Png, &frame));
}
