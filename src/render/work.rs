//! What the traversals of a plan cost: node visits and triangle tests of each pixel's rays, and how full the device's
//! subgroups were. A kernel of its own counts, so that nothing is left of it in those that are timed.

use super::auto;
use super::band::Band;
use super::choices::{Accumulator, Passes, Settings};
use super::execute::bands;
use super::plan::{Plan, kernel_by, traversal_name};
use super::stage::Stage;
use super::tally::Tally;
use crate::error::Result;
use crate::layout::Work;
use crate::vk::Device;

/// What rays of one kind cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct RayWork {
    /// Nodes visited per ray.
    pub visits: f64,
    /// Triangles tested per ray.
    pub tests: f64,
    /// Share of a subgroup's lanes that take part in a visit or test, in (0, 1]; 0 without any.
    pub lanes: f64,
}

/// What a render's rays cost.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkCount {
    /// By pixel number (tile by tile). A pixel's closest hit is found once for each dispatch that takes up its samples,
    /// and counts each time.
    pub pixels: Vec<Work>,
    /// How many camera rays were traced.
    pub camera_rays: u64,
    /// Of the camera rays, as often as they were traced.
    pub closest: RayWork,
    /// Of the ambient rays.
    pub any: RayWork,
    /// How often pixels' work had to be taken up again (a driver's loop limit). What the rays that were begun anew had
    /// cost until then is counted too, so only with 0 are the figures exact.
    pub repeats: u32,
}

/// Renders the plan's samples once with the kernel that counts for its method and accessor, in one pass whatever the
/// plan's are. `None` where the device does not have the subgroup operations that counting needs.
pub fn count_work(device: &Device, plan: &Plan<'_>) -> Result<Option<WorkCount>> {
    let kernel = kernel_by(&format!("work/{}", traversal_name(&plan.settings)), plan.accessor)?;
    if auto::check_subgroup(kernel, device.adapter()).is_err() {
        return Ok(None);
    }
    let settings = Settings { passes: Passes::Single, accumulator: Accumulator::Count, ..plan.settings };
    let plan = Plan { settings, kernels: vec![kernel], ..plan.clone() };
    let stage = Stage::new(device, &plan)?;
    let mut ignore = |_: &_| {};
    let mut tally = Tally::new(&plan, &mut ignore);
    let mut pixels: Vec<Work> = Vec::new();
    for (begin, end) in bands(&plan, device) {
        let band = Band::new(&stage, begin, end)?;
        band.render(plan.job.samples.clone(), &mut tally)?;
        pixels.extend(band.work()?);
    }
    Ok(Some(WorkCount {
        closest: ray_work(&pixels, tally.totals.primary_finished, |work| {
            [work.closest_visits, work.closest_tests, work.closest_group_steps]
        }),
        any: ray_work(&pixels, tally.totals.ambient_finished, |work| {
            [work.any_visits, work.any_tests, work.any_group_steps]
        }),
        pixels,
        camera_rays: tally.totals.primary_finished,
        repeats: tally.repeats,
    }))
}

/// `fields`: visits, tests and the subgroup's steps.
fn ray_work(pixels: &[Work], rays: u64, fields: impl Fn(&Work) -> [u32; 3]) -> RayWork {
    let sum = |field: usize| pixels.iter().map(|work| u64::from(fields(work)[field])).sum::<u64>() as f64;
    let [visits, tests, steps] = [sum(0), sum(1), sum(2)];
    let rays = rays.max(1) as f64;
    let size = pixels.iter().map(|work| work.subgroup_size).max().unwrap_or(0);
    let lanes = if steps > 0.0 { (visits + tests) / (f64::from(size) * steps) } else { 0.0 };
    RayWork { visits: visits / rays, tests: tests / rays, lanes }
}
