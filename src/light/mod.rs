//! Light: emitters, the environment, and the cones in which virtual geometry is seen.

pub mod backdrop;
pub mod blocking;
pub mod cones;
pub mod environment;
pub mod environment_table;
pub mod guide;
pub mod lights;
pub(crate) mod rectangle;
#[cfg(test)]
mod tests;
