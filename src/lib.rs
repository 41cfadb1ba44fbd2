//! mixray renders virtual objects into photographs and video so that they look as if the same camera had taken them.
//!
//! Data flows one way:
//!
//! ```text
//! scene.toml, photo, glTF ──> scene::Scene         validated, world space, f64
//!                              │
//!                              ├─> accel::WorldBvh  one over the real, one over the virtual triangles
//!                              └─> packed::PackedScene   flat records relative to an anchor, f32; what both backends read
//!                                    │
//!                     cpu / gpu      │   one estimator, written twice, same random numbers
//!                                    v
//!                              film::Film           per-pixel sums: mask, M*Im, difference, real radiance
//!                                    │
//!                                    v
//!                              film::composite ──> stages: antialiasing, noise, or cartoon ──> output: PNG, EXR
//! ```
//!
//! [`Renderer`] drives all of it: built once from a scene, advanced by a budget, asked for its film at any moment.
//! A backend knows no file format, and nothing below `cli` prints.
//!
//! What is meant for users of the library is named below; the modules are public for the program, the tests and the benchmarks alone,
//! and may change. Features, on by default: `cli`, the program; `bench`, its `mixray bench`; `track`, its `mixray track`; `start`, its `mixray new`. Without them the library is
//! lean. Off by default: `preview`, the window of `mixray preview`.
//!
//! ```no_run
//! use mixray::{Budget, PngBits, Renderer, RendererOptions, Target, Watcher, load, write_png};
//!
//! let scene = load("scene.toml".as_ref())?;
//! let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())?;
//! renderer.advance(Budget::Complete, &Watcher::none())?;
//! let photo = renderer.scene().photo.as_ref();
//! let target = Target::picture("picture.png".as_ref())?;
//! write_png(&target, &renderer.picture(), photo, PngBits::for_photo(photo))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[doc(hidden)]
pub mod accel;
#[cfg(feature = "bench")]
#[doc(hidden)]
pub mod bench;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod blender;
#[doc(hidden)]
pub mod camera;
#[doc(hidden)]
pub mod check;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
mod clock;
#[doc(hidden)]
pub mod cpu;
mod decode;
#[doc(hidden)]
pub mod distortion;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod farm;
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod film;
#[doc(hidden)]
pub mod gpu;
#[cfg(feature = "track")]
mod least_squares;
#[doc(hidden)]
pub mod light;
#[cfg(feature = "start")]
#[doc(hidden)]
pub mod light_fit;
#[cfg(feature = "track")]
#[doc(hidden)]
pub mod live;
#[doc(hidden)]
pub mod material;
#[doc(hidden)]
pub mod math;
#[doc(hidden)]
pub mod memory;
#[doc(hidden)]
pub mod output;
#[doc(hidden)]
pub mod pack;
#[doc(hidden)]
pub mod packed;
#[cfg(feature = "preview")]
#[doc(hidden)]
pub mod preview;
mod refusal;
#[doc(hidden)]
pub mod renderer;
#[doc(hidden)]
pub mod scene;
#[doc(hidden)]
pub mod sequence;
#[doc(hidden)]
pub mod shared;
#[doc(hidden)]
pub mod stages;
#[cfg(feature = "start")]
#[doc(hidden)]
pub mod start;
#[cfg(feature = "track")]
#[doc(hidden)]
pub mod tracking;
#[doc(hidden)]
pub mod video;
#[doc(hidden)]
pub mod work;

#[doc(inline)]
pub use film::{Film, MergeError, Picture, Planes, composite};
#[doc(inline)]
pub use gpu::GpuError;
#[doc(inline)]
pub use output::{
    ExrPicture, Format, Metadata, OutputError, PngBits, Target, write_exr, write_png,
};
#[doc(inline)]
pub use refusal::Refusal;
#[doc(inline)]
pub use renderer::{
    Budget, CameraNoise, ErrorGoal, FrameEdit, RenderError, Renderer, RendererOptions, Skip, Stats,
    Without,
};
#[doc(inline)]
pub use scene::{
    BackendChoice, Camera, Composite, Estimator, Given, Lens, Photo, SamplerKind, Scene,
    SceneError, Settings, load, load_with,
};
#[doc(inline)]
pub use sequence::{RenderedSequence, SequenceError, SequenceOptions, render_sequence};
#[doc(inline)]
pub use stages::{Finished, GpuStages, finish};
#[doc(inline)]
pub use work::{Phase, Progress, Watcher};
