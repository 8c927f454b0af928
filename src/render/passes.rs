//! How a range becomes dispatches: one kernel (`single`), kept hits and a list of pixels (`split`), or a kernel a step
//! (`staged`). Nothing waits for the host in between.

use std::cell::Cell;

use super::choices::{Accumulator, Passes};
use super::plan::Plan;
use crate::error::Result;
use crate::layout::{
    self, HitRecord, ListArguments, Listed, Partial, Range, RayRecord, STAGE_ANY, STAGE_BOTH, STAGE_CLOSEST,
    WORKGROUP_SIZE,
};
use crate::vk::{
    Access, Batch, Binding, BoundKernel, Buffer, BufferUse, Device, DeviceKind, Hazard, Pipeline,
    WORKGROUP_INVOCATIONS,
};

const _: () = assert!(layout::LIST_SIZE <= WORKGROUP_INVOCATIONS);

/// Partial results that `split` keeps at a time, and rays that `staged` does.
const ROOM: u64 = 1 << 21;
/// Samples that an invocation of `split` takes: on a GPU few, so that many are under way and none lasts long.
const GPU_BLOCK: u32 = 4;
/// The same where an invocation tests faces for many rays at a time.
const FACES_BLOCK: u32 = 64;
/// Samples that invocations share: enough that rays which go together are many, few enough that no lane has many.
const SHARED_BLOCK: u32 = 64;
/// Offset of the second sizes in [`ListArguments`].
const PIXEL_SIZES: u64 = 16;
/// Dispatches of a range at most.
pub const MOST_DISPATCHES: usize = 6;

/// Samples of an invocation of `split`: all of a range on a CPU, where a pixel's surface is found once for them. Sums of
/// floats must be added up one by one, or the frame's in one go.
fn least_block(plan: &Plan<'_>, device: DeviceKind) -> u32 {
    match (device, plan.settings.accumulator) {
        (DeviceKind::Cpu, _) => 1024,
        (_, Accumulator::Count) if plan.sample_lanes() > 1 => SHARED_BLOCK,
        (_, Accumulator::Count) if plan.finds_edges() => FACES_BLOCK,
        (_, Accumulator::Count) => GPU_BLOCK,
        _ => 1,
    }
}

/// What the passes keep between their kernels, for a band of pixels.
pub struct Buffers {
    passes: Passes,
    /// Elements of the buffers that hold something for each pixel and block of samples.
    room: u64,
    /// Camera rays' hits are there.
    hits_known: Cell<bool>,
    /// The range that the list was made for.
    listed: Cell<Option<Range>>,
    hits: Buffer,
    list: Buffer,
    arguments: Buffer,
    partials: Buffer,
    rays: Buffer,
    answers: Buffer,
    block: u32,
}

impl Buffers {
    /// For `pixels` of a band.
    pub fn new(device: &Device, plan: &Plan<'_>, pixels: u64) -> Result<Self> {
        let passes = plan.settings.passes;
        let room = (pixels * plan.job.samples.len() as u64).min(ROOM).max(pixels);
        let buffer = |name, usage, wanted: bool, elements: u64, record: usize| {
            Buffer::new(device, name, usage, if wanted { elements * record as u64 } else { 16 })
        };
        let several = passes != Passes::Single;
        let (split, staged) = (passes == Passes::Split, passes == Passes::Staged);
        let storage = BufferUse::Storage;
        Ok(Self {
            passes,
            room,
            hits_known: Cell::new(false),
            listed: Cell::new(None),
            hits: buffer("camera hits", storage, several, pixels, size_of::<HitRecord>())?,
            list: buffer("list of pixels", storage, several, pixels, size_of::<Listed>())?,
            arguments: buffer("list's sizes", BufferUse::Indirect, true, 1, size_of::<ListArguments>())?,
            partials: buffer("partial sums", storage, split, room, size_of::<Partial>())?,
            rays: buffer("rays", storage, staged, room, size_of::<RayRecord>())?,
            answers: buffer("answers", storage, staged, room, size_of::<HitRecord>())?,
            block: plan.tuning.block.unwrap_or_else(|| least_block(plan, device.adapter().kind)),
        })
    }

    /// Pixels times samples of a range for which there is room.
    pub fn room(&self) -> Option<u64> {
        match self.passes {
            Passes::Single => None,
            Passes::Split => Some(self.room * u64::from(self.block)),
            Passes::Staged => Some(self.room),
        }
    }

    /// Has the camera rays traced again with the next samples, as after a move of the camera.
    pub fn forget_hits(&self) {
        self.hits_known.set(false);
        self.listed.set(None);
    }

