//! Splats in Bevy's main 3D pass.

mod view;

pub use view::{view_from_camera, view_pixel};
