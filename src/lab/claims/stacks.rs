//! What a stack costs, and what does without one.

use super::scenes::method;
use super::{Evidence, Lab, Verdict, listed};
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::interleave::{Ratio, Variant, digits};
use crate::layout::{FRAME_SAMPLES, SPEC_STACK_ROOM};
use crate::render::choices::{Method, Preset};
use crate::render::geometry::Geometry;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::Plan;
use crate::render::stage;
use crate::scene::Scene;
use crate::vk::PipelineStatistics;

/// A threaded tree that takes no longer than this times a small stack's time is as fast.
const AS_FAST: f64 = 1.05;

/// `stackN` whose array is exactly as long as its stack, as the original's was.
fn exact<'g>(lab: &Lab<'_>, scene: &Scene, geometry: &'g Geometry, entries: u32) -> Result<Variant<'g>> {
    let plan = lab.plan(scene, geometry, &method(Preset::Original, Method::Stack(entries)))?;
    Ok(Variant::new(format!("stack{entries}"), plan.with_constant(SPEC_STACK_ROOM, entries)))
}

/// Pixels whose 8-bit means differ.
fn pixels_apart(a: &Accumulated, b: &Accumulated, plan: &Plan<'_>) -> usize {
    let light = |accumulated| Picture::new(plan.tiles, accumulated).light;
    light(a).iter().zip(&light(b)).filter(|(a, b)| a != b).count()
}

/// Stacks of several sizes on the house, which overflows the small ones, and on the Cornell box, which does not.
pub fn small_stack(lab: &Lab<'_>) -> Result<Evidence> {
    let geometry = lab.geometry(&lab.maison, Preset::Original, Builder::Midpoint)?;
    let small = lab.geometry(&lab.cornell, Preset::Original, Builder::Midpoint)?;
    let padded = lab.plan(&lab.maison, &geometry, &method(Preset::Original, Method::Stack(16)))?;
    let mut variants = Vec::new();
    for entries in [64, 32, 24, 16] {
        variants.push(exact(lab, &lab.maison, &geometry, entries)?);
    }
    variants.push(Variant::new("stack16 in an array of 32", padded));
    let house = lab.interleave("maison", &variants)?;
    let ratios = (1..variants.len()).map(|which| house.ratio(which, 0)).collect::<Result<Vec<_>>>()?;
    let totals = &house.totals[3];
    // The original traces a pixel's ambient rays even where its camera ray hits nothing.
    let rays = u64::from(lab.size.0) * u64::from(lab.size.1) * u64::from((1 + FRAME_SAMPLES) * house.frames);
    let per_million = totals.overflowed as f64 * 1e6 / rays.max(1) as f64;
    let changed = pixels_apart(&house.accumulated[3], &house.accumulated[0], &variants[0].plan);
    let box_variants = [exact(lab, &lab.cornell, &small, 64)?, exact(lab, &lab.cornell, &small, 16)?];
    let fits = lab.interleave("cornell", &box_variants)?.ratio(1, 0)?;
    // Where a stack overflows, what is lost is saved time as well; those do not decide.
    let complete = ratios[..3].iter().zip(&house.totals[1..4]).filter(|(_, totals)| totals.overflowed == 0);
    let verdict = Verdict::all(complete.map(|(ratio, _)| ratio.below(1.0)).chain([fits.below(1.0)]));
    let parts: Vec<String> =
        ratios.iter().map(|ratio| format!("{} {}", ratio.over, ratio.figure())).collect();
    let measured = format!(
        "time over stack64 on maison, arrays as long as the stacks: {}; there stack16 overflowed in {} of a million rays \
         (this tree can need {}) and changed {changed} pixels; on cornell, which needs at most {}, stack16 over stack64: {}",
        listed(&parts),
        digits(per_million),
        geometry.stack_bound,
        small.stack_bound,
        fits.figure()
    );
    Ok(Evidence::new(verdict, measured)
        .number("overflowed_rays", totals.overflowed)
        .number("overflowed_per_million", per_million)
        .number("pixels_changed", changed)
        .number("stack_bound", geometry.stack_bound)
        .ratios(ratios)
        .ratios([fits]))
}

