//! A sample in flight, and its place in a sharing tile.

use super::state::PathState;

/// A sample in flight.
pub struct InFlight {
    /// Among the pixel's samples: not [`super::state::Path::index`] where the pixel's differences take turns.
    pub index: u32,
    pub state: PathState,
}

/// A sample that takes part in its tile.
#[derive(Clone, Copy)]
pub struct Member {
    /// Its place among the samples of its number.
    pub slot: usize,
    /// Its pixel's number in the tile.
    pub number: u32,
}
