//! Which part and layer of an OpenEXR file is the picture, where it lies, and that all of it is there.

use std::io::Cursor;

use ::exr::prelude::*;

use super::ChannelFile;
use crate::decode::{Pixels, decode_image};

const WIDTH: usize = 4;
const HEIGHT: usize = 3;

/// A layer whose red counts the pixels from `first`.
fn layer(name: Option<&str>, channels: [&str; 3], first: f32) -> Layer<AnyChannels<FlatSamples>> {
    let samples = |step: f32| {
        let values = (0..WIDTH * HEIGHT).map(|i| first + step * i as f32);
        FlatSamples::F32(values.collect())
    };
    let channels = channels
        .into_iter()
        .zip([1.0, 0.0, 0.0])
        .map(|(name, step)| AnyChannel::new(name, samples(step)))
        .collect();
    Layer::new(
        Vec2(WIDTH, HEIGHT),
        LayerAttributes {
            layer_name: name.map(Text::from),
            ..LayerAttributes::default()
        },
        Encoding::UNCOMPRESSED,
        AnyChannels::sort(channels),
    )
}

fn file(layers: Vec<Layer<AnyChannels<FlatSamples>>>, window: IntegerBounds) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_layers(ImageAttributes::new(window), layers);
    image.write().to_buffered(&mut bytes).expect("encodes");
    bytes.into_inner()
}

fn window() -> IntegerBounds {
    IntegerBounds::from_dimensions((WIDTH, HEIGHT))
}

fn red(bytes: &[u8]) -> std::result::Result<Vec<f32>, String> {
    match decode_image(bytes)?.pixels {
        Pixels::Linear(pixels) => Ok(pixels.iter().map(|pixel| pixel[0]).collect()),
        _ => Err("it is not linear".to_owned()),
    }
}

const RGB: [&str; 3] = ["R", "G", "B"];

#[test]
fn the_part_that_is_named_as_the_picture_is_taken() {
    let of = |names: [&str; 2]| {
        let layers = vec![
            layer(Some(names[0]), RGB, 100.0),
            layer(Some(names[1]), RGB, 0.0),
        ];
        red(&file(layers, window()))
    };
    for name in ["rgba", "Beauty", "ViewLayer.Combined"] {
        assert_eq!(of(["albedo", name]).map(|red| red[0]), Ok(0.0), "{name}");
        assert_eq!(of([name, "albedo"]).map(|red| red[0]), Ok(100.0), "{name}");
    }
    let two = of(["A.Combined", "B.Combined"]).expect_err("none is the one");
    assert!(two.contains("(A.Combined, B.Combined)"), "{two}");
    assert_eq!(of(["color", "rgba"]).map(|red| red[0]), Ok(0.0));
    let refused = of(["albedo", "diffuse"]).expect_err("none is the picture");
    assert!(refused.contains("(albedo, diffuse)"), "{refused}");
}

#[test]
fn layers_by_prefix_are_taken_as_parts_are() {
    let combined = ["A.Combined.R", "A.Combined.G", "A.Combined.B"];
    let bytes = file(vec![layer(None, combined, 7.0)], window());
    assert_eq!(red(&bytes).map(|red| red[..2].to_vec()), Ok(vec![7.0, 8.0]));
    for (part, names) in [
        ("b", ["beauty.r", "beauty.g", "beauty.b"]),
        ("main", ["Red", "Green", "Blue"]),
    ] {
        let albedo = ["albedo.R", "albedo.G", "albedo.B"];
        let layers = vec![
            layer(Some("a"), albedo, 90.0),
            layer(Some(part), names, 7.0),
        ];
        let red = red(&file(layers, window())).map(|red| red[0]);
        assert_eq!(red, Ok(7.0), "{names:?}");
    }
    let halves = ["A.Combined.R", "A.Combined.G", "X.B"];
    let bytes = file(vec![layer(None, halves, 7.0)], window());
    assert!(red(&bytes).is_err(), "control: no layer is whole");
}

#[test]
fn a_data_window_is_placed_in_the_display_window() {
    let mut inside = layer(None, RGB, 1.0);
    inside.attributes.layer_position = Vec2(3, 2);
    let display = IntegerBounds::new((1, 1), (8, 5));
    let bytes = file(vec![inside], display);
    let image = decode_image(&bytes).expect("decodes");
    assert_eq!((image.width, image.height), (8, 5));
    assert!(
        image.warnings[0].contains("data window (3, 2)..(6, 4)"),
        "{:?}",
        image.warnings
    );
    let mut beside = layer(None, RGB, 1.0);
    beside.attributes.layer_position = Vec2(9, 2);
    let refused = decode_image(&file(vec![beside], display)).expect_err("nothing is seen");
    assert!(refused.contains("lies outside"), "{refused}");
    let red = red(&bytes).expect("decodes");
    let sample = |x: usize, y: usize| red[y * 8 + x];
    assert_eq!(sample(2, 1), 1.0, "its first pixel");
    assert_eq!(sample(5, 3), 12.0, "its last pixel");
    assert_eq!(
        [sample(1, 1), sample(6, 3), sample(2, 4)],
        [0.0; 3],
        "control: beside it"
    );

    let mut beyond = layer(None, RGB, 1.0);
    beyond.attributes.layer_position = Vec2(-1, -1);
    let red = self::red(&file(vec![beyond], window())).expect("decodes");
    assert_eq!(red[..2], [6.0, 7.0], "what lies outside is cut off");
}

#[test]
fn a_block_that_stands_for_another_is_noticed() {
    let whole = file(vec![layer(None, RGB, 1.0)], window());
    let block = 8 + 3 * 4 * WIDTH;
    let second = whole.len() - (HEIGHT - 1) * block;
    let mut damaged = whole.clone();
    assert_eq!(damaged[second], 1, "the line's number");
    damaged[second] = 0;
    assert!(
        red(&whole).is_ok() && ChannelFile::decode(&whole).is_ok(),
        "control"
    );
    for problem in [
        red(&damaged).unwrap_err(),
        ChannelFile::decode(&damaged).unwrap_err().to_string(),
    ] {
        assert!(problem.contains("2 of its 3 blocks"), "{problem}");
    }
}

#[test]
fn texts_beyond_latin_1_come_back() {
    let mut named = layer(None, RGB, 1.0);
    let text = |bytes: &[u8]| AttributeValue::Text(Text::from_bytes_unchecked(bytes.into()));
    let other = &mut named.attributes.other;
    other.insert(Text::from("a"), text("плёнка".as_bytes()));
    other.insert(Text::from("b"), text(b"caf\xe9"));
    let read = ChannelFile::decode(&file(vec![named], window())).expect("decodes");
    assert_eq!(read.texts["a"], "плёнка");
    assert_eq!(
        read.texts["b"], "café",
        "control: Latin-1, as older files have it"
    );
}
