//! The render plugin against the rasteriser: headless apps, small pictures, every way a camera can be set up.
//!
//! Where there is no Vulkan device each test prints `skipped: no Vulkan device` and passes. `SPLAT_PICTURES=<folder>`
//! writes the pictures as PNG.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking and says what it skips")]

mod harness;

mod bent;
mod cameras;
mod memory;
mod meshes;
mod plain;
mod settings;
