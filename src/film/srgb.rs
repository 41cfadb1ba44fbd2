//! The piecewise sRGB transfer function (IEC 61966-2-1), in f64 so that 8- and 16-bit codes make the round trip exactly.

/// Code value in 0..1 to linear.
pub fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// Linear to code value; negative values follow the linear segment, values above 1 the curve.
pub fn encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        linear * 12.92
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// Linear to a code of 0..=max: clamped, rounded half up, no dither. NaN becomes 0.
fn quantise(linear: f32, max: f64) -> f64 {
    (encode(f64::from(linear)).clamp(0.0, 1.0) * max + 0.5).floor()
}

pub fn encode8(linear: f32) -> u8 {
    quantise(linear, 255.0) as u8
}

pub fn encode16(linear: f32) -> u16 {
    quantise(linear, 65535.0) as u16
}

pub fn decode8(code: u8) -> f32 {
    decode(f64::from(code) / 255.0) as f32
}

pub fn decode16(code: u16) -> f32 {
    decode(f64::from(code) / 65535.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_makes_the_round_trip() {
        assert!((0..=255).all(|c| encode8(decode8(c)) == c));
        assert!((0..=65535).all(|c| encode16(decode16(c)) == c));
        let gamma = |c: u16| (f64::from(c) / 65535.0).powf(2.2) as f32;
        assert!(
            !(0..=65535).all(|c| encode16(gamma(c)) == c),
            "control: a plain gamma does not"
        );
    }

    #[test]
    fn known_values_and_clamping() {
        assert!((decode(0.5) - 0.214_041_140_482_232_5).abs() < 1e-15);
        assert_eq!((encode8(0.214_040), encode8(0.214_042)), (127, 128));
        assert_eq!((encode8(-1.0), encode8(2.0)), (0, 255));
        assert_eq!((encode8(f32::NAN), encode8(f32::INFINITY)), (0, 255));
    }
}
