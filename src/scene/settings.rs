//! `[render]`, and the flags that win over it.

use super::error::Result;
use super::photo::PhotoSettings;
use super::reader::{Choice, Node, Table};
use super::{
    Backdrop, BackendChoice, Combine, Composite, Estimator, Exposure, SamplerKind, Settings, Side,
};

impl Choice for Side {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("real", Self::Real), ("virtual", Self::Virtual)];
}

impl Choice for Estimator {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("direct", Self::Direct), ("paper", Self::Paper)];
}

impl Choice for SamplerKind {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("sobol", Self::Sobol),
        ("jittered", Self::Jittered),
        ("cmj", Self::Cmj),
    ];
}

impl Choice for Composite {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("additive", Self::Additive), ("quotient", Self::Quotient)];
}

impl Choice for Combine {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("mean", Self::Mean), ("robust", Self::Robust)];
}

impl Choice for BackendChoice {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("auto", Self::Auto), ("gpu", Self::Gpu), ("cpu", Self::Cpu)];
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            rays_per_pixel: 49,
            max_bounces: 4,
            clamp_indirect: f32::INFINITY,
            seed: 0,
            estimator: Estimator::Direct,
            sampler: SamplerKind::Sobol,
            composite: Composite::Additive,
            combine: Combine::Robust,
            backend: BackendChoice::Auto,
            exposure: Exposure::Ev(0.0),
            backdrop: Backdrop::Photograph(None),
            multiple_scattering: true,
            upright_photo: false,
        }
    }
}

impl Settings {
    /// The largest number of rays a pixel can ask for.
    pub const MAX_RAYS_PER_PIXEL: u32 = 1 << 24;
    /// The deepest path that can be asked for.
    pub const MAX_BOUNCES: u32 = 1024;

    /// Replaces what the command line gave.
    pub fn apply(&mut self, flags: &Overrides) {
        self.rays_per_pixel = flags.rays_per_pixel.unwrap_or(self.rays_per_pixel);
        self.max_bounces = flags.max_bounces.unwrap_or(self.max_bounces);
        self.seed = flags.seed.unwrap_or(self.seed);
        self.estimator = flags.estimator.unwrap_or(self.estimator);
        self.sampler = flags.sampler.unwrap_or(self.sampler);
        self.composite = flags.composite.unwrap_or(self.composite);
        self.combine = flags.combine.unwrap_or(self.combine);
        self.backend = flags.backend.unwrap_or(self.backend);
    }
}

/// What the command line gave; flags win over the scene file. `None`: not given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overrides {
    /// 1..=[`Settings::MAX_RAYS_PER_PIXEL`].
    pub rays_per_pixel: Option<u32>,
    /// 1..=[`Settings::MAX_BOUNCES`].
    pub max_bounces: Option<u32>,
    pub seed: Option<u32>,
    pub estimator: Option<Estimator>,
    pub sampler: Option<SamplerKind>,
    pub composite: Option<Composite>,
    pub combine: Option<Combine>,
    pub backend: Option<BackendChoice>,
}

const KEYS: &[&str] = &[
    "rays_per_pixel",
    "max_bounces",
    "clamp_indirect",
    "seed",
    "estimator",
    "sampler",
    "composite",
    "combine",
    "backend",
    "multiple_scattering",
];

/// `[render]`; what stands in `[photo]` is given.
pub(super) fn read_settings(root: &Table, photo: PhotoSettings) -> Result<Settings> {
    let mut settings = Settings {
        exposure: photo.exposure,
        backdrop: photo.backdrop,
        upright_photo: photo.upright_photo,
        ..Settings::default()
    };
    if let Some(table) = root.table("render", "[render]", KEYS)? {
        if let Some(clamp) = table.optional("clamp_indirect", Node::positive_or_infinite)? {
            settings.clamp_indirect = clamp as f32;
        }
        if let Some(wanted) = table.optional("multiple_scattering", Node::boolean)? {
            settings.multiple_scattering = wanted;
        }
        settings.apply(&Overrides {
            rays_per_pixel: table.optional("rays_per_pixel", |node| {
                node.integer(1, Settings::MAX_RAYS_PER_PIXEL)
            })?,
            max_bounces: table
                .optional("max_bounces", |node| node.integer(1, Settings::MAX_BOUNCES))?,
            seed: table.optional("seed", |node| node.integer(0, u32::MAX))?,
            estimator: table.optional("estimator", |node| node.choice())?,
            sampler: table.optional("sampler", |node| node.choice())?,
            composite: table.optional("composite", |node| node.choice())?,
            combine: table.optional("combine", |node| node.choice())?,
            backend: table.optional("backend", |node| node.choice())?,
        });
    }
    Ok(settings)
}
