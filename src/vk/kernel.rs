//! Kernels made ready for a device, and their descriptors.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Device, Shared};
use super::failed;
use super::image::Image;
use crate::error::{Error, Result};
use crate::kernels::{DescriptorKind, Kernel};

fn descriptor_type(kind: DescriptorKind) -> vk::DescriptorType {
    match kind {
        DescriptorKind::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
        DescriptorKind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
        DescriptorKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
        DescriptorKind::UniformTexelBuffer => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
    }
}

/// What is bound to a binding.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    Buffer(&'a Buffer),
    Texels(&'a Buffer),
    Image(&'a Image),
}

/// SPIR-V handed to the driver, for as long as a pipeline is being made of it.
struct Module<'a> {
    raw: vk::ShaderModule,
    device: &'a Shared,
}

impl<'a> Module<'a> {
    fn new(device: &'a Shared, kernel: &Kernel) -> std::result::Result<Self, vk::Result> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(kernel.spirv))
            .map_err(|_| vk::Result::ERROR_INITIALIZATION_FAILED)?;
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the SPIR-V comes from the compiler at build time.
        let raw = unsafe { device.raw.create_shader_module(&info, None)? };
        Ok(Self { raw, device })
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: pipelines need their modules no longer once they are made.
        unsafe { self.device.raw.destroy_shader_module(self.raw, None) };
    }
}

/// Map entries and bytes of specialization constants.
fn specialization(constants: &[(u32, u32)]) -> (Vec<vk::SpecializationMapEntry>, Vec<u8>) {
    let entry = |(place, (id, _)): (usize, &(u32, u32))| {
        vk::SpecializationMapEntry::default().constant_id(*id).offset(place as u32 * 4).size(4)
    };
    (
        constants.iter().enumerate().map(entry).collect(),
        constants.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect(),
    )
}

fn preparing(kernel: &Kernel) -> String {
    format!("Preparing the kernel {}", kernel.name)
}

/// A kernel made ready for a device with its specialization constants.
pub struct Pipeline {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    pub(super) kernel: &'static Kernel,
    /// Whether the driver was asked to keep statistics.
    pub(super) captures: bool,
    pub(super) device: Arc<Shared>,
}

impl Pipeline {
    /// Compiles a kernel. `constants` are (id, value) of specialization constants; ids that the kernel
    /// does not have are ignored. `push_bytes`: size of its push constants.
    pub fn new(
        device: &Device,
        kernel: &'static Kernel,
        constants: &[(u32, u32)],
        push_bytes: u32,
    ) -> Result<Self> {
        Self::for_computing(device, kernel, constants, push_bytes, false)
    }

    /// The same, but asks the driver to keep what [`Pipeline::statistics`] tells. That may change what the driver
    /// keeps in its caches, so kernels that are timed are made by [`Pipeline::new`].
    pub fn with_statistics(
        device: &Device,
        kernel: &'static Kernel,
        constants: &[(u32, u32)],
        push_bytes: u32,
    ) -> Result<Self> {
        Self::for_computing(device, kernel, constants, push_bytes, device.shared.statistics.is_some())
    }

    fn for_computing(
        device: &Device,
        kernel: &'static Kernel,
        constants: &[(u32, u32)],
        push_bytes: u32,
        captures: bool,
    ) -> Result<Self> {
        let mut pipeline = Self::without_code(device, kernel, vk::ShaderStageFlags::COMPUTE, push_bytes)?;
        pipeline.captures = captures;
        pipeline.compile(constants).map_err(|result| failed(&preparing(kernel), result))?;
        pipeline.name();
        Ok(pipeline)
    }

