//! Passes: what it costs and saves to cut the work into kernels.

use super::{Evidence, Lab, Verdict, listed};
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::interleave::{Ratio, Variant};
use crate::layout::{self, Count};
use crate::render::choices::{Method, Passes, Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Accumulated;
use crate::render::plan::{Job, Plan, Tuning};
use crate::scene::Scene;

/// Rays of a frame in which several threads add to one pixel.
const RAYS_TO_ADD: u32 = 16;
/// A part of a frame's time that is worth talking of.
const VISIBLE: f64 = 0.05;

/// The threaded tree with these passes.
fn wishes(passes: Passes) -> Wishes {
    Wishes { method: Some(Method::Threaded), passes: Some(passes), ..Wishes::default() }
}

fn plan<'g>(lab: &Lab<'_>, scene: &Scene, geometry: &'g Geometry, passes: Passes) -> Result<Plan<'g>> {
    lab.plan(scene, geometry, &wishes(passes))
}

fn scenes<'l>(lab: &'l Lab<'_>) -> [(&'static str, &'l Scene); 2] {
    [("maison", &lab.maison), ("cornell", &lab.cornell)]
}

fn on_scenes(ratios: &[Ratio]) -> String {
    let parts: Vec<String> =
        ratios.iter().map(|ratio| format!("{} on {}", ratio.figure(), ratio.scene)).collect();
    listed(&parts)
}

/// Passes against one kernel, with camera rays in every frame.
pub fn split(lab: &Lab<'_>) -> Result<Evidence> {
    let mut ratios = Vec::new();
    for (name, scene) in scenes(lab) {
        let geometry = lab.geometry(scene, Preset::Auto, Builder::Sah)?;
        let variants = [
            Variant::new("split", plan(lab, scene, &geometry, Passes::Split)?).forgetting(),
            Variant::new("single", plan(lab, scene, &geometry, Passes::Single)?),
        ];
        ratios.push(lab.interleave(name, &variants)?.ratio(0, 1)?);
    }
    let verdict = Verdict::all(ratios.iter().map(|ratio| ratio.below(1.0)));
    let measured = format!("kernel time of split over single, frames of 4 rays: {}", on_scenes(&ratios));
    Ok(Evidence::new(verdict, measured).ratios(ratios))
}

/// Hits that are kept against hits that are found again.
pub fn kept_hits(lab: &Lab<'_>) -> Result<Evidence> {
    let mut ratios = Vec::new();
    for (name, scene) in scenes(lab) {
        let geometry = lab.geometry(scene, Preset::Auto, Builder::Sah)?;
        let split = || plan(lab, scene, &geometry, Passes::Split);
        let variants = [
            Variant::new("split, hits kept", split()?),
            Variant::new("split, hits found again", split()?).forgetting(),
        ];
        ratios.push(lab.interleave(name, &variants)?.ratio(0, 1)?);
    }
    let verdict = Verdict::all(ratios.iter().map(|ratio| ratio.below(1.0)));
    let measured = format!(
        "kernel time of frames of 4 rays with hits kept over hits found again: {}",
        on_scenes(&ratios)
    );
    Ok(Evidence::new(verdict, measured).ratios(ratios))
}

