//! Triangles without area, needles, copies, and scales.

mod cabinet;

use glam::DVec3;
use rayon::prelude::*;

use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::scenes::{procedural, scene_of};
use crate::layout::{Count, HitRecord, RayRecord};
use crate::render::choices::{Accumulator, Intersector, Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::{Job, Plan};
use crate::render::raylist::{Query, RayLists};
use crate::render::twin::truth;
use crate::scene::rays::FileRay;
use crate::scene::{Mesh, Scene};
use cabinet::{Cabinet, KINDS, Numbers, VIEW, aimed, mesh_of};

pub const EXPERIMENT: Experiment = Experiment {
    name: "degenerate",
    what: "Zero-area, needle, duplicated, coplanar, overlapping and tiny triangles: wrong hits, NaNs, loops without end.",
    counts: "answers",
    worst: "failures in a million answers",
    run,
};

const SCALES: [f64; 3] = [1.0, 1e-6, 1e6];

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let auto = Wishes::default();
    let mut of_auto = Vec::new();
    let mut rows = Vec::new();
    for (place, &scale) in SCALES.iter().enumerate() {
        lab.observe(&format!("cabinet x {scale:e}"), 0.1 * place as f64);
        let trial = Trial::new(lab, scale)?;
        of_auto.extend(trial.cases(lab, &auto, !lab.quick || scale == 1.0)?);
        if scale != 1.0 {
            continue;
        }
        let means = Wishes { accumulator: Some(Accumulator::Rgba32f), ..auto };
        let (scene, geometry) = (&trial.cabinet.scene, &trial.geometry);
        let plan = lab.plan(lab.job(scene, lab.size, 4), scene, geometry, &means)?;
        of_auto.push(picture_case(lab, &plan, "picture of running means".into())?);
        rows.push(original(lab, &trial)?);
        for intersector in [Intersector::Moller, Intersector::Watertight] {
            let wishes = Wishes { intersector: Some(intersector), ..auto };
            rows.push(row(intersector.name(), trial.cases(lab, &wishes, !lab.quick)));
        }
        for method in lab.methods(&trial.geometry) {
            lab.observe(&method.to_string(), 0.1);
            let wishes = Wishes { method: Some(method), ..auto };
            rows.push(row(method.family(), trial.cases(lab, &wishes, !lab.quick)));
        }
    }
    for (place, (name, special)) in SPECIAL.iter().enumerate() {
        lab.observe(name, 0.3 + 0.1 * place as f64);
        match special(lab) {
            Ok(cases) => of_auto.extend(cases),
            Err(error) => {
                of_auto.push(Case { case: (*name).into(), note: Some(error.to_string()), ..Case::default() })
            }
        }
    }
    let cabinet = Cabinet::new(lab.seed, 1.0);
    rows.push(row("auto", Ok(of_auto)));
    Ok(Findings { rows, figures: vec![figure(lab, &cabinet)?] })
}

fn row(name: &str, cases: Result<Vec<Case>>) -> Row {
    match cases {
        Ok(cases) => Row::of(name, cases),
        Err(error) => Row::refused(name, error.to_string()),
    }
}

fn case(name: impl Into<String>, verdicts: &[std::result::Result<(), String>]) -> Case {
    let (trials, failures) = (verdicts.len() as u64, verdicts.iter().filter(|v| v.is_err()).count() as u64);
    Case {
        case: name.into(),
        trials,
        failures,
        worst: Some(1e6 * failures as f64 / (trials as f64).max(1.0)),
        note: verdicts.iter().find_map(|verdict| verdict.clone().err()),
        ..Case::default()
    }
}

/// The cabinet at a scale, and the rays that are aimed at it.
struct Trial {
    cabinet: Cabinet,
    scale: f64,
    geometry: Geometry,
    /// By kind.
    rays: Vec<Vec<RayRecord>>,
}

