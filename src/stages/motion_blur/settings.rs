//! `[motion_blur]`.

use crate::scene::error::Result;
use crate::scene::fingerprint::{content, content_by_name};
use crate::scene::reader::{Choice, Node, Table};
use crate::stages::table::{StageSettings, read_into};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionBlurMethod {
    /// Shutter time as one more dimension of the rays.
    Shutter,
    /// The paper's: copies of each object along its motion in the picture.
    Copies,
}

impl Choice for MotionBlurMethod {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("shutter", Self::Shutter), ("copies", Self::Copies)];
}

/// How motion is shown. All but the method concerns the copies (Fischer and Bartz 2006, section 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionBlurSettings {
    pub method: MotionBlurMethod,
    /// Objects whose centre moves by less from the frame before stay sharp, pixels; so do those that move by more than the maximum, which
    /// errors of the tracking do.
    pub min_length_px: f32,
    pub max_length_px: f32,
    /// Distance between two copies, pixels; smaller is smoother and slower.
    pub step_px: f32,
    /// Of the copy that is drawn last, at the object's own place, 0 to 1: it keeps the photograph from shining through.
    pub centre_opacity: f32,
}

impl Default for MotionBlurSettings {
    fn default() -> Self {
        Self {
            method: MotionBlurMethod::Shutter,
            min_length_px: 5.0,
            max_length_px: 150.0,
            step_px: 1.0,
            centre_opacity: 0.8,
        }
    }
}

content! {
    MotionBlurSettings { method, min_length_px, max_length_px, step_px, centre_opacity }
}

content_by_name! { MotionBlurMethod }

impl StageSettings for MotionBlurSettings {
    const KEYS: &'static [&'static str] = &[
        "method",
        "min_length_px",
        "max_length_px",
        "step_px",
        "centre_opacity",
    ];

    fn read(table: &Table) -> Result<Self> {
        let mut settings = MotionBlurSettings::default();
        read_into(table, "method", &mut settings.method, |node| node.choice())?;
        let length = |node: &Node| {
            let expected = "pixels from 0 to 4096";
            Ok(node.number(expected, |x| (0.0..=4096.0).contains(&x))? as f32)
        };
        read_into(table, "min_length_px", &mut settings.min_length_px, length)?;
        read_into(table, "max_length_px", &mut settings.max_length_px, length)?;
        read_into(table, "step_px", &mut settings.step_px, |node| {
            let expected = "pixels from 0.1 to 1000";
            Ok(node.number(expected, |x| (0.1..=1e3).contains(&x))? as f32)
        })?;
        read_into(
            table,
            "centre_opacity",
            &mut settings.centre_opacity,
            |node| node.unit(),
        )?;
        Ok(settings)
    }
}
