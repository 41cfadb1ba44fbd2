//! What tells square markers apart: a family's cells, or patterns of the user's own.

use std::sync::Arc;

use super::family::Family;
use super::patterns::Patterns;

/// What tells square markers apart.
#[derive(Clone, Debug)]
pub enum Code {
    Family(&'static Family),
    Patterns(Arc<Patterns>),
}

impl Code {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Family(family) => family.name,
            Self::Patterns(_) => "patterns",
        }
    }

    /// Its markers' borders are white in a ring of black.
    pub fn is_ringed(&self) -> bool {
        matches!(self, Self::Family(family) if family.is_ringed)
    }

    /// Markers that there are; their ids count from 0.
    pub fn count(&self) -> usize {
        match self {
            Self::Family(family) => family.codes.len(),
            Self::Patterns(patterns) => patterns.list().len(),
        }
    }
}

/// No two sets of patterns meet in one run.
impl PartialEq for Code {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}
