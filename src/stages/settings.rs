//! `[cartoon]` and the other tables of camera stages. A stage whose table is absent is off.

use super::noise::profile::NoiseProfile;
use crate::scene::error::Result;
use crate::scene::reader::{Choice, Node, Table};

/// The stages that a scene asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stages {
    pub antialias: Option<AntialiasSettings>,
    pub motion_blur: Option<MotionBlurSettings>,
    pub noise: Option<NoiseSettings>,
    /// Never beside the others: it replaces what makes a picture look photographed.
    pub cartoon: Option<CartoonSettings>,
}

/// Blending of virtual border pixels with their real neighbours, for pictures whose mask is binary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntialiasSettings {
    /// Share of the blended colour, 0 to 1; 0 changes nothing.
    pub beta: f32,
}

impl Default for AntialiasSettings {
    fn default() -> Self {
        Self { beta: 0.8 }
    }
}

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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseMethod {
    /// As much as is missing, drawn for each pixel with the measured correlation.
    Missing,
    /// The paper's: noise textures over the virtual pixels.
    Textures,
}

impl Choice for NoiseMethod {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("missing", Self::Missing), ("textures", Self::Textures)];
}

#[derive(Clone, Debug, PartialEq)]
pub struct NoiseSettings {
    pub profile: NoiseProfile,
    pub method: NoiseMethod,
    /// Factor on the noise that is added; 1 is the camera's own.
    pub scale: f32,
    /// Side of the textures, a power of two.
    pub texture_size: u32,
    /// Pixels that one texel covers along each axis.
    pub magnification: f32,
    /// Frames that keep the same noise.
    pub update_delay_frames: u32,
    /// Textures rounded to 8 bits, as the paper's are.
    pub eight_bit: bool,
}

impl NoiseSettings {
    /// Most texels of all bins' textures together: 1 GiB of them.
    pub const MAX_TEXELS: u64 = 1 << 26;
    /// Largest texture side, texels.
    pub const MAX_TEXTURE_SIZE: u32 = 4096;

    /// Whether the textures are of a size that can be held.
    ///
    /// # Errors
    /// In one line: they are too large together.
    pub fn check_textures(&self) -> std::result::Result<(), String> {
        let texels = u64::from(self.texture_size).pow(2) * self.profile.bins.len() as u64;
        if self.method == NoiseMethod::Textures && texels > Self::MAX_TEXELS {
            return Err(format!(
                "{} textures of {} x {} texels are more than {} texels in all; expected fewer or smaller ones; make texture_size smaller",
                self.profile.bins.len(),
                self.texture_size,
                self.texture_size,
                Self::MAX_TEXELS
            ));
        }
        Ok(())
    }

    pub fn new(profile: NoiseProfile) -> Self {
        Self {
            profile,
            method: NoiseMethod::Missing,
            scale: 1.0,
            texture_size: 512,
            magnification: 1.0,
            update_delay_frames: 1,
            eight_bit: false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CartoonStyle {
    /// Fischer and Bartz 2005: Sobel edges of the simplified and of the original picture.
    Photometric,
    /// Lines that follow the picture's contours: a flow-guided difference of Gaussians (Kang et al. 2007).
    Flow,
}

impl Choice for CartoonStyle {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("photometric", Self::Photometric), ("flow", Self::Flow)];
}

/// Parameters of the cartoon. The defaults are the paper's (its figures 4 to 6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartoonSettings {
    pub style: CartoonStyle,
    /// Size of the simplified picture, pixels. Smaller is coarser and faster. A picture that is smaller keeps its size.
    pub shrunk_width: u32,
    pub shrunk_height: u32,
    /// Passes of the photometric filter; more make flatter colours.
    pub iterations: u32,
    /// Standard deviation of the photometric weight, encoded UV units; larger mixes colours that differ more.
    pub sigma_p: f32,
    /// Weight of colour against brightness in an edge, 0 to 1.
    pub alpha: f32,
    /// Weight of the original picture's edges against the simplified one's, 0 to 1.
    pub beta: f32,
    /// Responses of the simplified picture at which a silhouette begins and is complete.
    pub s0: f32,
    pub s1: f32,
    /// The same of the original picture.
    pub a0: f32,
    pub a1: f32,
    pub flow: FlowSettings,
}

impl Default for CartoonSettings {
    fn default() -> Self {
        Self {
            style: CartoonStyle::Photometric,
            shrunk_width: 240,
            shrunk_height: 180,
            iterations: 7,
            sigma_p: 0.025,
            alpha: 0.3,
            beta: 0.3,
            s0: 0.054,
            s1: 0.064,
            a0: 0.3,
            a1: 0.7,
            flow: FlowSettings::default(),
        }
    }
}

/// Parameters of the `flow` style's lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowSettings {
    /// Standard deviation of the smoothing of the contour directions, pixels; larger gives calmer lines.
    pub tensor_sigma_px: f32,
    /// Standard deviation of the inner Gaussian across a contour, pixels: the line width. The outer one is 1.6 times that.
    pub edge_sigma_px: f32,
    /// Standard deviation of the smoothing along a contour, pixels; larger makes longer, more coherent lines.
    pub line_sigma_px: f32,
    /// Weight of the outer Gaussian; nearer to 1 finds fainter lines.
    pub tau: f32,
    /// Depth of the response below 0 at which a line begins and is complete.
    pub t0: f32,
    pub t1: f32,
}

