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
        let samples = values.iter().map(|v| v[c]);
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
        assert!(types(&[], Precision::Half).is_empty());
        assert!(is_half(0.5) && !is_half(0.1));
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
