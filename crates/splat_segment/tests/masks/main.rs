//! From masks to Gaussians, on a small generated room and a slow rasteriser.

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
