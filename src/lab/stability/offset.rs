//! Where ambient rays start: self-hits and leaks of light.

mod ground;
mod scenes;

use std::rc::Rc;

use super::{Case, Experiment, Findings, Lab, Row, Verdict};
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::lab::interleave::digits as digits_of;
use crate::lab::scenes::scene_of;
use crate::layout::{HitRecord, NO_HIT, RayRecord};
use crate::render::choices::{Offset, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Picture;
use crate::render::plan::Job;
use crate::render::raylist::{Compiled, Query, RayLists};
use crate::scene::{Mesh, Scene, digits};
use scenes::{Subject, moved, subjects};

pub const EXPERIMENT: Experiment = Experiment {
    name: "offset",
    what: "Scenes scaled and shifted: ambient rays that meet their own surface or start behind it.",
    counts: "rays",
    worst: "failures in a million rays",
    run,
};

/// A way for rays to leave their surface.
struct Variant {
    name: &'static str,
    offset: Option<Offset>,
    /// Whether the scene is brought to the origin before it becomes 32-bit floats.
    conditioned: bool,
    /// Whether its file holds no more digits than 32-bit floats.
    of_floats: bool,
}

impl Variant {
    fn wishes(&self) -> Wishes {
        Wishes { offset: self.offset, ..Wishes::default() }
    }
}

const PLAIN: Variant = Variant { name: "auto", offset: None, conditioned: true, of_floats: false };

const VARIANTS: [Variant; 8] = [
    Variant { name: "fixed", offset: Some(Offset::Fixed), ..PLAIN },
    Variant { name: "fixed, unconditioned", offset: Some(Offset::Fixed), conditioned: false, ..PLAIN },
    Variant { name: "scaled", offset: Some(Offset::Scaled), ..PLAIN },
    Variant { name: "scaled, unconditioned", offset: Some(Offset::Scaled), conditioned: false, ..PLAIN },
    Variant { name: "ulp", offset: Some(Offset::Ulp), ..PLAIN },
    Variant { name: "ulp, unconditioned", offset: Some(Offset::Ulp), conditioned: false, ..PLAIN },
    Variant { name: "auto, file of 32-bit floats", of_floats: true, ..PLAIN },
    PLAIN,
];

/// Scales, and shifts in widths of the scene.
const QUICK: [(f64, f64); 5] = [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e4), (1e-3, 1e6)];
const SCALES: [f64; 5] = [1.0, 1e-6, 1e-3, 1e3, 1e6];
const SHIFTS: [f64; 4] = [0.0, 1e2, 1e4, 1e6];

fn run(lab: &Lab<'_>) -> Result<Findings> {
    lab.observe("what rays meet in f64", 0.0);
    let subjects = subjects(lab)?;
    let all = SCALES.iter().flat_map(|&scale| SHIFTS.map(|shift| (scale, shift)));
    let places: Vec<(f64, f64)> = if lab.quick { QUICK.into() } else { all.collect() };
    let compiled = Rc::new(Compiled::default());
    let mut cases: Vec<Vec<Case>> = VARIANTS.iter().map(|_| Vec::new()).collect();
    let (mut done, count) = (0.0, (subjects.len() * places.len()) as f64);
    for subject in &subjects {
        for &place in &places {
            let forms = Forms::new(lab, subject, place);
            for (variant, cases) in VARIANTS.iter().zip(&mut cases) {
                lab.observe(&format!("{}, {}", forms.name, variant.name), done / count * 0.9);
                cases.push(trial(lab, subject, &forms, variant, &compiled));
            }
            done += 1.0;
        }
    }
    let costs = if lab.quick { Vec::new() } else { costs(lab, &subjects)? };
    let rows = VARIANTS.iter().zip(cases).enumerate().map(|(place, (variant, cases))| {
        row(variant, cases).costing(costs.iter().find(|(known, _)| *known == place).map(|(_, cost)| *cost))
    });
    Ok(Findings { rows: rows.collect(), figures: figures(lab, &subjects)? })
}

/// A scene at a place, as its file may hold it and as it is placed.
struct Forms {
    name: String,
    place: (f64, f64),
    doubles: Scene,
    floats: Scene,
    conditioned: Result<Geometry>,
    unconditioned: Result<Geometry>,
    of_floats: Result<Geometry>,
}

