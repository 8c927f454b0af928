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

/// A kernel made ready for a device with its specialization constants.
pub struct Pipeline {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    kernel: &'static Kernel,
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
        let shared = device.shared.clone();
        let bindings: Vec<_> = kernel
            .bindings
            .iter()
            .map(|(binding, kind)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(*binding)
                    .descriptor_type(descriptor_type(*kind))
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let mut pipeline = Self {
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            kernel,
            device: shared.clone(),
        };
        let what = || format!("Preparing the kernel {}", kernel.name);
        // SAFETY: the device is alive and the descriptions are complete; `pipeline` destroys what was
        // made if a later step fails.
        unsafe {
            pipeline.set_layout = shared
                .raw
                .create_descriptor_set_layout(&info, None)
                .map_err(|result| failed(&what(), result))?;
            let sets = [pipeline.set_layout];
            let ranges = [vk::PushConstantRange::default()
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
                .size(push_bytes)];
            let info =
                vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&ranges);
            pipeline.layout =
                shared.raw.create_pipeline_layout(&info, None).map_err(|result| failed(&what(), result))?;
        }
        pipeline.compile(constants).map_err(|result| failed(&what(), result))?;
        if let Ok(label) = CString::new(kernel.name) {
            shared.name_object(pipeline.raw, &label);
        }
        Ok(pipeline)
    }

    fn compile(&mut self, constants: &[(u32, u32)]) -> std::result::Result<(), vk::Result> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(self.kernel.spirv))
            .map_err(|_| vk::Result::ERROR_INITIALIZATION_FAILED)?;
        let entries: Vec<_> = constants
            .iter()
            .enumerate()
            .map(|(place, (id, _))| {
                vk::SpecializationMapEntry::default().constant_id(*id).offset(place as u32 * 4).size(4)
            })
            .collect();
        let values: Vec<u8> = constants.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect();
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&values);
        let raw = &self.device.raw;
        // SAFETY: the SPIR-V comes from the compiler at build time; the module is destroyed after the
        // pipeline was made, and everything pointed to lives until the call returns.
        unsafe {
            let module =
                raw.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout);
            let made = raw.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            raw.destroy_shader_module(module, None);
            self.raw = made.map_err(|(_, result)| result)?[0];
        }
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
