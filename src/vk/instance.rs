//! The loader and the instance, with the validation layer where it is asked for.

use std::ffi::{CStr, c_char, c_void};
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

use ash::{ext, vk};

use super::adapter::Adapter;
use super::failed;
use crate::error::{Error, Result};

/// The layer that checks every call, and the package that holds it.
pub const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// What the validation layer said.
pub(super) type Messages = Mutex<Vec<String>>;

/// A Vulkan instance; devices made from it keep it alive.
#[derive(Clone)]
pub struct Instance {
    pub(super) shared: Arc<Shared>,
}

pub(super) struct Shared {
    pub(super) raw: ash::Instance,
    /// Keeps the loader's library open as long as the instance.
    entry: ash::Entry,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// Boxed: the messenger holds its address.
    messages: Box<Messages>,
    pub(super) names_objects: bool,
}

impl Instance {
    /// Loads Vulkan and makes an instance. With `validate`, the validation layer watches every call
    /// (with synchronization validation), and its absence is an error.
    pub fn new(validate: bool) -> Result<Self> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers, which we trust as every
        // Vulkan program does.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| {
            Error::device(format!(
                "The Vulkan loader could not be opened ({error}): install it (Debian: apt install libvulkan1 \
                 mesa-vulkan-drivers)."
            ))
        })?;
        let layers = if validate { vec![validation_layer(&entry)?.as_ptr()] } else { vec![] };
        let extensions = extensions(&entry)?;
        let names_objects = validate && extensions.contains(&ext::debug_utils::NAME);
        let mut wanted: Vec<*const c_char> = Vec::new();
        let portability = extensions.contains(&ash::khr::portability_enumeration::NAME);
        if portability {
            wanted.push(ash::khr::portability_enumeration::NAME.as_ptr());
        }
        if names_objects {
            wanted.push(ext::debug_utils::NAME.as_ptr());
        }
        let application =
            vk::ApplicationInfo::default().application_name(c"cousu").api_version(vk::API_VERSION_1_2);
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let messages: Box<Messages> = Box::default();
        let mut messenger_info = messenger_info(&messages);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&wanted);
        if portability {
            info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
        }
        if validate {
            info = info.push_next(&mut features);
        }
        if names_objects {
            info = info.push_next(&mut messenger_info);
        }
        // SAFETY: everything that `info` points to lives until the call returns.
        let raw = unsafe { entry.create_instance(&info, None) }
            .map_err(|result| failed("Making a Vulkan instance", result))?;
        let messenger = if names_objects { Some(start_messenger(&entry, &raw, &messages)?) } else { None };
        Ok(Self { shared: Arc::new(Shared { raw, entry, messenger, messages, names_objects }) })
    }

    /// Whether the validation layer is installed.
    pub fn validation_available() -> bool {
        // SAFETY: as in `new`.
        unsafe { ash::Entry::load() }.is_ok_and(|entry| validation_layer(&entry).is_ok())
    }

    /// Every device that a driver shows, best first: discrete, integrated, virtual, CPU.
    pub fn adapters(&self) -> Result<Vec<Adapter>> {
        // SAFETY: the instance is alive.
        let raw = unsafe { self.shared.raw.enumerate_physical_devices() }
            .map_err(|result| failed("Listing the Vulkan devices", result))?;
        let mut adapters: Vec<Adapter> = raw
            .into_iter()
            .map(|device| Adapter::probe(&self.shared.entry, &self.shared.raw, device))
            .collect();
        adapters.sort_by_key(|adapter| adapter.kind);
        Ok(adapters)
    }

    /// What the validation layer has said so far.
    pub fn messages(&self) -> Vec<String> {
        self.shared.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: devices hold an `Arc` of this, so nothing made from the instance is left.
        unsafe {
            if let Some((functions, messenger)) = &self.messenger {
                functions.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

fn validation_layer(entry: &ash::Entry) -> Result<&'static CStr> {
    // SAFETY: a query without preconditions.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(|result| failed("Listing the Vulkan layers", result))?;
    if layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
        return Ok(VALIDATION_LAYER);
    }
    Err(Error::device(
        "--validate needs the Vulkan validation layer, which is not installed: install it (Debian: apt install \
         vulkan-validationlayers) or leave the flag out.",
    ))
}

fn extensions(entry: &ash::Entry) -> Result<Vec<&'static CStr>> {
    // SAFETY: a query without preconditions.
    let found = unsafe { entry.enumerate_instance_extension_properties(None) }
        .map_err(|result| failed("Listing the Vulkan extensions", result))?;
    let known = [ext::debug_utils::NAME, ash::khr::portability_enumeration::NAME];
    Ok(known
        .into_iter()
        .filter(|name| found.iter().any(|extension| extension.extension_name_as_c_str() == Ok(*name)))
        .collect())
}

fn messenger_info(messages: &Messages) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(on_message))
        .user_data(std::ptr::from_ref(messages) as *mut c_void)
}

fn start_messenger(
    entry: &ash::Entry,
    raw: &ash::Instance,
    messages: &Messages,
) -> Result<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)> {
    let functions = ext::debug_utils::Instance::new(entry, raw);
    // SAFETY: the instance has the extension, and `messages` outlives the messenger (`Shared::drop`).
    let messenger = unsafe { functions.create_debug_utils_messenger(&messenger_info(messages), None) }
        .map_err(|result| failed("Listening to the validation layer", result))?;
    Ok((functions, messenger))
}

unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `messages` is what `messenger_info` gave, alive as long as the messenger; `data` and the
    // strings in it are valid during the call.
    unsafe {
        let messages = &*(messages as *const Messages);
        if let Some(text) = data.as_ref().and_then(|data| data.message_as_c_str()) {
            let text = text.to_string_lossy().into_owned();
            // A panic must not leave this function, so no eprintln.
            let _ = writeln!(std::io::stderr(), "validation: {text}");
            messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
        }
    }
    vk::FALSE
}
