//! `cousu devices`.

use comfy_table::{Table, presets};

use crate::error::{Error, Result};
use crate::vk::{Adapter, Instance};

pub fn run() -> Result<()> {
    let adapters = Instance::new(false)?.adapters()?;
    if adapters.is_empty() {
        return Err(Error::device("No Vulkan device was found: `cousu doctor` tells what to install."));
    }
    super::print(&table(&adapters))
}

/// The devices, best first, numbered as `--device` takes them.
pub fn table(adapters: &[Adapter]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["", "name", "kind", "Vulkan", "subgroup", "memory", "timestamps", "driver"]);
    for (number, adapter) in adapters.iter().enumerate() {
        let (major, minor, patch) = adapter.api_version;
        table.add_row([
            number.to_string(),
            adapter.name.clone(),
            adapter.kind.name().to_string(),
            format!("{major}.{minor}.{patch}"),
            format!("{}: {}", adapter.subgroup.size, adapter.subgroup.operations().join(" ")),
            format!("{:.1} GB", adapter.memory_bytes as f64 / 1e9),
            adapter
                .timestamps
                .map_or("none".to_string(), |(period, bits)| format!("{bits} bits of {period} ns")),
            adapter.unusable.clone().unwrap_or_else(|| adapter.driver.clone()),
        ]);
    }
    table.trim_fmt()
}
