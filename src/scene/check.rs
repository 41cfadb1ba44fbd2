//! Warnings about scenes that load and still cannot be meant, and `[check] allow`, which silences them.

use super::error::Result;
use super::reader::{Choice, Table};

/// One kind of warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Check {
    /// The camera is inside of an object, or of a virtual object's box.
    CameraInside,
    /// Nothing shines.
    NoLight,
    /// A quad light has nothing before it.
    LightFacesAway,
    /// No part of a virtual object is in the picture.
    OutOfFrame,
    /// A virtual object hangs above what is under it.
    Floating,
    /// A virtual object is sunk into what it stands on.
    Sunken,
    /// A virtual object is far too large or small for where it stands.
    Size,
    /// The proxy does not reach under a virtual object.
    Uncovered,
    /// The focal length of `[lens]` does not go with the field of view.
    FocalLength,
    /// The light is too strong or too weak for the photograph by a stop or more.
    Exposure,
}

impl Choice for Check {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("camera-inside", Self::CameraInside),
        ("no-light", Self::NoLight),
        ("light-faces-away", Self::LightFacesAway),
        ("out-of-frame", Self::OutOfFrame),
        ("floating", Self::Floating),
        ("sunken", Self::Sunken),
        ("size", Self::Size),
        ("uncovered", Self::Uncovered),
        ("focal-length", Self::FocalLength),
        ("exposure", Self::Exposure),
    ];
}

/// `[check] allow`: the warnings that are not wanted.
pub(super) fn read_allowed(root: &Table) -> Result<Vec<Check>> {
    let Some(table) = root.table("check", "[check]", &["allow"])? else {
        return Ok(Vec::new());
    };
    let names = table.list("allow")?;
    names.iter().map(|node| node.choice()).collect()
}
