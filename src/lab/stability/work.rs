//! More work than a dispatch may do.

use std::time::Instant;

use super::shapes::{Shapes, framed, yard, yard_framed};
use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::lab::interleave::digits;
use crate::lab::scenes::{procedural, scene_of};
use crate::layout::Count;
use crate::render::auto;
use crate::render::choices::{Method, Passes, Wishes};
use crate::render::execute::run_traced;
use crate::render::geometry::Geometry;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::{Job, Plan, Tuning};
use crate::render::repeat::Repeated;
use crate::render::schedule::Pace;
use crate::render::seeds::hash;
use crate::render::spans::Spans;
use crate::render::stage::Stage;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::vk::DeviceKind;

pub const EXPERIMENT: Experiment = Experiment {
    name: "work",
    what: "Samples and triangles beyond the iterations of a loop, and submits of 100 ms: rays that are lost.",
    counts: "rays",
    worst: "rays lost or wrong in a million",
    run,
};

/// Samples of a dispatch of the render that the others are compared with.
const SMALL_BLOCK: u32 = 500;
/// Longest dispatches and submits that the scheduler is told to make, ms.
const PACES: [(f64, f64); 3] = [(100.0, 100.0), (1.0, 2.0), (1e6, 1e6)];

/// Much work for one invocation.
struct Load {
    name: &'static str,
    scene: Scene,
    job: Job,
    /// The method of every variant that has none of its own.
    method: Option<Method>,
}

/// A way through the work.
struct Variant {
    name: String,
    wishes: Wishes,
    /// All samples in one dispatch, whatever a loop may do.
    whole: bool,
    /// And what was lost stays lost.
    unguarded: bool,
}

/// What a render gave.
struct Found {
    counts: Vec<Count>,
    note: Option<String>,
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let loads = loads(lab)?;
    let geometries =
        loads.iter().map(|load| lab.geometry(&load.scene, &Wishes::default())).collect::<Result<Vec<_>>>()?;
    let references = loads
        .iter()
        .zip(&geometries)
        .map(|(load, geometry)| reference(lab, load, geometry))
        .collect::<Result<Vec<_>>>()?;
    let all: Vec<(&Load, &Geometry, &[Count])> = loads
        .iter()
        .zip(&geometries)
        .zip(&references)
        .map(|((load, geometry), counts)| (load, geometry, &counts[..]))
        .collect();
    let variants = variants(lab, &geometries);
    let (mut rows, mut figures) = (Vec::new(), Vec::new());
    for (place, variant) in variants.iter().enumerate() {
        lab.observe(&variant.name, place as f64 / (variants.len() + 1) as f64);
        let mut cases = Vec::new();
        for &(load, geometry, reference) in &all {
            // That work is another method's.
            if variant.wishes.method.is_some() && load.method.is_some() {
                continue;
            }
            cases.push(match render(lab, load, geometry, variant) {
                Ok(found) => {
                    if variant.unguarded && load.method.is_some() {
                        figures.extend(figure(load, &found.counts, reference));
                    }
                    judge(load.name, load, &found, reference)
                }
                Err(error) => Case {
                    case: load.name.into(),
                    // A refusal is no trial; rays that the device lost and told of are.
                    trials: if error.exit_code() == 4 { asked(load, reference) } else { 0 },
                    failures: if error.exit_code() == 4 { asked(load, reference) } else { 0 },
                    note: Some(error.to_string()),
                    ..Case::default()
                },
            });
        }
        let row = Row::of(&variant.name, cases);
        rows.push(match lab.device.adapter().limits.loop_iterations {
            Some(limit) if variant.unguarded => row.noting(format!(
                "nothing is cut for this driver's {limit} iterations of an invocation, and nobody looks whether rays came to \
                 their end"
            )),
            None if variant.unguarded => row.noting("this device's loops have no limit"),
            _ => row,
        });
    }
    if !lab.quick {
        let passes = [Passes::Single, Passes::Split, Passes::Staged]
            .map(|passes| (passes.name(), Wishes { passes: Some(passes), ..Wishes::default() }));
        let costs = lab.costs(&loads[0].scene, &geometries[0], &passes)?;
        for ((name, _), cost) in passes.iter().zip(costs) {
            rows.iter_mut().filter(|row| row.variant == *name).for_each(|row| row.gpu_ms_ratio = Some(cost));
        }
    }
    lab.observe("paces", variants.len() as f64 / (variants.len() + 1) as f64);
    rows.push(paces(lab, &all)?);
    Ok(Findings { rows, figures })
}

