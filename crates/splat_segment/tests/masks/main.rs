//! From masks to Gaussians, on a small generated room and a slow rasteriser.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests, outside the functions marked as such")]

mod aggregations;
mod boundary;
mod diagnosis;
mod hostile;
mod presegment;
mod project;
mod reference;
mod room;
mod segmentation;
mod trackers;
mod views;
mod votes;
