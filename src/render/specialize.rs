//! What kernels are specialized for: the constants that a driver compiles in, from the choices, the scene and the job.

use super::auto::Decision;
use super::choices::{Accumulator, Intersector, Method, Offset, Passes, Preset, Sampler, Settings, Slabs};
use super::geometry::Geometry;
use super::invocations::lanes_of;
use super::plan::Job;
use super::rounds::Goal;
use crate::kernels::NodeLayout;
use crate::layout::{self, Frame};
use crate::pack;

/// Arrays shorter than this are put into registers by NVIDIA's compiler: stack16 took 2.3 times as long as
/// stack32 on an H100.
const SHORTEST_STACK_ARRAY: u32 = 32;

/// Of all kernels of a plan: (id, value).
pub fn constants(
    job: &Job,
    settings: &Settings,
    geometry: &Geometry,
    decision: &Decision,
    frame: &Frame,
) -> Vec<(u32, u32)> {
    let bound = geometry.stack_bound_of(settings.method);
    let stack_entries = if let Method::Stack(entries) = settings.method { entries } else { bound.max(1) };
    let original = settings.preset.is_original();
    let mut constants = vec![
        (layout::SPEC_STACK_SIZE, stack_entries),
        (layout::SPEC_STACK_ROOM, stack_entries.max(SHORTEST_STACK_ARRAY)),
        (layout::SPEC_SAMPLER, sampler_code(settings.sampler)),
        (layout::SPEC_ORIGINAL, u32::from(original)),
        (layout::SPEC_ROBUST_SLABS, u32::from(settings.slabs == Slabs::Robust)),
        (layout::SPEC_WATERTIGHT, u32::from(settings.intersector == Intersector::Watertight)),
        (layout::SPEC_CONSERVATIVE, u32::from(settings.intersector == Intersector::Conservative)),
        (layout::SPEC_LEAF_SIZE, geometry.largest_leaf_of(settings.method)),
        (layout::SPEC_FACING, u32::from(settings.preset != Preset::Original)),
        (layout::SPEC_REPEAT, 0),
        (layout::SPEC_MARKS_MISSES, 1),
        (layout::SPEC_SAMPLE_LANES, lanes_of(settings, job.samples.len() as u32, decision.sample_lanes)),
        (layout::SPEC_ULP_OFFSET, u32::from(settings.offset == Offset::Ulp)),
        (layout::SPEC_COMPACT, u32::from(takes_compact_nodes(settings, geometry))),
        (layout::SPEC_LEAVES_LOOPS, u32::from(decision.leaves_loops)),
        (layout::SPEC_BOUNDED, u32::from(frame.ambient_t_max < f32::MAX)),
    ];
    constants.extend(constants_of_job(job, settings));
    constants
}

/// Those that follow from what a plan is asked for beside the choices.
pub fn constants_of_job(job: &Job, settings: &Settings) -> [(u32, u32); 3] {
    [
        (layout::SPEC_JITTERED, u32::from(job.jitters > 1)),
        (layout::SPEC_BUDGETS, u32::from(job.adaptive)),
        (layout::SPEC_CELLS, sobol_cells(job, settings.accumulator)),
    ]
}

/// From so many bytes of nodes on `entry` reads compact ones: they save caches, but take a few operations more to read (measured on an H100 at 64 samples,
/// by `split` with stealing: 1.04 to 1.10 times the rate on terrains of 20,000 to 600,000 triangles, 1.19 on 300,000 leaves of trees, 1.01 to 1.03 on a mesh of 70,000, 0.98 to 0.99 on the
/// arcade of 260,000, on maison and on Cornell; by `single` at 4 samples 1.13 with 70,000 triangles, 1.09 to 1.15 with 260,000, 0.96 with 5,456).
const COMPACT_FROM: u64 = 2 << 20;
/// So does `postponed` in one kernel; by `split` it does from so many on ...
const COMPACT_FROM_POSTPONED: u64 = 24 << 20;
/// ... or from this SAH cost on, where rays visit many nodes (there, at 64 samples on the hairball of 770,000 triangles, of cost 189: 1.08 times with `entry`, 1.07 with
/// `postponed`; of cost 58, 0.94 times with `postponed`).
const COMPACT_FROM_COST: f64 = 100.0;

fn takes_compact_nodes(settings: &Settings, geometry: &Geometry) -> bool {
    if !settings.method.fuses_boxes() {
        return false;
    }
    let bytes = pack::node_array_bytes(NodeLayout::Centred, &geometry.tree, geometry.collapsed());
    let always = settings.method == Method::Entry || settings.passes == Passes::Single;
    bytes >= COMPACT_FROM_POSTPONED
        || bytes >= COMPACT_FROM && (always || geometry.quality().sah_cost >= COMPACT_FROM_COST)
}

/// Bits of the cells in whose order the job's samples are taken, where all of them are one go and one net.
fn sobol_cells(job: &Job, accumulator: Accumulator) -> u32 {
    let samples = job.samples.len() as u32;
    let one_go = job.goal == Goal::Samples && !job.adaptive && accumulator == Accumulator::Count;
    if one_go && samples.is_power_of_two() && job.samples.start.is_multiple_of(samples) {
        samples.ilog2().saturating_sub(1).min(layout::SOBOL_CELL_BITS)
    } else {
        layout::ANY_CELLS
    }
}

/// As the kernels know it.
pub fn sampler_code(sampler: Sampler) -> u32 {
    match sampler {
        Sampler::Lcg => layout::SAMPLER_LCG,
        Sampler::Pcg => layout::SAMPLER_PCG,
        Sampler::Sobol => layout::SAMPLER_SOBOL,
        Sampler::Strata => layout::SAMPLER_STRATA,
        Sampler::Philox => layout::SAMPLER_PHILOX,
    }
}
