//! Rays that pass between neighbouring triangles.

use glam::{DVec3, Vec3};

use super::closed::{blob, cone, cube, is_closed, points_inside, sphere};
use super::measure::fitted;
use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::scenes::procedural;
use crate::layout::{Corners, HitRecord, NO_HIT, RayRecord};
use crate::render::choices::{Intersector, Method, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Picture;
use crate::render::plan::Plan;
use crate::render::raylist::Query;
use crate::render::seeds::hash;
use crate::scene::Scene;

pub const EXPERIMENT: Experiment = Experiment {
    name: "watertight",
    what: "Rays from inside closed meshes, aimed at edges and vertices: those that leave.",
    counts: "rays",
    worst: "leaks in a million rays",
    run,
};

/// Triangle tests of a variant of `brute` on one mesh, at most: what would take longer has fewer rays.
const BRUTE_TESTS: usize = 1 << 27;
const QUICK_BRUTE_TESTS: usize = 1 << 21;
const ORIGINS: usize = 64;

/// A closed mesh with rays that start inside it.
struct Closed<'a> {
    scene: &'a Scene,
    geometry: Geometry,
    rays: Vec<RayRecord>,
}

impl<'a> Closed<'a> {
    fn new(lab: &Lab<'_>, scene: &'a Scene, count: usize) -> Result<Self> {
        let geometry = lab.geometry(scene, &Wishes::default())?;
        let corners = geometry.corners(&scene.mesh);
        let origins = points_inside(corners, ORIGINS, lab.seed);
        let rays = match origins.is_empty() || !is_closed(&scene.mesh) {
            true => Vec::new(),
            false => (0..count as u32).map(|i| aimed(corners, &origins, i, lab.seed)).collect(),
        };
        Ok(Self { scene, geometry, rays })
    }
}

/// Ray `i`: from one of the origins at a corner, at a point of an edge, or some ulps beside.
fn aimed(corners: &[Corners], origins: &[Vec3], i: u32, seed: u32) -> RayRecord {
    let random = |purpose: u32| f64::from(hash(4 * i + purpose, seed ^ 0x6c65_616b)) / 4_294_967_296.0;
    let at = &corners[(random(0) * corners.len() as f64) as usize];
    let [a, b, c] = [at.a, at.b, at.c].map(|corner| Vec3::from(corner).as_dvec3());
    let [from, to] = [[a, b], [b, c], [c, a]][(i / 2 % 3) as usize];
    let target = if i.is_multiple_of(2) { from } else { from.lerp(to, random(1)) };
    let origin = origins[(random(2) * origins.len() as f64) as usize];
    let direction = (target - origin.as_dvec3()).as_vec3();
    let beside = |component: f32, k: u32| match i % 4 {
        // Up to two ulps to either side.
        3 => f32::from_bits(component.to_bits().wrapping_add(hash(i, k) % 5).wrapping_sub(2)),
        _ => component,
    };
    let direction = Vec3::new(beside(direction.x, 1), beside(direction.y, 2), beside(direction.z, 3));
    RayRecord {
        origin: origin.to_array(),
        t_max: f32::MAX,
        // A direction of length 1, as ambient rays have, has other roundings.
        direction: if i % 8 < 4 { direction } else { direction.normalize() }.to_array(),
        weight: 1.0,
    }
}

fn leaks(hits: &[HitRecord]) -> Vec<bool> {
    hits.iter().map(|hit| hit.index == NO_HIT).collect()
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let count = lab.pick(4_000, 250_000);
    let times = lab.pick(3, 6);
    lab.observe("meshes", 0.0);
    let scenes = [cube()?, sphere(times), blob(times), cone(lab.pick(64, 512), 40.0)];
    let meshes = scenes
        .iter()
        .chain(lab.scenes)
        .map(|scene| Closed::new(lab, scene, count))
        .collect::<Result<Vec<_>>>()?;
    let auto = [(None, Wishes::default())];
    let intersectors = [Intersector::Moller, Intersector::Conservative, Intersector::Watertight];
    let methods = lab.methods(&meshes[0].geometry);
    let variants: Vec<(Option<Method>, Wishes)> = auto
        .into_iter()
        .chain(intersectors.into_iter().flat_map(|intersector| {
            methods.iter().map(move |method| {
                let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
                (Some(*method), wishes)
            })
        }))
        .collect();
    let mut findings = Findings::default();
    for (place, (method, wishes)) in variants.iter().enumerate() {
        let intersector = wishes.intersector.map_or("auto", Intersector::name);
        let label = match method {
            Some(method) => format!("{intersector}, {}", method.family()),
            None => intersector.to_string(),
        };
        lab.observe(&label, place as f64 / variants.len() as f64);
        let mut cases = Vec::new();
        for mesh in &meshes {
            let method = method.map(|method| fitted(method, &mesh.geometry));
            let case = case(lab, mesh, &Wishes { method, ..*wishes });
            cases.push(case.unwrap_or_else(|error| Case::of_error(&mesh.scene.path, &error)));
        }
        findings.rows.push(Row::of(label, cases));
    }
    let costs = costs(lab, &methods).unwrap_or_default();
    for row in &mut findings.rows {
        row.gpu_ms_ratio = costs.iter().find(|(label, _)| *label == row.variant).map(|(_, ratio)| *ratio);
    }
    findings.figures.extend(figure(lab, &meshes[3]).ok().flatten());
    Ok(findings)
}

