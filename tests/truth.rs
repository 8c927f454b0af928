//! Pictures and hits against closed forms, f64 brute force and the shaders' twin.

mod common;

use common::{
    INTERSECTORS, every_traversal, geometry, job, pinhole, plan, plan_decided, run, scene_from, scene_named,
    scene_of, with_device,
};
use cousu::layout::{Count, HitRecord, NO_HIT, RayRecord};
use cousu::reference;
use cousu::reference::exact::Truth;
use cousu::render::choices::{Accumulator, Intersector, Method, Offset, Preset, Sampler, Wishes};
use cousu::render::geometry::Geometry;
use cousu::render::picture::Accumulated;
use cousu::render::plan::Job;
use cousu::render::raylist::{Query, RayLists, reach_of};
use cousu::render::seeds::{hash, lcg_seeds};
use cousu::render::twin::Twin;
use cousu::scene::{Mesh, Scene, obj};
use cousu::vk::{Device, DeviceKind};
use glam::DVec3;
use rayon::prelude::*;

fn counts(accumulated: Accumulated) -> Vec<Count> {
    match accumulated {
        Accumulated::Counts(counts) => counts,
        Accumulated::Means(_) => panic!("counts were asked for"),
    }
}

const ROOM: &str = "v -2 0 -1\nv 2 0 -1\nv 2 0 1\nv -2 0 1\nv -2 3 -1\nv 2 3 -1\nv 2 3 1\nv -2 3 1\n\
                    f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
const CEILING: &str = "f 5 6 7 8\n";

#[test]
fn a_lone_plane_gives_1_however_it_is_seen() {
    with_device(|device| {
        let scene = scene_of("v -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nf 4 3 2 1\n");
        let geometry = geometry(&scene, Preset::Auto);
        for eye in [[0.1, 5.0, 0.2], [3.0, 0.01, 8.0], [1.0, -4.0, 2.0]] {
            for (offset, intersector) in [Offset::Scaled, Offset::Ulp]
                .into_iter()
                .flat_map(|offset| INTERSECTORS.map(|of| (offset, of)))
            {
                let camera = pinhole(eye, [0.0; 3], [0.3, 0.2, 1.0], 60.0);
                let job = Job { camera, ..job(&scene, (64, 40), 0..64) };
                let wishes =
                    Wishes { offset: Some(offset), intersector: Some(intersector), ..Wishes::default() };
                let outcome = run(device, &plan(device, &scene, &geometry, job, wishes));
                assert!(outcome.ambient_rays > 64 * 100, "{eye:?} {offset} {intersector}");
                assert!(all_escaped(&counts(outcome.accumulated)), "{eye:?} {offset} {intersector}");
            }
        }
    });
}

fn all_escaped(counts: &[Count]) -> bool {
    counts.iter().all(|c| c.escaped0 == c.traced0 && c.escaped1 == c.traced1)
}

/// Planes turned in every way, from either side, moved off by ulps; in the file's own units too.
#[test]
fn a_plane_askew_gives_1_with_an_offset_of_ulps() {
    with_device(|device| {
        let number = |i: u32| f64::from(hash(i, 5)) / f64::from(u32::MAX) * 2.0 - 1.0;
        for i in 0..12 {
            let vector = |place: u32| DVec3::new(number(place), number(place + 1), number(place + 2));
            let normal = vector(9 * i).normalize();
            let side = vector(9 * i + 3).cross(normal).normalize();
            let (preset, unit) =
                if i % 3 == 2 { (Preset::OriginalUnbiased, 100.0) } else { (Preset::Auto, 1.0) };
            let shift = vector(9 * i + 6) * unit;
            let mut mesh = Mesh::default();
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                mesh.positions.push(shift + (side * x + normal.cross(side) * y) * unit);
            }
            mesh.triangles.extend([[0, 1, 2], [2, 3, 0]]);
            let scene = scene_from(mesh, obj::Report::default());
            let geometry = geometry(&scene, preset);
            let eye = shift + (normal + side * 0.5) * unit * 2.0 * if i % 2 == 0 { 1.0 } else { -1.0 };
            let camera = pinhole(eye.to_array(), shift.to_array(), side.to_array(), 60.0);
            let job = Job { camera, ..job(&scene, (48, 30), 0..64) };
            for intersector in INTERSECTORS {
                // The original's has no errors to grant.
                if preset.is_original() && intersector == Intersector::Conservative {
                    continue;
                }
                let wishes = Wishes {
                    preset: Some(preset),
                    accumulator: Some(Accumulator::Count),
                    offset: Some(Offset::Ulp),
                    intersector: Some(intersector),
                    ..Wishes::default()
                };
                let outcome = run(device, &plan(device, &scene, &geometry, job.clone(), wishes));
                assert!(outcome.ambient_rays > 64 * 100, "plane {i}: {} rays", outcome.ambient_rays);
                assert!(all_escaped(&counts(outcome.accumulated)), "plane {i} {intersector}");
            }
        }
    });
}

