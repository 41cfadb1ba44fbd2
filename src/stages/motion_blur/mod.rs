//! Motion blur by copies along the motion in the picture.

mod copies;
mod gpu;
mod motion;
mod see_through;
pub(super) mod settings;
mod stage;
#[cfg(test)]
mod tests;

pub use copies::{Copies, CopyLayer, draw_copies};
pub use motion::{ObjectBlur, PictureMotion};
pub use see_through::{draw_see_through, shape};
pub use settings::{MotionBlurMethod, MotionBlurSettings};
pub(super) use stage::STAGE;