    /// Compiles a vertex and a fragment kernel that fill a picture; descriptors are the latter's.
    pub(super) fn for_drawing(
        device: &Device,
        [vertex, fragment]: [&'static Kernel; 2],
        constants: &[(u32, u32)],
        pass: vk::RenderPass,
        size: (u32, u32),
    ) -> Result<Self> {
        let mut pipeline = Self::without_code(device, fragment, vk::ShaderStageFlags::FRAGMENT, 0)?;
        pipeline
            .compile_drawing(vertex, constants, pass, size)
            .map_err(|result| failed(&preparing(fragment), result))?;
        pipeline.name();
        Ok(pipeline)
    }

    /// The layouts of a kernel's descriptors and push constants.
    fn without_code(
        device: &Device,
        kernel: &'static Kernel,
        stage: vk::ShaderStageFlags,
        push_bytes: u32,
    ) -> Result<Self> {
        let shared = device.shared.clone();
        let bindings: Vec<_> = kernel
            .bindings
            .iter()
            .map(|(binding, kind)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(*binding)
                    .descriptor_type(descriptor_type(*kind))
                    .descriptor_count(1)
                    .stage_flags(stage)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let mut pipeline = Self {
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            kernel,
            captures: false,
            device: shared.clone(),
        };
        let fail = |result| failed(&preparing(kernel), result);
        let ranges = [vk::PushConstantRange::default().stage_flags(stage).size(push_bytes)];
        // SAFETY: the device is alive and the descriptions are complete; `pipeline` destroys what was
        // made if a later step fails.
        unsafe {
            pipeline.set_layout = shared.raw.create_descriptor_set_layout(&info, None).map_err(fail)?;
            let sets = [pipeline.set_layout];
            let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            if push_bytes > 0 {
                info = info.push_constant_ranges(&ranges);
            }
            pipeline.layout = shared.raw.create_pipeline_layout(&info, None).map_err(fail)?;
        }
        Ok(pipeline)
    }

    fn name(&self) {
        if let Ok(label) = CString::new(self.kernel.name) {
            self.device.name_object(self.raw, &label);
        }
    }

    fn compile(&mut self, constants: &[(u32, u32)]) -> std::result::Result<(), vk::Result> {
        let (entries, values) = specialization(constants);
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&values);
        let module = Module::new(&self.device, self.kernel)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.raw)
            .name(c"main")
            .specialization_info(&specialization);
        let mut info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout);
        let mut cache = self.device.pipelines.raw;
        if self.captures {
            info = info.flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR);
            // What is kept is for kernels that run.
            cache = vk::PipelineCache::null();
        }
        // SAFETY: everything pointed to lives until the call returns.
        let made = unsafe { self.device.raw.create_compute_pipelines(cache, &[info], None) };
        self.raw = made.map_err(|(_, result)| result)?[0];
        Ok(())
    }

    fn compile_drawing(
        &mut self,
        vertex: &Kernel,
        constants: &[(u32, u32)],
        pass: vk::RenderPass,
        (width, height): (u32, u32),
    ) -> std::result::Result<(), vk::Result> {
        let (entries, values) = specialization(constants);
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&values);
        let (vertex, fragment) =
            (Module::new(&self.device, vertex)?, Module::new(&self.device, self.kernel)?);
        let stage = |flags, module: &Module<'_>| {
            vk::PipelineShaderStageCreateInfo::default().stage(flags).module(module.raw).name(c"main")
        };
        let stages = [
            stage(vk::ShaderStageFlags::VERTEX, &vertex),
            stage(vk::ShaderStageFlags::FRAGMENT, &fragment).specialization_info(&specialization),
        ];
        let input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewports = [vk::Viewport::default().width(width as f32).height(height as f32).max_depth(1.0)];
        let scissors = [vk::Rect2D::default().extent(vk::Extent2D { width, height })];
        let viewport =
            vk::PipelineViewportStateCreateInfo::default().viewports(&viewports).scissors(&scissors);
        let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let blends =
            [vk::PipelineColorBlendAttachmentState::default()
                .color_write_mask(vk::ColorComponentFlags::RGBA)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .color_blend_state(&blend)
            .layout(self.layout)
            .render_pass(pass);
        // SAFETY: everything pointed to lives until the call returns.
        let made =
            unsafe { self.device.raw.create_graphics_pipelines(self.device.pipelines.raw, &[info], None) };
        self.raw = made.map_err(|(_, result)| result)?[0];
        Ok(())
    }

    /// Writes a descriptor set for this kernel. `bound` must hold everything that the kernel uses; what
    /// it does not use is ignored.
    pub fn bind<'a>(&'a self, bound: &[(u32, Binding<'a>)]) -> Result<BoundKernel<'a>> {
        let raw = &self.device.raw;
        let sizes: Vec<_> = self
            .kernel
            .bindings
            .iter()
            .map(|(_, kind)| vk::DescriptorPoolSize::default().ty(descriptor_type(*kind)).descriptor_count(1))
            .collect();
        let what = || format!("Binding the kernel {}", self.kernel.name);
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive; `kernel` destroys the pool if a later step fails.
        let pool =
            unsafe { raw.create_descriptor_pool(&info, None) }.map_err(|result| failed(&what(), result))?;
        let mut kernel = BoundKernel { pipeline: self, pool, set: vk::DescriptorSet::null() };
        let layouts = [self.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool was made for one set of this layout.
        kernel.set =
            unsafe { raw.allocate_descriptor_sets(&info) }.map_err(|result| failed(&what(), result))?[0];
        for &(binding, kind) in self.kernel.bindings {
            let resource = bound.iter().find(|(place, _)| *place == binding).map(|(_, resource)| *resource);
            let Some(resource) = resource else {
                return Err(Error::other(format!(
                    "The kernel {} was given nothing at binding {binding}: report this as a bug.",
                    self.kernel.name
                )));
            };
            kernel.write(binding, kind, resource);
        }
        Ok(kernel)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: batches that use the pipeline borrow it through `BoundKernel`, and wait when dropped.
        unsafe {
            self.device.raw.destroy_pipeline(self.raw, None);
            self.device.raw.destroy_pipeline_layout(self.layout, None);
            self.device.raw.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// A kernel with its descriptors.
pub struct BoundKernel<'a> {
    pub(super) pipeline: &'a Pipeline,
    pub(super) set: vk::DescriptorSet,
    pool: vk::DescriptorPool,
}

impl BoundKernel<'_> {
    pub fn name(&self) -> &'static str {
        self.pipeline.kernel.name
    }

    fn write(&self, binding: u32, kind: DescriptorKind, resource: Binding<'_>) {
        let mut buffers = [vk::DescriptorBufferInfo::default().range(vk::WHOLE_SIZE)];
        let mut images = [vk::DescriptorImageInfo::default().image_layout(vk::ImageLayout::GENERAL)];
        let mut views = [vk::BufferView::null()];
        let mut write = vk::WriteDescriptorSet::default()
            .dst_set(self.set)
            .dst_binding(binding)
            .descriptor_type(descriptor_type(kind))
            .descriptor_count(1);
        write = match resource {
            Binding::Buffer(buffer) => {
                buffers[0].buffer = buffer.raw;
                write.buffer_info(&buffers)
            }
            Binding::Texels(buffer) => {
                views[0] = buffer.view.unwrap_or_default();
                write.texel_buffer_view(&views)
            }
            Binding::Image(image) => {
                images[0].image_view = image.view;
                write.image_info(&images)
            }
        };
        // SAFETY: the set is not in use by a batch yet, and the resource outlives it by lifetime.
        unsafe { self.pipeline.device.raw.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for BoundKernel<'_> {
    fn drop(&mut self) {
        // SAFETY: batches that use the set are waited for before this goes (`Batch::drop`).
        unsafe { self.pipeline.device.raw.destroy_descriptor_pool(self.pool, None) };
    }
}
