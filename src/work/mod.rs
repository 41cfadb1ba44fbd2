//! What goes between the renderer and its backends: the work asked for, the rays that it took, and who watches. A backend is given a
//! [`WorkList`] and fills it into the film, whatever it was made for.

pub(crate) mod list;
mod photons;
mod places;
pub(crate) mod rays;
mod watcher;

pub use list::{Pass, PixelWork, WorkList};
pub use photons::PhotonWork;
pub use places::{Begun, Place, Places, Spent};
pub use rays::{RayCounts, SampleRays};
pub use watcher::{Meter, Phase, Progress, Watcher};
