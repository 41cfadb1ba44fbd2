//! The invariants of the design: what every picture must keep, whatever the scene. Each check is a function of the backend, runs on the
//! CPU, and has a control that shows it can fail.

mod backdrop;
mod emitters;
mod estimators;
mod extremes;
mod first_lights;
mod form_factor;
mod furnace;
mod lens;
mod panes;
mod perfect_proxy;
mod photograph;
mod photons;
mod repeatability;
mod savings;
mod stated_error;
mod support;
