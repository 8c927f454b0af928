//! One triangle over a whole image, shaded by a fragment shader.

use std::rc::Rc;
use std::time::Instant;

use glow::HasContext;

use super::compute::{Elapsed, build_program, refused};
use super::context::{Context, Shared};
use crate::error::Result;
use crate::kernels::Kernel;

/// A program that draws into its own rgba8 image.
pub struct Raster {
    program: glow::Program,
    texture: glow::Texture,
    framebuffer: glow::Framebuffer,
    vertices: glow::VertexArray,
    timer: glow::Query,
    size: (u32, u32),
    shared: Rc<Shared>,
}

impl Raster {
    pub fn new(
        context: &Context,
        vertex: &Kernel,
        fragment: &Kernel,
        constants: &[(u32, u32)],
        size: (u32, u32),
    ) -> Result<Self> {
        let shared = context.shared.clone();
        let stages = [(glow::VERTEX_SHADER, vertex), (glow::FRAGMENT_SHADER, fragment)];
        let program = build_program(&shared.gl, &stages, constants)?;
        let gl = &shared.gl;
        // SAFETY: the context is current on this thread.
        unsafe {
            let texture = gl.create_texture().map_err(refused)?;
            gl.bind_texture(glow::TEXTURE_2D, Some(texture));
            gl.tex_storage_2d(glow::TEXTURE_2D, 1, glow::RGBA8, size.0 as i32, size.1 as i32);
            let framebuffer = gl.create_framebuffer().map_err(refused)?;
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(framebuffer));
            let target = glow::COLOR_ATTACHMENT0;
            gl.framebuffer_texture_2d(glow::FRAMEBUFFER, target, glow::TEXTURE_2D, Some(texture), 0);
            // A core profile draws only with a vertex array, though nothing is in it.
            let vertices = gl.create_vertex_array().map_err(refused)?;
            let timer = gl.create_query().map_err(refused)?;
            Ok(Self { program, texture, framebuffer, vertices, timer, size, shared: shared.clone() })
        }
    }

    /// Shades every pixel and waits.
    pub fn draw(&self) -> Elapsed {
        let gl = &self.shared.gl;
        // SAFETY: the program is linked, and what it reads is bound.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer));
            gl.bind_vertex_array(Some(self.vertices));
            gl.viewport(0, 0, self.size.0 as i32, self.size.1 as i32);
            gl.clear_color(0.0, 0.0, 0.0, 0.0);
            gl.use_program(Some(self.program));
            gl.finish();
            let start = Instant::now();
            gl.begin_query(glow::TIME_ELAPSED, self.timer);
            gl.clear(glow::COLOR_BUFFER_BIT);
            gl.draw_arrays(glow::TRIANGLES, 0, 3);
            gl.end_query(glow::TIME_ELAPSED);
            gl.finish();
            let wall_ms = start.elapsed().as_secs_f64() * 1e3;
            let device_ms = gl.get_query_parameter_u64(self.timer, glow::QUERY_RESULT) as f64 * 1e-6;
            Elapsed { device_ms, wall_ms }
        }
    }

    /// All pixels, row by row from the top.
    pub fn read(&self) -> Vec<[f32; 4]> {
        let (width, height) = self.size;
        let mut bytes = vec![0u8; width as usize * height as usize * 16];
        let gl = &self.shared.gl;
        // SAFETY: the slice holds a float for each channel of each pixel.
        unsafe {
            gl.bind_texture(glow::TEXTURE_2D, Some(self.texture));
            let data = glow::PixelPackData::Slice(Some(&mut bytes));
            gl.get_tex_image(glow::TEXTURE_2D, 0, glow::RGBA, glow::FLOAT, data);
        }
        // OpenGL's first row is the bottom one.
        let rows = bytes.chunks_exact(width as usize * 16).rev();
        rows.flat_map(bytemuck::pod_collect_to_vec::<u8, [f32; 4]>).collect()
    }
}

impl Drop for Raster {
    fn drop(&mut self) {
        let gl = &self.shared.gl;
        // SAFETY: all of it belongs to the current context.
        unsafe {
            gl.delete_query(self.timer);
            gl.delete_vertex_array(self.vertices);
            gl.delete_framebuffer(self.framebuffer);
            gl.delete_texture(self.texture);
            gl.delete_program(self.program);
        }
    }
}
