//! Picking, selecting and tools in an app without window and device, on the generated room.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its world should stop there")]

mod bent;
mod harness;
mod picking;
mod select;
mod tools;