impl Default for FlowSettings {
    fn default() -> Self {
        Self {
            tensor_sigma_px: 2.0,
            edge_sigma_px: 1.0,
            line_sigma_px: 3.0,
            tau: 0.99,
            t0: 0.0,
            t1: 0.02,
        }
    }
}

const NOISE_KEYS: &[&str] = &[
    "profile",
    "method",
    "scale",
    "texture_size",
    "magnification",
    "update_delay_frames",
    "eight_bit",
];

const MOTION_BLUR_KEYS: &[&str] = &[
    "method",
    "min_length_px",
    "max_length_px",
    "step_px",
    "centre_opacity",
];

const CARTOON_KEYS: &[&str] = &[
    "style",
    "shrunk_width",
    "shrunk_height",
    "iterations",
    "sigma_p",
    "alpha",
    "beta",
    "s0",
    "s1",
    "a0",
    "a1",
    "tensor_sigma_px",
    "edge_sigma_px",
    "line_sigma_px",
    "tau",
    "t0",
    "t1",
];

impl CartoonSettings {
    /// Most passes of the photometric filter.
    pub const MAX_ITERATIONS: u32 = 1000;
    /// Widest smoothing of the flow style, pixels.
    pub const MAX_FLOW_SIGMA_PX: f32 = 16.0;
    /// Longest side of the simplified picture, pixels.
    pub const MAX_SHRUNK_PX: u32 = 32768;
}

pub(crate) fn read_stages(root: &Table) -> Result<Stages> {
    for stage in ["noise", "antialias", "motion_blur"] {
        root.refuse_both("cartoon", stage)?;
    }
    Ok(Stages {
        antialias: root
            .table("antialias", "[antialias]", &["beta"])?
            .map(|table| read_antialias(&table))
            .transpose()?,
        motion_blur: root
            .table("motion_blur", "[motion_blur]", MOTION_BLUR_KEYS)?
            .map(|table| read_motion_blur(&table))
            .transpose()?,
        noise: root
            .table("noise", "[noise]", NOISE_KEYS)?
            .map(|table| read_noise(&table))
            .transpose()?,
        cartoon: root
            .table("cartoon", "[cartoon]", CARTOON_KEYS)?
            .map(|table| read_cartoon(&table))
            .transpose()?,
    })
}

fn read_antialias(table: &Table) -> Result<AntialiasSettings> {
    let mut settings = AntialiasSettings::default();
    read(table, "beta", &mut settings.beta, |node| node.unit())?;
    Ok(settings)
}

fn read_motion_blur(table: &Table) -> Result<MotionBlurSettings> {
    let mut settings = MotionBlurSettings::default();
    read(table, "method", &mut settings.method, |node| node.choice())?;
    let length = |node: &Node| {
        let expected = "pixels from 0 to 4096";
        Ok(node.number(expected, |x| (0.0..=4096.0).contains(&x))? as f32)
    };
    read(table, "min_length_px", &mut settings.min_length_px, length)?;
    read(table, "max_length_px", &mut settings.max_length_px, length)?;
    read(table, "step_px", &mut settings.step_px, |node| {
        let expected = "pixels from 0.1 to 1000";
        Ok(node.number(expected, |x| (0.1..=1e3).contains(&x))? as f32)
    })?;
    read(
        table,
        "centre_opacity",
        &mut settings.centre_opacity,
        |node| node.unit(),
    )?;
    Ok(settings)
}

