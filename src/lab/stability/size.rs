//! Pictures and scenes of odd sizes.

use super::shapes::{Shapes, framed, yard, yard_framed};
use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::{Error, Result};
use crate::lab::scenes::{procedural, scene_of};
use crate::layout::{Count, NO_HIT, RayRecord, Triangle};
use crate::pack::NodeArrays;
use crate::reference::exact::Truth;
use crate::reference::{Inputs, render_counts, trace_closest};
use crate::render::auto;
use crate::render::builder::choose_builder;
use crate::render::choices::{Method, Passes, Preset, Wishes};
use crate::render::execute::bands;
use crate::render::geometry::Geometry;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::{Job, Plan, Tuning};
use crate::render::raylist::{Query, RayLists};
use crate::render::twin::Twin;
use crate::scene::camera::Camera;
use crate::scene::{Mesh, Scene, obj};
use crate::vk::DeviceKind;
use rayon::prelude::*;

pub const EXPERIMENT: Experiment = Experiment {
    name: "size",
    what: "Pictures of one pixel, odd sides, and beyond the limit; scenes of 0 to 3 triangles; ids above 2^24.",
    counts: "cases",
    worst: "wrong pixels",
    run,
};

/// Ambient rays of a pixel.
const SAMPLES: u32 = 8;
/// Sides that no workgroup fits.
const ODD: (u32, u32) = (7, 13);
/// The width that the experiment is about, pixels.
const WIDE: u32 = 16_384;
/// First ids of coincident triangles: small ones, the first that a 32-bit float can't tell from the next, and large ones.
const FIRST_IDS: [u32; 3] = [0, 1 << 24, (1 << 28) - 1024];
/// Triangles of a scene whose own ids are that large, and of its rays that f64 judges.
const MANY: u64 = 17_000_000;
const JUDGED: usize = 64;

/// A way to render.
struct Variant {
    name: String,
    wishes: Wishes,
    /// Ids go through 32-bit floats.
    float_ids: bool,
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let variant = |name: &str, wishes| Variant { name: name.into(), wishes, float_ids: false };
    let original = Wishes { preset: Some(Preset::Original), ..Wishes::default() };
    let mut variants = vec![variant("auto", Wishes::default()), variant("original", original)];
    let scene = scene_of("sheets", sheets().0);
    let geometry = lab.geometry(&scene, &Wishes::default())?;
    variants.extend(lab.methods(&geometry).into_iter().map(|method| {
        variant(
            &method.to_string(),
            Wishes { method: Some(method), passes: Some(Passes::Single), ..Wishes::default() },
        )
    }));
    let brute = Wishes { method: Some(Method::Brute), ..Wishes::default() };
    variants.push(Variant { float_ids: true, ..variant("ids as 32-bit floats", brute) });
    let mut rows = Vec::new();
    for (place, variant) in variants.iter().enumerate() {
        lab.observe(&variant.name, place as f64 / variants.len() as f64);
        let plan = lab.plan(lab.job(&scene, ODD, SAMPLES), &scene, &geometry, &variant.wishes);
        let runs = |plan: Plan<'_>| {
            plan.kernels.iter().try_for_each(|kernel| auto::check_subgroup(kernel, lab.device.adapter()))
        };
        rows.push(match plan.and_then(runs) {
            Ok(()) => Row::of(&variant.name, cases(lab, variant)),
            Err(error) => Row::refused(&variant.name, error.to_string()),
        });
    }
    Ok(Findings { rows, figures: Vec::new() })
}

fn cases(lab: &Lab<'_>, variant: &Variant) -> Vec<Case> {
    let wishes = &variant.wishes;
    let mut cases = Vec::new();
    if !variant.float_ids {
        let fewest = if lab.quick && wishes.method.is_some() { 3 } else { 1 };
        for count in fewest..=3 {
            cases.push(told(format!("{count} triangles"), plane(lab, wishes, count, ODD)));
        }
    }
    let whole = wishes.method.is_none();
    if whole {
        let height = lab.pick(1, 4);
        for size in [(1, 1), (WIDE, height), (height, WIDE)] {
            cases.push(told_or_refused(format!("{}x{}", size.0, size.1), plane(lab, wishes, 2, size)));
        }
        cases.extend(refusals(lab, wishes));
    }
    // What the original leaves to the driver is not the twin's.
    if wishes.preset.is_none() && !variant.float_ids && (whole || !lab.quick) {
        let sizes: &[(u32, u32)] = if whole { &[(1, 1), ODD, (WIDE, 1)] } else { &[ODD] };
        for &size in sizes {
            cases.push(told_or_refused(
                format!("yard at {}x{}", size.0, size.1),
                against_twin(lab, wishes, size),
            ));
        }
    }
    let first_ids = if lab.quick && !variant.float_ids { &FIRST_IDS[1..2] } else { &FIRST_IDS[..] };
    for &first in first_ids {
        let wrong = coincident(lab, wishes, first, variant.float_ids);
        cases.push(told(format!("coincident triangles {first} and {}", first + 1), wrong));
    }
    if whole && wishes.preset.is_none() && !lab.quick && lab.device.adapter().kind != DeviceKind::Cpu {
        cases.push(told(format!("terrain of {MANY} triangles"), many(lab, wishes)));
    }
    cases
}

