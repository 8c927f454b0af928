//! Compute programs and what they work on.

use std::rc::Rc;
use std::time::Instant;

use glow::HasContext;

use super::context::{Context, Shared};
use crate::error::{Error, Result};
use crate::kernels::Kernel;

/// What times a dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimerKind {
    /// GL_TIME_ELAPSED.
    Device,
    /// The host's clock around dispatch and glFinish, where the query reports nothing for compute.
    Wall,
}

/// How long a dispatch took by either clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elapsed {
    pub device_ms: f64,
    pub wall_ms: f64,
}

/// Which clock times dispatches.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    kind: TimerKind,
}

impl Clock {
    /// Mesa's software renderer reports nothing for compute, and a tenth of the time for drawing; on others
    /// GL_TIME_ELAPSED is trusted.
    pub fn new(context: &Context) -> Self {
        Self { kind: if context.is_software() { TimerKind::Wall } else { TimerKind::Device } }
    }

    pub fn kind(&self) -> TimerKind {
        self.kind
    }

    /// The milliseconds of a dispatch.
    pub fn read(&self, elapsed: Elapsed) -> f64 {
        match self.kind {
            TimerKind::Device => elapsed.device_ms,
            TimerKind::Wall => elapsed.wall_ms,
        }
    }
}

/// Where a buffer is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferTarget {
    Storage,
    Uniform,
}

impl BufferTarget {
    fn raw(self) -> u32 {
        match self {
            Self::Storage => glow::SHADER_STORAGE_BUFFER,
            Self::Uniform => glow::UNIFORM_BUFFER,
        }
    }
}

/// A buffer with its content.
pub struct Buffer {
    raw: glow::Buffer,
    target: BufferTarget,
    shared: Rc<Shared>,
}

impl Buffer {
    pub fn new(context: &Context, target: BufferTarget, content: &[u8]) -> Result<Self> {
        let shared = context.shared.clone();
        // SAFETY: the context is current on this thread (`Rc` keeps everything on it).
        unsafe {
            let raw = shared.gl.create_buffer().map_err(refused)?;
            let buffer = Self { raw, target, shared };
            buffer.write(content);
            Ok(buffer)
        }
    }

    /// Replaces the content.
    pub fn write(&self, content: &[u8]) {
        let gl = &self.shared.gl;
        // SAFETY: as above.
        unsafe {
            gl.bind_buffer(self.target.raw(), Some(self.raw));
            gl.buffer_data_u8_slice(self.target.raw(), content, glow::DYNAMIC_COPY);
        }
    }

    /// The content after the programs that wrote it.
    pub fn read(&self) -> Result<Vec<u8>> {
        let gl = &self.shared.gl;
        // SAFETY: the slice is as long as the buffer.
        unsafe {
            gl.memory_barrier(glow::BUFFER_UPDATE_BARRIER_BIT);
            gl.bind_buffer(self.target.raw(), Some(self.raw));
            let bytes = gl.get_buffer_parameter_i32(self.target.raw(), glow::BUFFER_SIZE);
            let mut content = vec![0; usize::try_from(bytes).unwrap_or(0)];
            gl.get_buffer_sub_data(self.target.raw(), 0, &mut content);
            Ok(content)
        }
    }

    /// Binds it for the programs that follow.
    pub fn bind(&self, binding: u32) {
        // SAFETY: as above.
        unsafe { self.shared.gl.bind_buffer_base(self.target.raw(), binding, Some(self.raw)) };
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: the buffer belongs to the current context.
        unsafe { self.shared.gl.delete_buffer(self.raw) };
    }
}

/// A two-dimensional rgba8 or rgba32f image.
pub struct Image {
    raw: glow::Texture,
    format: u32,
    size: (u32, u32),
    shared: Rc<Shared>,
}

impl Image {
    /// Makes an image of zeros.
    pub fn new(context: &Context, eight_bit: bool, size: (u32, u32)) -> Result<Self> {
        let shared = context.shared.clone();
        let format = if eight_bit { glow::RGBA8 } else { glow::RGBA32F };
        // SAFETY: the context is current on this thread.
        unsafe {
            let gl = &shared.gl;
            let raw = gl.create_texture().map_err(refused)?;
            gl.bind_texture(glow::TEXTURE_2D, Some(raw));
            gl.tex_storage_2d(glow::TEXTURE_2D, 1, format, size.0 as i32, size.1 as i32);
            let image = Self { raw, format, size, shared };
            image.clear();
            Ok(image)
        }
    }

    /// Sets all of it to 0.
    pub fn clear(&self) {
        let zeros = vec![0u8; self.size.0 as usize * self.size.1 as usize * 4];
        let gl = &self.shared.gl;
        // SAFETY: the slice holds a byte for each channel of each pixel.
        unsafe {
            gl.bind_texture(glow::TEXTURE_2D, Some(self.raw));
            let (width, height) = (self.size.0 as i32, self.size.1 as i32);
            let data = glow::PixelUnpackData::Slice(Some(&zeros));
            gl.tex_sub_image_2d(
                glow::TEXTURE_2D,
                0,
                0,
                0,
                width,
                height,
                glow::RGBA,
                glow::UNSIGNED_BYTE,
                data,
            );
        }
    }

