//! Y'CbCr of BT.601 or BT.709 to encoded RGB and back.
//!
//! Limited range: luma 16 to 235, colour 16 to 240; full range where the stream says so. A colour sample belongs to all pixels of its block
//! alike, so that a pixel that nothing changed keeps its luma and its share of the colour, and a block that nothing changed its bytes.
//! By hand: crates convert whole frames, which would lose just that.

use super::y4m::Header;

#[derive(Clone, Copy)]
struct Range {
    /// Weights of red and blue in luma.
    red: f64,
    blue: f64,
    luma_zero: f64,
    luma_span: f64,
    colour_span: f64,
}

impl Range {
    fn of(header: &Header) -> Self {
        let (red, blue) = header.matrix.weights();
        match header.full_range {
            true => Self {
                red,
                blue,
                luma_zero: 0.0,
                luma_span: 255.0,
                colour_span: 255.0,
            },
            false => Self {
                red,
                blue,
                luma_zero: 16.0,
                luma_span: 219.0,
                colour_span: 224.0,
            },
        }
    }

    fn decoder(self) -> Decoder {
        let colour = |weight: f64, code: f64| {
            let share = (code - 128.0) / self.colour_span;
            2.0 * (1.0 - weight) * share
        };
        Decoder {
            luma: table(|code| (code - self.luma_zero) / self.luma_span),
            red: table(|code| colour(self.red, code)),
            blue: table(|code| colour(self.blue, code)),
            range: self,
        }
    }

    /// Unrounded codes.
    fn encode(&self, rgb: [u8; 3]) -> [f64; 3] {
        let [red, green, blue] = rgb.map(|x| f64::from(x) / 255.0);
        let luma = self.red * red + (1.0 - self.red - self.blue) * green + self.blue * blue;
        let cb = (blue - luma) / (2.0 * (1.0 - self.blue));
        let cr = (red - luma) / (2.0 * (1.0 - self.red));
        [
            self.luma_zero + self.luma_span * luma,
            128.0 + self.colour_span * cb,
            128.0 + self.colour_span * cr,
        ]
    }
}

/// What each code adds: a frame has far more pixels than there are codes.
struct Decoder {
    range: Range,
    luma: [f64; 256],
    /// Of Cr to red, and of Cb to blue.
    red: [f64; 256],
    blue: [f64; 256],
}