impl Trial {
    fn new(lab: &Lab<'_>, scale: f64) -> Result<Self> {
        let cabinet = Cabinet::new(lab.seed, scale);
        let geometry = lab.geometry(&cabinet.scene, &Wishes::default())?;
        let count = lab.pick(200, 3000);
        let rays =
            (0..KINDS.len()).map(|kind| cabinet.rays(kind, count, lab.seed, &geometry.placement)).collect();
        Ok(Self { cabinet, scale, geometry, rays })
    }

    /// A case a kind, and one for the picture if it is asked for.
    fn cases(&self, lab: &Lab<'_>, wishes: &Wishes, with_picture: bool) -> Result<Vec<Case>> {
        let scene = &self.cabinet.scene;
        let plan = lab.plan(lab.job(scene, lab.size, 4), scene, &self.geometry, wishes)?;
        let answers = lab.trace(&plan, Query::Closest, &self.rays.concat())?;
        let mut answers = answers.as_slice();
        let mut cases = Vec::new();
        for (kind, rays) in KINDS.iter().zip(&self.rays) {
            let (own, rest) = answers.split_at(rays.len());
            answers = rest;
            cases.push(case(format!("{} x {:e}", kind.name, self.scale), &judge(&plan, rays, own)));
        }
        if with_picture {
            cases.push(picture_case(lab, &plan, format!("picture x {:e}", self.scale))?);
            cases.push(rays_case(lab, &plan, format!("rays of a picture x {:e}", self.scale))?);
        }
        Ok(cases)
    }
}

/// Whether the answers are those of f64 within its bound.
fn judge(plan: &Plan<'_>, rays: &[RayRecord], answers: &[HitRecord]) -> Vec<std::result::Result<(), String>> {
    let truth = truth(plan);
    let verdict = |(ray, answer): (&RayRecord, &HitRecord)| {
        numbers_only(answer)?;
        truth.closest(ray).accepts(answer)
    };
    rays.par_iter().zip(answers).map(verdict).collect()
}

/// The buffers of a render: counts that add up, and light in [0, 1].
fn picture_case(lab: &Lab<'_>, plan: &Plan<'_>, name: String) -> Result<Case> {
    let accumulated = lab.render(plan)?.accumulated;
    let mut verdicts: Vec<_> = Picture::new(plan.tiles, &accumulated)
        .light
        .iter()
        .map(|light| match (0.0..=1.0).contains(light) {
            true => Ok(()),
            false => Err(format!("a pixel of light {light}")),
        })
        .collect();
    let adds_up = |count: &Count| match count.escaped0 <= count.traced0 && count.escaped1 <= count.traced1 {
        true => Ok(()),
        false => Err(format!("{count:?}")),
    };
    if let Accumulated::Counts(counts) = &accumulated {
        verdicts.extend(counts.iter().map(adds_up));
    }
    Ok(case(name, &verdicts))
}

/// What `staged` keeps between its steps: hits of camera rays, and rays that start there.
fn rays_case(lab: &Lab<'_>, plan: &Plan<'_>, name: String) -> Result<Case> {
    let lists = RayLists::new(lab.device, plan)?;
    let hits = lists.trace(Query::Closest, &lists.camera_rays()?)?;
    let finite = |ray: &RayRecord| {
        let numbers = ray.origin.iter().chain(&ray.direction).chain([&ray.t_max, &ray.weight]);
        match numbers.copied().all(f32::is_finite) {
            true => Ok(()),
            false => Err(format!("NaN: {ray:?}")),
        }
    };
    let mut verdicts: Vec<_> = hits.iter().map(numbers_only).collect();
    verdicts.extend(lists.ambient_rays(&hits, 0)?.iter().map(finite));
    Ok(case(name, &verdicts))
}

