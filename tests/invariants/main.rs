//! The invariants of the design: what every picture must keep, whatever the scene and the backend. Each check is a function of the backend
//! and each has a control that shows it can fail.

mod estimators;
mod photograph;
mod repeatability;
mod support;
