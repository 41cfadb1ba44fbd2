//! Colours of codes that are not sRGB: ICC profiles of matrices and curves, and what stands for one in a PNG file.

use std::fmt;

use glam::{DMat3, DVec3};
use moxcms::{
    Chromaticity, CicpProfile, ColorPrimaries, ColorProfile, DataColorSpace, LocalizableString,
    MatrixCoefficients, ProfileText, ToneReprCurve, TransferCharacteristics,
};

use super::png::GammaAndPrimaries;

/// Codes of a curve's table.
const CODES: usize = 1 << 16;
/// Matrices that differ by less are one: those of sRGB profiles differ by their rounding.
const SAME_MATRIX: f64 = 3e-3;
/// Gammas that are believed, 1/100000: powers from 10 to 1/5.
const GAMMAS: std::ops::RangeInclusive<u32> = 10_000..=500_000;

/// XYZ of the profiles' white, in units of 1/65536.
const D50: [u32; 3] = [0xf6d6, 0x1_0000, 0xd32d];

/// From codes to linear Rec.709 and back.
pub struct ColourProfile {
    /// What goes on to pictures that keep the codes.
    icc: Vec<u8>,
    /// Linear values of all codes of 16 bits, rising, a channel each.
    curves: [Vec<f32>; 3],
    rec709_from_device: DMat3,
    device_from_rec709: DMat3,
}

/// Why a profile is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unused {
    /// Its colours are sRGB's.
    IsSrgb,
    /// PQ or HLG.
    IsHdr,
    NotUnderstood,
}

impl ColourProfile {
    /// Of an ICC profile: gray, or RGB by matrix and curves.
    pub(super) fn of_icc(icc: Vec<u8>) -> Result<Self, Unused> {
        let profile = ColorProfile::new_from_slice(&icc).map_err(|_| Unused::NotUnderstood)?;
        match profile.color_space {
            DataColorSpace::Rgb => Self::of_profile(&profile, icc),
            DataColorSpace::Gray => {
                let curve = profile.gray_trc.clone().ok_or(Unused::NotUnderstood)?;
                Self::of_curve(curve)
            }
            _ => Err(Unused::NotUnderstood),
        }
    }

    /// Of a PNG file's cICP chunk: primaries, curve, matrix, range.
    pub(super) fn of_cicp([primaries, curve, matrix, range]: [u8; 4]) -> Result<Self, Unused> {
        let unknown = |_| Unused::NotUnderstood;
        let transfer = TransferCharacteristics::try_from(curve).map_err(unknown)?;
        let is_hdr = matches!(
            transfer,
            TransferCharacteristics::Smpte2084 | TransferCharacteristics::Hlg
        );
        if is_hdr {
            return Err(Unused::IsHdr);
        }
        if matrix != 0 || range != 1 {
            return Err(Unused::NotUnderstood);
        }
        let profile = ColorProfile::new_from_cicp(CicpProfile {
            color_primaries: primaries.try_into().map_err(unknown)?,
            transfer_characteristics: transfer,
            matrix_coefficients: MatrixCoefficients::Identity,
            full_range: true,
        });
        Self::of_made(profile)
    }

    /// Of a PNG file's gAMA and cHRM chunks.
    pub(super) fn of_gamma(told: GammaAndPrimaries) -> Result<Self, Unused> {
        let mut profile = ColorProfile::new_srgb();
        profile.cicp = None;
        if let Some(gamma) = told.gamma {
            if !GAMMAS.contains(&gamma) {
                return Err(Unused::NotUnderstood);
            }
            set_curve(
                &mut profile,
                ToneReprCurve::Parametric(vec![1e5 / gamma as f32]),
            );
        }
        if let Some(places) = told.chromaticities {
            let at = |first: usize| {
                let [x, y] = [first, first + 1].map(|at| places[at] as f32 / 1e5);
                Chromaticity { x, y }
            };
            let primaries = ColorPrimaries {
                red: at(2),
                green: at(4),
                blue: at(6),
            };
            profile.update_rgb_colorimetry(at(0).to_xyyb(), primaries);
        }
        Self::of_made(profile)
    }

    /// Gray spread to three channels: sRGB's primaries with the curve of the gray profile.
    fn of_curve(curve: ToneReprCurve) -> Result<Self, Unused> {
        let mut profile = ColorProfile::new_srgb();
        profile.cicp = None;
        set_curve(&mut profile, curve);
        Self::of_made(profile)
    }

