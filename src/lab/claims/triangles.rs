//! How many triangles a tree needs to pay.

use super::scenes::{method, with_triangles};
use super::{Evidence, Lab, Verdict, listed};
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::lab::interleave::{Variant, digits};
use crate::render::choices::{Method, Preset};
use crate::render::geometry::Geometry;

/// The time of a frame at 30 frames a second, ms.
const REAL_TIME_MS: f64 = 1000.0 / 30.0;
/// Pixels of the original's window.
const WINDOW: f64 = 1024.0 * 640.0;
/// Triangles with which brute force is compared with trees.
const COUNTS: [usize; 5] = [8, 16, 32, 64, 128];

/// Brute force and two trees on the house, with the original's kernels.
pub fn tree(lab: &Lab<'_>) -> Result<Evidence> {
    let scene = &lab.maison;
    let size = lab.smaller(4);
    let geometry = lab.geometry(scene, Preset::Original, Builder::Midpoint)?;
    let plan =
        |size, way| lab.plan_job(lab.job(scene, size), scene, &geometry, &method(Preset::Original, way));
    let series = lab.interleave(
        "maison",
        &[
            Variant::new("brute", plan(size, Method::Brute)?),
            Variant::new("threaded", plan(size, Method::Threaded)?),
            Variant::new("stack64", plan(size, Method::Stack(64))?),
        ],
    )?;
    let ratios = [series.ratio(0, 1)?, series.ratio(0, 2)?];
    // A picture of few pixels does not fill a device; brute force alone takes too long for more.
    let alone = [Variant::new("threaded", plan(lab.size, Method::Threaded)?)];
    let tree_ms = lab.interleave("maison", &alone)?.frame_ms(0)? * scale(lab.size);
    let brute_ms = series.frame_ms(0)? * scale(size);
    let scaled = if scale(size) == 1.0 {
        String::new()
    } else {
        format!(" (scaled by the pixels from {}x{} and {}x{})", size.0, size.1, lab.size.0, lab.size.1)
    };
    let verdict =
        Verdict::all([ratios[0].above(1.0), ratios[1].above(1.0), Verdict::of(brute_ms > REAL_TIME_MS)]);
    let measured = format!(
        "time of {}, over stack64 {}; a frame of 4 rays at 1024x640 takes {} ms by brute force and {} ms with the \
         threaded tree{scaled}, where real-time is {} ms",
        ratios[0],
        ratios[1].figure(),
        digits(brute_ms),
        digits(tree_ms),
        digits(REAL_TIME_MS)
    );
    Ok(Evidence::new(verdict, measured)
        .ratios(ratios)
        .number("brute_frame_ms", brute_ms)
        .number("threaded_frame_ms", tree_ms)
        .number("real_time_ms", REAL_TIME_MS))
}

/// Pixels of the original's window over those of a picture of this size.
fn scale((width, height): (u32, u32)) -> f64 {
    WINDOW / (f64::from(width) * f64::from(height))
}

/// Brute force and every other method on the Cornell box; then at which number of triangles brute force stops winning.
pub fn few_triangles(lab: &Lab<'_>) -> Result<Evidence> {
    let geometry = lab.geometry(&lab.cornell, Preset::Auto, Builder::Sah)?;
    let mut variants = Vec::new();
    for way in Method::all(geometry.stack_bound.max(1)) {
        match lab.plan(&lab.cornell, &geometry, &method(Preset::Auto, way)) {
            Ok(plan) => variants.push(Variant::new(way.to_string(), plan)),
            // A method that this device can't run is no part of the comparison.
            Err(Error::Usage(_) | Error::Device(_)) => {}
            Err(error) => return Err(error),
        }
    }
    let series = lab.interleave("cornell", &variants)?;
    let ratios = (1..variants.len()).map(|other| series.ratio(0, other)).collect::<Result<Vec<_>>>()?;
    let verdict = Verdict::all(ratios.iter().map(|ratio| ratio.below(1.0)));
    let parts: Vec<String> =
        ratios.iter().map(|ratio| format!("{} {}", ratio.under, ratio.figure())).collect();
    let mut evidence = Evidence::new(verdict, String::new()).ratios(ratios);
    let (mut wins_up_to, mut loses_from, mut crossing) = (None, None, Vec::new());
    for count in COUNTS {
        let (ratio, won, lost) = brute_over_best(lab, count)?;
        crossing.push(format!("{count}: {}", digits(ratio)));
        if won && loses_from.is_none() {
            wins_up_to = Some(count);
        }
        if lost && loses_from.is_none() {
            loses_from = Some(count);
        }
        evidence = evidence.number(&format!("brute_over_best_tree_{count}"), ratio);
    }
    let turn = match (wins_up_to, loses_from) {
        (Some(up_to), Some(from)) => format!("brute wins up to {up_to} triangles and loses from {from}"),
        (Some(_), None) => "brute wins at all of these".to_string(),
        (None, Some(from)) => format!("brute loses from {from} triangles"),
        (None, None) => "neither wins clearly".to_string(),
    };
    evidence.measured = format!(
        "brute on cornell over {}; on boxes of other numbers of triangles, over the better of threaded and ordered: {}, \
         so {turn}",
        listed(&parts),
        listed(&crossing)
    );
    Ok(evidence.number("brute_wins_up_to", wins_up_to).number("brute_loses_from", loses_from))
}

/// Brute force over the faster of two trees on a Cornell box of `count` triangles; whether it beats both for sure, and
/// whether it loses to one for sure.
fn brute_over_best(lab: &Lab<'_>, count: usize) -> Result<(f64, bool, bool)> {
    let scene = with_triangles(&lab.cornell, count);
    let geometry: Geometry = lab.geometry(&scene, Preset::Auto, Builder::Sah)?;
    let plan = |way| lab.plan(&scene, &geometry, &method(Preset::Auto, way));
    let variants = [Method::Brute, Method::Threaded, Method::Ordered]
        .into_iter()
        .map(|way| Ok(Variant::new(way.to_string(), plan(way)?)))
        .collect::<Result<Vec<_>>>()?;
    let series = lab.interleave("cornell", &variants)?;
    let ratios = [series.ratio(0, 1)?, series.ratio(0, 2)?];
    let won = ratios.iter().all(|ratio| ratio.below(1.0) == Verdict::Holds);
    let lost = ratios.iter().any(|ratio| ratio.above(1.0) == Verdict::Holds);
    Ok((ratios[0].ratio.max(ratios[1].ratio), won, lost))
}
