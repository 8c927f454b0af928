//! One list of rays traced again and again, with everything in place: what a benchmark of lists of rays times.

use std::time::Instant;

use super::auto;
use super::plan::{Plan, accessor_of};
use super::raylist::{MOST_RAYS, Query, check_finished, range_of, reach_of, trace_kernel};
use super::repeat::FrameCost;
use super::stage::Uploaded;
use super::tally::{KernelTime, Totals};
use crate::error::Result;
use crate::kernels::Kernel;
use crate::layout::{
    self, BINDING_COUNTERS, BINDING_FRAME, BINDING_HITS, BINDING_NODES, BINDING_RAYS, BINDING_TRIANGLES,
    COUNTER_SLOTS, Counters, HitRecord, Range, RayRecord,
};
use crate::vk::{Access, Batch, Binding, Buffer, BufferUse, Device, Hazard, Pipeline, PipelineStatistics};

/// Rays on a device, in pieces of one dispatch each.
pub struct RaySet {
    pieces: Vec<Piece>,
    rays: u64,
    /// The largest coordinate of an origin.
    reach: f64,
}

struct Piece {
    rays: Buffer,
    /// Records, those that stand where there is no ray included.
    count: u32,
    /// Rays among them.
    asked: u64,
}

impl RaySet {
    pub fn new(device: &Device, rays: &[RayRecord]) -> Result<Self> {
        let reach = reach_of(rays);
        let mut pieces = Vec::new();
        for piece in rays.chunks(MOST_RAYS) {
            pieces.push(Piece {
                rays: Buffer::with_content(device, "rays", BufferUse::Storage, bytemuck::cast_slice(piece))?,
                count: piece.len() as u32,
                asked: piece.iter().filter(|ray| ray.t_max >= 0.0).count() as u64,
            });
        }
        let rays = pieces.iter().map(|piece| piece.asked).sum();
        Ok(Self { pieces, rays, reach })
    }

    /// How many rays there are.
    pub fn rays(&self) -> u64 {
        self.rays
    }
}

/// A plan's method, its scene and a list of rays.
pub struct Retraced<'a> {
    device: &'a Device,
    plan: &'a Plan<'a>,
    query: Query,
    set: &'a RaySet,
    uploaded: Uploaded,
    kernel: &'static Kernel,
    pipeline: Pipeline,
    frame: Buffer,
    counters: Buffer,
    /// Of each piece.
    hits: Vec<Buffer>,
}

impl<'a> Retraced<'a> {
    /// `uploaded` must be the plan's, and the rays within its reach.
    pub fn new(
        device: &'a Device,
        plan: &'a Plan<'a>,
        uploaded: Uploaded,
        set: &'a RaySet,
        query: Query,
    ) -> Result<Self> {
        plan.check_reach(set.reach, query == Query::Any)?;
        let kernel = trace_kernel(plan)?;
        auto::check_subgroup(kernel, device.adapter())?;
        let hits = |piece: &Piece| {
            let bytes = u64::from(piece.count) * size_of::<HitRecord>() as u64;
            Buffer::new(device, "hits", BufferUse::Storage, bytes)
        };
        let slots = u64::from(COUNTER_SLOTS) * size_of::<Counters>() as u64;
        Ok(Self {
            pipeline: Pipeline::new(device, kernel, &plan.constants, size_of::<Range>() as u32)?,
            frame: uploaded.frame(device, plan)?,
            counters: Buffer::new(device, "counters", BufferUse::Storage, slots)?,
            hits: set.pieces.iter().map(hits).collect::<Result<_>>()?,
            device,
            plan,
            query,
            set,
            uploaded,
            kernel,
        })
    }

    /// Traces all rays. Fails if one does not come to its end.
    pub fn frame(&mut self) -> Result<FrameCost> {
        let mut cost = FrameCost { kernels: Vec::new(), totals: Totals::default(), repeats: 0 };
        let mut time = KernelTime { name: self.kernel.name.to_string(), gpu_ms: 0.0, dispatches: 0 };
        for (piece, hits) in self.set.pieces.iter().zip(&self.hits) {
            let (totals, ms) = self.dispatch(piece, hits)?;
            check_finished(self.kernel.name, piece.asked, totals.primary_finished + totals.ambient_finished)?;
            cost.totals.add(&totals);
            time.gpu_ms += ms;
            time.dispatches += 1;
        }
        cost.kernels.push(time);
        Ok(cost)
    }

    /// What the rays hit, in their order, once [`Self::frame`] has run.
    pub fn hits(&self) -> Result<Vec<HitRecord>> {
        let mut all = Vec::new();
        for hits in &self.hits {
            all.extend(bytemuck::pod_collect_to_vec::<u8, HitRecord>(&hits.read(self.device)?));
        }
        Ok(all)
    }

    /// The name of the accessor by which the rays' kernel reads.
    pub fn accessor_name(&self) -> &'static str {
        accessor_of(&[self.kernel], self.plan.accessor).name()
    }

    /// What the driver's compiler tells of the kernel, compiled for this alone.
    pub fn statistics(&self) -> Result<Option<PipelineStatistics>> {
        if !self.device.adapter().features.contains(&("pipeline statistics", true)) {
            return Ok(None);
        }
        let push_bytes = size_of::<Range>() as u32;
        Pipeline::with_statistics(self.device, self.kernel, &self.plan.constants, push_bytes)?.statistics()
    }

    fn dispatch(&self, piece: &Piece, hits: &Buffer) -> Result<(Totals, f64)> {
        let geometry =
            |buffer| if self.plan.texels() { Binding::Texels(buffer) } else { Binding::Buffer(buffer) };
        let bound = self.pipeline.bind(&[
            (BINDING_FRAME, Binding::Buffer(&self.frame)),
            (BINDING_NODES, geometry(&self.uploaded.nodes)),
            (BINDING_TRIANGLES, geometry(&self.uploaded.triangles)),
            (BINDING_COUNTERS, Binding::Buffer(&self.counters)),
            (BINDING_RAYS, Binding::Buffer(&piece.rays)),
            (BINDING_HITS, Binding::Buffer(hits)),
        ])?;
        let mut batch = Batch::new(self.device, 1)?;
        batch.fill(&self.counters, 0);
        batch.barrier(&[
            Hazard::Buffer(&self.counters, Access::TransferWrite, Access::ShaderWrite),
            Hazard::Buffer(hits, Access::ShaderWrite, Access::ShaderWrite),
        ]);
        let range = range_of(self.plan, piece.count, 0, self.query.stage());
        let groups = piece.count.div_ceil(layout::WORKGROUP_SIZE);
        batch.dispatch(&bound, bytemuck::bytes_of(&range), [groups, 1, 1], self.kernel.name);
        let start = Instant::now();
        batch.submit()?;
        let finished = batch.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let ms = finished.timings.first().and_then(|timing| timing.gpu_ms).unwrap_or(wall_ms);
        let counters: Vec<Counters> = bytemuck::pod_collect_to_vec(&self.counters.read(self.device)?);
        Ok((Totals::of(&counters), ms))
    }
}
