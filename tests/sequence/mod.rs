//! Moving cameras and objects: motion blur against its analytic profiles, sequences of frames in and out.

mod animation;
mod blur;
mod copies;
mod damages;
mod errors;
mod flicker;
mod frames;
mod outputs;
mod ranges;
mod resume;
pub mod support;
mod vectors;
