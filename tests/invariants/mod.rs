//! The invariants of the design: what every picture must keep, whatever the scene and the backend. Each check is a function of the backend
//! and each has a control that shows it can fail.

mod emitters;
mod estimators;
mod extremes;
mod form_factor;
mod furnace;
mod lens;
mod perfect_proxy;
mod photograph;
mod repeatability;
mod savings;
mod stated_error;
mod support;