fn variants(lab: &Lab<'_>, geometries: &[Geometry]) -> Vec<Variant> {
    let row = |name: &str, wishes| Variant { name: name.into(), wishes, whole: false, unguarded: false };
    let passes = |passes: Passes| row(passes.name(), Wishes { passes: Some(passes), ..Wishes::default() });
    let single = Wishes { passes: Some(Passes::Single), ..Wishes::default() };
    let mut variants = vec![
        row("auto", Wishes::default()),
        passes(Passes::Single),
        passes(Passes::Split),
        passes(Passes::Staged),
        // The other passes give an invocation no more than 1,024 samples anyhow.
        Variant { whole: true, ..row("one dispatch, taken up again", single) },
        Variant { whole: true, unguarded: true, ..row("one dispatch, unguarded", single) },
    ];
    // A kernel more for each method: too many for a first look.
    if !lab.quick {
        let fitted = geometries.iter().map(|geometry| geometry.stack_bound).max().unwrap_or(1);
        let known = geometries.first().map(|geometry| lab.methods(geometry)).unwrap_or_default();
        variants.extend(known.into_iter().map(|method| {
            let method = if let Method::Stack(_) = method { Method::Stack(fitted) } else { method };
            row(&method.to_string(), Wishes { method: Some(method), ..Wishes::default() })
        }));
    }
    variants
}

fn loads(lab: &Lab<'_>) -> Result<Vec<Load>> {
    let on_cpu = lab.device.adapter().kind == DeviceKind::Cpu;
    let load = |name, scene: Scene, camera, size, samples, method| Load {
        name,
        job: Job { camera, ..lab.job(&scene, size, samples) },
        scene,
        method,
    };
    // A GPU has no limit on loops, but brute force takes 2^20 triangles a dispatch there.
    let triangles = if on_cpu { 70_000 } else { 1_200_000 };
    let size = match (on_cpu, lab.quick) {
        (true, true) => (8, 1),
        (true, false) => (8, 8),
        _ => (32, 20),
    };
    let mut loads = vec![load(
        "samples beyond the limit",
        scene_of("yard", yard([0.0; 3], 1.0)),
        yard_framed(size),
        size,
        lab.pick(66_000, 80_000),
        None,
    )];
    let terrain = procedural("terrain", Some(triangles), lab.seed)?;
    let [centre, away] =
        [terrain.bounds.center(), glam::DVec3::new(0.3, 0.5, 0.4) * terrain.bounds.diagonal()];
    let size = lab.pick((8, 5), (24, 15));
    let camera = framed((centre + away).to_array(), centre.to_array(), size);
    let brute = Some(Method::Brute);
    loads.push(load("triangles beyond the limit, by brute force", terrain, camera, size, 2, brute));
    if !lab.quick {
        let camera = Camera::Pinhole {
            eye: [0.0, 3.0, 14.0],
            target: [0.0, 2.0, 0.0],
            up: [0.0, 1.0, 0.0],
            fov: 45.0,
        };
        loads.push(load("slivers, whose rays visit most leaves", slivers(), camera, (8, 8), 219, None));
    }
    Ok(loads)
}

