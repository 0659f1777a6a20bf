//! Files in memory, an app without a device.

mod files;
mod reload;
mod scenes;
