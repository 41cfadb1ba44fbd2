//! Camera poses from markers and chessboards: known cameras, real videos, and what must be refused.

mod commands;
pub mod film;
mod photographs;
mod scale;
mod videos;
