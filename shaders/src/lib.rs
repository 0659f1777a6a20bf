//! WGSL of the splat rasteriser.
