//! Motion blur by copies along the motion in the picture.

mod copies;
mod gpu;
pub(super) mod settings;
mod stage;
#[cfg(test)]
mod tests;

pub use copies::{Copies, CopyLayer, draw_copies};
pub use settings::{MotionBlurMethod, MotionBlurSettings};
pub(super) use stage::STAGE;
pub use stage::{ObjectBlur, PictureMotion};
