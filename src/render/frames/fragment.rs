//! The original's first form: a fragment shader over all triangles of a uniform buffer, on both APIs.

use super::Frames;
use crate::error::{Error, Result};
use crate::gl;
use crate::kernels::find_kernel;
use crate::layout::{BINDING_FRAME, BINDING_TRIANGLES, Frame, Triangle, UNIFORM_TRIANGLES};
use crate::render::geometry::Geometry;
use crate::render::plan::{Plan, frame_of};
use crate::scene::Scene;
use crate::scene::camera::RayModel;
use crate::vk::{Batch, Binding, BoundKernel, Buffer, Device, Image, ImageFormat, Raster};

/// What the form is called in tables.
pub const NAME: &str = "fragment";

/// Frame and triangles as the shader reads them; a scene that does not fit is refused. (The original ignored
/// the rest.)
pub struct Inputs {
    frame: Frame,
    triangles: Vec<Triangle>,
}

impl Inputs {
    pub fn new(scene: &Scene, geometry: &Geometry, plan: &Plan<'_>) -> Result<Self> {
        let most = UNIFORM_TRIANGLES as usize;
        let count = geometry.triangles.len();
        if count > most {
            return Err(Error::usage(format!(
                "The uniform buffer of the original's first form holds {most} triangles, and {} has {count}: leave \
                 {NAME} out with --methods.",
                scene.path
            )));
        }
        let mut triangles = geometry.triangles.clone();
        // In the order of the file, which decided ties.
        triangles.sort_by_key(|triangle| triangle.id);
        triangles.resize(most, Triangle::default());
        let frame = frame_of(&plan.job, &plan.settings, scene, geometry, RayModel::MiddleToFar);
        Ok(Self { frame, triangles })
    }

    fn triangle_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.triangles)
    }
}

/// What the frames work on in Vulkan.
pub struct VulkanStage<'a> {
    device: &'a Device,
    raster: Raster,
    target: Image,
    frame: Buffer,
    triangles: Buffer,
}

impl<'a> VulkanStage<'a> {
    pub fn new(device: &'a Device, inputs: &Inputs, plan: &Plan<'_>) -> Result<Self> {
        let target = Image::color_target(device, "picture", plan.job.size)?;
        let (vertex, fragment) = (find_kernel("fragment/vertex")?, find_kernel("fragment/primary")?);
        Ok(Self {
            raster: Raster::new(device, vertex, fragment, &plan.constants, &target)?,
            target,
            frame: Buffer::uniform(device, "frame", bytemuck::bytes_of(&inputs.frame))?,
            triangles: Buffer::uniform(device, "triangles", inputs.triangle_bytes())?,
            device,
        })
    }

    pub fn bind(&self) -> Result<VulkanFragment<'_>> {
        let kernel = self.raster.bind(&[
            (BINDING_FRAME, Binding::Buffer(&self.frame)),
            (BINDING_TRIANGLES, Binding::Buffer(&self.triangles)),
        ])?;
        Ok(VulkanFragment { stage: self, kernel })
    }
}

/// A stage with its descriptors.
pub struct VulkanFragment<'a> {
    stage: &'a VulkanStage<'a>,
    kernel: BoundKernel<'a>,
}

impl Frames for VulkanFragment<'_> {
    fn frame(&mut self, _number: u32) -> Result<f64> {
        let mut batch = Batch::new(self.stage.device, 1)?;
        let start = std::time::Instant::now();
        batch.draw(&self.stage.raster, &self.kernel, self.kernel.name());
        batch.submit()?;
        let finished = batch.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(finished.timings.first().and_then(|timing| timing.gpu_ms).unwrap_or(wall_ms))
    }

    fn restart(&mut self) -> Result<()> {
        Ok(())
    }

    fn image(&mut self) -> Result<Vec<[f32; 4]>> {
        let format = ImageFormat::Rgba8;
        let bytes = self.stage.target.read(self.stage.device, format.bytes_per_pixel())?;
        Ok(crate::render::execute::pixels_of(format, &bytes))
    }
}

/// The frames in OpenGL.
pub struct OpenGlFragment {
    raster: gl::Raster,
    clock: gl::Clock,
    _inputs: [gl::Buffer; 2],
}

impl OpenGlFragment {
    pub fn new(context: &gl::Context, inputs: &Inputs, plan: &Plan<'_>) -> Result<Self> {
        let uniform = |content: &[u8]| gl::Buffer::new(context, gl::BufferTarget::Uniform, content);
        let buffers = [uniform(bytemuck::bytes_of(&inputs.frame))?, uniform(inputs.triangle_bytes())?];
        buffers[0].bind(BINDING_FRAME);
        buffers[1].bind(BINDING_TRIANGLES);
        let (vertex, fragment) = (find_kernel("fragment/vertex")?, find_kernel("fragment/primary")?);
        let raster = gl::Raster::new(context, vertex, fragment, &plan.constants, plan.job.size)?;
        Ok(Self { raster, clock: gl::Clock::new(context), _inputs: buffers })
    }

    /// What times the frames.
    pub fn timer(&self) -> gl::TimerKind {
        self.clock.kind()
    }
}

impl Frames for OpenGlFragment {
    fn frame(&mut self, _number: u32) -> Result<f64> {
        Ok(self.clock.read(self.raster.draw()))
    }

    fn restart(&mut self) -> Result<()> {
        Ok(())
    }

    fn image(&mut self) -> Result<Vec<[f32; 4]>> {
        Ok(self.raster.read())
    }
}
