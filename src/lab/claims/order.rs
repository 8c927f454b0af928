//! The order in which a traversal goes through its tree, and what it keeps meanwhile.

use super::scenes::method;
use super::{Evidence, Lab, Verdict, listed};
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::interleave::Variant;
use crate::render::choices::{Method, Preset};
use crate::render::geometry::Geometry;
use crate::render::work::{RayWork, count_work};
use crate::scene::Scene;

/// Frames in which the entries that rays use are looked for.
const FRAMES: u32 = 4;

/// Entries of `stackN` that the rays of some frames really use: the smallest stack that none of them overflows.
fn entries_used(lab: &Lab<'_>, scene: &Scene, geometry: &Geometry) -> Result<u32> {
    let (mut too_few, mut enough) = (0, geometry.stack_bound.max(1));
    while enough - too_few > 1 {
        let middle = (too_few + enough) / 2;
        let plan = lab.plan(scene, geometry, &method(Preset::Auto, Method::Stack(middle)))?;
        let (_, totals) = lab.frames(&plan, if lab.quick { 1 } else { FRAMES })?;
        if totals.overflowed > 0 { too_few = middle } else { enough = middle }
    }
    Ok(enough)
}

/// Bounds of both stacks on several trees, the entries that rays use, and the time.
pub fn single_push(lab: &Lab<'_>) -> Result<Evidence> {
    let (mut bounds, mut halves, mut used, mut ratios) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut figures = Vec::new();
    for (name, scene) in [("maison", &lab.maison), ("cornell", &lab.cornell)] {
        for builder in [Builder::Midpoint, Builder::Sah] {
            let geometry = lab.geometry(scene, Preset::Auto, builder)?;
            let of_both = geometry.stack_bound;
            let of_one = geometry.stack_bound_of(Method::SinglePush);
            bounds.push(format!("{of_one} of {of_both} ({name}, {builder})"));
            figures.push(vec![of_one, of_both]);
            halves.push(Verdict::of(2 * of_one <= of_both + 1));
            if builder == Builder::Sah {
                let stack = Method::Stack(of_both.max(1));
                let both = entries_used(lab, scene, &geometry)?;
                // Both visit the same nodes in the same order; stackN pushes what single-push goes to at once.
                let one = both.saturating_sub(1);
                used.push(format!("{one} of {both} ({name}, {builder})"));
                let plan = |way| lab.plan(scene, &geometry, &method(Preset::Auto, way));
                let variants = [
                    Variant::new("single-push", plan(Method::SinglePush)?),
                    Variant::new(stack.to_string(), plan(stack)?),
                ];
                ratios.push(lab.interleave(name, &variants)?.ratio(0, 1)?);
            }
        }
    }
    let times: Vec<String> = ratios.iter().map(ToString::to_string).collect();
    let measured = format!(
        "entries that single-push can need of those that stackN can: {}; entries used (one fewer than stackN, whose nodes it visits in the same order): {}; time of {}",
        listed(&bounds),
        listed(&used),
        listed(&times)
    );
    Ok(Evidence::new(Verdict::all(halves), measured).ratios(ratios).number("stack_bounds", figures))
}

/// Two-child nodes against nodes with one box each, on the same trees.
pub fn both_children(lab: &Lab<'_>) -> Result<Evidence> {
    let mut ratios = Vec::new();
    for (name, scene) in [("maison", &lab.maison), ("cornell", &lab.cornell)] {
        let geometry = lab.geometry(scene, Preset::Auto, Builder::Sah)?;
        let plan = |way| lab.plan(scene, &geometry, &method(Preset::Auto, way));
        let stack = Method::Stack(geometry.stack_bound.max(1));
        let variants = [Method::Ordered, Method::SinglePush, stack]
            .into_iter()
            .map(|way| Ok(Variant::new(way.to_string(), plan(way)?)))
            .collect::<Result<Vec<_>>>()?;
        let series = lab.interleave(name, &variants)?;
        ratios.extend([series.ratio(0, 1)?, series.ratio(0, 2)?]);
    }
    let verdict = Verdict::all(ratios.iter().map(|ratio| ratio.below(1.0)));
    let times: Vec<String> = ratios.iter().map(ToString::to_string).collect();
    Ok(Evidence::new(verdict, format!("time of {}", listed(&times))).ratios(ratios))
}

/// Subgroups whose lanes are at work less than this have idle ones.
const BUSY: f64 = 0.9;

/// Lanes at work with leaves tested at once and with leaves that wait. The time is told beside it: boxes are tested in fewer operations
/// with `postponed`, too.
pub fn divergence(lab: &Lab<'_>) -> Result<Evidence> {
    let geometry = lab.geometry(&lab.maison, Preset::Auto, Builder::Sah)?;
    let plan = |way| lab.plan(&lab.maison, &geometry, &method(Preset::Auto, way));
    let variants = [
        Variant::new("postponed", plan(Method::Postponed)?),
        Variant::new("ordered", plan(Method::Ordered)?),
    ];
    let ratio = lab.interleave("maison", &variants)?.ratio(0, 1)?;
    let [postponed, ordered] =
        [count_work(lab.device, &variants[0].plan)?, count_work(lab.device, &variants[1].plan)?];
    let (Some(postponed), Some(ordered)) = (postponed, ordered) else {
        let measured = format!("this device lacks the subgroup operations that count lanes; time of {ratio}");
        return Ok(Evidence::new(Verdict::NotDecided, measured).ratios([ratio]));
    };
    let verdict = Verdict::all([
        Verdict::of(ordered.any.lanes < BUSY),
        Verdict::of(postponed.any.lanes > ordered.any.lanes),
    ]);
    let percent = |work: &RayWork| format!("{:.0}%", work.lanes * 100.0);
    let measured = format!(
        "of a subgroup's lanes {} are at work with ordered and {} with postponed for ambient rays on maison, {} and {} for \
         camera rays; time of {ratio}",
        percent(&ordered.any),
        percent(&postponed.any),
        percent(&ordered.closest),
        percent(&postponed.closest)
    );
    Ok(Evidence::new(verdict, measured)
        .ratios([ratio])
        .number("lanes_any", vec![ordered.any.lanes, postponed.any.lanes])
        .number("lanes_closest", vec![ordered.closest.lanes, postponed.closest.lanes]))
}