/// A plane of any size, anywhere: read in f64 and brought to the origin before it becomes f32.
#[test]
fn a_lone_plane_gives_1_at_any_scale_and_place() {
    with_device(|device| {
        for scale in [1e-3, 1.0, 1e6] {
            for shift in [0.0, 1e3, -1e6] {
                let (low, high, y) = (scale * (shift - 1.0), scale * (shift + 1.0), scale * shift);
                let scene = scene_of(&format!(
                    "v {low} {y} {low}\nv {high} {y} {low}\nv {high} {y} {high}\nv {low} {y} {high}\nf 4 3 2 1\n"
                ));
                assert_eq!(scene.mesh.triangles.len(), 2, "scale {scale}, shift {shift}");
                let geometry = geometry(&scene, Preset::Auto);
                let center = scene.bounds.center();
                let eye = (center + DVec3::new(0.1, 2.0, 0.3) * scale).to_array();
                let camera = pinhole(eye, center.to_array(), [0.0, 0.0, 1.0], 40.0);
                let job = Job { camera, ..job(&scene, (32, 20), 0..16) };
                let outcome = run(device, &plan(device, &scene, &geometry, job, Wishes::default()));
                assert!(outcome.ambient_rays > 16 * 300, "scale {scale}, shift {shift}");
                let whole = counts(outcome.accumulated)
                    .iter()
                    .all(|c| c.escaped0 + c.escaped1 == c.traced0 + c.traced1);
                assert!(whole, "scale {scale}, shift {shift}");
            }
        }
    });
}

#[test]
fn a_closed_box_gives_0_inside() {
    with_device(|device| {
        let scene = scene_of(&format!("{ROOM}{CEILING}"));
        let geometry = geometry(&scene, Preset::Auto);
        let camera = pinhole([0.3, 1.4, 0.2], [-1.0, 0.5, -0.4], [0.0, 1.0, 0.0], 100.0);
        for intersector in INTERSECTORS {
            let job = Job { camera, ..job(&scene, (128, 80), 0..64) };
            let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
            let outcome = run(device, &plan(device, &scene, &geometry, job, wishes));
            assert_eq!(outcome.ambient_rays, 128 * 80 * 64, "every camera ray hits");
            assert!(counts(outcome.accumulated).iter().all(|c| c.escaped0 + c.escaped1 == 0));
        }
    });
}

/// Share of the cosine-weighted hemisphere about `normal` that a polygon takes, seen from `point` (Lambert
/// 1760): the sum over its edges of the angle they subtend times the cosine of their plane's tilt.
fn form_factor(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let sum: f64 = (0..polygon.len())
        .map(|i| {
            let a = (polygon[i] - point).normalize();
            let b = (polygon[(i + 1) % polygon.len()] - point).normalize();
            a.angle_between(b) * a.cross(b).normalize().dot(normal)
        })
        .sum();
    sum.abs() / (2.0 * std::f64::consts::PI)
}