/// Statistics of a plan's first kernel, if the device tells any.
fn told(lab: &Lab<'_>, plan: &Plan<'_>) -> Result<Option<PipelineStatistics>> {
    Ok(stage::statistics(lab.device, plan)?.into_iter().next())
}

fn words(statistics: &PipelineStatistics) -> String {
    let said = |value: Option<u32>, unit: &str| value.map_or(format!("? {unit}"), |n| format!("{n} {unit}"));
    format!(
        "{} and {}",
        said(statistics.registers, "registers"),
        said(statistics.stack_bytes, "bytes of stack")
    )
}

/// stack64 and the threaded tree on the house: what the compiler gave them, and the time.
pub fn stack_cost(lab: &Lab<'_>) -> Result<Evidence> {
    let geometry = lab.geometry(&lab.maison, Preset::Original, Builder::Midpoint)?;
    let plan = |way| lab.plan(&lab.maison, &geometry, &method(Preset::Original, way));
    let variants = [
        Variant::new("stack64", plan(Method::Stack(64))?),
        Variant::new("threaded", plan(Method::Threaded)?),
    ];
    let statistics = [told(lab, &variants[0].plan)?, told(lab, &variants[1].plan)?];
    let ratio = lab.interleave("maison", &variants)?.ratio(0, 1)?;
    let [Some(stack), Some(threaded)] = statistics else {
        let measured = format!(
            "this device does not tell registers (VK_KHR_pipeline_executable_properties is missing); time of {ratio}"
        );
        return Ok(Evidence::new(Verdict::NotDecided, measured).ratios([ratio]));
    };
    let verdict = match (stack.registers, threaded.registers) {
        (Some(stack), Some(threaded)) => Verdict::of(stack > threaded),
        _ => Verdict::NotDecided,
    };
    let measured = format!("stack64 has {}, threaded {}; time of {ratio}", words(&stack), words(&threaded));
    Ok(Evidence::new(verdict, measured)
        .ratios([ratio])
        .number("registers", vec![stack.registers, threaded.registers])
        .number("stack_bytes", vec![stack.stack_bytes, threaded.stack_bytes]))
}

/// The threaded tree and small stacks on the same tree, on both scenes.
pub fn threaded(lab: &Lab<'_>) -> Result<Evidence> {
    let mut ratios: Vec<Ratio> = Vec::new();
    let mut memory = None;
    let scenes: [(&str, &Scene); 2] = [("maison", &lab.maison), ("cornell", &lab.cornell)];
    for (name, scene) in scenes {
        let geometry = lab.geometry(scene, Preset::Original, Builder::Midpoint)?;
        let plan = lab.plan(scene, &geometry, &method(Preset::Original, Method::Threaded))?;
        if memory.is_none() {
            memory = told(lab, &plan)?.and_then(|statistics| statistics.stack_bytes);
        }
        let variants = [
            Variant::new("threaded", plan),
            exact(lab, scene, &geometry, 16)?,
            exact(lab, scene, &geometry, 32)?,
        ];
        let series = lab.interleave(name, &variants)?;
        ratios.extend([series.ratio(0, 1)?, series.ratio(0, 2)?]);
    }
    let said = match memory {
        Some(bytes) => format!("the compiler gave it {bytes} bytes of stack"),
        None => "by its design it has no stack (this device does not tell)".to_string(),
    };
    let no_memory = memory.map(|bytes| Verdict::of(bytes == 0));
    let verdict = Verdict::all(ratios.iter().map(|ratio| ratio.below(AS_FAST)).chain(no_memory));
    let parts: Vec<String> =
        ratios.iter().map(|ratio| format!("{} on {} {}", ratio.under, ratio.scene, ratio.figure())).collect();
    let measured = format!(
        "{said}; its time over that of {}, where up to {} counts as equal",
        listed(&parts),
        digits(AS_FAST)
    );
    Ok(Evidence::new(verdict, measured).ratios(ratios).number("stack_bytes", memory))
}