/// The number of wrong pixels as a case.
fn told(case: impl Into<String>, wrong: Result<u64>) -> Case {
    let case = Case { case: case.into(), trials: 1, ..Case::default() };
    match wrong {
        Ok(wrong) => Case { failures: u64::from(wrong > 0), worst: Some(wrong as f64), ..case },
        Err(error) => Case { failures: 1, note: Some(error.to_string()), ..case },
    }
}

/// The same of a picture that the device's limits may rule out.
fn told_or_refused(case: String, wrong: Result<u64>) -> Case {
    match wrong {
        Err(error) if matches!(error.exit_code(), 2 | 3) => refused(case, Err::<(), _>(error)),
        other => told(case, other),
    }
}

/// Something that must be refused: with a sentence, and an exit code that blames the command line or the input.
fn refused<T>(case: impl Into<String>, outcome: Result<T>) -> Case {
    let (right, note) = match outcome {
        Ok(_) => (false, "it is not refused".into()),
        Err(error) => {
            let text = error.to_string();
            (matches!(error.exit_code(), 2 | 3) && text.contains(' ') && text.ends_with('.'), text)
        }
    };
    Case { case: case.into(), trials: 1, failures: u64::from(!right), note: Some(note), ..Case::default() }
}

/// A plane in 1 to 3 triangles. It fills the picture and hides nothing: each pixel has light 1.
fn plane(lab: &Lab<'_>, wishes: &Wishes, count: u32, size: (u32, u32)) -> Result<u64> {
    let mut shapes = Shapes::default();
    let [a, b, c, d] = [[-90.0, -50.0, 0.0], [90.0, -50.0, 0.0], [0.0, 130.0, 0.0], [1.0, 2.0, 0.0]];
    match count {
        1 => shapes.triangle([a, b, c]),
        2 => shapes.quad([[-60.0, -60.0, 0.0], [60.0, -60.0, 0.0], [60.0, 60.0, 0.0], [-60.0, 60.0, 0.0]]),
        _ => [[a, b, d], [b, c, d], [c, a, d]].into_iter().for_each(|corners| shapes.triangle(corners)),
    }
    let scene = scene_of("plane", shapes.mesh());
    let geometry = lab.geometry(&scene, wishes)?;
    let camera = framed([0.3, 0.2, 30.0], [0.3, 0.2, 0.0], size);
    let plan = lab.plan(Job { camera, ..lab.job(&scene, size, SAMPLES) }, &scene, &geometry, wishes)?;
    let Picture { light, coverage, .. } = lab.picture(&plan)?;
    let white = |light: f32| if plan.settings.preset.is_original() { light > 0.995 } else { light == 1.0 };
    let wrong = light.iter().zip(&coverage).filter(|(light, covered)| !white(**light) || **covered != 1.0);
    Ok(wrong.count() as u64)
}

fn yard_job(lab: &Lab<'_>, size: (u32, u32)) -> (Scene, Job) {
    let scene = scene_of("yard", yard([0.0; 3], 1.0));
    let camera = yard_framed(size);
    let job = Job { camera, ..lab.job(&scene, size, SAMPLES) };
    (scene, job)
}

/// Pixels whose counts are not those of the twin by brute force.
fn against_twin(lab: &Lab<'_>, wishes: &Wishes, size: (u32, u32)) -> Result<u64> {
    let (scene, job) = yard_job(lab, size);
    let geometry = lab.geometry(&scene, wishes)?;
    let found = counts(lab, &lab.plan(job.clone(), &scene, &geometry, wishes)?)?;
    let brute = Wishes { method: Some(Method::Brute), ..*wishes };
    let plan = lab.plan(job, &scene, &geometry, &brute)?;
    let expected = render_counts(&Twin::new(&plan).inputs(&plan), 0..SAMPLES, None).counts;
    let apart = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
    Ok((apart + found.len().abs_diff(expected.len())) as u64)
}