/// The original divides by determinants that may be zero, and no comparison rejects a NaN.
fn original(lab: &Lab<'_>, trial: &Trial) -> Result<Row> {
    let wishes = Wishes { preset: Some(Preset::Original), ..Wishes::default() };
    let scene = &trial.cabinet.scene;
    let geometry = lab.geometry(scene, &wishes)?;
    let plan = lab.plan(lab.job(scene, lab.size, 4), scene, &geometry, &wishes)?;
    let rays: Vec<Vec<RayRecord>> = (0..KINDS.len())
        .map(|kind| trial.cabinet.rays(kind, trial.rays[kind].len(), lab.seed, &geometry.placement))
        .collect();
    let answers = lab.trace(&plan, Query::Closest, &rays.concat())?;
    let mut answers = answers.as_slice();
    let mut cases = Vec::new();
    for (kind, rays) in KINDS.iter().zip(&rays) {
        let (own, rest) = answers.split_at(rays.len());
        answers = rest;
        let verdicts: Vec<_> = own.iter().map(numbers_only).collect();
        cases.push(case(kind.name, &verdicts));
    }
    Ok(row("original", Ok(cases)).noting("exempt: only its NaNs are counted; nothing is left out on load"))
}

fn numbers_only(answer: &HitRecord) -> std::result::Result<(), String> {
    match [answer.t, answer.u, answer.v].iter().any(|number| number.is_nan()) {
        true => Err(format!("NaN: {answer:?}")),
        false => Ok(()),
    }
}

/// The original's picture beside that of `auto`; red where a camera ray's hit is a NaN.
fn figure(lab: &Lab<'_>, cabinet: &Cabinet) -> Result<Figure> {
    lab.observe("picture", 0.95);
    let scene = &cabinet.scene;
    let picture = |wishes: &Wishes| -> Result<(Picture, Vec<bool>)> {
        let geometry = lab.geometry(scene, wishes)?;
        let job = Job { camera: VIEW, ..lab.job(scene, lab.size, 64) };
        let plan = lab.plan(job, scene, &geometry, wishes)?;
        let lists = RayLists::new(lab.device, &plan)?;
        let hits = lists.trace(Query::Closest, &lists.camera_rays()?)?;
        let pixels = (0..lab.size.1).flat_map(|y| (0..lab.size.0).map(move |x| (x, y)));
        let is_nan = |(x, y)| numbers_only(&hits[plan.tiles.number(x, y) as usize]).is_err();
        let nans = pixels.map(is_nan).collect();
        Ok((lab.picture(&plan)?, nans))
    };
    let original = Wishes { preset: Some(Preset::Original), ..Wishes::default() };
    let ((failing, nans), (survivor, _)) = (picture(&original)?, picture(&Wishes::default())?);
    Ok(Figure::of_failure("degenerate-nans", &failing, &survivor, &nans))
}

/// Scenes by themselves.
type Special = (&'static str, fn(&Lab<'_>) -> Result<Vec<Case>>);

const SPECIAL: [Special; 4] = [
    ("one triangle", one_triangle),
    ("identical triangles", |lab| stacked(lab, "identical triangles", lab.pick(100_000, 1_000_000), 0.0)),
    ("triangles next to each other", |lab| stacked(lab, "triangles next to each other", 100_000, 1e-6)),
    ("terrain scaled down 10^4", terrain),
];

const TRIANGLE: [DVec3; 3] =
    [DVec3::new(-1.0, 0.1, -0.7), DVec3::new(1.0, 0.0, -0.6), DVec3::new(0.1, 0.3, 1.0)];

fn one_triangle(lab: &Lab<'_>) -> Result<Vec<Case>> {
    traced(lab, "one triangle", &scene_of("one triangle", mesh_of([TRIANGLE].iter())))
}

