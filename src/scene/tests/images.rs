//! Photographs and environment maps of every format, and broken ones.

use exr::WritableImage as _;
use exr::prelude as exr;
use image::{DynamicImage, ImageFormat};

use super::super::srgb::{decode8, decode16, encode8};
use super::super::*;
use super::{CAMERA, Folder, shared_data};

const HEAD: &str = "[camera]\nfx = 4\n[photo]\nimage = ";

impl Folder {
    fn photo(&self, name: &str) -> Result<Scene, SceneError> {
        self.load(&format!("{HEAD}\"{name}\"\n"))
    }

    fn photo_problem(&self, name: &str) -> String {
        let message = self.photo(name).unwrap_err().to_string();
        assert!(message.contains("scene.toml:4:9: "), "{message}");
        message
    }

    fn write_exr(&self, name: &str, channels: &[&str], value: impl Fn(usize, usize) -> f32) {
        let list = channels
            .iter()
            .enumerate()
            .map(|(c, channel)| {
                let samples = (0..12).map(|pixel| value(c, pixel)).collect();
                exr::AnyChannel::new(*channel, exr::FlatSamples::F32(samples))
            })
            .collect();
        let layer = exr::Layer::new(
            (4, 3),
            exr::LayerAttributes::named("main"),
            exr::Encoding::FAST_LOSSLESS,
            exr::AnyChannels::sort(list),
        );
        exr::Image::from_layer(layer)
            .write()
            .to_file(self.path(name))
            .unwrap();
    }
}

#[test]
fn png_of_eight_bits() {
    let folder = Folder::new();
    let rgb = image::RgbImage::from_fn(4, 3, |x, y| image::Rgb([x as u8 * 60, y as u8 * 90, 255]));
    rgb.save(folder.path("photo.png")).unwrap();
    let photo = folder.photo("photo.png").unwrap().photo.unwrap();
    let EncodedPhoto::Codes8(codes) = &photo.encoded else {
        panic!("not 8 bits")
    };
    assert_eq!(codes[5], [60, 90, 255]);
    assert_eq!(photo.linear[5], [60, 90, 255].map(decode8));
    for (linear, code) in photo.linear.iter().zip(codes) {
        assert_eq!(linear.map(encode8), *code);
    }
    // Grey, with a plain alpha, spreads to three channels and says nothing.
    let grey = image::GrayAlphaImage::from_pixel(4, 3, image::LumaA([7, 255]));
    grey.save(folder.path("grey.png")).unwrap();
    let scene = folder.photo("grey.png").unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert!(
        matches!(&scene.photo.unwrap().encoded, EncodedPhoto::Codes8(codes) if codes[0] == [7; 3])
    );
    let clear = image::RgbaImage::from_pixel(4, 3, image::Rgba([7, 8, 9, 0]));
    clear.save(folder.path("clear.png")).unwrap();
    let scene = folder.photo("clear.png").unwrap();
    assert_eq!(scene.warnings, ["clear.png: its alpha channel is ignored"]);
    assert!(
        matches!(&scene.photo.unwrap().encoded, EncodedPhoto::Codes8(codes) if codes[0] == [7, 8, 9])
    );
}

#[test]
fn png_of_sixteen_bits() {
    let folder = Folder::new();
    let rgb =
        image::ImageBuffer::from_fn(4, 3, |x, y| image::Rgb([x as u16 * 20001, y as u16, 65535]));
    DynamicImage::ImageRgb16(rgb)
        .save(folder.path("photo.png"))
        .unwrap();
    let photo = folder.photo("photo.png").unwrap().photo.unwrap();
    let EncodedPhoto::Codes16(codes) = &photo.encoded else {
        panic!("not 16 bits")
    };
    assert_eq!(codes[5], [20001, 1, 65535]);
    assert_eq!(photo.linear[5], [20001, 1, 65535].map(decode16));
    let grey = image::ImageBuffer::from_pixel(4, 3, image::Luma([300_u16]));
    DynamicImage::ImageLuma16(grey)
        .save(folder.path("grey.png"))
        .unwrap();
    let photo = folder.photo("grey.png").unwrap().photo.unwrap();
    assert!(matches!(&photo.encoded, EncodedPhoto::Codes16(codes) if codes[0] == [300; 3]));
}

/// Inserts a chunk after IHDR; decoders need no valid CRC of gAMA here, but a right one is cheap to give.
fn with_chunk(png: &[u8], name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut crc = u32::MAX;
    for byte in name.iter().chain(data) {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
        }
    }
    let mut out = png[..33].to_vec();
    out.extend((data.len() as u32).to_be_bytes());
    out.extend(name);
    out.extend(data);
    out.extend((!crc).to_be_bytes());
    out.extend(&png[33..]);
    out
}

