//! Draw, pick, select and take apart 3D Gaussian splat captures in Bevy.
