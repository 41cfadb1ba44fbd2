//! `[cartoon]`.

use crate::scene::error::Result;
use crate::scene::fingerprint::{content, content_by_name};
use crate::scene::reader::{Choice, Node, Table};
use crate::stages::table::{StageSettings, read_into};

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

impl CartoonSettings {
    /// Most passes of the photometric filter.
    pub const MAX_ITERATIONS: u32 = 1000;
    /// Widest smoothing of the flow style, pixels.
    pub const MAX_FLOW_SIGMA_PX: f32 = 16.0;
    /// Longest side of the simplified picture, pixels.
    pub const MAX_SHRUNK_PX: u32 = 32768;
}

content! {
    CartoonSettings { style, shrunk_width, shrunk_height, iterations, sigma_p, alpha, beta, s0, s1, a0, a1, flow }
    FlowSettings { tensor_sigma_px, edge_sigma_px, line_sigma_px, tau, t0, t1 }
}

content_by_name! { CartoonStyle }

impl StageSettings for CartoonSettings {
    const KEYS: &'static [&'static str] = &[
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
    const ALONE: bool = true;

    fn read(table: &Table) -> Result<Self> {
        let mut settings = CartoonSettings::default();
        if let Some(style) = table.optional("style", |node| node.choice())? {
            settings.style = style;
        }
        let side = |node: &Node| node.integer(1, CartoonSettings::MAX_SHRUNK_PX);
        read_into(table, "shrunk_width", &mut settings.shrunk_width, side)?;
        read_into(table, "shrunk_height", &mut settings.shrunk_height, side)?;
        read_into(table, "iterations", &mut settings.iterations, |node| {
            node.integer(0, CartoonSettings::MAX_ITERATIONS)
        })?;
        read_into(table, "sigma_p", &mut settings.sigma_p, |node| {
            let expected = "a number from 0.0001 to 1000";
            Ok(node.number(expected, |x| (1e-4..=1e3).contains(&x))? as f32)
        })?;
        read_into(table, "alpha", &mut settings.alpha, |node| node.unit())?;
        read_into(table, "beta", &mut settings.beta, |node| node.unit())?;
        read_step(table, ["s0", "s1"], &mut settings.s0, &mut settings.s1)?;
        read_step(table, ["a0", "a1"], &mut settings.a0, &mut settings.a1)?;
        let flow = &mut settings.flow;
        read_into(
            table,
            "tensor_sigma_px",
            &mut flow.tensor_sigma_px,
            flow_sigma,
        )?;
        read_into(table, "edge_sigma_px", &mut flow.edge_sigma_px, flow_sigma)?;
        read_into(table, "line_sigma_px", &mut flow.line_sigma_px, flow_sigma)?;
        read_into(table, "tau", &mut flow.tau, |node| node.unit())?;
        read_step(table, ["t0", "t1"], &mut flow.t0, &mut flow.t1)?;
        Ok(settings)
    }
}

fn flow_sigma(node: &Node) -> Result<f32> {
    let most = f64::from(CartoonSettings::MAX_FLOW_SIGMA_PX);
    let expected = format!("a number from 0.1 to {most}");
    Ok(node.number(&expected, |x| (0.1..=most).contains(&x))? as f32)
}

/// Two thresholds, the second above the first.
fn read_step(table: &Table, keys: [&str; 2], low: &mut f32, high: &mut f32) -> Result<()> {
    let threshold = |node: &Node| {
        Ok(node.number("a number from 0 to 100", |x| (0.0..=100.0).contains(&x))? as f32)
    };
    read_into(table, keys[0], low, threshold)?;
    read_into(table, keys[1], high, threshold)?;
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
