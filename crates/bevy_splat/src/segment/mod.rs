//! From a click to an object, in the background.
