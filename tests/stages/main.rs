//! Camera stages against independent transcriptions and simulated cameras.

mod cartoon;
