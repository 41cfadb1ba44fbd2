//! Caustics from the lamps' side: photons go from the lights through smooth virtual objects, and where they land the camera sees them
//! (docs/estimator.md). They bring exactly the paths that the eye's samples leave to them ([`super::contribution::left_to_photons`]).

pub mod emission;
pub mod guide;
pub mod path;
pub mod plan;
pub mod render;