fn read_noise(table: &Table) -> Result<NoiseSettings> {
    let profile = table.required("profile", "profile = \"noise.toml\"", |node| {
        let path = node.existing_file()?;
        NoiseProfile::read(&path).map_err(|problem| node.file_error(&path, &problem))
    })?;
    let mut settings = NoiseSettings::new(profile);
    read(table, "method", &mut settings.method, |node| node.choice())?;
    read(table, "scale", &mut settings.scale, |node| {
        let expected = "a number from 0 to 1000";
        Ok(node.number(expected, |x| (0.0..=1e3).contains(&x))? as f32)
    })?;
    read(table, "texture_size", &mut settings.texture_size, |node| {
        let most = NoiseSettings::MAX_TEXTURE_SIZE;
        let size = node.integer(1, most)?;
        if size.is_power_of_two() {
            Ok(size)
        } else {
            Err(node.impossible(format!("a power of two, at most {most}")))
        }
    })?;
    read(
        table,
        "magnification",
        &mut settings.magnification,
        |node| {
            let expected = "a number from 0.01 to 1000";
            Ok(node.number(expected, |x| (0.01..=1e3).contains(&x))? as f32)
        },
    )?;
    let delay = &mut settings.update_delay_frames;
    read(table, "update_delay_frames", delay, |node| {
        node.integer(1, u32::MAX)
    })?;
    read(table, "eight_bit", &mut settings.eight_bit, |node| {
        node.boolean()
    })?;
    if let Err(problem) = settings.check_textures() {
        read(table, "texture_size", &mut settings.texture_size, |node| {
            Err(node.impossible(&problem))
        })?;
    }
    Ok(settings)
}

fn read_cartoon(table: &Table) -> Result<CartoonSettings> {
    let mut settings = CartoonSettings::default();
    if let Some(style) = table.optional("style", |node| node.choice())? {
        settings.style = style;
    }
    let side = |node: &Node| node.integer(1, CartoonSettings::MAX_SHRUNK_PX);
    read(table, "shrunk_width", &mut settings.shrunk_width, side)?;
    read(table, "shrunk_height", &mut settings.shrunk_height, side)?;
    read(table, "iterations", &mut settings.iterations, |node| {
        node.integer(0, CartoonSettings::MAX_ITERATIONS)
    })?;
    read(table, "sigma_p", &mut settings.sigma_p, |node| {
        let expected = "a number from 0.0001 to 1000";
        Ok(node.number(expected, |x| (1e-4..=1e3).contains(&x))? as f32)
    })?;
    read(table, "alpha", &mut settings.alpha, |node| node.unit())?;
    read(table, "beta", &mut settings.beta, |node| node.unit())?;
    read_step(table, ["s0", "s1"], &mut settings.s0, &mut settings.s1)?;
    read_step(table, ["a0", "a1"], &mut settings.a0, &mut settings.a1)?;
    let flow = &mut settings.flow;
    read(
        table,
        "tensor_sigma_px",
        &mut flow.tensor_sigma_px,
        flow_sigma,
    )?;
    read(table, "edge_sigma_px", &mut flow.edge_sigma_px, flow_sigma)?;
    read(table, "line_sigma_px", &mut flow.line_sigma_px, flow_sigma)?;
    read(table, "tau", &mut flow.tau, |node| node.unit())?;
    read_step(table, ["t0", "t1"], &mut flow.t0, &mut flow.t1)?;
    Ok(settings)
}

fn flow_sigma(node: &Node) -> Result<f32> {
    let most = f64::from(CartoonSettings::MAX_FLOW_SIGMA_PX);
    let expected = format!("a number from 0.1 to {most}");
    Ok(node.number(&expected, |x| (0.1..=most).contains(&x))? as f32)
}

/// Replaces `value` if the key is there.
fn read<'a, T>(
    table: &Table<'a>,
    key: &str,
    value: &mut T,
    read: impl FnOnce(&Node<'a>) -> Result<T>,
) -> Result<()> {
    if let Some(given) = table.optional(key, read)? {
        *value = given;
    }
    Ok(())
}

/// Two thresholds, the second above the first.
fn read_step(table: &Table, keys: [&str; 2], low: &mut f32, high: &mut f32) -> Result<()> {
    let threshold = |node: &Node| {
        Ok(node.number("a number from 0 to 100", |x| (0.0..=100.0).contains(&x))? as f32)
    };
    read(table, keys[0], low, threshold)?;
    read(table, keys[1], high, threshold)?;
    if *high > *low {
        return Ok(());
    }
    let [low_key, high_key] = keys;
    let problem = format!("`{low_key}` is {low} and `{high_key}` is {high}");
    let expected = format!("`{high_key}` above `{low_key}`");
    // One of the two is there: the defaults are in order.
    let node = table.get(high_key).or(table.get(low_key));
    Err(match node {
        Some(node) => node.error(problem, expected, "correct the value"),
        None => table.error(problem, expected, "correct the values"),
    })
}
