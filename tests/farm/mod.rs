//! Jobs for farms: what they are made of, tasks that may be repeated, results equal to one run.

mod bundles;
mod frames;
mod jobs;
mod rays;
