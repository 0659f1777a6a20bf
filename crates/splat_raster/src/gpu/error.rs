//! [`GpuError`]: why the GPU back end cannot work.

/// Why a GPU cannot be used, or a frame not be drawn with it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No device was found.
    #[error("no GPU was found ({reason}); install a Vulkan, Metal or DirectX 12 driver, or draw with the CPU")]
    NoAdapter {
        /// What the system says.
        reason: String,
    },
    /// The device does not open.
    #[error("the GPU `{adapter}` cannot be opened: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
    /// The device has less of something than the stages need.
    #[error(
        "the GPU's `{what}` is {found}, at least {needed} is needed; open the device with its adapter's own limits"
    )]
    Limit {
        /// Name of the limit.
        what: &'static str,
        /// What the device was opened with.
        found: u64,
        /// What is needed.
        needed: u64,
    },
    /// A shader was not accepted.
    #[error("the GPU's driver does not take the shader `{stage}`: {reason}")]
    Shader {
        /// The stage.
        stage: &'static str,
        /// What the driver says.
        reason: String,
    },
    /// There is no memory for a buffer.
    #[error("the GPU has no room for {bytes} bytes of {what}")]
    OutOfMemory {
        /// What it was for.
        what: &'static str,
        /// How much.
        bytes: u64,
    },
    /// The device went away.
    #[error("the GPU stopped working: {reason}")]
    Lost {
        /// What the driver says.
        reason: String,
    },
}
