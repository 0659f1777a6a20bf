//! Which Gaussian is under a pointer.
