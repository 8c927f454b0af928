//! `cousu doctor`: loader, drivers, devices, layers; what is missing and the package that mends it.

use std::path::Path;

use super::{devices, session};
use crate::cache;
use crate::error::{Error, Result};
use crate::gl::{Context, Preference};
use crate::vk::{Adapter, DeviceKind, Instance};

/// Where the loader looks for drivers' manifests by default.
const ICD_FOLDERS: &[&str] =
    &["/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/share/vulkan/icd.d"];
/// Variables that name other drivers.
const ICD_VARIABLES: &[&str] = &["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES"];

pub fn run() -> Result<()> {
    let mut text = String::new();
    let mut remedies = Vec::new();
    let instance = match Instance::new(false) {
        Ok(instance) => {
            text += "loader      found\n";
            Some(instance)
        }
        Err(error) => {
            text += &format!("loader      missing: {error}\n");
            remedies.push("Vulkan loader: apt install libvulkan1");
            None
        }
    };
    text += &drivers();
    let adapters = match &instance {
        Some(instance) => instance.adapters()?,
        None => Vec::new(),
    };
    text += &describe(&adapters);
    if instance.is_some() && adapters.is_empty() {
        remedies
            .push("a driver: apt install mesa-vulkan-drivers (it also runs on the CPU), or your GPU's own");
    }
    match Context::open(Preference::Hardware) {
        Ok(context) => {
            text += &format!("OpenGL      {} ({}, {})\n", context.renderer, context.version, context.platform)
        }
        Err(_) => {
            text += "OpenGL      no context without a window (only `compare` needs it)\n";
            remedies
                .push("OpenGL for `compare`: apt install libegl1 libgl1-mesa-dri, or your GPU's own driver");
        }
    }
    if Instance::validation_available() {
        text += "validation  layer found (--validate)\n";
    } else {
        text += "validation  layer missing (only --validate and the tests need it)\n";
        remedies.push("validation layer: apt install vulkan-validationlayers");
    }
    text += &cached();
    if remedies.is_empty() {
        text += "\nNothing is missing.";
    } else {
        text += &format!("\nTo mend (Debian's package names):\n  {}", remedies.join("\n  "));
    }
    super::print(&text)?;
    if adapters.iter().any(|adapter| adapter.unusable.is_none()) {
        Ok(())
    } else {
        Err(Error::device("There is no usable Vulkan device: see above for what to install."))
    }
}

/// The drivers' manifests that the loader finds, and variables that change where it looks.
fn drivers() -> String {
    let mut text = String::new();
    for name in ICD_VARIABLES {
        if let Some(value) = std::env::var_os(name) {
            text += &format!("driver      {name}={}\n", value.to_string_lossy());
        }
    }
    for folder in ICD_FOLDERS {
        let mut files: Vec<_> = std::fs::read_dir(Path::new(folder))
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|ending| ending == "json"))
            .collect();
        files.sort();
        for file in files {
            text += &format!("driver      {}\n", file.display());
        }
    }
    if text.is_empty() { format!("driver      none in {}\n", ICD_FOLDERS.join(", ")) } else { text }
}

/// What is kept of compiled kernels from run to run.
fn cached() -> String {
    let Some(folder) = cache::folder(session::PIPELINES) else {
        return format!("cache       off ({}, or no HOME)\n", cache::VARIABLE);
    };
    let files =
        std::fs::read_dir(&folder).into_iter().flatten().filter_map(|file| file.ok()?.metadata().ok());
    let (count, bytes) = files.fold((0, 0), |(count, bytes), file| (count + 1, bytes + file.len()));
    format!(
        "cache       {}: {count} files of compiled kernels, {:.1} MB\n",
        folder.display(),
        bytes as f64 / 1e6
    )
}

/// The devices and what each lacks.
fn describe(adapters: &[Adapter]) -> String {
    if adapters.is_empty() {
        return "devices     none\n".into();
    }
    let mut text = format!("\n{}\n\n", devices::table(adapters));
    for (number, adapter) in adapters.iter().enumerate() {
        match &adapter.unusable {
            Some(reason) => text += &format!("device {number}    can't be used: {reason}\n"),
            None => text += &format!("device {number}    usable\n"),
        }
        let lacking: Vec<&str> =
            adapter.features.iter().filter(|(_, there)| !there).map(|(name, _)| *name).collect();
        if !lacking.is_empty() {
            text += &format!("            lacks {} (optional)\n", lacking.join(", "));
        }
        if adapter.timestamps.is_none() {
            text += "            lacks timestamps: times are the host's\n";
        }
        if let Some(limit) = adapter.limits.loop_iterations {
            text += &format!(
                "            leaves loops silently after {limit} iterations: work is cut so that none is lost\n"
            );
        }
        if adapter.kind == DeviceKind::Cpu {
            text +=
                "            is a CPU: for a GPU install its vendor's driver (Mesa's: mesa-vulkan-drivers)\n";
        }
    }
    text
}
