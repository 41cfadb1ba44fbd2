//! The photons that a backend is to trace in one go.

/// Photons by their number, which alone decides with the seed where they go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonWork {
    pub first: u64,
    pub end: u64,
    /// When they fly: beginning and length, as shares of the time from the opening of the first row to the closing of the last.
    pub window: [f32; 2],
}