impl Decoder {
    fn decode(&self, [y, cb, cr]: [u8; 3]) -> [u8; 3] {
        let (weight_red, weight_blue) = (self.range.red, self.range.blue);
        let luma = self.luma[usize::from(y)];
        let red = luma + self.red[usize::from(cr)];
        let blue = luma + self.blue[usize::from(cb)];
        let green =
            (luma - weight_red * red - weight_blue * blue) / (1.0 - weight_red - weight_blue);
        [red, green, blue].map(|x| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
    }
}

fn table(of: impl Fn(f64) -> f64) -> [f64; 256] {
    std::array::from_fn(|code| of(code as f64))
}

fn code(x: f64) -> u8 {
    (x.clamp(0.0, 255.0) + 0.5) as u8
}

/// The planes of a frame as encoded RGB, row-major.
pub fn decode_yuv(header: &Header, planes: &[u8]) -> Vec<[u8; 3]> {
    let decoder = Range::of(header).decoder();
    let (width, height) = (header.width as usize, header.height as usize);
    let (block_x, block_y) = header.chroma.block();
    let (chroma_width, chroma_height) = header.chroma_size();
    let (luma, colour) = planes.split_at(width * height);
    let (cb, cr) = colour.split_at(chroma_width as usize * chroma_height as usize);
    let mut rgb = Vec::with_capacity(width * height);
    for y in 0..height {
        let row = y / block_y as usize * chroma_width as usize;
        for x in 0..width {
            let at = row + x / block_x as usize;
            rgb.push(decoder.decode([luma[y * width + x], cb[at], cr[at]]));
        }
    }
    rgb
}

/// Brightness of a frame's pixels as codes of full range, row-major: what [`decode_yuv`] makes of them without their colours.
pub fn luma_codes(header: &Header, planes: &[u8]) -> Vec<u8> {
    let luma = Range::of(header).decoder().luma;
    let codes = luma.map(|x| code(255.0 * x));
    let pixels = header.width as usize * header.height as usize;
    planes[..pixels]
        .iter()
        .map(|luma| codes[usize::from(*luma)])
        .collect()
}

/// The planes of encoded RGB. Pixels that equal `before`'s, a frame of the same stream in both forms, keep its samples.
pub fn encode_yuv(
    header: &Header,
    rgb: &[[u8; 3]],
    before: Option<(&[[u8; 3]], &[u8])>,
) -> Vec<u8> {
    let range = Range::of(header);
    let (width, height) = (header.width as usize, header.height as usize);
    let (block_x, block_y) = header.chroma.block();
    let (chroma_width, chroma_height) = header.chroma_size();
    let chroma_len = chroma_width as usize * chroma_height as usize;
    let mut planes = vec![0; header.frame_bytes()];
    let mut sums = vec![[0.0f64; 3]; chroma_len];
    for y in 0..height {
        let row = y / block_y as usize * chroma_width as usize;
        for x in 0..width {
            let pixel = y * width + x;
            let at = row + x / block_x as usize;
            let kept = before.filter(|(rgb_before, _)| rgb_before[pixel] == rgb[pixel]);
            let [luma, cb, cr] = match kept {
                Some((_, planes)) => {
                    let colour = width * height + at;
                    [planes[pixel], planes[colour], planes[colour + chroma_len]].map(f64::from)
                }
                None => range.encode(rgb[pixel]),
            };
            planes[pixel] = code(luma);
            let sum = &mut sums[at];
            *sum = [sum[0] + cb, sum[1] + cr, sum[2] + 1.0];
        }
    }
    for (at, [cb, cr, count]) in sums.into_iter().enumerate() {
        planes[width * height + at] = code(cb / count);
        planes[width * height + chroma_len + at] = code(cr / count);
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::super::matrix::Matrix;
    use super::*;

    fn header_of(chroma: &str, more: &str) -> Header {
        Header::parse(&format!("YUV4MPEG2 W6 H4 F25:1 C{chroma} {more}")).expect("parses")
    }

    /// ITU-R BT.601's own table of colour bars at 100 percent, limited range.
    #[test]
    fn colour_bars_have_the_standards_codes() {
        let header = header_of("444", "");
        for (rgb, yuv) in [
            ([255, 255, 255], [235, 128, 128]),
            ([255, 255, 0], [210, 16, 146]),
            ([0, 255, 255], [170, 166, 16]),
            ([0, 255, 0], [145, 54, 34]),
            ([255, 0, 255], [106, 202, 222]),
            ([255, 0, 0], [81, 90, 240]),
            ([0, 0, 255], [41, 240, 110]),
            ([0, 0, 0], [16, 128, 128]),
        ] {
            let range = Range::of(&header);
            assert_eq!(range.encode(rgb).map(code), yuv);
            let back = range.decoder().decode(yuv);
            assert!(
                rgb.iter().zip(back).all(|(a, b)| a.abs_diff(b) <= 1),
                "{rgb:?} {back:?}"
            );
        }
        let full = Range::of(&header_of("444", "XCOLORRANGE=FULL"));
        assert_eq!(
            full.encode([255; 3]).map(code),
            [255, 128, 128],
            "control: another range"
        );
    }

    /// ITU-R BT.709's primaries and white at 100 percent, limited range.
    #[test]
    fn high_definition_has_its_own_weights() {
        let mut header = header_of("444", "");
        let red = |header: &Header| Range::of(header).encode([255, 0, 0]).map(code);
        assert_eq!(red(&header), [81, 90, 240], "control");
        header.matrix = Matrix::Bt709;
        assert_eq!(red(&header), [63, 102, 240]);
        let range = Range::of(&header);
        assert_eq!(range.encode([0, 255, 0]).map(code), [173, 42, 26]);
        assert_eq!(range.encode([255; 3]).map(code), [235, 128, 128]);
        for rgb in [[244, 89, 89], [0, 0, 255], [10, 200, 30]] {
            let back = range.decoder().decode(range.encode(rgb).map(code));
            assert!(
                rgb.iter().zip(back).all(|(a, b)| a.abs_diff(b) <= 2),
                "{back:?}"
            );
        }
        let tall = Header::parse("YUV4MPEG2 W1280 H720").expect("parses");
        assert_eq!(
            (tall.matrix, header_of("420", "").matrix),
            (Matrix::Bt709, Matrix::Bt601)
        );
    }

    /// Control: colours have another brightness in green alone.
    #[test]
    fn brightness_is_that_of_the_decoded_pixels() {
        for more in ["", "XCOLORRANGE=FULL"] {
            let header = header_of("444", more);
            let range = Range::of(&header);
            let rgb = [[0, 0, 0], [255; 3], [120, 60, 200], [200, 190, 30]];
            let mut planes = vec![128; header.frame_bytes()];
            for (pixel, rgb) in rgb.into_iter().enumerate() {
                let samples = range.encode(rgb).map(code);
                for (plane, sample) in samples.into_iter().enumerate() {
                    planes[24 * plane + pixel] = sample;
                }
            }
            let luma = luma_codes(&header, &planes);
            for (own, [r, g, b]) in luma.into_iter().zip(rgb) {
                let exact = 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
                assert!((f64::from(own) - exact).abs() < 1.1, "{own} {exact}");
                let is_grey = r == g;
                assert!(is_grey || (exact - f64::from(g)).abs() > 2.0, "control");
            }
        }
    }

    #[test]
    fn what_is_not_changed_keeps_its_bytes() {
        for chroma in ["420jpeg", "422", "444"] {
            let header = header_of(chroma, "");
            let planes: Vec<u8> = (0..header.frame_bytes())
                .map(|i| crate::math::hash_u32(i as u32) as u8)
                .collect();
            let rgb = decode_yuv(&header, &planes);
            assert_eq!(encode_yuv(&header, &rgb, Some((&rgb, &planes))), planes);
            assert_ne!(
                encode_yuv(&header, &rgb, None),
                planes,
                "control: codes out of range clip"
            );
            // One pixel changed: luma elsewhere stays, and the colour of the other blocks.
            let mut changed = rgb.clone();
            changed[8] = [10, 200, 30];
            let out = encode_yuv(&header, &changed, Some((&rgb, &planes)));
            let differ = out.iter().zip(&planes).filter(|(a, b)| a != b).count();
            assert!((1..=3).contains(&differ), "{chroma}: {differ}");
            assert_ne!(out[8], planes[8]);
        }
    }
}