#[test]
fn the_floor_of_an_open_box_sees_the_opening_by_its_form_factor() {
    // A unit square, seen from one unit below its corner: atan(1 / sqrt 2) / (sqrt 2 pi).
    let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Z, DVec3::Z];
    let corner = 0.5f64.sqrt().atan() / (2f64.sqrt() * std::f64::consts::PI);
    assert!((form_factor(DVec3::NEG_Y, DVec3::Y, &square) - corner).abs() < 1e-12);

    with_device(|device| {
        let scene = scene_of(ROOM);
        let geometry = geometry(&scene, Preset::Auto);
        let samples = 4096;
        let (width, height, fov) = (32u32, 20u32, 20.0);
        let eye = DVec3::new(0.4, 9.0, 0.1);
        let camera = pinhole(eye.to_array(), [0.4, 0.0, 0.1], [0.0, 0.0, -1.0], fov);
        let job = Job { camera, ..job(&scene, (width, height), 0..samples) };
        let plan = plan(device, &scene, &geometry, job, Wishes::default());
        let counts = counts(run(device, &plan).accumulated);
        let opening =
            [(-2.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-2.0, 1.0)].map(|(x, z)| DVec3::new(x, 3.0, z));
        let offset = 1e-4 * scene.bounds.diagonal();
        let unit = 2.0 * (fov.to_radians() * 0.5).tan() / f64::from(height);
        let mut tested = 0;
        for y in 0..height {
            for x in 0..width {
                let right = (f64::from(x) + 0.5 - f64::from(width) * 0.5) * unit * eye.y;
                let down = (f64::from(y) + 0.5 - f64::from(height) * 0.5) * unit * eye.y;
                let floor = DVec3::new(eye.x + right, offset, eye.z + down);
                if floor.x.abs() > 1.3 || floor.z.abs() > 0.65 {
                    continue; // The camera sees a wall there.
                }
                let exact = form_factor(floor, DVec3::Y, &opening);
                let count = counts[plan.tiles.number(x, y) as usize];
                let (escaped, traced) = (count.escaped0 + count.escaped1, count.traced0 + count.traced1);
                assert_eq!(traced, samples);
                let measured = f64::from(escaped) / f64::from(traced);
                let standard_error = (exact * (1.0 - exact) / f64::from(traced)).sqrt();
                assert!(
                    (measured - exact).abs() < 4.0 * standard_error,
                    "at {floor}: {measured}, exactly {exact} +- {standard_error}"
                );
                tested += 1;
            }
        }
        assert!(tested > 50, "{tested} points");
    });
}