    fn of_made(mut profile: ColorProfile) -> Result<Self, Unused> {
        let text = |value: &str| {
            let text = LocalizableString::new("en".into(), "US".into(), value.into());
            Some(ProfileText::Localizable(vec![text]))
        };
        // Of even lengths, so that the tags behind begin at multiples of four.
        profile.description = text("Colours of the photographs");
        profile.copyright = text("In the public domain");
        let mut icc = profile.encode().map_err(|_| Unused::NotUnderstood)?;
        make_strict(&mut icc).ok_or(Unused::NotUnderstood)?;
        Self::of_profile(&profile, icc)
    }

    fn of_profile(profile: &ColorProfile, icc: Vec<u8>) -> Result<Self, Unused> {
        let srgb = ColorProfile::new_srgb();
        let curves = [&profile.red_trc, &profile.green_trc, &profile.blue_trc].map(table);
        let [Some(red), Some(green), Some(blue)] = curves else {
            return Err(Unused::NotUnderstood);
        };
        let curves = [red, green, blue];
        let rows = profile.transform_matrix(&srgb).v;
        let rec709_from_device = DMat3::from_cols_array_2d(&rows).transpose();
        let device_from_rec709 = rec709_from_device.inverse();
        if !(rec709_from_device.is_finite() && device_from_rec709.is_finite()) {
            return Err(Unused::NotUnderstood);
        }
        let same_matrix = rec709_from_device.abs_diff_eq(DMat3::IDENTITY, SAME_MATRIX);
        let reference = table(&srgb.red_trc).ok_or(Unused::NotUnderstood)?;
        if same_matrix
            && curves
                .iter()
                .all(|curve| is_within_a_code(curve, &reference))
        {
            return Err(Unused::IsSrgb);
        }
        Ok(Self {
            icc,
            curves,
            rec709_from_device,
            device_from_rec709,
        })
    }

    /// The profile's own bytes, of RGB pictures.
    pub fn icc(&self) -> &[u8] {
        &self.icc
    }

    /// Linear Rec.709 of a code of 16 bits; negative where that has no such colour.
    pub fn linear(&self, code: [u16; 3]) -> [f32; 3] {
        let device = [0, 1, 2].map(|c| f64::from(self.curves[c][usize::from(code[c])]));
        let linear = self.rec709_from_device * DVec3::from(device);
        linear.as_vec3().to_array()
    }

    /// The code of a linear Rec.709 colour, 0 to 1; clamped to what the profile holds.
    pub fn encoded(&self, linear: [f32; 3]) -> [f64; 3] {
        let linear = linear.map(|x| if x.is_finite() { f64::from(x) } else { 0.0 });
        let device = self.device_from_rec709 * DVec3::from(linear);
        [0, 1, 2].map(|c| {
            let curve = &self.curves[c];
            let above = curve.partition_point(|value| f64::from(*value) <= device[c]);
            let Some(below) = above.checked_sub(1) else {
                return 0.0;
            };
            let next = curve.get(above).map_or(0.0, |next| {
                let (from, to) = (f64::from(curve[below]), f64::from(*next));
                (device[c] - from) / (to - from)
            });
            (below as f64 + next) / (CODES - 1) as f64
        })
    }
}

fn set_curve(profile: &mut ColorProfile, curve: ToneReprCurve) {
    profile.red_trc = Some(curve.clone());
    profile.green_trc = Some(curve.clone());
    profile.blue_trc = Some(curve);
}

/// Year, month, day, hour, minute and second of all profiles that are made here.
const CREATED: [u16; 6] = [2000, 1, 1, 0, 0, 0];

/// What strict readers of ICC.1:2022 ask for and the crate leaves out: a length that is a multiple of four, and D50 to the last bit; and a time
/// that is not the clock's, so that the same run writes the same bytes.
fn make_strict(icc: &mut Vec<u8>) -> Option<()> {
    icc.resize(icc.len().next_multiple_of(4), 0);
    let length = u32::try_from(icc.len()).ok()?;
    icc.get_mut(..4)?.copy_from_slice(&length.to_be_bytes());
    icc.get_mut(24..36)?
        .copy_from_slice(CREATED.map(u16::to_be_bytes).as_flattened());
    for (place, word) in D50.into_iter().enumerate() {
        let at = 68 + 4 * place;
        icc.get_mut(at..at + 4)?
            .copy_from_slice(&word.to_be_bytes());
    }
    Some(())
}

impl fmt::Debug for ColourProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ColourProfile({} bytes)", self.icc.len())
    }
}

/// `None` where a curve is absent, falls, or leaves 0 to 1.
fn table(curve: &Option<ToneReprCurve>) -> Option<Vec<f32>> {
    let curve = curve.as_ref()?.make_linear_evaluator().ok()?;
    let mut values: Vec<f32> = (0..CODES)
        .map(|code| curve.evaluate_value(code as f32 / (CODES - 1) as f32))
        .collect();
    // The crate's power of 0 is no number.
    if !(-1e-3..=1.0).contains(&values[0]) {
        values[0] = 0.0;
    }
    let rises = values.windows(2).all(|pair| pair[0] <= pair[1]);
    let in_range = |x: &f32| (-1e-3..=1.001).contains(x);
    (rises && values.iter().all(in_range)).then_some(values)
}

