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
    quantise(linear, 255.0) as u8
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
