//! Lists of rays on a Vulkan device: the rays that a plan would trace, and what they hit.

use std::cell::RefCell;
use std::rc::Rc;

use super::auto;
use super::plan::{Plan, kernel_by, traversal_name};
use super::stage::Uploaded;
use super::tally::Totals;
use crate::error::{Error, Result};
use crate::kernels::{Kernel, find_kernel};
use crate::layout::{
    self, BINDING_COUNTERS, BINDING_FRAME, BINDING_HITS, BINDING_NODES, BINDING_RAYS, BINDING_TRIANGLES,
    Counters, HitRecord, Range, RayRecord, STAGE_ANY, STAGE_CLOSEST, WORKGROUP_SIZE,
};
use crate::vk::{Access, Batch, Binding, Buffer, BufferUse, Device, Hazard, Pipeline};

/// Rays of one dispatch at most.
pub(super) const MOST_RAYS: usize = 1 << 20;

/// What is asked of each ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is one: index 0 or `NO_HIT`.
    Any,
}

impl Query {
    pub(super) fn stage(self) -> u32 {
        if self == Self::Closest { STAGE_CLOSEST } else { STAGE_ANY }
    }

    pub fn name(self) -> &'static str {
        if self == Self::Closest { "closest" } else { "any" }
    }
}

/// The kernel that answers lists of rays with a plan's method.
pub(super) fn trace_kernel(plan: &Plan<'_>) -> Result<&'static Kernel> {
    kernel_by(&format!("trace/{}", traversal_name(&plan.settings)), plan.accessor)
}

/// The largest coordinate of an origin, for [`Plan::with_reach`]; places without a ray do not count.
pub fn reach_of(rays: &[RayRecord]) -> f64 {
    let there = rays.iter().filter(|ray| ray.t_max >= 0.0);
    there.flat_map(|ray| ray.origin).fold(0f32, |most, at| most.max(at.abs())).into()
}

/// The range of a dispatch over a list of `count` rays.
pub(super) fn range_of(plan: &Plan<'_>, count: u32, sample: u32, stage: u32) -> Range {
    Range {
        pixel_end: count,
        sample_begin: sample,
        sample_end: sample + 1,
        triangle_end: plan.frame.triangle_count,
        stage,
        set_begin: plan.job.samples.start,
        set_end: plan.job.samples.end,
        ..Range::default()
    }
}

/// All rays must have come to their end.
pub(super) fn check_finished(kernel: &str, asked: u64, finished: u64) -> Result<()> {
    if finished == asked {
        return Ok(());
    }
    Err(Error::device(format!(
        "{} rays of {asked} did not come to their end with {kernel}: choose another --method or device.",
        asked.saturating_sub(finished),
    )))
}

/// Kernels that were compiled, found again by plans that take the same ones with the same constants.
#[derive(Default)]
pub struct Compiled {
    known: RefCell<Vec<(Constants, Rc<Pipeline>)>>,
}

/// A kernel's name and its specialization constants.
type Constants = (&'static str, Vec<(u32, u32)>);

impl Compiled {
    fn of(&self, device: &Device, kernel: &'static Kernel, plan: &Plan<'_>) -> Result<Rc<Pipeline>> {
        let key = (kernel.name, plan.constants.clone());
        if let Some((_, pipeline)) = self.known.borrow().iter().find(|(known, _)| *known == key) {
            return Ok(pipeline.clone());
        }
        auto::check_subgroup(kernel, device.adapter())?;
        let pipeline = Rc::new(Pipeline::new(device, kernel, &plan.constants, size_of::<Range>() as u32)?);
        self.known.borrow_mut().push((key, pipeline.clone()));
        Ok(pipeline)
    }
}

/// A plan's scene on a device, ready for lists of rays.
pub struct RayLists<'a> {
    device: &'a Device,
    plan: &'a Plan<'a>,
    uploaded: Uploaded,
    frame: Buffer,
    compiled: Rc<Compiled>,
}

impl<'a> RayLists<'a> {
    pub fn new(device: &'a Device, plan: &'a Plan<'a>) -> Result<Self> {
        Self::with_uploaded(device, plan, Uploaded::new(device, plan)?)
    }

    /// With arrays that are there already; they must be the plan's.
    pub fn with_uploaded(device: &'a Device, plan: &'a Plan<'a>, uploaded: Uploaded) -> Result<Self> {
        Ok(Self { frame: uploaded.frame(device, plan)?, uploaded, compiled: Rc::default(), device, plan })
    }

    /// With kernels that may be there already.
    pub fn sharing(self, compiled: &Rc<Compiled>) -> Self {
        Self { compiled: compiled.clone(), ..self }
    }

    /// What each ray hits. Fails if a ray does not come to its end, or starts beyond the plan's reach.
    pub fn trace(&self, query: Query, rays: &[RayRecord]) -> Result<Vec<HitRecord>> {
        Ok(self.trace_counting(query, rays)?.0)
    }

    /// The same, and how many of the rays lost a part of the tree to a full stack.
    pub fn trace_counting(&self, query: Query, rays: &[RayRecord]) -> Result<(Vec<HitRecord>, u64)> {
        self.plan.check_reach(reach_of(rays), query == Query::Any)?;
        let kernel = trace_kernel(self.plan)?;
        let mut hits = Vec::with_capacity(rays.len());
        let mut overflowed = 0;
        for piece in rays.chunks(MOST_RAYS) {
            let rays =
                Buffer::with_content(self.device, "rays", BufferUse::Storage, bytemuck::cast_slice(piece))?;
            let bytes = size_of_val(piece) / size_of::<RayRecord>() * size_of::<HitRecord>();
            let found = Buffer::new(self.device, "hits", BufferUse::Storage, bytes as u64)?;
            let range = range_of(self.plan, piece.len() as u32, 0, query.stage());
            let totals = self.dispatch(kernel, &rays, &found, range)?;
            let finished = totals.primary_finished + totals.ambient_finished;
            let asked = piece.iter().filter(|ray| ray.t_max >= 0.0).count() as u64;
            check_finished(kernel.name, asked, finished)?;
            hits.extend(bytemuck::pod_collect_to_vec::<u8, HitRecord>(&found.read(self.device)?));
            overflowed += totals.overflowed;
        }
        Ok((hits, overflowed))
    }

    /// The camera ray of each pixel number; beyond the image, rays that meet nothing.
    pub fn camera_rays(&self) -> Result<Vec<RayRecord>> {
        let pixels = self.plan.tiles.numbers() as u32;
        let unused = Buffer::new(self.device, "no hits", BufferUse::Storage, 16)?;
        let mut all = Vec::with_capacity(pixels as usize);
        for begin in (0..pixels).step_by(MOST_RAYS) {
            let range = self.piece(begin, (pixels - begin).min(MOST_RAYS as u32), 0, STAGE_CLOSEST);
            all.extend(self.made_rays("rays/camera", &unused, range)?);
        }
        Ok(all)
    }

    /// The ambient ray of one sample (of `pcg` in place of `lcg`) of each pixel number, given what the camera rays hit;
    /// rays that meet nothing where they missed. With `sobol` and `strata` those of one of several samples go one way from all pixels.
    pub fn ambient_rays(&self, hits: &[HitRecord], sample: u32) -> Result<Vec<RayRecord>> {
        let mut all = Vec::with_capacity(hits.len());
        for (place, piece) in hits.chunks(MOST_RAYS).enumerate() {
            let hit =
                Buffer::with_content(self.device, "hits", BufferUse::Storage, bytemuck::cast_slice(piece))?;
            let begin = (place * MOST_RAYS) as u32;
            let range = self.piece(begin, piece.len() as u32, sample, STAGE_ANY);
            all.extend(self.made_rays("rays/ambient", &hit, range)?);
        }
        Ok(all)
    }

    /// The range of `count` pixels, whose buffers begin with the first of them.
    fn piece(&self, begin: u32, count: u32, sample: u32, stage: u32) -> Range {
        let range = range_of(self.plan, count, sample, stage);
        Range { pixel_begin: begin, pixel_end: begin + count, pixel_base: begin, ..range }
    }

    fn made_rays(&self, kernel: &str, hits: &Buffer, range: Range) -> Result<Vec<RayRecord>> {
        let bytes = u64::from(range.pixel_end - range.pixel_begin) * size_of::<RayRecord>() as u64;
        let rays = Buffer::new(self.device, "rays", BufferUse::Storage, bytes)?;
        self.dispatch(find_kernel(kernel)?, &rays, hits, range)?;
        Ok(bytemuck::pod_collect_to_vec(&rays.read(self.device)?))
    }

    fn dispatch(
        &self,
        kernel: &'static Kernel,
        rays: &Buffer,
        hits: &Buffer,
        range: Range,
    ) -> Result<Totals> {
        let pipeline = self.compiled.of(self.device, kernel, self.plan)?;
        let bytes = (layout::COUNTER_SLOTS as usize * size_of::<Counters>()) as u64;
        let counters = Buffer::new(self.device, "counters", BufferUse::Storage, bytes)?;
        let geometry = |binding, buffer| {
            // The kernels that make rays read geometry from storage buffers on every device.
            let texels = self.plan.texels() && kernel.name.starts_with("trace/");
            (binding, if texels { Binding::Texels(buffer) } else { Binding::Buffer(buffer) })
        };
        let bound = pipeline.bind(&[
            (BINDING_FRAME, Binding::Buffer(&self.frame)),
            geometry(BINDING_NODES, &self.uploaded.nodes),
            geometry(BINDING_TRIANGLES, &self.uploaded.triangles),
            (BINDING_COUNTERS, Binding::Buffer(&counters)),
            (BINDING_RAYS, Binding::Buffer(rays)),
            (BINDING_HITS, Binding::Buffer(hits)),
        ])?;
        let mut batch = Batch::new(self.device, 1)?;
        batch.fill(&counters, 0);
        batch.barrier(&[Hazard::Buffer(&counters, Access::TransferWrite, Access::ShaderWrite)]);
        let groups = (range.pixel_end - range.pixel_begin).div_ceil(WORKGROUP_SIZE);
        batch.dispatch(&bound, bytemuck::bytes_of(&range), [groups, 1, 1], kernel.name);
        batch.submit()?;
        batch.wait()?;
        Ok(Totals::of(&bytemuck::pod_collect_to_vec::<u8, Counters>(&counters.read(self.device)?)))
    }
}
