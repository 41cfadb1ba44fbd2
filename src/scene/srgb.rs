//! The piecewise sRGB transfer function (IEC 61966-2-1), exact in both directions for every 8- and 16-bit code.

use std::sync::LazyLock;

/// Linear value of an encoded one, both nominally in 0..=1.
pub fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// Derivative of [`decode`].
pub fn decode_slope(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        1.0 / 12.92
    } else {
        2.4 / 1.055 * ((encoded + 0.055) / 1.055).powf(1.4)
    }
}

/// Encoded value of a linear one, both nominally in 0..=1.
pub fn encode(linear: f64) -> f64 {
    if linear <= 0.0031308 {
        linear * 12.92
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// Linear value of an 8-bit code.
pub fn decode8(code: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|code| decode(code as f64 / 255.0) as f32));
    TABLE[code as usize]
}

/// Linear value of a 16-bit code.
pub fn decode16(code: u16) -> f32 {
    static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
        (0..=u16::MAX)
            .map(|code| decode(f64::from(code) / 65535.0) as f32)
            .collect()
    });
    TABLE[code as usize]
}

/// Nearest 8-bit code, half rounded up, clamped. NaN becomes 0.
pub fn encode8(linear: f32) -> u8 {
    static CODES: LazyLock<Codes8> = LazyLock::new(Codes8::new);
    CODES.of(linear)
}

/// What hardly differs from a photograph's 8-bit code keeps it: half a code is what rounding hides anyway, and the rest is what noise may then be off
/// without a change of code.
pub const KEPT_CODES: f64 = 0.7;

/// The code, if the value lies within [`KEPT_CODES`] of it, else [`encode8`]'s.
pub fn encode8_near(linear: f32, code: u8) -> u8 {
    static KEPT: LazyLock<[[f32; 2]; 256]> = LazyLock::new(|| {
        std::array::from_fn(|code| {
            let bound = |side: f64| ((code as f64 + side * KEPT_CODES) / 255.0).clamp(0.0, 1.0);
            [-1.0, 1.0].map(|side| decode(bound(side)) as f32)
        })
    });
    let [low, high] = KEPT[code as usize];
    match low < linear && linear < high {
        true => code,
        false => encode8(linear),
    }
}

/// The 8-bit codes by a look at a few of them, where a power takes ten times as long.
struct Codes8 {
    /// By the upper bits of a value from 2^-13 to 1: the code of the least such value.
    least: Vec<u8>,
    /// By code, the least value that has a larger one.
    end: [f32; 256],
}

impl Codes8 {
    /// What is below 2^-13 has code 0.
    const FIRST_BITS: u32 = (127 - 13) << 23;
    const ONE_BITS: u32 = 127 << 23;
    /// 128 steps to each doubling: at most two codes lie in one.
    const SHIFT: u32 = 16;

    fn new() -> Self {
        let count = ((Self::ONE_BITS - Self::FIRST_BITS) >> Self::SHIFT) + 1;
        let value = |i: u32| f32::from_bits(Self::FIRST_BITS + (i << Self::SHIFT));
        let mut end = [f32::INFINITY; 256];
        for (code, end) in end.iter_mut().enumerate().take(255) {
            // The bits of positive numbers are in their order.
            let (mut low, mut high) = (0, Self::ONE_BITS);
            while high - low > 1 {
                let middle = low + (high - low) / 2;
                match quantise(f32::from_bits(middle), 255.0) as usize > code {
                    true => high = middle,
                    false => low = middle,
                }
            }
            *end = f32::from_bits(high);
        }
        Self {
            least: (0..count)
                .map(|i| quantise(value(i), 255.0) as u8)
                .collect(),
            end,
        }
    }

    fn of(&self, linear: f32) -> u8 {
        if linear >= 1.0 {
            return 255;
        }
        let bits = linear.to_bits();
        if linear.is_nan() || linear <= 0.0 || bits < Self::FIRST_BITS {
            return 0;
        }
        let least = self.least[((bits - Self::FIRST_BITS) >> Self::SHIFT) as usize];
        least + u8::from(linear >= self.end[least as usize])
    }
}

/// Nearest 16-bit code, half rounded up, clamped. NaN becomes 0.
pub fn encode16(linear: f32) -> u16 {
    quantise(linear, 65535.0) as u16
}

fn quantise(linear: f32, top: f64) -> f64 {
    (encode(f64::from(linear).clamp(0.0, 1.0)) * top + 0.5).floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_8_bit_code_survives_the_round_trip() {
        for code in 0..=u8::MAX {
            assert_eq!(encode8(decode8(code)), code);
        }
    }

    #[test]
    fn every_16_bit_code_survives_the_round_trip() {
        for code in 0..=u16::MAX {
            assert_eq!(encode16(decode16(code)), code);
        }
    }

    /// Those of the formula: beside every border, and at a million values.
    #[test]
    fn codes_by_table_are_those_of_the_formula() {
        let formula = |linear: f32| quantise(linear, 255.0) as u8;
        for code in 0..255_u8 {
            let border = decode((f64::from(code) + 0.5) / 255.0) as f32;
            for bits in border.to_bits() - 300..border.to_bits() + 300 {
                let linear = f32::from_bits(bits);
                assert_eq!(encode8(linear), formula(linear), "{linear}");
            }
        }
        for bits in (0..=u32::MAX).step_by(4099) {
            let linear = f32::from_bits(bits);
            assert_eq!(encode8(linear), formula(linear), "{linear}");
        }
        assert_ne!(encode8(0.5), formula(0.49), "control");
    }

    /// Negative control: a pure power of 2.2, the usual shortcut, does not survive.
    #[test]
    fn a_plain_gamma_fails_the_round_trip() {
        let broken = (0..=u8::MAX)
            .filter(|code| encode8((f32::from(*code) / 255.0).powf(2.2)) != *code)
            .count();
        assert!(broken > 100, "{broken}");
    }

    #[test]
    fn codes_change_half_way_and_half_rounds_up() {
        for code in 0..255_u8 {
            let border = decode((f64::from(code) + 0.5) / 255.0);
            assert_eq!(encode8((border * (1.0 - 1e-6)) as f32), code);
            assert_eq!(encode8((border * (1.0 + 1e-6)) as f32), code + 1);
        }
        // 0.5 / 255 / 12.92 lies on the linear segment, where the border is exact in f64.
        assert_eq!(quantise(0.0, 255.0), 0.0);
    }

    #[test]
    fn out_of_range_values_clamp() {
        assert_eq!(encode8(-1.0), 0);
        assert_eq!(encode8(f32::INFINITY), 255);
        assert_eq!(encode8(f32::NAN), 0);
        assert_eq!(encode16(2.0), 65535);
        assert_eq!(decode8(255), 1.0);
    }

    #[test]
    fn known_values() {
        assert!((decode(0.5) - 0.214_041_140_482_232_6).abs() < 1e-12);
        assert!((decode8(10) - 10.0 / 255.0 / 12.92).abs() < 1e-9);
    }
}
