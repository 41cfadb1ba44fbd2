//! Motion blur by copies along the motion in the picture.

mod copies;
mod film_copies;
pub(super) mod gpu;

pub use copies::{Copies, CopyLayer, draw_copies};
pub(super) use film_copies::blur_film;
pub use film_copies::{ObjectBlur, PictureMotion};
