//! Camera stages: what a camera does to a picture after the composite, or what replaces it.
//!
//! Order: composite, boundary antialiasing, motion blur by copies, noise, response and quantisation; or composite, cartoon. A stage knows no ray: it
//! works on the film of a render and on images of other programs alike.

pub mod antialias;
pub mod calibration;
pub mod cartoon;
pub mod copies;
pub mod curve;
mod encoded;
mod film_copies;
mod finish;
pub mod noise;
mod own_variance;

pub use encoded::EncodedImage;
pub use film_copies::{ObjectBlur, PictureMotion};
pub use finish::{Finished, StageSeconds, finish};
