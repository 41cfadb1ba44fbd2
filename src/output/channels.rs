//! Channels of an OpenEXR file in the making: 16-bit floats where they are enough, else 32-bit.

use exr::prelude::{AnyChannel, FlatSamples, SmallVec, Text, f16};

pub(super) type Channels = SmallVec<[AnyChannel<FlatSamples>; 4]>;

/// What a channel's values need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// Eleven bits, as far as the values are in the range of half floats: they are light that is added, or factors.
    Half,
    /// All bits: the values are compared, summed, or taken from others of their size.
    Single,
    /// 32 bits, in steps of 2^-18: 0.01 codes of 8 bits at black. Bits that show nothing are zeros, which compress.
    Steps,
    /// 32 bits, the last 13 of them zeros: an estimate has no more than three digits.
    Digits,
}

/// Steps of [`Precision::Steps`] from 0 to 1.
const STEPS: f32 = (1 << 18) as f32;

impl Precision {
    fn rounded(self, value: f32) -> f32 {
        match self {
            Self::Half | Self::Single => value,
            Self::Steps => (value * STEPS).round() / STEPS,
            Self::Digits => {
                let bits = value.to_bits();
                f32::from_bits(bits.saturating_add(1 << 12) & !((1 << 13) - 1))
            }
        }
    }
}

/// Samples that are empty stand for a plane that was not asked for: it is left out.
pub(super) fn push_channel<T: IntoSamples>(channels: &mut Channels, name: &str, samples: Vec<T>) {
    if !samples.is_empty() {
        channels.push(AnyChannel::new(Text::from(name), T::into_samples(samples)));
    }
}

/// What a channel can hold.
pub(super) trait IntoSamples: Sized {
    fn into_samples(samples: Vec<Self>) -> FlatSamples;
}

impl IntoSamples for f16 {
    fn into_samples(samples: Vec<Self>) -> FlatSamples {
        FlatSamples::F16(samples)
    }
}

impl IntoSamples for f32 {
    fn into_samples(samples: Vec<Self>) -> FlatSamples {
        FlatSamples::F32(samples)
    }
}

impl IntoSamples for u32 {
    fn into_samples(samples: Vec<Self>) -> FlatSamples {
        FlatSamples::U32(samples)
    }
}

/// Three channels of a layer, whose name ends with a dot.
pub(super) fn push_three(
    channels: &mut Channels,
    layer: &str,
    names: [&str; 3],
    values: &[[f32; 3]],
    precision: Precision,
) {
    let is_half = precision == Precision::Half && values.iter().flatten().all(|v| fits_half(*v));
    for (c, name) in names.into_iter().enumerate() {
        let name = format!("{layer}{name}");
        let samples = values.iter().map(|v| precision.rounded(v[c]));
        match is_half {
            true => push_channel(
                channels,
                &name,
                samples.map(f16::from_f32).collect::<Vec<f16>>(),
            ),
            false => push_channel(channels, &name, samples.collect::<Vec<f32>>()),
        }
    }
}

/// In their range, so that none becomes infinite.
fn fits_half(value: f32) -> bool {
    value.abs() <= f32::from(f16::MAX)
}

/// Bit for bit.
pub(super) fn is_half(value: f32) -> bool {
    f16::from_f32(value).to_f32() == value
}

#[cfg(test)]
mod tests {
    use super::*;

    fn types(values: &[[f32; 3]], precision: Precision) -> Vec<bool> {
        let mut channels = Channels::new();
        push_three(&mut channels, "a.", ["R", "G", "B"], values, precision);
        (channels.iter())
            .map(|channel| matches!(channel.sample_data, FlatSamples::F16(_)))
            .collect()
    }

    #[test]
    fn half_floats_hold_what_is_in_their_range() {
        assert_eq!(types(&[[0.1, 65504.0, -2.0]], Precision::Half), [true; 3]);
        assert_eq!(types(&[[0.1, 65505.0, -2.0]], Precision::Half), [false; 3]);
        assert_eq!(types(&[[0.1, f32::NAN, -2.0]], Precision::Half), [false; 3]);
        assert_eq!(types(&[[0.1, 0.5, -2.0]], Precision::Single), [false; 3]);
        assert_eq!(types(&[[0.5; 3]], Precision::Steps), [false; 3]);
        assert!(types(&[], Precision::Half).is_empty());
        assert!(is_half(0.5) && !is_half(0.1));
    }

    #[test]
    fn rounding_loses_nothing_that_shows() {
        use crate::scene::srgb::decode8;
        let black = decode8(1);
        for value in [0.3f32, -0.3, 1e-3, 7.25, 12345.678] {
            let step = Precision::Steps.rounded(value);
            assert!((step - value).abs() <= 0.01 * black, "{value}: {step}");
            let digits = Precision::Digits.rounded(value);
            assert!((digits / value - 1.0).abs() < 5e-4, "{value}: {digits}");
            assert_eq!(digits.to_bits() & 0x1fff, 0);
        }
        assert_ne!(Precision::Steps.rounded(0.3), 0.3, "control");
        for value in [0.0, f32::INFINITY] {
            assert_eq!(Precision::Steps.rounded(value), value);
            assert_eq!(Precision::Digits.rounded(value), value);
        }
    }

    /// Photographs of 8 bits are told apart: a half float of each code is read as that code.
    #[test]
    fn half_floats_tell_all_codes_apart() {
        use crate::scene::srgb::{decode8, encode8};
        for code in 0..=255u8 {
            let stored = f16::from_f32(decode8(code)).to_f32();
            assert_eq!(encode8(stored), code);
        }
    }
}