#[test]
fn gamma_chunks_say_what_codes_mean_where_nothing_else_does() {
    let folder = Folder::new();
    let mut plain = std::io::Cursor::new(Vec::new());
    let rgb = image::RgbImage::from_pixel(4, 3, image::Rgb([100, 150, 200]));
    rgb.write_to(&mut plain, ImageFormat::Png).unwrap();
    let plain = plain.into_inner();
    let gamma = with_chunk(&plain, b"gAMA", &100_000_u32.to_be_bytes());
    let both = with_chunk(&gamma, b"sRGB", &[0]);
    let none = with_chunk(&plain, b"gAMA", &0_u32.to_be_bytes());
    let codes = [100_u8, 150, 200];
    let srgb = codes.map(decode8);
    let linear = codes.map(|code| f32::from(code) / 255.0);
    for (name, bytes, light, warns) in [
        ("plain.png", &plain, srgb, false),
        ("gamma.png", &gamma, linear, false),
        ("both.png", &both, srgb, false),
        ("none.png", &none, srgb, true),
    ] {
        std::fs::write(folder.path(name), bytes).unwrap();
        let scene = folder.photo(name).unwrap();
        let told = scene.warnings.iter().any(|w| w.contains("gamma"));
        assert_eq!(told, warns, "{name}: {:?}", scene.warnings);
        let photo = scene.photo.unwrap();
        assert!(matches!(&photo.encoded, EncodedPhoto::Codes8(kept) if kept[0] == codes));
        let pairs = photo.linear[0].into_iter().zip(light);
        let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{name}: {:?}, not {light:?}", photo.linear[0]);
    }
}

#[test]
fn jpeg() {
    let folder = Folder::new();
    let rgb = image::RgbImage::from_pixel(4, 3, image::Rgb([100, 150, 200]));
    rgb.save(folder.path("photo.jpg")).unwrap();
    // The content decides, not the name.
    std::fs::copy(folder.path("photo.jpg"), folder.path("photo.bin")).unwrap();
    for name in ["photo.jpg", "photo.bin"] {
        let photo = folder.photo(name).unwrap().photo.unwrap();
        let EncodedPhoto::Codes8(codes) = &photo.encoded else {
            panic!("not 8 bits")
        };
        assert!(
            codes[0]
                .iter()
                .zip([100, 150, 200_u8])
                .all(|(a, b)| a.abs_diff(b) <= 3)
        );
    }
}

#[test]
fn exr_and_hdr_are_linear() {
    let folder = Folder::new();
    folder.write_exr("photo.exr", &["R", "G", "B"], |c, pixel| {
        c as f32 * 10.0 - pixel as f32 / 7.0
    });
    let photo = folder.photo("photo.exr").unwrap().photo.unwrap();
    assert!(matches!(photo.encoded, EncodedPhoto::Linear));
    assert_eq!((photo.width, photo.height), (4, 3));
    let pixel = 5.0_f32 / 7.0;
    assert_eq!(photo.linear[5], [-pixel, 10.0 - pixel, 20.0 - pixel]);
    for (alpha, is_told) in [(1.0, false), (0.5, true)] {
        let value = |channel, _| if channel == 3 { alpha } else { 0.25 };
        folder.write_exr("rgba.exr", &["R", "G", "B", "A"], value);
        let warnings = folder.photo("rgba.exr").unwrap().warnings;
        let told = warnings.iter().any(|w| w.contains("alpha"));
        assert_eq!(told, is_told, "{alpha}: {warnings:?}");
    }
    folder.write_exr("grey.exr", &["Y"], |_, pixel| pixel as f32);
    assert_eq!(
        folder.photo("grey.exr").unwrap().photo.unwrap().linear[5],
        [5.0; 3]
    );

    let hdr = image::Rgb32FImage::from_fn(4, 3, |x, _| image::Rgb([x as f32 * 64.0, 0.5, 0.25]));
    DynamicImage::ImageRgb32F(hdr)
        .save(folder.path("photo.hdr"))
        .unwrap();
    let photo = folder.photo("photo.hdr").unwrap().photo.unwrap();
    assert!(matches!(photo.encoded, EncodedPhoto::Linear));
    assert!((photo.linear[3][0] - 192.0).abs() <= 1.0);
}

