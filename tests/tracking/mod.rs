//! Camera poses from markers and chessboards: known cameras, real videos, and what must be refused.

mod commands;
mod film;
mod photographs;
mod videos;
