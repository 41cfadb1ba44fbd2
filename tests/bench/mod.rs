//! `mixray bench`, `mixray render --range` and `mixray merge` through the built program.

mod ablation;
mod gpu_code;
mod growth;
mod merge;
mod rows;
mod subcommands;
mod support;