#[test]
fn broken_photographs() {
    let folder = Folder::new();
    folder.write_exr("nan.exr", &["R", "G", "B"], |_, pixel| {
        if pixel == 6 { f32::NAN } else { 1.0 }
    });
    assert!(
        folder
            .photo_problem("nan.exr")
            .contains("pixel (2, 1) is NaN or infinite")
    );
    folder.write_exr("depth.exr", &["Z"], |_, _| 1.0);
    assert!(
        folder
            .photo_problem("depth.exr")
            .contains("no channels R, G, B or Y")
    );
    std::fs::write(folder.path("text.png"), "hello").unwrap();
    assert!(
        folder
            .photo_problem("text.png")
            .contains("format is not known")
    );
    std::fs::write(folder.path("empty.png"), "").unwrap();
    assert!(
        folder
            .photo_problem("empty.png")
            .contains("format is not known")
    );
    for format in ["png", "hdr", "exr"] {
        let name = format!("photo.{format}");
        match format {
            "exr" => folder.write_exr(&name, &["R", "G", "B"], |_, pixel| pixel as f32),
            "hdr" => DynamicImage::new(4, 3, image::ColorType::Rgb32F)
                .save(folder.path(&name))
                .unwrap(),
            _ => image::RgbImage::new(4, 3).save(folder.path(&name)).unwrap(),
        }
        assert!(folder.photo(&name).is_ok(), "{name}");
        let whole = std::fs::read(folder.path(&name)).unwrap();
        std::fs::write(folder.path(&name), &whole[..whole.len() * 2 / 3]).unwrap();
        assert!(
            folder.photo_problem(&name).contains("cannot be decoded"),
            "{name}"
        );
    }
}

#[test]
fn a_camera_of_another_size_is_refused() {
    let folder = Folder::new();
    image::RgbImage::new(4, 3)
        .save(folder.path("photo.png"))
        .unwrap();
    let photo = "[photo]\nimage = \"photo.png\"\n";
    assert!(
        folder
            .load(&format!("{photo}[camera]\nfx = 4\nwidth = 4\nheight = 3\n"))
            .is_ok()
    );
    let message = folder
        .load(&format!("{photo}[camera]\nfx = 4\nheight = 4\n"))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("scene.toml:5:10: `height` is 4 but the photograph's is 3"),
        "{message}"
    );
}

#[test]
fn automatic_exposure_needs_a_photograph() {
    let folder = Folder::new();
    image::RgbImage::new(4, 3)
        .save(folder.path("photo.png"))
        .unwrap();
    let scene = folder
        .load(&format!("{HEAD}\"photo.png\"\nexposure_ev = \"auto\"\n"))
        .unwrap();
    assert_eq!(scene.settings.exposure, Exposure::Auto);
}

#[test]
fn environments() {
    let folder = Folder::new();
    let constant = folder
        .load(&format!("{CAMERA}[environment]\nradiance = [1, 2, 3]\n"))
        .unwrap();
    let constant = constant.environment.unwrap();
    assert!(matches!(
        constant.map,
        EnvironmentMap::Constant([1.0, 2.0, 3.0])
    ));
    assert_eq!((constant.rotation_deg, constant.scale), (0.0, 1.0));

    folder.write_exr("env.exr", &["R", "G", "B"], |_, pixel| {
        if pixel == 5 { -1.0 } else { 2.0 }
    });
    let scene = folder
        .load(&format!(
            "{CAMERA}[environment]\nimage = \"env.exr\"\nrotation_deg = 90\nscale = 0.5\n"
        ))
        .unwrap();
    assert_eq!(
        scene.warnings,
        [
            "env.exr: it has 4 x 3 pixels: a lat-long map is twice as wide as high",
            "env.exr: 3 negative values are taken as 0"
        ]
    );
    let environment = scene.environment.unwrap();
    assert_eq!((environment.rotation_deg, environment.scale), (90.0, 0.5));
    let EnvironmentMap::LatLong {
        width,
        height,
        texels,
    } = environment.map
    else {
        panic!("no map")
    };
    assert_eq!((width, height, texels.len()), (4, 3, 12));
    assert_eq!((texels[4], texels[5]), ([2.0; 3], [0.0; 3]));

    image::RgbImage::new(1, 1)
        .save(folder.path("dot.png"))
        .unwrap();
    let message = folder
        .load(&format!("{CAMERA}[environment]\nimage = \"dot.png\"\n"))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("scene.toml:6:9: ") && message.contains("at least 2 x 2"),
        "{message}"
    );
}

#[test]
fn a_measured_environment() {
    let Some(path) = shared_data("hdr_environments/brown_photostudio_02_1k.hdr") else {
        return;
    };
    let text = format!("{CAMERA}[environment]\nimage = '{}'\n", path.display());
    let scene = Folder::new().load(&text).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let Some(EnvironmentMap::LatLong {
        width,
        height,
        texels,
    }) = scene.environment.map(|e| e.map)
    else {
        panic!("no map")
    };
    assert_eq!((width, height), (1024, 512));
    assert!(texels.iter().any(|texel| texel[0] > 10.0));
}
