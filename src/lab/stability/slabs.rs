//! Boxes that a ray meets and the test misses.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::measure::fitted;
use super::{Case, Experiment, Findings, Lab, Row};
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::scenes::{procedural, scene_of};
use crate::layout::{HitRecord, NO_HIT, RayRecord, Triangle};
use crate::reference::exact::{Rules, Shapes, Truth};
use crate::render::choices::{Intersector, Method, Slabs, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Picture;
use crate::render::plan::Plan;
use crate::render::raylist::Query;
use crate::render::seeds::hash;
use crate::scene::{Mesh, Scene};

pub const EXPERIMENT: Experiment = Experiment {
    name: "slabs",
    what: "Rays along axes and in faces of boxes, flat boxes, boxes far away: hits that are lost.",
    counts: "rays",
    worst: "hits lost in a million rays",
    run,
};

/// A scene of flat triangles along the axes, in the file's own units, with rays and, where f64 is certain of it, how far
/// away the hit is at most.
struct Lattice {
    scene: Scene,
    geometry: Geometry,
    rays: Vec<RayRecord>,
    farthest: Vec<Option<f64>>,
}

/// Cells of a side.
const CELLS: u32 = 8;

/// Cubes of a unit, `CELLS` x `CELLS` of different heights with gaps, every coordinate a multiple of a quarter.
fn city(at: DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    for cell in 0..CELLS * CELLS {
        let height = f64::from(1 + hash(cell, 3) % 5);
        let foot = at + DVec3::new(1.25 * f64::from(cell % CELLS), 0.0, 1.25 * f64::from(cell / CELLS));
        let first = mesh.positions.len() as u32;
        mesh.positions.extend((0..8).map(|i| {
            foot + DVec3::new(f64::from(i & 1), height * f64::from(i >> 1 & 1), f64::from(i >> 2 & 1))
        }));
        let quads: [[u32; 4]; 6] =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        mesh.triangles.extend(triangles.map(|corners| corners.map(|corner| first + corner)));
    }
    mesh
}

/// What a direction's smallest components are.
const SMALL: [f32; 8] = [0.0, -0.0, 1e-45, -1e-40, 1e-38, -1e-30, 1e-20, 1e-7];

/// Ray `i` at the inside of a triangle: along an axis or nearly so, or from a point in the plane of a box's face.
fn ray(triangles: &[Triangle], i: u32, seed: u32) -> RayRecord {
    let random = |purpose: u32| hash(8 * i + purpose, seed ^ 0x736c_6162) as f32 / 4_294_967_296.0;
    let pick = |purpose: u32, count: usize| ((random(purpose) * count as f32) as usize).min(count - 1);
    let triangle = &triangles[pick(0, triangles.len())];
    let [u, v] = [0.1 + 0.3 * random(1), 0.1 + 0.3 * random(2)];
    let (a, ab, ac) = (Vec3::from(triangle.a), Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let target = a + u * ab + v * ac;
    let size = ab.length().max(ac.length());
    // The axis across a flat triangle.
    let across = (0..3).find(|&axis| ab[axis] == 0.0 && ac[axis] == 0.0).unwrap_or(0);
    let mut direction = Vec3::ZERO;
    direction[across] = if random(3) < 0.5 { -1.0 } else { 1.0 };
    let [first, second] = [(across + 1) % 3, (across + 2) % 3];
    direction[first] = SMALL[pick(4, SMALL.len())];
    let mut origin = target - direction * size * (0.5 + 2.0 * random(5));
    if i.is_multiple_of(2) {
        direction[second] = SMALL[pick(6, SMALL.len())];
    } else {
        // In the plane of a face: the coordinate of a corner, and from there to the target.
        origin[second] = a[second];
        direction[second] = (target[second] - origin[second]) / (target[across] - origin[across]).abs();
    }
    RayRecord { origin: origin.to_array(), t_max: f32::MAX, direction: direction.to_array(), weight: 1.0 }
}

/// A floor of unit squares, two triangles each.
fn floor(at: DVec3, step: f64) -> Mesh {
    let side = 2 * CELLS + 1;
    let corner = |i: u32| at + step * DVec3::new(f64::from(i % side), 0.0, f64::from(i / side));
    let squares = (0..side * side).filter(|i| i % side < side - 1 && i / side < side - 1);
    Mesh {
        positions: (0..side * side).map(corner).collect(),
        triangles: squares.flat_map(|i| [[i, i + 1, i + side + 1], [i, i + side + 1, i + side]]).collect(),
    }
}

/// Ray `i` of a floor: straight down or nearly so at a corner within it, in which the boxes of its triangles meet.
fn ray_at_corner(mesh: &Mesh, i: u32, seed: u32) -> RayRecord {
    let side = 2 * CELLS + 1;
    let random = |purpose: u32, count: u32| hash(4 * i + purpose, seed ^ 0x666c_6f6f) % count;
    let corner = (1 + random(0, side - 2)) * side + 1 + random(1, side - 2);
    let small = |purpose: u32| SMALL[random(purpose, SMALL.len() as u32) as usize];
    let step = mesh.positions[1].x - mesh.positions[0].x;
    let origin = mesh.positions[corner as usize] + DVec3::Y * step;
    let direction = [small(2), -1.0, small(3)];
    RayRecord { origin: origin.as_vec3().to_array(), t_max: f32::MAX, direction, weight: 1.0 }
}

impl Lattice {
    fn of(mesh: Mesh, name: &str) -> Result<Self> {
        let scene = scene_of(name, mesh);
        let geometry = Geometry::build(&scene, false, Builder::Sah, &|_| {})?;
        Ok(Self { scene, geometry, rays: Vec::new(), farthest: Vec::new() })
    }

    /// Rays at the insides of triangles; f64 brute force tells what they hit.
    fn new(lab: &Lab<'_>, name: &str, mesh: Mesh, count: u32) -> Result<Self> {
        let mut lattice = Self::of(mesh, name)?;
        let triangles = &lattice.geometry.triangles;
        lattice.rays = (0..count).map(|i| ray(triangles, i, lab.seed)).collect();
        let rules = Rules { box_pad: lattice.geometry.box_pad, robust_slabs: true };
        let truth = Truth { triangles: Shapes::Edges(triangles), rules };
        let farthest = |ray| truth.closest(ray).certain.map(|(_, meeting)| meeting.t + meeting.t_error);
        lattice.farthest = lattice.rays.par_iter().map(farthest).collect();
        Ok(lattice)
    }

    /// Rays at the corners of a floor, which are hit as far away as they start above it.
    fn of_floor(lab: &Lab<'_>, name: &str, at: DVec3, step: f64, count: u32) -> Result<Self> {
        let mut lattice = Self::of(floor(at, step), name)?;
        let mesh = &lattice.scene.mesh;
        lattice.rays = (0..count).map(|i| ray_at_corner(mesh, i, lab.seed)).collect();
        lattice.farthest = vec![Some(step * 1.0001); count as usize];
        Ok(lattice)
    }

    fn plan(&self, lab: &Lab<'_>, wishes: &Wishes) -> Result<Plan<'_>> {
        lab.plan(lab.job(&self.scene, (8, 8), 4), &self.scene, &self.geometry, wishes)
    }

    fn case(&self, lab: &Lab<'_>, wishes: &Wishes) -> Result<Case> {
        let plan = self.plan(lab, wishes)?;
        let closest = lab.trace(&plan, Query::Closest, &self.rays)?;
        let any = lab.trace(&plan, Query::Any, &self.rays)?;
        let lost = |hit: &HitRecord, farthest: f64| hit.index == NO_HIT || f64::from(hit.t) > farthest;
        let certain = || (0..self.rays.len()).filter_map(|i| self.farthest[i].map(|farthest| (i, farthest)));
        let failures = certain().filter(|&(i, farthest)| lost(&closest[i], farthest)).count()
            + certain().filter(|&(i, _)| any[i].index == NO_HIT).count();
        let trials = 2 * certain().count();
        Ok(Case {
            case: self.scene.path.clone(),
            trials: trials as u64,
            failures: failures as u64,
            worst: Some(failures as f64 * 1e6 / trials.max(1) as f64),
            ..Case::default()
        })
    }
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let count = lab.pick(1_000, 20_000);
    lab.observe("rays and f64 brute force", 0.0);
    let far = |x: f64| DVec3::new(x, -x, x);
    let sheets = Mesh {
        positions: (0..4 * 64)
            .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2) / 64.0))
            .collect(),
        triangles: (0..64)
            .flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 3], [4 * i, 4 * i + 3, 4 * i + 2]])
            .collect(),
    };
    let mut grown = city(DVec3::ZERO);
    grown.positions.iter_mut().for_each(|p| *p = *p * 8.0 + far(1e7));
    let lattices = [
        Lattice::new(lab, "city", city(DVec3::ZERO), count)?,
        Lattice::of_floor(lab, "floor", DVec3::ZERO, 1.0, count)?,
        Lattice::new(lab, "flat sheets", sheets, count)?,
        Lattice::of_floor(lab, "floor moved by 1,000.25", far(1000.25), 1.0, count)?,
        Lattice::new(lab, "city moved by 54,321.75", city(far(54_321.75)), count)?,
        Lattice::new(lab, "city at 1e7", grown, count)?,
        Lattice::of_floor(lab, "floor at 1e7", far(1e7), 8.0, count)?,
    ];
    let methods = lab.methods(&lattices[0].geometry);
    let mut variants: Vec<(String, Option<Method>, Option<Slabs>)> = vec![("auto".into(), None, None)];
    for slabs in [Slabs::Plain, Slabs::Robust] {
        variants.extend(methods.iter().map(|m| (format!("{slabs}, {}", m.family()), Some(*m), Some(slabs))));
    }
    let costs = costs(lab, &methods).unwrap_or_default();
    let mut findings = Findings::default();
    for (place, (label, method, slabs)) in variants.iter().enumerate() {
        lab.observe(label, place as f64 / variants.len() as f64);
        let mut cases = Vec::new();
        for lattice in &lattices {
            let method = method.map(|method| fitted(method, &lattice.geometry));
            // So that a ray at an edge is no question of the triangles'.
            let intersector = slabs.map(|_| Intersector::Watertight);
            let wishes = Wishes { method, slabs: *slabs, intersector, ..Wishes::default() };
            let case = lattice.case(lab, &wishes);
            cases.push(case.unwrap_or_else(|error| Case::of_error(&lattice.scene.path, &error)));
        }
        let cost = costs.iter().find(|(known, _)| known == label).map(|(_, ratio)| *ratio);
        findings.rows.push(Row::of(label, cases).costing(cost));
    }
    findings.figures.extend(figure(lab, &lattices[1]));
    Ok(findings)
}

