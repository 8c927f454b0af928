//! What rows of a view have in common: plans, their arrays, the fields of a row that every kind of rays fills in.

use super::rows::{Row, Spec};
use super::{Bench, Case};
use crate::error::Result;
use crate::kernels::NodeLayout;
use crate::lab::statistics::Median;
use crate::layout::{self, FRAME_SAMPLES};
use crate::render::auto;
use crate::render::choices::{Accumulator, Passes, Preset};
use crate::render::geometry::Geometry;
use crate::render::plan::{Job, Plan};
use crate::render::rounds::Goal;

/// A row's plan. The original traces its own number of rays a frame.
pub fn plan_of<'a>(
    bench: &Bench<'_>,
    case: &Case<'a>,
    spec: &Spec,
    geometry: &'a Geometry,
) -> Result<Plan<'a>> {
    plan_sized(bench, case, spec, geometry, bench.options.size)
}

/// The same for a picture of another size.
pub fn plan_sized<'a>(
    bench: &Bench<'_>,
    case: &Case<'a>,
    spec: &Spec,
    geometry: &'a Geometry,
    size: (u32, u32),
) -> Result<Plan<'a>> {
    let scene = &case.subject.scene;
    let decision = auto::decide(&spec.wishes(), geometry, bench.device.adapter());
    let job = Job {
        camera: case.view.camera_for(scene),
        size,
        samples: 0..if spec.preset == Preset::Original { FRAME_SAMPLES } else { bench.options.spp },
        seed: bench.options.seed,
        max_distance: None,
        jitters: 1,
        adaptive: false,
        goal: Goal::Samples,
        block: None,
    };
    let plan = Plan::new(job, scene, geometry, &decision, &bench.device.adapter().limits)?;
    // Every frame is timed with all its camera rays.
    Ok(plan.with_constant(layout::SPEC_MARKS_MISSES, 0))
}

/// What a row tells before anything was measured.
pub fn blank_row(case: &Case<'_>, spec: &Spec, plan: &Plan<'_>, order: usize) -> Row {
    Row {
        order,
        scene: case.subject.name.clone(),
        scene_hash: format!("{:016x}", case.subject.scene.hash),
        triangles: case.subject.scene.mesh.triangles.len(),
        view: case.view.name.clone(),
        preset: spec.preset.name(),
        method: spec.method.to_string(),
        builder: spec.builder.name(),
        passes: spec.passes.name(),
        query: None,
        api: "vulkan",
        accessor: plan.accessor_name(),
        spp: plan.job.samples.len() as u32,
        frames: 0,
        rays_per_frame: 0,
        subset: None,
        gpu_ms_median: 0.0,
        gpu_ms_ci95: [0.0; 2],
        first_frame_ms: None,
        traversal_ms: None,
        mrays_per_s: 0.0,
        max_stack: plan.stack_bound(),
        overflowed_rays: 0,
        mismatched_pixels: None,
        build_ms: plan.geometry.tree_ms(),
        tree: *plan.geometry.quality(),
        bvh_bytes: 0,
        registers: None,
        stack_bytes: None,
        closest: None,
        any: None,
    }
}

/// Fills in what the times of frames tell. `rays`: of a frame, of those that ran; `share`: they are this share of all.
pub fn set_times(row: &mut Row, times: &[f64], rays: u64, share: f64) {
    row.frames = times.len();
    row.rays_per_frame = (rays as f64 / share).round() as u64;
    row.subset = (share < 1.0).then_some(share);
    if let Some(Median { median, ci95 }) = Median::of(times) {
        row.gpu_ms_median = median / share;
        row.gpu_ms_ci95 = ci95.map(|end| end / share);
        row.mrays_per_s = if median > 0.0 { rays as f64 / median * 1e-3 } else { 0.0 };
    }
}

/// Bytes of the nodes on a device, given those of their buffer, which is there even where nothing reads it.
pub fn bvh_bytes(plan: &Plan<'_>, buffer_bytes: u64) -> u64 {
    if matches!(plan.node_layout(), NodeLayout::None | NodeLayout::Faces) { 0 } else { buffer_bytes }
}

/// Device memory that a row needs, about: scene and what it keeps for each pixel (`band.rs`, `passes.rs`).
pub fn row_bytes(plan: &Plan<'_>) -> u64 {
    let pixels = plan.tiles.padded_pixels();
    let room = (pixels * plan.job.samples.len() as u64).clamp(pixels, pixels.max(1 << 21));
    let per_pixel = 20
        + if plan.brute() { 32 } else { 0 }
        + if plan.settings.accumulator == Accumulator::Count { 0 } else { 16 };
    let passes = match plan.settings.passes {
        Passes::Single => 0,
        Passes::Split => 32 * pixels + 16 * room,
        Passes::Staged => 32 * pixels + 48 * room,
    };
    let nodes = plan.node_array_bytes();
    pixels * per_pixel + passes + nodes + plan.triangle_bytes().len() as u64
}

/// Cuts rows into groups of at most `most` bytes together; each has at least one.
pub fn groups<T>(rows: Vec<T>, most: u64, bytes: impl Fn(&T) -> u64) -> Vec<Vec<T>> {
    let mut groups: Vec<Vec<T>> = Vec::new();
    let mut taken = 0;
    for row in rows {
        let needed = bytes(&row);
        match groups.last_mut() {
            Some(group) if taken + needed <= most => {
                taken += needed;
                group.push(row);
            }
            _ => {
                taken = needed;
                groups.push(vec![row]);
            }
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_hold_what_fits_and_lose_nothing() {
        let cut = groups(vec![5u64, 5, 1, 30, 2, 8, 1], 10, |bytes| *bytes);
        assert_eq!(cut, [vec![5, 5], vec![1], vec![30], vec![2, 8], vec![1]]);
    }
}
