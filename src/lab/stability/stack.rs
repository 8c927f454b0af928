//! Stacks that are too small for a tree.
//!
//! Trees split at the middle, as the original's were, whose scenes make them degenerate: a chain, of whose triangles each
//! split puts one aside, and stairs of which each step is half as large as the one before. A ray that pierces them all
//! leaves an entry on the stack at each.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Case, Experiment, Findings, Lab, Row, Verdict};
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::lab::interleave::{Variant, digits, interleave};
use crate::lab::scenes::{procedural, scene_of};
use crate::layout::{Count, FRAME_SAMPLES, HitRecord, NO_HIT, RayRecord};
use crate::reference::exact::Truth;
use crate::reference::ray::{Ray, no_hit};
use crate::reference::{render_counts, traverse};
use crate::render::auto::check_stack;
use crate::render::choices::{Method, Passes, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Accumulated;
use crate::render::plan::{Job, Plan};
use crate::render::raylist::{Query, RayLists, reach_of};
use crate::render::seeds::hash;
use crate::render::twin::Twin;
use crate::scene::camera::Camera;
use crate::scene::{Mesh, Scene};
use crate::vk::DeviceKind;

pub const EXPERIMENT: Experiment = Experiment {
    name: "stack",
    what: "Trees that need 8 to 200 entries, and the house: rays that lose a subtree.",
    counts: "rays",
    worst: "entries needed over entries there are",
    run,
};

/// Entries of stacks that some trees overflow.
const SHORT: &[u32] = &[8, 16, 32, 64];
const QUICK_SHORT: &[u32] = &[16];
/// Steps of the stairs: the smallest are 2^-50 of the largest, beyond which f32 can't tell a hit.
const STEPS: u32 = 50;
/// Of the stack that pictures are shown of.
const SHOWN: u32 = 8;
/// Samples of the pictures.
const SAMPLES: u32 = 4 * FRAME_SAMPLES;
/// Rays times triangles that f64 brute force looks at in a scene, about.
const TRUTH_TESTS: usize = 1 << 23;
const QUICK_TRUTH_TESTS: usize = 1 << 20;

const QUERIES: [Query; 2] = [Query::Closest, Query::Any];

/// What a variant is.
#[derive(Clone, Copy)]
enum What {
    Auto,
    Method(Method),
    /// `stackN` as deep as the tree needs.
    Fitted,
    /// `stackN` of so many entries, and whether it may overflow.
    Short(u32, bool),
}

impl What {
    fn label(self) -> String {
        match self {
            Self::Auto => "auto".into(),
            Self::Method(method) => method.to_string(),
            Self::Fitted => "stack as deep as the tree".into(),
            Self::Short(entries, false) => format!("stack{entries}"),
            Self::Short(entries, true) => format!("stack{entries} --allow-overflow"),
        }
    }

    fn method(self, geometry: &Geometry) -> Option<Method> {
        match self {
            Self::Auto => None,
            Self::Method(method) => Some(method),
            Self::Fitted => Some(Method::Stack(geometry.stack_bound)),
            Self::Short(entries, _) => Some(Method::Stack(entries)),
        }
    }
}

/// A scene that asks for a deep stack.
struct Trap {
    name: String,
    scene: Scene,
    camera: Camera,
    /// Split at the middle.
    tree: Geometry,
    /// As `auto` would have it.
    usual: Geometry,
    /// Of either query.
    rays: [Vec<RayRecord>; 2],
    /// What `brute` finds.
    truth: Answers,
}

/// Of each query and ray, the bits of the distance and the coordinates, and the triangle's id; how many rays were
/// reported to have lost a part of the tree.
struct Answers {
    found: [Vec<[u32; 4]>; 2],
    reported: u64,
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let mut traps = Vec::new();
    lab.observe("scenes", 0.0);
    let sizes: &[u32] = lab.pick(&[200], &[8, 32, 64, 200]);
    for &size in sizes {
        traps.push(trap(lab, &format!("chain-{size}"), chain(size, false))?);
    }
    if !lab.quick {
        traps.push(trap(lab, "mirrored-200", chain(200, true))?);
        traps.push(trap(lab, "stairs-50", stairs(STEPS))?);
    }
    lab.observe("maison", 0.1);
    traps.push(house(lab)?);

    let short = lab.pick(QUICK_SHORT, SHORT);
    let mut variants: Vec<What> =
        short.iter().flat_map(|&n| [false, true].map(|may| What::Short(n, may))).collect();
    variants.push(What::Fitted);
    let of_method = |method| if let Method::Stack(_) = method { None } else { Some(What::Method(method)) };
    variants.extend(lab.methods(&traps[0].tree).into_iter().filter_map(of_method));
    variants.push(What::Auto);

    let mut rows = Vec::new();
    for (place, &what) in variants.iter().enumerate() {
        lab.observe(&what.label(), 0.2 + 0.5 * place as f64 / variants.len() as f64);
        rows.push(
            row(lab, &traps, what).unwrap_or_else(|error| Row::undecided(what.label(), error.to_string())),
        );
    }
    lab.observe("pictures", 0.7);
    let figures = [&traps[sizes.len() - 1], &traps[traps.len() - 1]].map(|trap| picture(lab, trap));
    if !lab.quick {
        lab.observe("costs", 0.8);
        add_costs(lab, &traps[traps.len() - 1], &variants, &mut rows);
    }
    Ok(Findings { rows, figures: figures.into_iter().collect::<Result<_>>()? })
}

/// A right-deep tree split at the middle: triangle k reaches from x_k to just beyond 1, and the middle of all that are left
/// lies beyond the middle of the first of them alone. `size` entries are needed; none of the boxes is small. Mirrored, it
/// is left-deep.
fn chain(size: u32, mirrored: bool) -> Scene {
    let mut random = Random { seed: 17, drawn: 0 };
    let step = 1.0 / f64::from(size);
    let side = if mirrored { -1.0 } else { 1.0 };
    let mut mesh = Mesh::default();
    for k in 0..size {
        let share = f64::from(k) * step;
        let [begin, end] = [-1.0 + share, 1.0 + share * step * 0.25];
        let height = 0.8 * share - 0.4;
        let [y, aside, wide] = [0.3 * random.signed(), 0.3 * random.signed(), 0.1 + 0.2 * random.unit()];
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([
            DVec3::new(side * begin, y, height),
            DVec3::new(side * end, aside - wide, height),
            DVec3::new(side * end, aside + wide, height + 0.01),
        ]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    scene_of("chain", mesh)
}

/// Two flights of stairs that come down to the middle from both sides, each step half as long, wide and high as the one
/// before: a split at the middle puts one step aside.
fn stairs(steps: u32) -> Scene {
    let mut mesh = Mesh::default();
    for side in [-1.0, 1.0] {
        for step in 0..steps {
            let size = (-f64::from(step)).exp2();
            let corner = |x: f64, z: f64| DVec3::new(side * x * size, 0.25 * size, z * size);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([corner(1.0, -0.2), corner(1.0, 0.2), corner(0.5, 0.2), corner(0.5, -0.2)]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    scene_of("stairs", mesh)
}

fn trap(lab: &Lab<'_>, name: &str, scene: Scene) -> Result<Trap> {
    let tree = Geometry::build(&scene, true, Builder::Midpoint, &|_| {})?;
    let count = match lab.device.adapter().kind {
        DeviceKind::Cpu => lab.pick(1 << 10, 1 << 12),
        _ => lab.pick(1 << 14, 1 << 16),
    };
    let rays = [0, 1].map(|query| rays_at(&tree, count, lab.seed.wrapping_add(query)));
    let camera = Camera::Pinhole { eye: [0.0, 0.0, 3.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov: 30.0 };
    finish(lab, name, scene, camera, tree, rays)
}

/// The house, and the rays of its picture.
fn house(lab: &Lab<'_>) -> Result<Trap> {
    let scene = procedural("maison", None, lab.seed)?;
    let tree = Geometry::build(&scene, true, Builder::Midpoint, &|_| {})?;
    let rays = {
        // Of one sample, since the first of several goes one way from all pixels.
        let plan = lab.plan(lab.job(&scene, lab.size, 1), &scene, &tree, &method(Method::Threaded))?;
        let lists = RayLists::new(lab.device, &plan)?;
        let camera = lists.camera_rays()?;
        let hits = lists.trace(Query::Closest, &camera)?;
        [camera, lists.ambient_rays(&hits, 0)?]
            .map(|rays| rays.into_iter().filter(|ray| ray.t_max >= 0.0).collect())
    };
    let camera = Camera::default_for(&scene.path);
    finish(lab, "maison", scene, camera, tree, rays)
}

fn finish(
    lab: &Lab<'_>,
    name: &str,
    scene: Scene,
    camera: Camera,
    tree: Geometry,
    rays: [Vec<RayRecord>; 2],
) -> Result<Trap> {
    let usual = lab.geometry(&scene, &Wishes::default())?;
    let none = Answers { found: Default::default(), reported: 0 };
    let mut trap = Trap { name: name.into(), scene, camera, tree, usual, rays, truth: none };
    let plan = trap.plan(lab, What::Method(Method::Brute), SAMPLES)?;
    trap.truth = trap.answers(lab, &plan)?;
    Ok(trap)
}

fn method(method: Method) -> Wishes {
    Wishes { method: Some(method), ..Wishes::default() }
}

/// Rays at points in and about random triangles: down and along the x axis, a little aslant, and from anywhere.
fn rays_at(geometry: &Geometry, count: u32, seed: u32) -> Vec<RayRecord> {
    let mut random = Random { seed, drawn: 0 };
    let mut one = |k: u32| {
        let target = (random.unit() * geometry.triangles.len() as f64) as usize;
        let triangle = &geometry.triangles[target.min(geometry.triangles.len() - 1)];
        let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(|v| Vec3::from(v).as_dvec3());
        let point = a + (1.5 * random.unit() - 0.25) * ab + (1.5 * random.unit() - 0.25) * ac;
        let side = if random.unit() < 0.5 { -1.0 } else { 1.0 };
        let tilt = DVec3::new(random.signed(), random.signed(), random.signed()) * 0.05;
        let direction = match k % 4 {
            0 => DVec3::Z * side + tilt,
            1 => DVec3::X * side + tilt,
            2 => DVec3::Y * side + tilt,
            _ => point - DVec3::new(random.signed(), random.signed(), random.signed()) * 1.5,
        };
        let origin = point - direction * if k % 4 == 3 { 1.0 } else { 2.0 };
        RayRecord {
            origin: origin.as_vec3().to_array(),
            t_max: f32::MAX,
            direction: direction.as_vec3().to_array(),
            weight: 1.0,
        }
    };
    (0..count).map(&mut one).collect()
}

/// Hashes of a counter.
struct Random {
    seed: u32,
    drawn: u32,
}

impl Random {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        self.drawn += 1;
        f64::from(hash(self.drawn, self.seed)) / 4_294_967_296.0
    }

    /// In [-1, 1).
    fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
}

impl Trap {
    fn geometry(&self, what: What) -> &Geometry {
        if let What::Auto = what { &self.usual } else { &self.tree }
    }

    fn plan(&self, lab: &Lab<'_>, what: What, samples: u32) -> Result<Plan<'_>> {
        let geometry = self.geometry(what);
        // Kernels of one pass are the fewest to compile; auto keeps what it chooses.
        let passes = if let What::Auto = what { None } else { Some(Passes::Single) };
        let wishes = Wishes { method: what.method(geometry), passes, ..Wishes::default() };
        let job = Job { camera: self.camera, ..lab.job(&self.scene, lab.size, samples) };
        let reach = self.rays.iter().map(|rays| reach_of(rays)).fold(0.0, f64::max);
        Ok(lab.plan(job, &self.scene, geometry, &wishes)?.with_reach(reach, true))
    }

    fn answers(&self, lab: &Lab<'_>, plan: &Plan<'_>) -> Result<Answers> {
        let lists = RayLists::new(lab.device, plan)?;
        let mut answers = Answers { found: Default::default(), reported: 0 };
        for (query, (rays, found)) in QUERIES.into_iter().zip(self.rays.iter().zip(&mut answers.found)) {
            let (hits, reported) = lists.trace_counting(query, rays)?;
            *found = hits.iter().map(|hit| bits(plan, query, hit)).collect();
            answers.reported += reported;
        }
        Ok(answers)
    }

    fn count(&self) -> u64 {
        self.rays.iter().map(|rays| rays.len() as u64).sum()
    }
}

/// An answer that does not depend on the order of the leaves.
fn bits(plan: &Plan<'_>, query: Query, hit: &HitRecord) -> [u32; 4] {
    let triangle = plan.geometry.triangles.get(hit.index as usize).filter(|_| query == Query::Closest);
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), triangle.map_or(hit.index, |triangle| triangle.id)]
}

/// Whether each answer differs.
fn apart(a: &Answers, b: &Answers) -> Vec<bool> {
    a.found.iter().flatten().zip(b.found.iter().flatten()).map(|(a, b)| a != b).collect()
}

fn failures(wrong: &[bool]) -> u64 {
    wrong.iter().filter(|&&wrong| wrong).count() as u64
}

fn row(lab: &Lab<'_>, traps: &[Trap], what: What) -> Result<Row> {
    let (mut cases, mut refused, mut told) = (Vec::new(), None, true);
    for trap in traps {
        let geometry = trap.geometry(what);
        let short = if let What::Short(entries, may) = what { Some((entries, may)) } else { None };
        if let Some((entries, may)) = short
            && let Err(error) = check_stack(Method::Stack(entries), geometry, may)
        {
            cases.push(Case {
                case: trap.name.clone(),
                worst: Some(f64::from(geometry.stack_bound) / f64::from(entries)),
                note: Some("refused".into()),
                ..Case::default()
            });
            refused = refused.or(Some(error.to_string()));
            continue;
        }
        let plan = trap.plan(lab, what, SAMPLES)?;
        let needed = plan.stack_bound();
        let bound = if let Method::Stack(entries) = plan.settings.method { entries } else { needed };
        let mut case = Case {
            case: trap.name.clone(),
            worst: (needed > 0).then(|| f64::from(needed) / f64::from(bound)),
            note: (needed > 0).then(|| format!("{needed} entries needed")),
            ..Case::default()
        };
        if plan.brute() {
            (case.trials, case.failures) = against_f64(lab, trap, &plan);
        } else {
            let answers = trap.answers(lab, &plan)?;
            let wrong = apart(&answers, &trap.truth);
            (case.trials, case.failures) = (trap.count(), failures(&wrong));
            if let Some((_, true)) = short {
                let touched = touched(&plan, &trap.rays);
                told &= tells(&mut case, needed, &wrong, &touched, answers.reported);
            }
        }
        cases.push(case);
    }
    if let (What::Short(_, true), Some(house)) = (what, traps.last()) {
        let (case, tells) = picture_case(lab, house, what)?;
        cases.push(case);
        told &= tells;
    }
    let row = Row::of(what.label(), cases);
    let fails = row.verdict == Verdict::Fails;
    Ok(match refused {
        Some(sentence) if !fails => row.judged(Verdict::Refuses).noting(sentence),
        None if fails && told && matches!(what, What::Short(_, true)) => row.judged(Verdict::Tells).noting(
            "the rays that it reports are exactly those that lose a subtree, all wrong answers among them",
        ),
        _ => row,
    })
}

/// Writes down what was reported against what is true. Whether it is the same, every wrong answer within.
fn tells(case: &mut Case, needed: u32, wrong: &[bool], touched: &[bool], reported: u64) -> bool {
    let lost = failures(touched);
    let unreported = wrong.iter().zip(touched).filter(|(wrong, touched)| **wrong && !**touched).count();
    let per_million = lost as f64 * 1e6 / touched.len().max(1) as f64;
    case.note = Some(format!(
        "{needed} entries needed; {lost} rays lose a subtree ({} in a million), {reported} reported; {unreported} wrong \
         answers of rays that lose none",
        digits(per_million)
    ));
    reported == lost && unreported == 0
}

/// A whole picture, whose outcome reports the rays: whether they are as many as by the twin, and what they change against
/// the threaded tree.
fn picture_case(lab: &Lab<'_>, house: &Trap, what: What) -> Result<(Case, bool)> {
    let plan = house.plan(lab, what, SAMPLES)?;
    let outcome = lab.render(&plan)?;
    let whole = lab.render(&house.plan(lab, What::Method(Method::Threaded), SAMPLES)?)?;
    let twin = Twin::new(&plan);
    let truth = render_counts(&twin.inputs(&plan), 0..SAMPLES, None);
    let (Accumulated::Counts(short), Accumulated::Counts(whole)) = (&outcome.accumulated, &whole.accumulated)
    else {
        return Err(Error::other("Rays were not counted: report this as a bug."));
    };
    let changed = |(a, b): (&Count, &Count)| {
        let escaped = a.escaped0.abs_diff(b.escaped0) + a.escaped1.abs_diff(b.escaped1);
        u64::from(escaped + a.traced0.abs_diff(b.traced0) + a.traced1.abs_diff(b.traced1))
    };
    let wrong = short.iter().zip(whole).filter(|(a, b)| a != b).count();
    let (reported, lost) = (outcome.overflowed_rays, truth.overflowed);
    let case = Case {
        case: format!("{}, picture", house.name),
        trials: outcome.primary_rays + outcome.ambient_rays,
        failures: short.iter().zip(whole).map(changed).sum(),
        worst: None,
        note: Some(format!(
            "{wrong} pixels wrong; {lost} rays lose a subtree, {reported} reported; at least so many wrong answers as \
             the counts differ by"
        )),
        ..Case::default()
    };
    Ok((case, reported == lost && *short == truth.counts))
}

/// Whether each ray drops a push, by the twin.
fn touched(plan: &Plan<'_>, rays: &[Vec<RayRecord>; 2]) -> Vec<bool> {
    let twin = Twin::new(plan);
    let inputs = twin.inputs(plan);
    let closest = rays[0].par_iter().map(|ray| {
        let ray = Ray::of_record(ray);
        traverse::closest_hit(&inputs, &ray, no_hit(ray.t_max)).1
    });
    let any = rays[1].par_iter().map(|ray| traverse::any_hit(&inputs, &Ray::of_record(ray)).1);
    closest.chain(any).collect()
}

/// Rays of `brute` that were looked at, evenly spread, and those whose answer f64 does not accept.
fn against_f64(lab: &Lab<'_>, trap: &Trap, plan: &Plan<'_>) -> (u64, u64) {
    let twin = Twin::new(plan);
    let truth = Truth::of(&twin.inputs(plan));
    let tests = lab.pick(QUICK_TRUTH_TESTS, TRUTH_TESTS);
    let stride = (trap.count() as usize * plan.geometry.triangles.len()).div_ceil(tests);
    let place = |id: u32| plan.geometry.triangles.iter().position(|triangle| triangle.id == id);
    let (mut trials, mut wrong) = (0, 0);
    for (query, (rays, found)) in QUERIES.into_iter().zip(trap.rays.iter().zip(&trap.truth.found)) {
        let pairs: Vec<_> = rays.iter().zip(found).step_by(stride).collect();
        let accepts = |&(ray, &[t, u, v, id]): &(&RayRecord, &[u32; 4])| {
            let [t, u, v] = [t, u, v].map(f32::from_bits);
            let answer = |index| HitRecord { t, u, v, index };
            match query {
                Query::Any => truth.any(ray).accepts(&answer(id)).is_ok(),
                Query::Closest => {
                    let index = if id == NO_HIT { Some(NO_HIT) } else { place(id).map(|place| place as u32) };
                    index.is_some_and(|index| truth.closest(ray).accepts(&answer(index)).is_ok())
                }
            }
        };
        trials += pairs.len() as u64;
        wrong += pairs.par_iter().filter(|pair| !accepts(pair)).count() as u64;
    }
    (trials, wrong)
}

/// A picture by a stack that is too short, beside the threaded tree's.
fn picture(lab: &Lab<'_>, trap: &Trap) -> Result<Figure> {
    let light = |what| lab.picture(&trap.plan(lab, what, SAMPLES)?);
    let failing = light(What::Short(SHOWN, true))?;
    let survivor = light(What::Method(Method::Threaded))?;
    let fails: Vec<bool> = failing.light.iter().zip(&survivor.light).map(|(a, b)| a != b).collect();
    Ok(Figure::of_failure(format!("stack-{}-stack{SHOWN}", trap.name), &failing, &survivor, &fails))
}

/// Times on the house over that of a stack as deep as its tree.
fn add_costs(lab: &Lab<'_>, house: &Trap, variants: &[What], rows: &mut [Row]) {
    let (width, height) = lab.size;
    // brute takes long on a CPU.
    let size = if lab.device.adapter().kind == DeviceKind::Cpu { (width / 4, height / 4) } else { lab.size };
    let small = Lab {
        size: (size.0.max(8), size.1.max(8)),
        methods: Vec::new(),
        compiled: lab.compiled.clone(),
        ..*lab
    };
    let refused = |what: &What| matches!(what, What::Short(_, false));
    let ran = variants.iter().zip(&*rows);
    let ran = ran.filter(|(what, row)| !refused(what) && row.verdict != Verdict::NotDecided);
    let labels: Vec<(String, What)> = ran.map(|(what, row)| (row.variant.clone(), *what)).collect();
    let ratios = || -> Result<Vec<f64>> {
        let variant = |(label, what): &(String, What)| {
            Ok(Variant::new(label, house.plan(&small, *what, FRAME_SAMPLES)?))
        };
        let made = labels.iter().map(variant).collect::<Result<Vec<_>>>()?;
        let plain = labels
            .iter()
            .position(|(_, what)| matches!(what, What::Fitted))
            .ok_or_else(|| Error::other("The stack as deep as the tree did not run."))?;
        let series = interleave(lab.device, lab.quick, &house.name, &made)?;
        (0..made.len()).map(|which| Ok(series.ratio(which, plain)?.ratio)).collect()
    };
    let Ok(ratios) = ratios() else { return };
    for ((label, _), ratio) in labels.iter().zip(ratios) {
        rows.iter_mut().filter(|row| row.variant == *label).for_each(|row| row.gpu_ms_ratio = Some(ratio));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::stack::single_push_bound;
    use crate::render::choices::MOST_STACK;

    fn tree(scene: &Scene) -> Geometry {
        Geometry::build(scene, true, Builder::Midpoint, &|_| {}).unwrap()
    }

    #[test]
    fn chains_need_an_entry_for_each_triangle() {
        for size in [8, 32, 64, 200, 600] {
            let right = tree(&chain(size, false));
            assert_eq!((right.stack_bound, single_push_bound(&right.tree)), (size, size - 1));
            let left = tree(&chain(size, true));
            assert_eq!((left.stack_bound, left.tree.depth()), (2, size - 1));
            assert_eq!(left.without_area + right.without_area, 0);
        }
    }

    /// A stack that no kernel has is not advised.
    #[test]
    fn a_tree_beyond_every_stack_is_refused_with_what_there_is() {
        // f32 rounds the longest chains a little shorter.
        for (size, advised) in [(200, true), (1024, true), (1200, false)] {
            let tree = tree(&chain(size, false));
            let needed = tree.stack_bound;
            assert_eq!(needed <= MOST_STACK, advised, "{size}: {needed}");
            let refusal = check_stack(Method::Stack(16), &tree, false).unwrap_err().to_string();
            assert!(refusal.contains("threaded"), "{refusal}");
            assert_eq!(refusal.contains(&format!("stack{needed} or")), advised, "{refusal}");
        }
    }

    #[test]
    fn stairs_need_an_entry_for_each_step() {
        let stairs = tree(&stairs(STEPS));
        assert!((STEPS..STEPS + 4).contains(&stairs.stack_bound), "{}", stairs.stack_bound);
        assert_eq!(stairs.without_area, 0);
    }
}