fn counts(lab: &Lab<'_>, plan: &Plan<'_>) -> Result<Vec<Count>> {
    match lab.render(plan)?.accumulated {
        Accumulated::Counts(counts) => Ok(counts),
        Accumulated::Means(_) => Err(Error::other("Rays were to be counted: report this as a bug.")),
    }
}

fn refusals(lab: &Lab<'_>, wishes: &Wishes) -> Vec<Case> {
    let side = lab.device.adapter().limits.image_side;
    let (scene, job) = yard_job(lab, ODD);
    let mut cases = Vec::new();
    match lab.geometry(&scene, wishes) {
        Err(error) => cases.push(told("limits", Err(error))),
        Ok(geometry) => {
            let plan = |size, jitters| {
                let job = Job { size, jitters, samples: 0..SAMPLES, ..job.clone() };
                lab.plan(job, &scene, &geometry, wishes)
            };
            let above = side.saturating_add(1);
            cases.push(refused(format!("{above}x1, above the limit"), plan((above, 1), 1)));
            cases.push(refused(format!("1x{above}, above the limit"), plan((1, above), 1)));
            let many = u32::try_from((1u64 << 33) / u64::from(side).pow(2)).unwrap_or(2).max(2);
            // Running means take one camera ray a pixel, which is refused as well.
            cases.push(refused(
                format!("{side}x{side} with {many} camera rays a pixel"),
                plan((side, side), many),
            ));
            let whole = plan((side, side), 1).map(|plan| u64::from(!covers(&plan, lab)));
            cases.push(told_or_refused(format!("{side}x{side} in bands"), whole));
        }
    }
    let empty = scene_of("empty", Mesh::default());
    cases.push(refused("0 triangles", lab.geometry(&empty, wishes)));
    cases.push(refused("a file without faces", obj::read(std::io::Cursor::new("v 0 0 0\n"), "empty.obj")));
    if !wishes.preset.is_some_and(Preset::is_original) {
        let mut line = Shapes::default();
        line.triangle([[0.0; 3], [1.0; 3], [2.0; 3]]);
        cases.push(refused("a triangle without area", lab.geometry(&scene_of("line", line.mesh()), wishes)));
    }
    cases
}

/// Whether the bands of a plan hold each pixel once, and no more than a descriptor shows.
fn covers(plan: &Plan<'_>, lab: &Lab<'_>) -> bool {
    let bands = bands(plan, lab.device);
    let most = lab.device.adapter().limits.storage_buffer_bytes;
    let mut next = 0;
    let follow = bands.iter().all(|&(begin, end)| {
        let follows = begin == next && begin < end;
        next = end;
        follows && u64::from(end - begin) * size_of::<Count>() as u64 <= most
    });
    follow && u64::from(next) == plan.tiles.numbers()
}

/// Sheets of triangles, each there twice in one place: of the two, ids that follow one another; the smaller one comes first
/// in half of the pairs. With the ids, by place in the mesh.
fn sheets() -> (Mesh, Vec<u32>) {
    let mut shapes = Shapes::default();
    let mut ids = Vec::new();
    let side = 4;
    for cell in 0..side * side {
        let [x, y] = [cell % side, cell / side].map(|place| f64::from(place) - 0.5 * f64::from(side));
        let quad = [[x, y, 0.0], [x + 1.0, y, 0.0], [x + 1.0, y + 1.0, 0.0], [x, y + 1.0, 0.0]];
        shapes.quad(quad);
        shapes.quad(quad);
        let first = 4 * cell;
        ids.extend(match cell % 2 {
            0 => [first, first + 2, first + 1, first + 3],
            _ => [first + 1, first + 3, first, first + 2],
        });
    }
    (shapes.mesh(), ids)
}

