//! The sRGB curve in f32, with the polynomials that both backends share. Twin of `shaders/stages/curve.wgsl`.

use crate::math::{exp_, log_};

/// Encoded value of a linear one. Below the curve's straight end and above 1 it goes on.
pub fn encode_(linear: f32) -> f32 {
    if linear <= 0.003_130_8 {
        linear * 12.92
    } else {
        1.055 * exp_(log_(linear) * (1.0 / 2.4)) - 0.055
    }
}

/// [`encode_`] of each channel.
pub fn encode_rgb(linear: [f32; 3]) -> [f32; 3] {
    linear.map(encode_)
}

/// Linear value of an encoded one.
pub fn decode_(encoded: f32) -> f32 {
    if encoded <= 0.040_45 {
        encoded * (1.0 / 12.92)
    } else {
        exp_(log_((encoded + 0.055) * (1.0 / 1.055)) * 2.4)
    }
}

/// Derivative of the linear value by the encoded one.
pub fn decode_slope(encoded: f32) -> f32 {
    if encoded <= 0.040_45 {
        1.0 / 12.92
    } else {
        exp_(log_((encoded + 0.055) * (1.0 / 1.055)) * 1.4) * (2.4 / 1.055)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::srgb::{decode, encode};

    #[test]
    fn it_is_the_srgb_curve_to_a_thousandth_of_a_code() {
        for step in -200..4000 {
            let x = step as f32 / 2000.0;
            let truth = encode(f64::from(x));
            assert!((f64::from(encode_(x)) - truth).abs() < 3e-6, "{x}");
            let truth = decode(f64::from(x));
            assert!((f64::from(decode_(x)) - truth).abs() < 3e-6, "{x}");
            let h = 1e-6;
            let slope = (decode(f64::from(x) + h) - decode(f64::from(x) - h)) / (2.0 * h);
            // The curve has a corner at 0.04045.
            if (x - 0.040_45).abs() > 1e-4 {
                assert!((f64::from(decode_slope(x)) - slope).abs() < 1e-4, "{x}");
            }
        }
        assert!(
            (f64::from(encode_(0.5)) - 0.5f64.powf(1.0 / 2.2)).abs() > 1e-3,
            "control"
        );
    }
}