/// One, four and six kernels a frame, by the device's clock and by the host's; and the six with the host waiting for
/// each of them, which is what was feared.
pub fn round_trips(lab: &Lab<'_>) -> Result<Evidence> {
    let scene = &lab.cornell;
    let geometry = lab.geometry(scene, Preset::Auto, Builder::Sah)?;
    let waiting = Plan {
        tuning: Tuning { waits_between: true, ..Tuning::default() },
        ..plan(lab, scene, &geometry, Passes::Staged)?
    };
    let variants = [
        Variant::new("single", plan(lab, scene, &geometry, Passes::Single)?),
        Variant::new("split", plan(lab, scene, &geometry, Passes::Split)?).forgetting(),
        Variant::new("staged", plan(lab, scene, &geometry, Passes::Staged)?).forgetting(),
        Variant::new("staged, host waiting", waiting).forgetting(),
    ];
    let series = lab.interleave("cornell", &variants)?;
    let device = [series.ratio(1, 0)?, series.ratio(2, 0)?];
    let wall = [series.wall_ratio(1, 0)?, series.wall_ratio(2, 0)?];
    let feared = series.wall_ratio(3, 2)?;
    // What both clocks agree on is the kernels' own time; round trips are what the host's sees beyond that.
    let beyond = series.more_beyond_kernels(2, 0)?;
    let verdict = match beyond.ci95 {
        [low, _] if low > VISIBLE => Verdict::Holds,
        [_, high] if high < VISIBLE => Verdict::DoesNotHold,
        _ => Verdict::NotDecided,
    };
    let measured = format!(
        "time of split and staged over single on cornell: by the device's clock {} and {}, by the host's {} and {}; \
         outside its kernels staged spends {:.1}% [{:.1}, {:.1}] of a frame more than single ({:.0}% would be visible); \
         with the host waiting for each kernel, staged takes {} of its time by the host's clock",
        device[0].figure(),
        device[1].figure(),
        wall[0].figure(),
        wall[1].figure(),
        beyond.median * 100.0,
        beyond.ci95[0] * 100.0,
        beyond.ci95[1] * 100.0,
        VISIBLE * 100.0,
        feared.figure()
    );
    Ok(Evidence::new(verdict, measured)
        .number("beyond_kernels", beyond.median)
        .number("beyond_kernels_ci95", beyond.ci95.to_vec())
        .ratios(device)
        .ratios(wall)
        .ratios([feared]))
}

/// A thread a ray that adds to its pixel's counts atomically, against threads that write where no other writes; and
/// every escaped ray added to one place.
pub fn no_sync(lab: &Lab<'_>) -> Result<Evidence> {
    let scene = &lab.cornell;
    let geometry = lab.geometry(scene, Preset::Auto, Builder::Sah)?;
    let block = |plan, block| Plan { tuning: Tuning { block: Some(block), ..Tuning::default() }, ..plan };
    let split = || -> Result<Plan<'_>> {
        let job = Job { samples: 0..RAYS_TO_ADD, ..lab.job(scene, lab.smaller(2)) };
        let plan = lab.plan_job(job, scene, &geometry, &wishes(Passes::Split))?;
        Ok(plan.with_constant(layout::SPEC_SAMPLE_LANES, 1))
    };
    let accessor = split()?.accessor_name();
    let one = crate::kernels::find_kernel(&format!("ambient_list/threaded/one/{accessor}"))?;
    let mut to_one = block(split()?, RAYS_TO_ADD);
    to_one.kernels[2] = one;
    let atomic = split()?.with_adding_kernel(&format!("ambient_list/threaded/atomic/{accessor}"))?;
    let variants = [
        Variant::new("a thread a pixel", block(split()?, RAYS_TO_ADD)),
        Variant::new("a thread a ray, partial sums", block(split()?, 1)),
        Variant::new("a thread a ray, atomics", block(atomic, 1)),
        Variant::new("every ray added to one place", to_one),
    ];
    let series = lab.interleave("cornell", &variants)?;
    let ratios = [series.ratio(2, 1)?, series.ratio(2, 0)?, series.ratio(3, 0)?];
    let counts: Vec<u64> = series.accumulated.iter().map(escaped).collect();
    let equal = series.accumulated.iter().all(|other| *other == series.accumulated[0]);
    let verdict = Verdict::all([ratios[0].above(1.0), ratios[1].above(1.0)]);
    let measured = format!(
        "on cornell, frames of {RAYS_TO_ADD} rays, threads that add atomically to their pixel's counts take {} of the time \
         of threads with partial sums of their own and {} of that of a thread a pixel; adding each escaped ray to one \
         place takes {}; the counts are {}",
        ratios[0].figure(),
        ratios[1].figure(),
        ratios[2].figure(),
        if equal { "equal" } else { "not equal" }
    );
    Ok(Evidence::new(verdict, measured)
        .ratios(ratios)
        .number("counts_equal", equal)
        .number("escaped_rays", counts)
        .number("escaped_rays_in_one_place", series.totals[3].escaped))
}

fn escaped(accumulated: &Accumulated) -> u64 {
    let of = |count: &Count| u64::from(count.escaped0) + u64::from(count.escaped1);
    match accumulated {
        Accumulated::Counts(counts) => counts.iter().map(of).sum(),
        Accumulated::Means(_) => 0,
    }
}
