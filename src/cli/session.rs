//! Opening the device that a command works on.

use clap::Args;

use super::progress::BuildMeter;
use crate::cache;
use crate::error::Result;
use crate::render::builder::choose_builder;
use crate::render::choices::{Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::scene::Scene;
use crate::vk::{Adapter, Device, DeviceKind, Instance};

/// Which device, and how closely it is watched.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Device")]
pub struct DeviceArguments {
    /// Device by its number in `cousu devices`, or by a part of its name [default: the best]
    #[arg(long, value_name = "N|NAME")]
    pub device: Option<String>,
    /// Let the Vulkan validation layer watch every call, synchronization included
    #[arg(long)]
    pub validate: bool,
}

/// Compiled kernels, among what is kept from run to run.
pub const PIPELINES: &str = "pipelines";

/// The adapter that the arguments name.
pub fn adapter(arguments: &DeviceArguments) -> Result<(Instance, Adapter)> {
    let instance = Instance::new(arguments.validate)?;
    let adapters = instance.adapters()?;
    let adapter = Adapter::choose(&adapters, arguments.device.as_deref())?.clone();
    Ok((instance, adapter))
}

/// Opens it; a device that is a CPU is announced.
pub fn open(arguments: &DeviceArguments) -> Result<Device> {
    let device = open_silently(arguments)?;
    announce(&device);
    Ok(device)
}

/// Says so if the device is a CPU.
pub fn announce(device: &Device) {
    let adapter = device.adapter();
    if adapter.kind == DeviceKind::Cpu {
        super::tell(&format!(
            "!!! {} is a CPU: no GPU was found or chosen, and everything takes some hundred times longer.",
            adapter.name
        ));
    }
}

/// Opens it without a word, as beside the loading of a scene.
pub fn open_silently(arguments: &DeviceArguments) -> Result<Device> {
    let (instance, adapter) = adapter(arguments)?;
    Device::open_with_cache(&instance, &adapter, cache::folder(PIPELINES).as_deref())
}

/// The scene as the device gets it, with the tree that the choices ask for.
pub fn geometry(scene: &Scene, wishes: &Wishes) -> Result<Geometry> {
    let meter = BuildMeter::new();
    let conditioned = !wishes.preset.is_some_and(Preset::is_original);
    let builder = choose_builder(wishes);
    let geometry = Geometry::build(scene, conditioned, builder, &|done| meter.observe(done))?;
    meter.finish();
    Ok(geometry)
}