    /// Bindings of the steps; the second list is for the step that answers ambient rays.
    fn bindings(&self) -> [Vec<(u32, Binding<'_>)>; 2] {
        let shared = |hits| {
            vec![
                (layout::BINDING_HITS, Binding::Buffer(hits)),
                (layout::BINDING_LIST, Binding::Buffer(&self.list)),
                (layout::BINDING_ARGUMENTS, Binding::Buffer(&self.arguments)),
                (layout::BINDING_PARTIALS, Binding::Buffer(&self.partials)),
                (layout::BINDING_RAYS, Binding::Buffer(&self.rays)),
                (layout::BINDING_ANSWERS, Binding::Buffer(&self.answers)),
            ]
        };
        [shared(&self.hits), shared(&self.answers)]
    }

    /// Binds each step's kernel: to `common`, and to these buffers.
    pub fn bind<'a>(
        &'a self,
        pipelines: &'a [Pipeline],
        common: &[(u32, Binding<'a>)],
    ) -> Result<Vec<BoundKernel<'a>>> {
        let [usual, answering] = self.bindings();
        let bound = |(step, pipeline): (usize, &'a Pipeline)| {
            let own = if step == STAGED_ANY { &answering } else { &usual };
            pipeline.bind(&[common, own].concat())
        };
        pipelines.iter().enumerate().map(bound).collect()
    }

    fn all(&self) -> [&Buffer; 6] {
        [&self.hits, &self.list, &self.arguments, &self.partials, &self.rays, &self.answers]
    }
}

/// The step of `staged` that answers ambient rays.
const STAGED_ANY: usize = 4;

/// Records the ranges of one go over a band's samples.
pub struct Recorder<'a> {
    plan: &'a Plan<'a>,
    buffers: &'a Buffers,
    /// What the kernels keep for each pixel from range to range.
    pixel_hazards: Vec<Hazard<'a>>,
    /// The sample that every pixel comes to next; `None` where pixels are taken up again, each from its own.
    begins: Option<u32>,
    /// Pixels up to here may still be worked on, by this submit or the one before.
    busy_to: u32,
    /// Camera rays are traced with those first samples.
    traces_camera: bool,
}

impl<'a> Recorder<'a> {
    pub fn new(
        plan: &'a Plan<'a>,
        buffers: &'a Buffers,
        pixel_hazards: Vec<Hazard<'a>>,
        begins: Option<u32>,
    ) -> Self {
        let traces_camera = begins.is_none() || !buffers.hits_known.replace(true);
        if begins.is_none() {
            buffers.listed.set(None);
        }
        Self { plan, buffers, pixel_hazards, begins, busy_to: u32::MAX, traces_camera }
    }

