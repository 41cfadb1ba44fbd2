//! Camera stages against independent transcriptions and simulated cameras, in the library and from the command line.

mod antialias;
mod cartoon;
mod commands;
mod flicker;
mod noise;
mod render;
mod support;