/// Camera rays that meet the larger of two coincident triangles' ids, on the device or its twin, or nothing.
fn coincident(lab: &Lab<'_>, wishes: &Wishes, first: u32, float_ids: bool) -> Result<u64> {
    let (mesh, ids) = sheets();
    let scene = scene_of("sheets", mesh);
    // In the file's units, on numbers that 32-bit floats hold exactly: conditioning would leave copies out.
    let geometry = Geometry::build(&scene, false, choose_builder(wishes), &|_| {})?;
    if geometry.triangles.len() != ids.len() {
        return Err(Error::other("Coincident triangles were left out: report this as a bug."));
    }
    let size = lab.pick((32, 20), (64, 40));
    let camera = framed([0.013, 0.017, 6.0], [0.013, 0.017, 0.0], size);
    let plan = lab.plan(Job { camera, ..lab.job(&scene, size, SAMPLES) }, &scene, &geometry, wishes)?;
    let id = |place: u32| first + ids[place as usize];
    let kept = |id: u32| if float_ids { id as f32 as u32 } else { id };
    let renumbered = |triangle: &Triangle| Triangle { id: kept(id(triangle.id)), ..*triangle };
    let triangles: Vec<Triangle> = geometry.triangles.iter().map(renumbered).collect();
    // A record's id stands in the same place however triangles are kept.
    let mut bytes = plan.triangle_bytes().to_vec();
    for (record, triangle) in bytes.chunks_exact_mut(size_of::<Triangle>()).zip(&triangles) {
        record[12..16].copy_from_slice(&triangle.id.to_ne_bytes());
    }
    let plan = Plan { tuning: Tuning { triangles: Some(bytes), ..Tuning::default() }, ..plan };
    let rays = RayLists::new(lab.device, &plan)?.camera_rays()?;
    let hits = lab.trace(&plan, Query::Closest, &rays)?;
    let twin = Twin::new(&plan);
    let corners: Vec<_> = plan
        .corners
        .unwrap_or(&[])
        .iter()
        .zip(&triangles)
        .map(|(corners, triangle)| crate::layout::Corners { id: triangle.id, ..*corners })
        .collect();
    let inputs = Inputs { triangles: &triangles, corners: &corners, ..twin.inputs(&plan) };
    let twins = trace_closest(&inputs, &rays);
    let wrong = |index: u32| {
        let met = geometry.triangles.get(index as usize);
        // Even ids are the smaller ones.
        met.is_none_or(|triangle| !id(triangle.id).is_multiple_of(2))
    };
    let asked = |ray: &RayRecord| ray.t_max >= 0.0;
    let pairs = rays.iter().zip(hits.iter().zip(&twins)).filter(|(ray, _)| asked(ray));
    Ok(pairs.filter(|(_, (hit, twin))| wrong(hit.index) || wrong(twin.index)).count() as u64)
}

/// A camera above the last rows of a terrain, whose triangles run row by row: there ids are largest.
fn on_last(scene: &Scene, size: (u32, u32)) -> Camera {
    let mesh = &scene.mesh;
    let row = (2.0 * mesh.triangles.len() as f64).sqrt() as usize;
    let last = mesh.triangles.len().saturating_sub(3 * row + row / 2);
    let target = mesh.triangles.get(last).map_or(scene.bounds.center(), |t| mesh.positions[t[0] as usize]);
    let eye = target + glam::DVec3::new(0.002, 0.01, 0.002) * scene.bounds.diagonal();
    framed(eye.to_array(), target.to_array(), size)
}

/// A scene with so many triangles that their own ids exceed 2^24: pixels in which `auto` and the threaded tree differ, and
/// rays whose hit f64 brute force does not accept.
fn many(lab: &Lab<'_>, wishes: &Wishes) -> Result<u64> {
    let scene = procedural("terrain", Some(MANY), lab.seed)?;
    let geometry = lab.geometry(&scene, wishes)?;
    if geometry.triangles.len() <= 1 << 24 {
        return Err(Error::other("The terrain has too few triangles: report this as a bug."));
    }
    let size = (64, 40);
    let job = || Job { camera: on_last(&scene, size), ..lab.job(&scene, size, SAMPLES) };
    let plan = lab.plan(job(), &scene, &geometry, wishes)?;
    let threaded = Wishes { method: Some(Method::Threaded), ..*wishes };
    let other = counts(lab, &lab.plan(job(), &scene, &geometry, &threaded)?)?;
    let apart = counts(lab, &plan)?.iter().zip(&other).filter(|(a, b)| a != b).count();
    let rays = RayLists::new(lab.device, &plan)?.camera_rays()?;
    let hits = lab.trace(&plan, Query::Closest, &rays)?;
    let tree = NodeArrays::default();
    let truth = Truth::of(&Inputs {
        frame: &plan.frame,
        triangles: &geometry.triangles,
        corners: plan.corners.unwrap_or(&[]),
        tree: &tree,
        choices: Twin::choices(&plan),
    });
    let met: Vec<usize> = (0..rays.len()).filter(|&place| hits[place].index != NO_HIT).collect();
    let step = (met.len() / JUDGED).max(1);
    let judged: Vec<usize> = met.into_iter().step_by(step).collect();
    let refused = judged
        .par_iter()
        .filter(|&&place| truth.closest(&rays[place]).accepts(&hits[place]).is_err())
        .count();
    let large =
        judged.iter().filter(|&&place| geometry.triangles[hits[place].index as usize].id >= 1 << 24).count();
    if large * 2 < judged.len() || large == 0 {
        return Err(Error::other("Few rays meet a triangle whose id exceeds 2^24: report this as a bug."));
    }
    Ok((apart + refused) as u64)
}