impl Forms {
    fn new(lab: &Lab<'_>, subject: &Subject, (scale, shift): (f64, f64)) -> Self {
        let name = format!("{} x {scale:e} + {shift:e}", subject.scene.path);
        let mesh = moved(&subject.scene.mesh, scale, shift);
        let rounded = mesh.positions.iter().map(|p| p.as_vec3().as_dvec3()).collect();
        let floats = scene_of(&name, Mesh { positions: rounded, ..mesh.clone() });
        let doubles = scene_of(&name, mesh);
        Self {
            place: (scale, shift),
            conditioned: lab.geometry(&doubles, &Wishes::default()),
            unconditioned: as_in_file(&doubles),
            of_floats: lab.geometry(&floats, &Wishes::default()),
            name,
            doubles,
            floats,
        }
    }
}

/// The scene in the units of its file.
fn as_in_file(scene: &Scene) -> Result<Geometry> {
    Geometry::build(scene, false, Builder::Sah, &|_| {})
}

fn trial(
    lab: &Lab<'_>,
    subject: &Subject,
    forms: &Forms,
    variant: &Variant,
    compiled: &Rc<Compiled>,
) -> Case {
    match answers(lab, subject, forms, variant, compiled) {
        Ok(case) => case,
        Err(error) => Case::of_error(&forms.name, &error),
    }
}

/// Rays from where the device puts the starts, in directions whose answers are known.
fn answers(
    lab: &Lab<'_>,
    subject: &Subject,
    forms: &Forms,
    variant: &Variant,
    compiled: &Rc<Compiled>,
) -> Result<Case> {
    let (scene, geometry) = match (variant.of_floats, variant.conditioned) {
        (true, _) => (&forms.floats, &forms.of_floats),
        (false, true) => (&forms.doubles, &forms.conditioned),
        (false, false) => (&forms.doubles, &forms.unconditioned),
    };
    let geometry = geometry.as_ref().map_err(|error| Error::other(error.to_string()))?;
    let (scale, shift) = forms.place;
    let job = Job { camera: subject.camera(scale, shift), ..lab.job(scene, subject.size, 4) };
    let plan = lab.plan(job, scene, geometry, &variant.wishes())?;
    let lists = RayLists::new(lab.device, &plan)?.sharing(compiled);
    let mut places = vec![NO_HIT; subject.scene.mesh.triangles.len()];
    for (place, triangle) in geometry.triangles.iter().enumerate() {
        places[triangle.id as usize] = place as u32;
    }
    let nothing = HitRecord { index: NO_HIT, ..HitRecord::default() };
    let mut hits = vec![nothing; plan.tiles.numbers() as usize];
    let number = |pixel: u32| plan.tiles.number(pixel % subject.size.0, pixel / subject.size.0) as usize;
    for start in &subject.starts {
        let [u, v] = start.uv;
        hits[number(start.pixel)] = HitRecord { t: 1.0, u, v, index: places[start.triangle as usize] };
    }
    let starts = lists.ambient_rays(&hits, 0)?;
    // A triangle that was left out has no starts.
    let traced: Vec<_> = subject
        .rays
        .iter()
        .filter(|ray| places[subject.starts[ray.start].triangle as usize] != NO_HIT)
        .collect();
    let rays: Vec<RayRecord> = traced
        .iter()
        .map(|ray| RayRecord { direction: ray.direction, ..starts[number(subject.starts[ray.start].pixel)] })
        .collect();
    let (mut self_hits, mut leaks) = (0u64, 0u64);
    for (ray, answer) in traced.iter().zip(lists.trace(Query::Any, &rays)?) {
        match (ray.meets, answer.index != NO_HIT) {
            (false, true) => self_hits += 1,
            (true, false) => leaks += 1,
            _ => {}
        }
    }
    let (trials, failures) = (rays.len() as u64, self_hits + leaks);
    let said = if variant.of_floats { digits::warnings(&scene.mesh) } else { Vec::new() };
    let mut notes = Vec::new();
    if failures > 0 {
        notes.push(format!("{self_hits} self-hits, {leaks} leaks"));
    }
    notes.extend(said.first().map(|warning| format!("inspect: {warning}")));
    Ok(Case {
        case: forms.name.clone(),
        trials,
        failures,
        worst: (trials > 0).then(|| 1e6 * failures as f64 / trials as f64),
        note: (!notes.is_empty()).then(|| notes.join("; ")),
        ..Case::default()
    })
}

