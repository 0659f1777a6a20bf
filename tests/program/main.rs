//! The program from outside: what a user types, what comes back, what lies on the disk afterwards.

#![expect(clippy::unwrap_used, reason = "a test ends where something is missing")]

mod cameras_and_moves;
mod check;
mod common;
mod eval;
mod messages;
mod orient_and_scale;
mod pictures;
mod select;
mod simulate;
