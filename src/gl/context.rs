//! An OpenGL context without a window, through EGL.

use std::ffi::c_void;
use std::rc::Rc;

use glow::HasContext;
use khronos_egl as egl;

use crate::error::{Error, Result};

type Egl = egl::DynamicInstance<egl::EGL1_5>;

/// EGL_MESA_platform_surfaceless.
const PLATFORM_SURFACELESS: egl::Enum = 0x31DD;
/// EGL_EXT_platform_device.
const PLATFORM_DEVICE: egl::Enum = 0x313F;
/// Devices to ask for at most.
const MOST_DEVICES: usize = 16;

/// What the context should run on, so that two APIs can be compared on one device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preference {
    Software,
    Hardware,
}

/// A current OpenGL 4.3 context. It belongs to the thread that opened it.
pub struct Context {
    pub(super) shared: Rc<Shared>,
    /// What the driver calls the device.
    pub renderer: String,
    pub version: String,
    /// How EGL gave the context: surfaceless, device or pbuffer.
    pub platform: &'static str,
}

pub(super) struct Shared {
    pub(super) gl: glow::Context,
    egl: Egl,
    display: egl::Display,
    context: egl::Context,
    surface: Option<egl::Surface>,
}

/// A display to try, with its platform's name.
type Candidate = (&'static str, egl::Display);

impl Context {
    /// Opens a context: surfaceless, then each EGL device, then the default display with a small pbuffer;
    /// the first that runs on what is preferred, else the first there is.
    pub fn open(preference: Preference) -> Result<Self> {
        let mut second_best: Option<&'static str> = None;
        let mut faults = Vec::new();
        for (number, platform) in candidates(&load()?).into_iter().map(|(name, _)| name).enumerate() {
            match Self::open_candidate(number) {
                Ok(context) if context.is_software() == (preference == Preference::Software) => {
                    return Ok(context);
                }
                Ok(_) => second_best = second_best.or(Some(platform)),
                Err(fault) => faults.push(format!("{platform}: {fault}")),
            }
        }
        if second_best.is_some() {
            let any = (0..MOST_DEVICES).find_map(|number| Self::open_candidate(number).ok());
            if let Some(context) = any {
                return Ok(context);
            }
        }
        Err(Error::device(format!(
            "No headless OpenGL 4.3 context could be opened ({}): install a driver (Debian: apt install libegl1 \
             libgl1-mesa-dri).",
            if faults.is_empty() { "EGL shows no display".into() } else { faults.join("; ") }
        )))
    }

    /// Whether the context runs on the CPU.
    pub fn is_software(&self) -> bool {
        let renderer = self.renderer.to_lowercase();
        ["llvmpipe", "softpipe", "swrast", "software"].iter().any(|name| renderer.contains(name))
    }

    /// Opens the display of this number among the candidates.
    fn open_candidate(number: usize) -> std::result::Result<Self, String> {
        let egl = load().map_err(|error| error.to_string())?;
        let (platform, display) = *candidates(&egl).get(number).ok_or("no such display")?;
        let said = |error: egl::Error| error.to_string();
        egl.initialize(display).map_err(said)?;
        egl.bind_api(egl::OPENGL_API).map_err(said)?;
        let with_surface = platform == "pbuffer";
        let surface_kind = if with_surface { egl::PBUFFER_BIT } else { 0 };
        let wanted = [egl::RENDERABLE_TYPE, egl::OPENGL_BIT, egl::SURFACE_TYPE, surface_kind, egl::NONE];
        let config = egl.choose_first_config(display, &wanted).map_err(said)?.ok_or("no configuration")?;
        let attributes = [
            egl::CONTEXT_MAJOR_VERSION,
            4,
            egl::CONTEXT_MINOR_VERSION,
            3,
            egl::CONTEXT_OPENGL_PROFILE_MASK,
            egl::CONTEXT_OPENGL_CORE_PROFILE_BIT,
            egl::NONE,
        ];
        let context = egl.create_context(display, config, None, &attributes).map_err(said)?;
        let surface = if with_surface {
            let size = [egl::WIDTH, 16, egl::HEIGHT, 16, egl::NONE];
            Some(egl.create_pbuffer_surface(display, config, &size).map_err(said)?)
        } else {
            None
        };
        egl.make_current(display, surface, surface, Some(context)).map_err(said)?;
        // SAFETY: the context is current, and the pointers are those of its functions.
        let gl = unsafe {
            glow::Context::from_loader_function(|name| {
                egl.get_proc_address(name).map_or(std::ptr::null(), |function| function as *const c_void)
            })
        };
        // SAFETY: a query of the current context.
        let (renderer, version) =
            unsafe { (gl.get_parameter_string(glow::RENDERER), gl.get_parameter_string(glow::VERSION)) };
        Ok(Self {
            shared: Rc::new(Shared { gl, egl, display, context, surface }),
            renderer,
            version,
            platform,
        })
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // A context that cannot be given back is the driver's loss; there is nobody left to tell.
        let _ = self.egl.make_current(self.display, None, None, None);
        if let Some(surface) = self.surface {
            let _ = self.egl.destroy_surface(self.display, surface);
        }
        let _ = self.egl.destroy_context(self.display, self.context);
    }
}

fn load() -> Result<Egl> {
    // SAFETY: loading the system's EGL runs its initialisers, which we trust as every EGL program does.
    unsafe { Egl::load_required() }.map_err(|error| {
        Error::device(format!(
            "EGL 1.5 could not be opened ({error}): install it (Debian: apt install libegl1 libgl1-mesa-dri)."
        ))
    })
}

fn candidates(egl: &Egl) -> Vec<Candidate> {
    let none = [egl::ATTRIB_NONE];
    let mut found = Vec::new();
    // SAFETY: the surfaceless platform takes the default display only.
    if let Ok(display) =
        unsafe { egl.get_platform_display(PLATFORM_SURFACELESS, egl::DEFAULT_DISPLAY, &none) }
    {
        found.push(("surfaceless", display));
    }
    for device in devices(egl) {
        // SAFETY: the device comes from eglQueryDevicesEXT.
        if let Ok(display) = unsafe { egl.get_platform_display(PLATFORM_DEVICE, device, &none) } {
            found.push(("device", display));
        }
    }
    // SAFETY: the default display has no preconditions.
    if let Some(display) = unsafe { egl.get_display(egl::DEFAULT_DISPLAY) } {
        found.push(("pbuffer", display));
    }
    found
}

/// The devices of EGL_EXT_device_enumeration; none where it is missing.
fn devices(egl: &Egl) -> Vec<*mut c_void> {
    type QueryDevices = extern "system" fn(egl::Int, *mut *mut c_void, *mut egl::Int) -> egl::Boolean;
    let Some(function) = egl.get_proc_address("eglQueryDevicesEXT") else { return Vec::new() };
    // SAFETY: this is the function's type in EGL_EXT_device_enumeration.
    let query: QueryDevices = unsafe { std::mem::transmute(function) };
    let mut devices = [std::ptr::null_mut(); MOST_DEVICES];
    let mut count = 0;
    if query(MOST_DEVICES as egl::Int, devices.as_mut_ptr(), &mut count) != egl::TRUE {
        return Vec::new();
    }
    devices[..usize::try_from(count).unwrap_or(0).min(MOST_DEVICES)].to_vec()
}
