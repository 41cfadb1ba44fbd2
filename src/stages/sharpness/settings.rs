//! `[sharpness]`.

use crate::scene::error::Result;
use crate::scene::fingerprint::content;
use crate::scene::reader::{Node, Table};
use crate::stages::table::{StageSettings, read_into};

/// How a camera spreads and sharpens the light of a point, beyond the box of one pixel. In linear light: a normal distribution of deviation s, sharpened
/// by an unsharp mask, (1 + a) G(s) - a G(sqrt(s^2 + r^2)); its weights sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSpread {
    /// s of red, green and blue in the picture's centre, pixels, 0 to [`PointSpread::MAX_PX`].
    pub sigma_px: [f32; 3],
    /// s in the picture's corners; s^2 is linear in the squared distance from the centre.
    pub corner_sigma_px: [f32; 3],
    /// a, 0 to 10; 0 sharpens nothing.
    pub sharpening: f32,
    /// r, pixels, 0.1 to [`PointSpread::MAX_PX`].
    pub sharpening_radius_px: f32,
    /// How much further out than green red and blue lie in the corners, pixels, -4 to 4; linear in the distance from the centre.
    pub lateral_px: [f32; 2],
}

impl PointSpread {
    /// Largest deviation, pixels.
    pub const MAX_PX: f32 = 5.0;

    /// The same in all channels and everywhere, without sharpening.
    pub fn gaussian(sigma_px: f32) -> Self {
        Self {
            sigma_px: [sigma_px; 3],
            corner_sigma_px: [sigma_px; 3],
            sharpening: 0.0,
            sharpening_radius_px: 1.0,
            lateral_px: [0.0; 2],
        }
    }
}

/// The virtual light's sharpness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharpnessSettings {
    /// None: measured at the photograph's own edges.
    pub given: Option<PointSpread>,
}

content! {
    PointSpread { sigma_px, corner_sigma_px, sharpening, sharpening_radius_px, lateral_px }
    SharpnessSettings { given }
}

const NUMBERS: &[&str] = &[
    "sigma_px",
    "corner_sigma_px",
    "sharpening",
    "sharpening_radius_px",
    "lateral_px",
];

impl StageSettings for SharpnessSettings {
    const KEYS: &'static [&'static str] = &[
        "from",
        "sigma_px",
        "corner_sigma_px",
        "sharpening",
        "sharpening_radius_px",
        "lateral_px",
    ];

    fn read(table: &Table) -> Result<Self> {
        for key in NUMBERS {
            table.refuse_both("from", key)?;
        }
        let from = table.optional("from", |node| match node.string()? {
            "photo" => Ok(()),
            _ => Err(node.impossible("\"photo\", or numbers such as sigma_px in its place")),
        })?;
        if from.is_some() {
            return Ok(Self { given: None });
        }
        let sigma_px = table.required(
            "sigma_px",
            "from = \"photo\", or sigma_px = 0.8",
            deviations,
        )?;
        let mut spread = PointSpread {
            sigma_px,
            corner_sigma_px: sigma_px,
            ..PointSpread::gaussian(0.0)
        };
        read_into(
            table,
            "corner_sigma_px",
            &mut spread.corner_sigma_px,
            deviations,
        )?;
        read_into(table, "sharpening", &mut spread.sharpening, |node| {
            Ok(node.number("a number from 0 to 10", |x| (0.0..=10.0).contains(&x))? as f32)
        })?;
        let radius = &mut spread.sharpening_radius_px;
        read_into(table, "sharpening_radius_px", radius, |node| {
            Ok(node.number("pixels from 0.1 to 5", |x| (0.1..=5.0).contains(&x))? as f32)
        })?;
        read_into(table, "lateral_px", &mut spread.lateral_px, |node| {
            let shifts = node.numbers::<2>("pixels from -4 to 4", |x| x.abs() <= 4.0)?;
            Ok(shifts.map(|shift| shift as f32))
        })?;
        Ok(Self {
            given: Some(spread),
        })
    }
}

/// One number for all channels, or one for each.
fn deviations(node: &Node) -> Result<[f32; 3]> {
    let expected = "pixels from 0 to 5";
    let accept = |x: f64| (0.0..=f64::from(PointSpread::MAX_PX)).contains(&x);
    if node.is_array() {
        return Ok(node.numbers::<3>(expected, accept)?.map(|x| x as f32));
    }
    Ok([node.number(expected, accept)? as f32; 3])
}