fn plan<'g>(lab: &Lab<'_>, mesh: &'g Closed<'_>, wishes: &Wishes) -> Result<Plan<'g>> {
    lab.plan(lab.job(mesh.scene, (8, 8), 4), mesh.scene, &mesh.geometry, wishes)
}

fn case(lab: &Lab<'_>, mesh: &Closed<'_>, wishes: &Wishes) -> Result<Case> {
    let name = mesh.scene.path.clone();
    if mesh.rays.is_empty() {
        let note = Some("not closed, or without an inside: left out".into());
        return Ok(Case { case: name, note, ..Case::default() });
    }
    let plan = plan(lab, mesh, wishes)?;
    let tests = lab.pick(QUICK_BRUTE_TESTS, BRUTE_TESTS);
    let most = if plan.brute() { tests / mesh.geometry.triangles.len() } else { mesh.rays.len() };
    let rays = &mesh.rays[..most.clamp(1, mesh.rays.len())];
    // Both kinds of ray: an answer that is found by one alone is a leak as well.
    let quarter = &rays[..rays.len().div_ceil(4)];
    let any = leaks(&lab.trace(&plan, Query::Any, rays)?);
    let closest = leaks(&lab.trace(&plan, Query::Closest, quarter)?);
    let failures = any.iter().chain(&closest).filter(|leak| **leak).count() as u64;
    let trials = (any.len() + closest.len()) as u64;
    let note = plan.settings.intersector.name();
    Ok(Case {
        case: name,
        trials,
        failures,
        worst: Some(failures as f64 * 1e6 / trials as f64),
        note: wishes.intersector.is_none().then(|| format!("{note}, {}", plan.settings.method)),
        ..Case::default()
    })
}

/// Kernel time on the house: of each method's watertight variant over its other one; of `auto` over `auto` with the
/// cheaper intersector.
fn costs(lab: &Lab<'_>, methods: &[Method]) -> Result<Vec<(String, f64)>> {
    let scene = procedural("maison", None, lab.seed)?;
    let geometry = lab.geometry(&scene, &Wishes::default())?;
    let mut costs = Vec::new();
    for method in lab.timed(methods).into_iter().map(Some).chain([None]) {
        let method = method.map(|method| fitted(method, &geometry));
        let wishes = |intersector| Wishes { method, intersector, ..Wishes::default() };
        let others = match method {
            Some(_) => vec![Some(Intersector::Conservative), Some(Intersector::Watertight)],
            None => vec![None],
        };
        let choices: Vec<(&str, Wishes)> = [Some(Intersector::Moller)]
            .into_iter()
            .chain(others)
            .map(|intersector| (intersector.map_or("auto", Intersector::name), wishes(intersector)))
            .collect();
        let Ok(ratios) = lab.costs(&scene, &geometry, &choices) else { continue };
        for ((intersector, _), ratio) in choices.iter().zip(ratios) {
            match method {
                Some(method) => costs.push((format!("{intersector}, {}", method.family()), ratio)),
                None => costs.push((intersector.to_string(), ratio)),
            }
        }
    }
    Ok(costs)
}

/// Pixels of the map of leaks.
const MAP: (u32, u32) = (320, 200);

/// A map of rays at the slivers of the cone, each pixel one: from left to right round the rim, from top to bottom from apex
/// to base, all on edges. Grey where a ray is stopped, the lighter the farther.
fn figure(lab: &Lab<'_>, mesh: &Closed<'_>) -> Result<Option<Figure>> {
    let mesh_ref = &mesh.scene.mesh;
    let corners = mesh.geometry.corners(mesh_ref);
    let Some(origin) = points_inside(corners, 1, lab.seed).first().copied() else { return Ok(None) };
    let slivers = (mesh_ref.positions.len() - 2) as u32;
    let place = |index: u32| -> DVec3 {
        mesh.geometry.placement.point(mesh_ref.positions[index as usize]).as_vec3().as_dvec3()
    };
    let rays: Vec<RayRecord> = (0..MAP.0 * MAP.1)
        .map(|i| {
            let (x, y) = (i % MAP.0, i / MAP.0);
            let rim = place(x % slivers);
            let target = place(slivers).lerp(rim, (f64::from(y) + 0.5) / f64::from(MAP.1));
            let direction = (target - origin.as_dvec3()).as_vec3().to_array();
            RayRecord { origin: origin.to_array(), t_max: f32::MAX, direction, weight: 1.0 }
        })
        .collect();
    let map = |intersector| -> Result<(Picture, Vec<bool>)> {
        let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
        let plan = plan(lab, mesh, &wishes)?;
        let hits = lab.trace(&plan, Query::Closest, &rays)?;
        let light = hits.iter().map(|hit| if hit.index == NO_HIT { 1.0 } else { hit.t * 0.5 }).collect();
        let coverage = vec![1.0; hits.len()];
        Ok((Picture { width: MAP.0, height: MAP.1, light, coverage }, leaks(&hits)))
    };
    let (failing, fails) = map(Intersector::Moller)?;
    let (survivor, _) = map(Intersector::Watertight)?;
    Ok(Some(Figure::of_failure("watertight-moller-cone", &failing, &survivor, &fails)))
}