/// The same triangle again and again, each `apart` of its size from the last.
fn stacked(lab: &Lab<'_>, name: &str, count: u32, apart: f64) -> Result<Vec<Case>> {
    let positions = if apart == 0.0 {
        TRIANGLE.to_vec()
    } else {
        (0..count).flat_map(|i| TRIANGLE.map(|corner| corner + DVec3::Y * (apart * f64::from(i)))).collect()
    };
    let corners = |i: u32| if apart == 0.0 { [0, 1, 2] } else { [3 * i, 3 * i + 1, 3 * i + 2] };
    let mesh = Mesh { positions, triangles: (0..count).map(corners).collect() };
    traced(lab, &format!("{count} {name}"), &scene_of(name, mesh))
}

/// Rays at the triangle and a picture.
fn traced(lab: &Lab<'_>, name: &str, scene: &Scene) -> Result<Vec<Case>> {
    let wishes = Wishes::default();
    let geometry = lab.geometry(scene, &wishes)?;
    let plan = lab.plan(lab.job(scene, lab.size, 4), scene, &geometry, &wishes)?;
    let mut numbers = Numbers::new(lab.seed);
    let few = if geometry.triangles.len() > 1000 { 20 } else { lab.pick(200, 3000) };
    let rays: Vec<RayRecord> =
        (0..few).map(|_| aimed(&mut numbers, TRIANGLE).placed(&geometry.placement)).collect();
    let answers = lab.trace(&plan, Query::Closest, &rays)?;
    let mut hits = case(name, &judge(&plan, &rays, &answers));
    if geometry.copies > 0 {
        hits.note = Some(format!("{} copies left out on load", geometry.copies));
    }
    Ok(vec![hits, picture_case(lab, &plan, format!("{name}, picture"))?])
}

/// Rays straight down at the middles of its triangles.
fn terrain(lab: &Lab<'_>) -> Result<Vec<Case>> {
    let terrain = procedural("terrain", Some(lab.pick(20_000, 2_000_000)), lab.seed)?;
    let positions = terrain.mesh.positions.iter().map(|p| *p * 1e-4).collect();
    let scene = scene_of("terrain", Mesh { positions, triangles: terrain.mesh.triangles });
    let wishes = Wishes::default();
    let geometry = lab.geometry(&scene, &wishes)?;
    let triangles = scene.mesh.triangles.len();
    let left_out = (geometry.without_area + geometry.copies) as u64;
    let kept = Case {
        case: format!("{triangles} triangles of a terrain x 1e-4, kept"),
        trials: triangles as u64,
        failures: left_out,
        worst: Some(1e6 * left_out as f64 / triangles as f64),
        ..Case::default()
    };
    let plan = lab.plan(lab.job(&scene, lab.size, 4), &scene, &geometry, &wishes)?;
    let mut numbers = Numbers::new(lab.seed);
    let targets: Vec<u32> = (0..lab.pick(2000, 20_000)).map(|_| numbers.below(triangles) as u32).collect();
    let top = scene.bounds.max.y + scene.bounds.diagonal();
    let above = |id: &u32| {
        let corners = scene.mesh.triangles[*id as usize].map(|corner| scene.mesh.positions[corner as usize]);
        let middle = corners.iter().sum::<DVec3>() / 3.0;
        let origin = DVec3::new(middle.x, top, middle.z);
        FileRay { origin, direction: DVec3::NEG_Y, t_max: f64::INFINITY }.placed(&geometry.placement)
    };
    let rays: Vec<RayRecord> = targets.iter().map(above).collect();
    let answers = lab.trace(&plan, Query::Closest, &rays)?;
    let found = |(target, answer): (&u32, &HitRecord)| match geometry
        .triangles
        .get(answer.index as usize)
        .map(|triangle| triangle.id)
    {
        Some(id) if id == *target => Ok(()),
        other => Err(format!("{other:?} instead of {target}")),
    };
    let verdicts: Vec<_> = targets.iter().zip(&answers).map(found).collect();
    Ok(vec![kept, case(format!("{triangles} triangles of a terrain x 1e-4, hit"), &verdicts)])
}