    /// Records a range; returns how many camera rays it must begin, if that is known.
    pub fn record(
        &mut self,
        batch: &mut Batch<'a>,
        kernels: &'a [BoundKernel<'a>],
        range: &Range,
    ) -> Result<Option<u64>> {
        match (self.plan.settings.passes, kernels) {
            (Passes::Split, [primary, list, ambient, resolve]) => {
                self.record_split(batch, [primary, list, ambient], Some(resolve), range)
            }
            (Passes::Split, [primary, list, ambient]) => {
                self.record_split(batch, [primary, list, ambient], None, range)
            }
            (Passes::Staged, [camera, closest, list, rays, any, resolve]) => {
                self.record_staged(batch, [camera, closest, list, rays, any, resolve], range)
            }
            _ => Ok(self.record_single(batch, &kernels[0], range)),
        }
    }

    fn record_single(
        &mut self,
        batch: &mut Batch<'a>,
        kernel: &'a BoundKernel<'a>,
        range: &Range,
    ) -> Option<u64> {
        if range.pixel_begin < self.busy_to {
            batch.barrier(&self.pixel_hazards);
            self.busy_to = range.pixel_begin;
        }
        self.busy_to = self.busy_to.max(range.pixel_end);
        dispatch(batch, kernel, range);
        let starts_rays = range.stage == STAGE_BOTH
            || range.stage == STAGE_CLOSEST && range.triangle_end == self.plan.frame.triangle_count;
        // From the second dispatch on, pixels that hit nothing are passed over, and so are those that get no samples.
        let all_start = !self.plan.job.adaptive && (self.is_fresh(range) || !self.plan.marks_misses());
        if starts_rays && !all_start { None } else { self.camera_rays(range, starts_rays) }
    }

    fn record_split(
        &mut self,
        batch: &mut Batch<'a>,
        [primary, list, ambient]: [&'a BoundKernel<'a>; 3],
        resolve: Option<&'a BoundKernel<'a>>,
        range: &Range,
    ) -> Result<Option<u64>> {
        let Buffers { hits, partials, .. } = self.buffers;
        let span = range.pixel_end - range.pixel_begin;
        let samples = range.sample_end - range.sample_begin;
        let blocks = (self.buffers.room / u64::from(span)).clamp(1, u64::from(samples)) as u32;
        let block = samples.div_ceil(blocks).max(self.buffers.block);
        let range = Range { block, stride: span, ..*range };
        let fresh = self.is_fresh(&range);
        self.after_all(batch);
        if fresh || self.begins.is_none() {
            dispatch(
                batch,
                primary,
                &Range { stage: if fresh { STAGE_CLOSEST } else { STAGE_BOTH }, ..range },
            );
            batch.barrier(&[written(hits)]);
        }
        self.list_pixels(batch, list, &range);
        self.dispatch_list(batch, ambient, &range, 0)?;
        if let Some(resolve) = resolve {
            batch.barrier(&[written(partials)]);
            self.dispatch_list(batch, resolve, &range, PIXEL_SIZES)?;
        }
        Ok(self.camera_rays(&range, fresh))
    }

    fn record_staged(
        &mut self,
        batch: &mut Batch<'a>,
        [camera, closest, list, rays, any, resolve]: [&'a BoundKernel<'a>; 6],
        range: &Range,
    ) -> Result<Option<u64>> {
        let Buffers { hits, rays: ray_buffer, answers, .. } = self.buffers;
        let span = range.pixel_end - range.pixel_begin;
        let range = Range { block: 1, stride: span, ..*range };
        let fresh = self.is_fresh(&range);
        self.after_all(batch);
        if fresh || self.begins.is_none() {
            dispatch(batch, camera, &range);
            batch.barrier(&[written(ray_buffer)]);
            dispatch(batch, closest, &Range { stage: STAGE_CLOSEST, ..range });
            batch.barrier(&[written(ray_buffer), written(hits)]);
        }
        self.list_pixels(batch, list, &range);
        self.dispatch_list(batch, rays, &range, 0)?;
        batch.barrier(&[written(ray_buffer)]);
        // Rays are numbered by their place in the list, and so are the answers.
        let by_place = Range { pixel_begin: 0, pixel_end: span, pixel_base: 0, stage: STAGE_ANY, ..range };
        self.dispatch_list(batch, any, &by_place, 0)?;
        batch.barrier(&[written(answers)]);
        self.dispatch_list(batch, resolve, &range, PIXEL_SIZES)?;
        Ok(self.camera_rays(&range, fresh))
    }

    /// Whether the range holds the samples with which camera rays are traced.
    fn is_fresh(&self, range: &Range) -> bool {
        self.traces_camera && self.begins == Some(range.sample_begin)
    }

    /// The kernels of a range share their buffers with those of the one before.
    fn after_all(&self, batch: &mut Batch<'a>) {
        let mut hazards = self.pixel_hazards.clone();
        hazards.extend(self.buffers.all().map(written));
        batch.barrier(&hazards);
    }

    /// Makes the list, unless the one there is serves, which it does while no pixel is ahead of the others.
    fn list_pixels(&self, batch: &mut Batch<'a>, list: &'a BoundKernel<'a>, range: &Range) {
        let arguments = &self.buffers.arguments;
        let key = |range: &Range| {
            let samples = range.sample_end - range.sample_begin;
            (range.pixel_begin, range.pixel_end, samples, range.block)
        };
        // With later samples of the same go a pixel may lag behind, whose rays did not come to their end.
        let first = self.begins == Some(range.sample_begin);
        let same_for_all = !self.plan.job.adaptive;
        if first && same_for_all && self.buffers.listed.get().as_ref().map(key) == Some(key(range)) {
            return;
        }
        batch.barrier(&[
            Hazard::Buffer(arguments, Access::ShaderWrite, Access::TransferWrite),
            Hazard::Buffer(arguments, Access::IndirectRead, Access::TransferWrite),
        ]);
        batch.fill(arguments, 0);
        batch.barrier(&[Hazard::Buffer(arguments, Access::TransferWrite, Access::ShaderWrite)]);
        dispatch_by(batch, list, range, layout::LIST_SIZE);
        batch.barrier(&[
            written(&self.buffers.list),
            written(arguments),
            Hazard::Buffer(arguments, Access::ShaderWrite, Access::IndirectRead),
        ]);
        // A list of those that lag behind serves nobody else.
        self.buffers.listed.set(if first && same_for_all { Some(*range) } else { None });
    }

    fn dispatch_list(
        &self,
        batch: &mut Batch<'a>,
        kernel: &'a BoundKernel<'a>,
        range: &Range,
        offset: u64,
    ) -> Result<()> {
        let arguments = &self.buffers.arguments;
        batch.dispatch_indirect(kernel, bytemuck::bytes_of(range), arguments, offset, kernel.name())
    }

    fn camera_rays(&self, range: &Range, starts_rays: bool) -> Option<u64> {
        let inside = || self.plan.tiles.inside(range.pixel_begin, range.pixel_end);
        self.begins.map(|_| if starts_rays { inside() } else { 0 })
    }
}

/// One workgroup for every so many pixels of the range.
fn dispatch<'a>(batch: &mut Batch<'a>, kernel: &'a BoundKernel<'a>, range: &Range) {
    dispatch_by(batch, kernel, range, WORKGROUP_SIZE);
}

/// The same for kernels whose workgroups have another size.
fn dispatch_by<'a>(batch: &mut Batch<'a>, kernel: &'a BoundKernel<'a>, range: &Range, size: u32) {
    let groups = (range.pixel_end - range.pixel_begin).div_ceil(size);
    batch.dispatch(kernel, bytemuck::bytes_of(range), [groups, 1, 1], kernel.name());
}

/// Written (or read) by one kernel, used by the next.
fn written(buffer: &Buffer) -> Hazard<'_> {
    Hazard::Buffer(buffer, Access::ShaderWrite, Access::ShaderWrite)
}