/// `count` triangles of sizes from all over a cube down to a hundredth of it, some of them needles.
fn random_scene(count: u32) -> Scene {
    let number = |i: u32| f64::from(hash(i, count)) / f64::from(u32::MAX) * 2.0 - 1.0;
    let point = |i: u32| DVec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2));
    let mut mesh = Mesh::default();
    for i in 0..count {
        let size = (f64::from(count)).cbrt().recip() * number(9 * i).abs().max(0.02);
        let a = point(4 * i);
        let b = a + point(4 * i + 1) * size;
        let c = if i % 7 == 0 { b + point(4 * i + 2) * size * 1e-3 } else { a + point(4 * i + 2) * size };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([a, b, c]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    scene_from(mesh, obj::Report::default())
}

/// Ambient rays of one sample with what they hit.
type Traced = (Vec<RayRecord>, Vec<HitRecord>);

/// Expects that all methods give the same answers and that f64 brute force accepts each of them.
fn check_rays(
    device: &Device,
    scene: &Scene,
    geometry: &Geometry,
    job: &Job,
    ambient: std::ops::Range<u32>,
    intersector: Intersector,
) -> u64 {
    let mut first: Option<(Vec<HitRecord>, Vec<Traced>)> = None;
    let mut judged = 0;
    let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
    for decision in every_traversal(wishes, geometry, device) {
        let plan = plan_decided(device, scene, geometry, job.clone(), &decision);
        let lists = RayLists::new(device, &plan).unwrap();
        let camera = lists.camera_rays().unwrap();
        let closest = lists.trace(Query::Closest, &camera).unwrap();
        let any: Vec<Traced> = ambient
            .clone()
            .map(|sample| {
                // The rays are the storage buffer kernel's, so they are made once.
                let rays = match &first {
                    Some((_, any)) => any[(sample - ambient.start) as usize].0.clone(),
                    None => lists.ambient_rays(&closest, sample).unwrap(),
                };
                let hits = lists.trace(Query::Any, &rays).unwrap();
                (rays, hits)
            })
            .collect();
        match &first {
            Some((expected, expected_any)) => {
                assert!(bits(expected) == bits(&closest), "closest hits differ with {}", plan.kernel().name);
                for ((_, expected), (_, found)) in expected_any.iter().zip(&any) {
                    assert!(bits(expected) == bits(found), "any hits differ with {}", plan.kernel().name);
                }
            }
            None => {
                let twin = Twin::new(&plan);
                let inputs = twin.inputs(&plan);
                let truth = Truth::of(&inputs);
                judge(&camera, &closest, |ray, hit| truth.closest(ray).accepts(hit));
                judged += camera.len() as u64;
                for (rays, hits) in &any {
                    judge(rays, hits, |ray, hit| truth.any(ray).accepts(hit));
                    judged += rays.len() as u64;
                }
                first = Some((closest, any));
            }
        }
    }
    judged
}

fn bits(hits: &[HitRecord]) -> &[u8] {
    bytemuck::cast_slice(hits)
}

fn judge(
    rays: &[RayRecord],
    hits: &[HitRecord],
    accepts: impl Fn(&RayRecord, &HitRecord) -> Result<(), String> + Sync,
) {
    rays.par_iter().zip(hits).enumerate().for_each(|(place, (ray, hit))| {
        if let Err(reason) = accepts(ray, hit) {
            panic!("ray {place} ({ray:?}) gave {hit:?}: {reason}");
        }
    });
}

/// Random scenes of 1 to 10,000 triangles, more than 2^20 rays that the device dumped: every difference from
/// f64 brute force lies within the stated bound of an edge or a tie, and all methods agree exactly.
#[test]
fn a_million_rays_against_f64_brute_force() {
    with_device(|device| {
        let mut judged = [0, 0, 0];
        let cases = [
            (1, (256, 256), 0..4),
            (2, (256, 128), 0..3),
            (10, (256, 256), 0..3),
            (100, (256, 256), 0..3),
            (1000, (192, 128), 0..3),
            (10_000, (64, 32), 0..2),
        ];
        for (triangles, size, ambient) in cases {
            let scene = random_scene(triangles);
            let geometry = geometry(&scene, Preset::Auto);
            let camera = pinhole([0.4, 0.3, 2.2], [0.0; 3], [0.1, 1.0, 0.0], 60.0);
            let job = Job { camera, ..job(&scene, size, 0..1) };
            for (place, intersector) in INTERSECTORS.into_iter().enumerate() {
                if place > 0 && ![2, 100, 1000].contains(&triangles) {
                    continue;
                }
                let ambient = if place > 0 { 0..1 } else { ambient.clone() };
                judged[place] += check_rays(device, &scene, &geometry, &job, ambient, intersector);
            }
        }
        assert!(judged[0] >= 1 << 20 && judged[1].min(judged[2]) >= 1 << 17, "{judged:?} rays");
    });
}

/// Rays from a thousand sizes of the scene away to its inner edges: made for that reach, a plan loses none of them with
/// any method and gives the twin's bits; made for its camera, it refuses them.
#[test]
fn rays_from_far_away_lose_no_edge() {
    with_device(|device| {
        // A flat square in parts, so that a ray beside a triangle is beside its box, too.
        let parts = 7;
        let mut mesh = Mesh::default();
        for i in 0..(parts + 1) * (parts + 1) {
            let at = |i: i32| 2.0 * f64::from(i) / f64::from(parts) - 1.0;
            mesh.positions.push(DVec3::new(at(i % (parts + 1)), 0.0, at(i / (parts + 1))));
        }
        for i in 0..parts * parts {
            let a = (i / parts * (parts + 1) + i % parts) as u32;
            let [b, c, d] = [a + 1, a + parts as u32 + 2, a + parts as u32 + 1];
            mesh.triangles.extend([[a, b, c], [c, d, a]]);
        }
        // Those between columns: they lie in a face of both their triangles' boxes.
        let quads = mesh.triangles.iter().step_by(2).enumerate();
        let inner: Vec<[u32; 2]> = quads
            .filter(|(place, _)| place % parts as usize != parts as usize - 1)
            .map(|(_, &[_, b, c])| [b, c])
            .collect();
        let scene = scene_from(mesh, obj::Report::default());
        let geometry = geometry(&scene, Preset::Auto);
        let number = |i: u32| f64::from(hash(i, 8)) / f64::from(u32::MAX) * 2.0 - 1.0;
        let rays: Vec<RayRecord> = (0..4096u32)
            .map(|i| {
                let [a, c] =
                    inner[i as usize % inner.len()].map(|corner| scene.mesh.positions[corner as usize]);
                let target = geometry.placement.point(a + (c - a) * (0.05 + 0.9 * number(4 * i).abs()));
                let away =
                    DVec3::new(number(4 * i + 1), number(4 * i + 2) + 1.5, number(4 * i + 3)).normalize();
                let origin = (target + away * 1000.0).as_vec3();
                let direction = target.as_vec3() - origin;
                RayRecord {
                    origin: origin.to_array(),
                    t_max: f32::MAX,
                    direction: direction.to_array(),
                    weight: 1.0,
                }
            })
            .collect();
        let reach = reach_of(&rays);
        assert!(reach > 900.0 && reach < 1001.0, "{reach}");
        let wishes = Wishes { intersector: Some(Intersector::Watertight), ..Wishes::default() };
        for decision in every_traversal(wishes, &geometry, device) {
            let near = plan_decided(device, &scene, &geometry, job(&scene, (8, 8), 0..1), &decision);
            let refused = RayLists::new(device, &near).unwrap().trace(Query::Closest, &rays);
            assert!(refused.unwrap_err().to_string().contains("was made for"));
            let far = near.with_reach(reach, false);
            // What the corners' shear is derived to need; it is the proof that needs it, for no ray here was seen to be lost
            // with the camera's pad: at a distance the slab test's own slack does as much.
            let needed = 17.0 * 2f64.powi(-24) * (f64::from(far.frame.largest) + reach);
            assert!(f64::from(far.frame.box_pad) > needed && far.node_pad() >= far.frame.box_pad);
            let hits = RayLists::new(device, &far).unwrap().trace(Query::Closest, &rays).unwrap();
            let method = far.settings.method;
            let lost = hits.iter().filter(|hit| hit.index == NO_HIT).count();
            assert_eq!(lost, 0, "{method}: so many of {} rays got through", rays.len());
            let twin = Twin::new(&far);
            let expected = reference::trace_closest(&twin.inputs(&far), &rays);
            assert!(bits(&expected) == bits(&hits), "{method} differs from its twin");
        }
        // Boxes that are tested by fused products are grown for where any-hit rays start.
        for method in [Method::Entry, Method::Postponed] {
            let wishes = Wishes {
                method: Some(method),
                intersector: Some(Intersector::Conservative),
                ..Wishes::default()
            };
            let near = plan(device, &scene, &geometry, job(&scene, (8, 8), 0..1), wishes);
            let lists = RayLists::new(device, &near).unwrap();
            assert!(lists.trace(Query::Closest, &rays).is_ok(), "{method}");
            let refused = lists.trace(Query::Any, &rays).map(|hits| hits.len());
            let refused = refused.expect_err("rays from beyond the plan's reach");
            assert!(refused.to_string().contains("was made for"), "{method}: {refused}");
            // Closest hits need no larger boxes.
            assert_eq!(near.clone().with_reach(reach, false).node_pad(), near.node_pad(), "{method}");
            let far = near.with_reach(reach, true);
            assert!(far.node_pad() > 100.0 * far.frame.box_pad, "{method}");
            let hits = RayLists::new(device, &far).unwrap().trace(Query::Any, &rays).unwrap();
            assert!(hits.iter().all(|hit| hit.index != NO_HIT), "{method}: a ray got through");
            let expected = reference::trace_any(&Twin::new(&far).inputs(&far), &rays);
            assert!(bits(&expected) == bits(&hits), "{method} differs from its twin");
        }
    });
}

#[test]
fn the_twin_counts_the_same_rays() {
    with_device(|device| {
        for (name, triangles) in common::SCENES {
            let scene = scene_named(name, triangles);
            let geometry = geometry(&scene, Preset::Auto);
            for (method, sampler, offset, intersector) in [
                (Method::Threaded, Sampler::Pcg, Offset::Scaled, Intersector::Moller),
                (Method::Stack(geometry.stack_bound), Sampler::Lcg, Offset::Scaled, Intersector::Moller),
                (Method::Stack(6), Sampler::Pcg, Offset::Scaled, Intersector::Moller),
                (Method::Threaded, Sampler::Sobol, Offset::Scaled, Intersector::Moller),
                (Method::Threaded, Sampler::Strata, Offset::Ulp, Intersector::Moller),
                (Method::Threaded, Sampler::Philox, Offset::Scaled, Intersector::Moller),
                (Method::Threaded, Sampler::Pcg, Offset::Scaled, Intersector::Watertight),
                (Method::Stack(6), Sampler::Sobol, Offset::Ulp, Intersector::Watertight),
                (Method::Threaded, Sampler::Sobol, Offset::Ulp, Intersector::Conservative),
            ] {
                let wishes = Wishes {
                    method: Some(method),
                    sampler: Some(sampler),
                    offset: Some(offset),
                    intersector: Some(intersector),
                    ..Wishes::default()
                };
                let plan = plan(device, &scene, &geometry, job(&scene, (101, 67), 3..12), wishes);
                let outcome = run(device, &plan);
                let twin = Twin::new(&plan);
                let mut seeds = lcg_seeds(0, plan.tiles.padded_pixels() as u32, plan.job.seed);
                let expected = reference::render_counts(&twin.inputs(&plan), 3..12, Some(&mut seeds));
                let what = format!("{name} {method} {sampler} {intersector}");
                assert_eq!(outcome.overflowed_rays, expected.overflowed, "{what}");
                assert_eq!(outcome.ambient_rays, expected.ambient_rays, "{what}");
                assert!(counts(outcome.accumulated) == expected.counts, "{what}");
            }
        }
    });
}

/// Several camera rays a pixel: the same places in the pixel, the same surfaces, the same counts.
#[test]
fn the_twin_shoots_the_same_camera_rays() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = geometry(&scene, Preset::Auto);
        let job = Job { jitters: 5, ..job(&scene, (101, 67), 0..4) };
        let wishes = Wishes { method: Some(Method::Threaded), ..Wishes::default() };
        let plan = plan(device, &scene, &geometry, job, wishes);
        let outcome = run(device, &plan);
        let expected = reference::render_counts(&Twin::new(&plan).inputs(&plan), 0..4, None);
        assert_eq!(expected.counts.len() as u64, plan.tiles.numbers());
        assert!(expected.primary_hits > 5_000 && expected.primary_hits < 5 * 101 * 67);
        assert!(counts(outcome.accumulated) == expected.counts);
    });
}