    /// Binds it to read and write.
    pub fn bind(&self, unit: u32) {
        // SAFETY: the texture has storage of this format.
        unsafe {
            self.shared.gl.bind_image_texture(
                unit,
                Some(self.raw),
                0,
                false,
                0,
                glow::READ_WRITE,
                self.format,
            );
        }
    }

    /// All pixels, row by row.
    pub fn read(&self) -> Vec<[f32; 4]> {
        let mut bytes = vec![0u8; self.size.0 as usize * self.size.1 as usize * 16];
        let gl = &self.shared.gl;
        // SAFETY: the slice holds a float for each channel of each pixel.
        unsafe {
            gl.memory_barrier(glow::TEXTURE_UPDATE_BARRIER_BIT);
            gl.bind_texture(glow::TEXTURE_2D, Some(self.raw));
            let data = glow::PixelPackData::Slice(Some(&mut bytes));
            gl.get_tex_image(glow::TEXTURE_2D, 0, glow::RGBA, glow::FLOAT, data);
        }
        bytemuck::pod_collect_to_vec(&bytes)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: the texture belongs to the current context.
        unsafe { self.shared.gl.delete_texture(self.raw) };
    }
}

/// A kernel compiled by the driver.
pub struct Program {
    raw: glow::Program,
    timer: glow::Query,
    shared: Rc<Shared>,
}

impl Program {
    /// Compiles a kernel with its constants: (id, value), every id that it has.
    pub fn new(context: &Context, kernel: &Kernel, constants: &[(u32, u32)]) -> Result<Self> {
        let shared = context.shared.clone();
        let raw = build_program(&shared.gl, &[(glow::COMPUTE_SHADER, kernel)], constants)?;
        // SAFETY: the context is current on this thread.
        let timer = unsafe { shared.gl.create_query() }.map_err(refused)?;
        Ok(Self { raw, timer, shared })
    }

    /// Runs the program on `groups` workgroups, makes its writes visible to the next one and waits.
    pub fn dispatch(&self, groups: u32) -> Elapsed {
        let gl = &self.shared.gl;
        // SAFETY: the program is linked, and what it reads and writes is bound.
        unsafe {
            gl.use_program(Some(self.raw));
            gl.finish();
            let start = Instant::now();
            gl.begin_query(glow::TIME_ELAPSED, self.timer);
            gl.dispatch_compute(groups, 1, 1);
            gl.end_query(glow::TIME_ELAPSED);
            gl.memory_barrier(glow::SHADER_STORAGE_BARRIER_BIT | glow::SHADER_IMAGE_ACCESS_BARRIER_BIT);
            gl.finish();
            let wall_ms = start.elapsed().as_secs_f64() * 1e3;
            let device_ms = gl.get_query_parameter_u64(self.timer, glow::QUERY_RESULT) as f64 * 1e-6;
            Elapsed { device_ms, wall_ms }
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: both belong to the current context.
        unsafe {
            self.shared.gl.delete_query(self.timer);
            self.shared.gl.delete_program(self.raw);
        }
    }
}

/// Compiles and links kernels with their constants.
pub(super) fn build_program(
    gl: &glow::Context,
    stages: &[(u32, &Kernel)],
    constants: &[(u32, u32)],
) -> Result<glow::Program> {
    // SAFETY: the context is current on this thread.
    unsafe {
        let program = gl.create_program().map_err(refused)?;
        for (stage, kernel) in stages {
            let mut text = kernel.glsl.to_string();
            for (id, value) in constants {
                text = text.replace(&format!("SPECIALIZED({id})"), &value.to_string());
            }
            let shader = gl.create_shader(*stage).map_err(refused)?;
            gl.shader_source(shader, &text);
            gl.compile_shader(shader);
            gl.attach_shader(program, shader);
            let log = (!gl.get_shader_compile_status(shader)).then(|| gl.get_shader_info_log(shader));
            gl.delete_shader(shader);
            if let Some(log) = log {
                gl.delete_program(program);
                return Err(refused_kernel(kernel, &log));
            }
        }
        gl.link_program(program);
        if !gl.get_program_link_status(program) {
            let log = gl.get_program_info_log(program);
            gl.delete_program(program);
            return Err(refused_kernel(stages[0].1, &log));
        }
        Ok(program)
    }
}

fn refused_kernel(kernel: &Kernel, log: &str) -> Error {
    let first = log.lines().next().unwrap_or("no reason given");
    Error::device(format!(
        "The OpenGL driver refused the kernel {} ({first}): update the driver.",
        kernel.name
    ))
}

pub(super) fn refused(reason: String) -> Error {
    Error::device(format!("The OpenGL driver made no object ({reason}): update the driver."))
}