/// A floor under crossing slivers, whose boxes all overlap.
fn slivers() -> Scene {
    let number =
        |i: u32, low: f64, high: f64| low + (high - low) * f64::from(hash(i, 1)) / f64::from(u32::MAX);
    let mut shapes = Shapes::default();
    shapes.triangle([[-20.0, 0.0, -20.0], [20.0, 0.0, -20.0], [0.0, 0.0, 30.0]]);
    for i in 0..3000 {
        let at = |k: u32, low, high| number(6 * i + k, low, high);
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        let near = [at(0, -10.0, -9.0), at(1, 1.0, 2.0), side * at(2, -10.0, -9.0)];
        let [x, y, z] = [at(3, 9.0, 10.0), at(4, 9.0, 10.0), side * at(5, 9.0, 10.0)];
        shapes.triangle([near, [x, y, z], [x + 0.003, y, z]]);
    }
    scene_of("slivers", shapes.mesh())
}

/// The same work by the threaded tree, a few samples a dispatch.
fn reference(lab: &Lab<'_>, load: &Load, geometry: &Geometry) -> Result<Vec<Count>> {
    lab.observe(load.name, 0.0);
    let wishes = Wishes { method: Some(Method::Threaded), passes: Some(Passes::Single), ..Wishes::default() };
    let job = Job { block: Some(SMALL_BLOCK), ..load.job.clone() };
    let plan = lab.plan(job, &load.scene, geometry, &wishes)?;
    counts_of(lab.render(&plan)?.accumulated)
}

fn counts_of(accumulated: Accumulated) -> Result<Vec<Count>> {
    match accumulated {
        Accumulated::Counts(counts) => Ok(counts),
        Accumulated::Means(_) => Err(Error::other("Rays were to be counted: report this as a bug.")),
    }
}

fn render(lab: &Lab<'_>, load: &Load, geometry: &Geometry, variant: &Variant) -> Result<Found> {
    let wishes = Wishes { method: variant.wishes.method.or(load.method), ..variant.wishes };
    let block = variant.whole.then_some(load.job.samples.end);
    let plan = lab.plan(Job { block, ..load.job.clone() }, &load.scene, geometry, &wishes)?;
    let tuning = Tuning { unguarded: variant.unguarded, ..Tuning::default() };
    let plan = Plan { tuning, ..plan };
    for kernel in &plan.kernels {
        auto::check_subgroup(kernel, lab.device.adapter())
            .map_err(|error| Error::usage(error.to_string()))?;
    }
    let mut spans = Spans::new(Instant::now());
    let outcome = run_traced(lab.device, &plan, &mut |_| {}, Some(&mut spans))?;
    let longest = spans
        .submits
        .iter()
        .map(|submit| submit.finished.timings.iter().filter_map(|timing| timing.gpu_ms).sum::<f64>())
        .fold(0.0, f64::max);
    let again = match outcome.repeats {
        0 => String::new(),
        times => format!(", pixels were taken up again {times} times"),
    };
    let note = format!("{} submits, the longest {} ms{again}", outcome.submits, digits(longest));
    Ok(Found { counts: counts_of(outcome.accumulated)?, note: Some(note) })
}

fn traced(count: &Count) -> u64 {
    u64::from(count.traced0) + u64::from(count.traced1)
}

fn escaped(count: &Count) -> u64 {
    u64::from(count.escaped0) + u64::from(count.escaped1)
}

/// Rays that there must be: the reference covers the pixels that hit, and each has all its samples.
fn asked(load: &Load, reference: &[Count]) -> u64 {
    let covered = reference.iter().filter(|count| traced(count) > 0).count() as u64;
    covered * load.job.samples.len() as u64
}

/// Rays of a pixel that are not there, or escape where they must not or the other way round.
fn lost(load: &Load, found: &Count, reference: &Count) -> u64 {
    let wanted = if traced(reference) > 0 { load.job.samples.len() as u64 } else { 0 };
    let missing = traced(found).abs_diff(wanted);
    let half = |a: u32, b: u32| u64::from(a.abs_diff(b));
    let wrong = half(found.escaped0, reference.escaped0) + half(found.escaped1, reference.escaped1);
    // Of the rays that are missing, some would have escaped.
    missing + wrong.saturating_sub(missing)
}