/// Running means, the original's among them: what the device stores is the twin's, within the rounding of
/// what the API leaves to the driver (division; contraction in the original's intersector).
#[test]
fn the_twin_keeps_the_same_means() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        for (preset, accumulator) in [
            (Preset::Auto, Accumulator::Rgba32f),
            (Preset::Auto, Accumulator::Rgba8),
            (Preset::Original, Accumulator::Rgba32f),
            (Preset::Original, Accumulator::Rgba8),
        ] {
            let geometry = geometry(&scene, preset);
            let wishes = Wishes { preset: Some(preset), accumulator: Some(accumulator), ..Wishes::default() };
            let plan = plan(device, &scene, &geometry, job(&scene, (101, 67), 0..32), wishes);
            let Accumulated::Means(means) = run(device, &plan).accumulated else { panic!("means") };
            let twin = Twin::new(&plan);
            let mut seeds = lcg_seeds(0, plan.tiles.padded_pixels() as u32, plan.job.seed);
            let mut image = vec![[0f32; 4]; 101 * 67];
            let eight_bit = accumulator == Accumulator::Rgba8;
            for frame in 0..8 {
                let samples = 4 * frame..4 * frame + 4;
                let inputs = twin.inputs(&plan);
                reference::render_means(&inputs, &mut image, samples, Some(&mut seeds), eight_bit);
            }
            assert!(means.iter().any(|texel| texel[0] > 0.3));
            // Four rays often leave a mean halfway between two bytes, where a GPU's last bit decides; the CPU
            // device rounds as the twin does, but for what the original leaves to its compiler.
            let on_cpu = device.adapter().kind == DeviceKind::Cpu;
            let step = match (eight_bit, on_cpu, preset) {
                (false, ..) | (true, true, Preset::Auto) => 1e-6,
                (true, true, _) => 1.01 / 255.0,
                (true, false, _) => 2.01 / 255.0,
            };
            let allowed = if preset == Preset::Original { 5 } else { 0 };
            let differ =
                means.iter().zip(&image).filter(|(a, b)| (a[0] - b[0]).abs() > step || a[3] != b[3]).count();
            assert!(differ <= allowed, "{preset} {accumulator}: {differ} pixels of {}", image.len());
        }
    });
}
