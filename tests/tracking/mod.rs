//! Camera poses from markers and chessboards: known cameras, real videos, and what must be refused.

mod charuco;
mod commands;
pub mod film;
mod patterns;
mod photographs;
mod ringed;
mod rolling;
mod scale;
mod videos;
