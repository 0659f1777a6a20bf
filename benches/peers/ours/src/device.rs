//! The graphics device without an engine.

use peer_common::Failure;
use wgpu29 as wgpu;

use crate::failed;

/// An open device.
pub(crate) struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: wgpu::AdapterInfo,
    /// Name, interface and driver.
    pub(crate) name: String,
}

/// Opens the fastest device with all it can do, as Bevy does.
pub(crate) fn open() -> Result<Device, Failure> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    }))
    .map_err(|e| Failure(format!("there is no device to draw with: {e}")))?;
    let info = adapter.get_info();
    let wanted = wgpu::Features::SUBGROUP | wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::FLOAT32_FILTERABLE;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: adapter.features() & wanted,
        required_limits: adapter.limits(),
        ..Default::default()
    }))
    .map_err(failed)?;
    let name = format!("{} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info);
    Ok(Device { device, queue, info, name })
}
