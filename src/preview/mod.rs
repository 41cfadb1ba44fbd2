//! A window to compose a shot in: edits show at once, coarse first, and are saved into the scene file.
//!
//! [`session::Session`] holds the scene, its edits and their history and knows no window; [`window`] draws it; [`script`] drives both
//! without a display. Rendering runs on threads of its own ([`render_threads`]), which nothing waits for.

pub mod composition;
pub mod document;
pub mod frames;
pub mod geometry;
pub mod gizmo;
pub mod headless;
pub mod history;
pub mod keyframes;
pub mod manipulate;
pub mod material_form;
pub mod placement_number;
pub mod quantity;
pub mod render_threads;
pub mod script;
pub mod session;
pub mod still;
pub mod view;
pub mod watch;
pub mod window;