fn judge(case: &str, load: &Load, found: &Found, reference: &[Count]) -> Case {
    let trials = asked(load, reference);
    let lengths = found.counts.len().abs_diff(reference.len()) as u64;
    let failures = lengths
        + found
            .counts
            .iter()
            .zip(reference)
            .map(|(found, reference)| lost(load, found, reference))
            .sum::<u64>();
    Case {
        case: case.into(),
        trials,
        failures,
        worst: Some(failures as f64 * 1e6 / trials.max(1) as f64),
        note: found.note.clone(),
        ..Case::default()
    }
}

/// The picture with rays lost beside the whole one; none where nothing is lost. A ray that is lost gives no light.
fn figure(load: &Load, found: &[Count], reference: &[Count]) -> Option<Figure> {
    let tiles = load.job.tiles();
    let picture = |counts: &[Count]| {
        let mut picture = Picture::new(tiles, &Accumulated::Counts(counts.to_vec()));
        for y in 0..tiles.height {
            for x in 0..tiles.width {
                let count = &counts[tiles.number(x, y) as usize];
                picture.light[(y * tiles.width + x) as usize] =
                    escaped(count) as f32 / load.job.samples.len() as f32;
            }
        }
        picture
    };
    let fails: Vec<bool> = (0..tiles.width * tiles.height)
        .map(|pixel| {
            let number = tiles.number(pixel % tiles.width, pixel / tiles.width) as usize;
            lost(load, &found[number], &reference[number]) > 0
        })
        .collect();
    // Thin pictures show nothing.
    (fails.contains(&true) && tiles.height > 1)
        .then(|| Figure::of_failure("work", &picture(found), &picture(reference), &fails))
}

/// `auto` with other longest dispatches and submits than the device's.
fn paces(lab: &Lab<'_>, all: &[(&Load, &Geometry, &[Count])]) -> Result<Row> {
    let mut cases = Vec::new();
    for &(load, geometry, reference) in all {
        let wishes = Wishes { method: load.method, ..Wishes::default() };
        let plan = lab.plan(load.job.clone(), &load.scene, geometry, &wishes)?;
        for &(dispatch_ms, submit_ms) in lab.pick(&PACES[..1], &PACES[..]) {
            let mut stage = Stage::new(lab.device, &plan)?;
            stage.pace = Pace { dispatch_ms, submit_ms, ..stage.pace };
            let mut repeated = Repeated::new(&stage)?;
            let repeats = repeated.frame()?.repeats;
            let note = (repeats > 0).then(|| format!("pixels were taken up again {repeats} times"));
            let found = Found { counts: repeated.counts()?, note };
            let name = format!("{}, submits of {} ms", load.name, digits(submit_ms));
            cases.push(judge(&name, load, &found, reference));
        }
    }
    Ok(Row::of("auto, other paces", cases))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_are_missing_or_wrong_are_lost() {
        let scene = slivers();
        let job = Job {
            camera: Camera::default_for("a"),
            size: (8, 8),
            samples: 0..10,
            seed: 0,
            max_distance: None,
            jitters: 1,
            adaptive: false,
            goal: crate::render::rounds::Goal::Samples,
            block: None,
        };
        let load = Load { name: "a", scene, job, method: None };
        let count = |escaped0, traced0| Count { escaped0, traced0, ..Count::default() };
        let reference = [count(4, 10), Count::default()];
        let judged =
            |found: [Count; 2]| judge("a", &load, &Found { counts: found.to_vec(), note: None }, &reference);
        assert_eq!((judged(reference).trials, judged(reference).failures), (10, 0));
        assert_eq!(judged([count(4, 9), Count::default()]).failures, 1);
        assert_eq!(judged([count(3, 9), Count::default()]).failures, 1, "one ray, not two");
        assert_eq!(judged([count(6, 10), Count::default()]).failures, 2);
        assert_eq!(judged([Count::default(), Count::default()]).worst, Some(1e6));
        assert_eq!(judged([count(4, 10), count(0, 10)]).failures, 10, "out of nothing");
    }
}