/// Kernel time on the house: of each method's robust variant over its plain one, and of `auto` over `auto` with plain
/// slabs.
fn costs(lab: &Lab<'_>, methods: &[Method]) -> Result<Vec<(String, f64)>> {
    let scene = procedural("maison", None, lab.seed)?;
    let geometry = lab.geometry(&scene, &Wishes::default())?;
    let mut costs = Vec::new();
    for method in lab.timed(methods).into_iter().map(Some).chain([None]) {
        let method = method.map(|method| fitted(method, &geometry));
        let wishes = |slabs| Wishes { method, slabs: Some(slabs), ..Wishes::default() };
        let pair = [("plain", wishes(Slabs::Plain)), ("robust", wishes(Slabs::Robust))];
        let Ok(ratios) = lab.costs(&scene, &geometry, &pair) else { continue };
        match method {
            Some(method) => {
                costs.push((format!("plain, {}", method.family()), 1.0));
                costs.push((format!("robust, {}", method.family()), ratios[1]));
            }
            None => costs.push(("auto".into(), ratios[1])),
        }
    }
    Ok(costs)
}

/// Pixels of the map of lost hits.
const MAP: (u32, u32) = (161, 161);

/// A floor from above: a ray a pixel, straight down, from the points of a fine lattice, in which the edges of the boxes lie.
/// Grey where it is seen.
fn figure(lab: &Lab<'_>, floor: &Lattice) -> Result<Figure> {
    let step = 2.0 * CELLS as f32 / (MAP.0 - 1) as f32;
    let rays: Vec<RayRecord> = (0..MAP.0 * MAP.1)
        .map(|i| RayRecord {
            origin: [(i % MAP.0) as f32 * step, 8.0, (i / MAP.0) as f32 * step],
            t_max: f32::MAX,
            direction: [0.0, -1.0, 0.0],
            weight: 1.0,
        })
        .collect();
    let map = |slabs| -> Result<Picture> {
        let intersector = Some(Intersector::Watertight);
        let method = Some(Method::Threaded);
        let wishes = Wishes { slabs: Some(slabs), intersector, method, ..Wishes::default() };
        let hits = lab.trace(&floor.plan(lab, &wishes)?, Query::Closest, &rays)?;
        let light = hits.iter().map(|hit| if hit.index == NO_HIT { 0.0 } else { 0.5 });
        let coverage = vec![1.0; hits.len()];
        Ok(Picture { width: MAP.0, height: MAP.1, light: light.collect(), coverage })
    };
    let (failing, survivor) = (map(Slabs::Plain)?, map(Slabs::Robust)?);
    let fails: Vec<bool> = failing.light.iter().map(|light| *light == 0.0).collect();
    Ok(Figure::of_failure("slabs-plain-floor", &failing, &survivor, &fails))
}