/// No further than a step of 8 bits.
fn is_within_a_code(curve: &[f32], reference: &[f32]) -> bool {
    (0..=255).all(|code: usize| {
        let at = |code: usize| reference[code.min(255) * 257];
        let low = if code == 0 { -at(1) } else { at(code - 1) };
        let high = if code == 255 { 1.01 } else { at(code + 1) };
        (low..=high).contains(&curve[code * 257])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_p3_is_what_the_standard_says() {
        let icc = ColorProfile::new_display_p3().encode().unwrap();
        let p3 = ColourProfile::of_icc(icc).unwrap();
        let encode = |x: f32| (crate::scene::srgb::encode(f64::from(x)) * 255.0).round();
        let code = [200, 40, 40].map(|c: u16| c * 257);
        let srgb = p3.linear(code).map(encode);
        assert_eq!([srgb[0], srgb[2]], [218.0, 26.0]);
        assert!(p3.linear(code)[1] < 0.0, "outside of Rec.709");
        for code in [[200, 40, 40], [0, 0, 0], [255, 255, 255], [3, 90, 250]] {
            let back = p3.encoded(p3.linear(code.map(|c: u16| c * 257)));
            assert_eq!(back.map(|x| (x * 255.0).round() as u16), code);
        }
    }

    #[test]
    fn srgb_under_any_name_is_none_and_others_are_kept() {
        let made = |profile: ColorProfile| ColourProfile::of_icc(profile.encode().unwrap());
        assert_eq!(made(ColorProfile::new_srgb()).unwrap_err(), Unused::IsSrgb);
        assert_eq!(
            ColourProfile::of_cicp([1, 13, 0, 1]).unwrap_err(),
            Unused::IsSrgb
        );
        let adobe = made(ColorProfile::new_adobe_rgb()).unwrap();
        assert!(
            (adobe.linear([32768; 3])[1] - 0.2177).abs() < 2e-3,
            "gamma 2.2"
        );
        let gray = made(ColorProfile::new_gray_with_gamma(1.8)).unwrap();
        assert!((gray.linear([32768; 3])[0] - 0.2872).abs() < 2e-3);
        let again = ColourProfile::of_icc(gray.icc().to_vec()).unwrap();
        let apart = |other: &ColourProfile, code: u16| {
            let (a, b) = (other.linear([code; 3])[1], gray.linear([9999; 3])[1]);
            (a - b).abs()
        };
        assert!(apart(&again, 9999) < 5e-6, "as RGB");
        assert!(apart(&again, 10099) > 5e-5, "control");
        let p3 = ColourProfile::of_cicp([12, 13, 0, 1]).unwrap();
        assert_eq!(
            p3.icc()[24..36],
            *CREATED.map(u16::to_be_bytes).as_flattened(),
            "no clock's"
        );
        assert!(p3.linear([51400, 10280, 10280])[1] < 0.0);
        let display_p3 = GammaAndPrimaries {
            gamma: None,
            chromaticities: Some([31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000]),
        };
        let told = ColourProfile::of_gamma(display_p3).unwrap();
        for code in [[51400, 10280, 10280], [9, 65535, 0]] {
            let pairs = told.linear(code).into_iter().zip(p3.linear(code));
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3));
        }
        for gamma in [0, 9_999, u32::MAX] {
            let told = GammaAndPrimaries {
                gamma: Some(gamma),
                chromaticities: None,
            };
            let refused = ColourProfile::of_gamma(told).unwrap_err();
            assert_eq!(refused, Unused::NotUnderstood, "{gamma}");
        }
        let nowhere = GammaAndPrimaries {
            gamma: None,
            chromaticities: Some([0; 8]),
        };
        let refused = ColourProfile::of_gamma(nowhere).unwrap_err();
        assert_eq!(refused, Unused::NotUnderstood);
        for hdr in [[12, 16, 0, 1], [9, 18, 0, 1]] {
            assert_eq!(ColourProfile::of_cicp(hdr).unwrap_err(), Unused::IsHdr);
        }
        for refused in [[1, 13, 1, 1], [1, 13, 0, 0], [99, 13, 0, 1]] {
            assert_eq!(
                ColourProfile::of_cicp(refused).unwrap_err(),
                Unused::NotUnderstood
            );
        }
        assert_eq!(
            ColourProfile::of_icc(vec![7; 200]).unwrap_err(),
            Unused::NotUnderstood
        );
    }
}
