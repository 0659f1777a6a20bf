//! From a few clicks to a thing, by the capture's own structure.

pub mod boxes;
pub mod clicks;
pub mod cut;
pub mod edges;
pub mod evidence;
pub mod features;
pub mod hypotheses;
pub mod look;
pub mod masks;
pub mod patches;
pub mod prepared;
pub mod store;
pub mod superpoints;
pub mod tree;