fn row(variant: &Variant, cases: Vec<Case>) -> Row {
    let not_run = cases.iter().filter(|case| case.trials == 0).count();
    let told =
        |case: &Case| case.failures == 0 || case.note.as_ref().is_some_and(|note| note.contains("inspect: "));
    let warned = variant.of_floats && cases.iter().all(told);
    let row = Row::of(variant.name, cases);
    let row = match (row.failures, warned) {
        (1.., true) => row
            .judged(Verdict::Tells)
            .noting("the file has lost its digits, and `cousu inspect` says so of every scene that fails"),
        _ => row,
    };
    match (not_run, row.failures) {
        // The rule of three.
        (0, 0) => {
            let most = 3e6 / row.trials.max(1) as f64;
            row.noting(format!("fewer than {} in a million, at 95%", digits_of(most)))
        }
        (0, _) => row,
        _ => row.noting(format!("{not_run} scenes could not be traced")),
    }
}

/// Frame times on the largest scene over that of the first variant, of those whose scene is conditioned; by place.
fn costs(lab: &Lab<'_>, subjects: &[Subject]) -> Result<Vec<(usize, f64)>> {
    let Some(Subject { scene, .. }) = subjects.last() else { return Ok(Vec::new()) };
    lab.observe("times", 0.9);
    let geometry = lab.geometry(scene, &Wishes::default())?;
    let timed = |variant: &Variant| variant.conditioned && !variant.of_floats;
    let (places, choices): (Vec<usize>, Vec<(&str, Wishes)>) = VARIANTS
        .iter()
        .enumerate()
        .filter(|(_, variant)| timed(variant))
        .map(|(place, variant)| (place, (variant.name, variant.wishes())))
        .unzip();
    Ok(places.into_iter().zip(lab.costs(scene, &geometry, &choices)?).collect())
}

/// Pixels whose light is off by more are marked.
const MARKED: f32 = 0.08;

/// Cornell boxes in which a fixed length is too short and too long, and one far from the origin.
fn figures(lab: &Lab<'_>, subjects: &[Subject]) -> Result<Vec<Figure>> {
    let Some(cornell) = subjects.iter().find(|subject| subject.scene.path == "cornell") else {
        return Ok(Vec::new());
    };
    let fixed = Wishes { offset: Some(Offset::Fixed), ..Wishes::default() };
    let mut figures = Vec::new();
    for (name, place, wishes, conditioned) in [
        ("offset-fixed-self-hits", (1e6, 0.0), fixed, true),
        ("offset-fixed-leaks", (0.03, 0.0), fixed, true),
        ("offset-unconditioned", (1.0, 1e4), Wishes::default(), false),
    ] {
        lab.observe(name, 0.9 + 0.03 * figures.len() as f64);
        let scene = scene_of("cornell", moved(&cornell.scene.mesh, place.0, place.1));
        let survivor = picture(lab, &scene, &lab.geometry(&scene, &Wishes::default())?, &Wishes::default())?;
        let geometry = if conditioned { lab.geometry(&scene, &wishes)? } else { as_in_file(&scene)? };
        let failing = picture(lab, &scene, &geometry, &wishes)?;
        let off = |(a, b): (&f32, &f32)| (a - b).abs() > MARKED;
        let fails: Vec<bool> = failing.light.iter().zip(&survivor.light).map(off).collect();
        figures.push(Figure::of_failure(name, &failing, &survivor, &fails));
    }
    Ok(figures)
}

fn picture(lab: &Lab<'_>, scene: &Scene, geometry: &Geometry, wishes: &Wishes) -> Result<Picture> {
    lab.picture(&lab.plan(lab.job(scene, lab.size, lab.pick(64, 256)), scene, geometry, wishes)?)
}
