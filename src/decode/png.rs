//! What stands beside the pixels of a PNG file and says what their codes mean.

/// PNG's units of 1/100000: sRGB to within its own table.
const SRGB_GAMMA: std::ops::RangeInclusive<u32> = 45_000..=46_000;
/// White and primaries of sRGB.
const SRGB_CHROMATICITIES: [u32; 8] = [31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000];
/// How far chromaticities lie from those at most.
const SAME_CHROMATICITY: u32 = 200;

/// Of the chunks before the pixels.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct ColourChunks {
    pub cicp: Option<[u8; 4]>,
    /// A profile is there, whether or not it can be unpacked.
    pub has_profile: bool,
    /// What is not sRGB's, where nothing else says what the codes mean.
    pub other: Option<GammaAndPrimaries>,
}

/// gAMA and cHRM in PNG's units; `None`: sRGB's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct GammaAndPrimaries {
    /// Of light to the code, 1/100000.
    pub gamma: Option<u32>,
    /// x and y of white, red, green and blue, 1/100000.
    pub chromaticities: Option<[u32; 8]>,
}

pub(super) fn colour_chunks(bytes: &[u8]) -> ColourChunks {
    let mut found = ColourChunks::default();
    let (mut srgb, mut other) = (false, GammaAndPrimaries::default());
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((header, tail)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, name @ ..] = header;
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        let data = tail.get(..length).unwrap_or_default();
        let numbers = || {
            let words = data.as_chunks().0.iter();
            words.map(|word| u32::from_be_bytes(*word))
        };
        match name {
            b"cICP" => found.cicp = data.try_into().ok(),
            b"iCCP" => found.has_profile = true,
            b"sRGB" => srgb = true,
            b"gAMA" => other.gamma = numbers().next().filter(|g| !SRGB_GAMMA.contains(g)),
            b"cHRM" => {
                let told = numbers().collect::<Vec<u32>>().try_into().ok();
                other.chromaticities = told.filter(|told: &[u32; 8]| {
                    let mut pairs = told.iter().zip(SRGB_CHROMATICITIES);
                    !pairs.all(|(a, b)| a.abs_diff(b) <= SAME_CHROMATICITY)
                });
            }
            b"IDAT" => break,
            _ => {}
        }
        rest = tail.get(length.saturating_add(4)..).unwrap_or_default();
    }
    let is_told = srgb || found.has_profile || found.cicp.is_some();
    found.other = (!is_told && other != GammaAndPrimaries::default()).then_some(other);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(chunks: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        for (name, data) in chunks {
            bytes.extend((data.len() as u32).to_be_bytes());
            bytes.extend(*name);
            bytes.extend(data);
            bytes.extend([0; 4]);
        }
        bytes
    }

    fn words(numbers: &[u32]) -> Vec<u8> {
        numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
    }

    #[test]
    fn only_what_is_not_srgb_counts() {
        let other = |chunks: &[(&[u8; 4], Vec<u8>)]| colour_chunks(&file(chunks)).other;
        let same = (b"cHRM", words(&SRGB_CHROMATICITIES));
        assert_eq!(other(&[(b"gAMA", words(&[45455])), same]), None);
        let linear = other(&[(b"gAMA", words(&[100_000]))]).unwrap();
        assert_eq!((linear.gamma, linear.chromaticities), (Some(100_000), None));
        let p3 = [31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000];
        let wide = other(&[(b"gAMA", words(&[45455])), (b"cHRM", words(&p3))]).unwrap();
        assert_eq!((wide.gamma, wide.chromaticities), (None, Some(p3)));
        for winner in [
            (b"sRGB", vec![0]),
            (b"cICP", vec![1, 13, 0, 1]),
            (b"iCCP", vec![7]),
        ] {
            let both = [(b"gAMA", words(&[100_000])), winner];
            assert_eq!(other(&both), None, "a fallback");
        }
        let after = [(b"IDAT", vec![]), (b"gAMA", words(&[100_000]))];
        assert_eq!(other(&after), None, "control: pixels come first");
        let cicp = file(&[(b"cICP", vec![12, 13, 0, 1])]);
        assert_eq!(colour_chunks(&cicp).cicp, Some([12, 13, 0, 1]));
    }
}
