//! Which planes a picture is written with.

use crate::scene::Composite;

/// A layer of an EXR file; the composite has no name there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExrLayer {
    Composite,
    Virtual,
    Change,
    Ratio,
    Sharpness,
    Noise,
    Mixed,
    Real,
    Difference,
    Albedo,
    Variance,
    Normal,
    Mask,
    Depth,
    Samples,
    Motion,
    Cryptomatte,
}

impl ExrLayer {
    pub const NAMES: [(&str, Self); 17] = [
        ("composite", Self::Composite),
        ("virtual", Self::Virtual),
        ("change", Self::Change),
        ("ratio", Self::Ratio),
        ("sharpness", Self::Sharpness),
        ("noise", Self::Noise),
        ("difference", Self::Difference),
        ("mask", Self::Mask),
        ("depth", Self::Depth),
        ("normal", Self::Normal),
        ("albedo", Self::Albedo),
        ("variance", Self::Variance),
        ("samples", Self::Samples),
        ("real", Self::Real),
        ("mixed", Self::Mixed),
        ("motion", Self::Motion),
        ("cryptomatte", Self::Cryptomatte),
    ];

    /// What a compositor needs, without light that the composite does not take: depth and normal cost each ray its first hit.
    const USUAL: [Self; 12] = [
        Self::Composite,
        Self::Difference,
        Self::Virtual,
        Self::Change,
        Self::Ratio,
        Self::Sharpness,
        Self::Noise,
        Self::Mask,
        Self::Depth,
        Self::Normal,
        Self::Variance,
        Self::Samples,
    ];
}

impl std::str::FromStr for ExrLayer {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let names = Self::NAMES;
        match names.iter().find(|(own, _)| *own == name) {
            Some((_, layer)) => Ok(*layer),
            None => Err(format!("expected {}", names.map(|(own, _)| own).join(", "))),
        }
    }
}

/// The layers of an EXR file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExrLayers(Vec<ExrLayer>);

impl ExrLayers {
    /// Those asked for; of none, those that are usual: with the real light where the composite takes it everywhere.
    pub fn new(asked: &[ExrLayer], composite: Composite) -> Self {
        if !asked.is_empty() {
            return Self(asked.to_vec());
        }
        let real = (composite == Composite::Quotient).then_some(ExrLayer::Real);
        Self(ExrLayer::USUAL.into_iter().chain(real).collect())
    }

    /// Real rays are traced where nothing virtual needs them.
    pub fn need_real_everywhere(&self) -> bool {
        self.has(ExrLayer::Real) || self.has(ExrLayer::Mixed)
    }

    /// The first hits of all rays are wanted.
    pub fn need_guides(&self) -> bool {
        [ExrLayer::Depth, ExrLayer::Normal, ExrLayer::Albedo]
            .iter()
            .any(|layer| self.has(*layer))
    }

    /// The composite is taken apart.
    pub(super) fn need_parts(&self) -> bool {
        [ExrLayer::Virtual, ExrLayer::Change, ExrLayer::Ratio]
            .iter()
            .any(|layer| self.has(*layer))
    }

    /// What single stages add is kept.
    pub fn need_stages(&self) -> bool {
        self.has(ExrLayer::Sharpness) || self.has(ExrLayer::Noise)
    }

    /// Frames before and after are wanted.
    pub fn need_motion(&self) -> bool {
        self.has(ExrLayer::Motion)
    }

    /// Objects are told apart.
    pub fn need_mattes(&self) -> bool {
        self.has(ExrLayer::Cryptomatte)
    }

    pub(super) fn has(&self, layer: ExrLayer) -> bool {
        self.0.contains(&layer)
    }
}
