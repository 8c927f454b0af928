//! Counts and answers against a plain recount, and what the rays are.

use super::*;
use crate::bvh::{Builder, build};
use crate::layout::LEAF_LIMIT;
use crate::reference::testing::{Random, procedural, soup, triangle};

/// The same walk, by recursion and on boxes that are grown beforehand; f64 tests of triangles. Whether a triangle was met.
fn recount(tree: &Tree, index: u32, ray: &Ray, pad: f32, test: &mut dyn FnMut(u32) -> bool) -> (u64, bool) {
    let (left, right) = match tree.nodes[index as usize].content {
        Content::Leaf { first, count } => {
            return (0, (first..first + count).any(|k| test(tree.order[k as usize])));
        }
        Content::Inner { left, right } => (left, right),
    };
    let bounds = |child: u32| tree.nodes[child as usize].bounds;
    // Of equal ones the left one first, as `pack::pair_nodes` has them.
    let mut children = [left, right];
    children.sort_by(|&a, &b| bounds(b).half_area().total_cmp(&bounds(a).half_area()));
    let mut visits = 1;
    for child in children {
        let grown = Aabb { min: bounds(child).min - pad, max: bounds(child).max + pad };
        if !ray.meets_box(&grown, 0.0) {
            continue;
        }
        let (below, occluded) = recount(tree, child, ray, pad, test);
        visits += below;
        if occluded {
            return (visits, true);
        }
    }
    (visits, false)
}

/// Möller and Trumbore in f64.
fn meets_exactly(ray: &Ray, triangle: &Triangle) -> bool {
    let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(|v| Vec3::from(v).as_dvec3());
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let normal = ab.cross(ac);
    let toward = direction.dot(normal);
    let t = (a - origin).dot(normal) / toward;
    let point = origin + t * direction - a;
    let (u, v) = (point.cross(ac).dot(normal), ab.cross(point).dot(normal));
    let whole = normal.length_squared();
    t > 0.0 && t.is_finite() && u >= 0.0 && v >= 0.0 && u + v <= whole
}

#[test]
fn counts_and_answers_are_those_of_a_plain_recount() {
    for (name, triangles) in [("maison", procedural("maison", None)), ("soup", soup(81, 500, 0.4))] {
        let rays = AmbientRays::new(&triangles, 300).unwrap();
        for builder in [Builder::Sah, Builder::Reinsert, Builder::Midpoint] {
            let tree = build(builder, &triangles, &|_| ());
            let (mut counted, mut seen, mut other) = ((0, 0), 0, 0);
            for point in &rays.points {
                let mut sums = (0, 0);
                let mut escapes = false;
                for ray in point {
                    let mut tested = 0;
                    let mut test = |place: u32| {
                        tested += 1;
                        ray.meets(&triangles[place as usize])
                    };
                    let root = tree.nodes.len() as u32 - 1;
                    let (opened, met) = recount(&tree, root, ray, rays.pad, &mut test);
                    let walk = rays.walk(&tree, ray, &mut Vec::new());
                    let expected = Walk { visits: opened, tests: tested, occluded: met };
                    assert_eq!(walk, expected, "{name}, {builder}");
                    assert_eq!(met, triangles.iter().any(|triangle| ray.meets(triangle)), "{name}");
                    let exactly = triangles.iter().any(|triangle| meets_exactly(ray, triangle));
                    other += usize::from(met != exactly);
                    escapes |= !met;
                    sums = (sums.0 + opened, sums.1 + tested);
                }
                if escapes {
                    seen += 1;
                    counted = (counted.0 + sums.0, counted.1 + sums.1);
                }
            }
            let cost = rays.cost(&tree).unwrap();
            println!("{name}, {builder}: {cost:?}, {seen} points seen, {other} rays otherwise in f64");
            let mean = |sum: u64| sum as f64 / (4 * seen) as f64;
            assert_eq!(cost, WalkCost { visits: mean(counted.0), tests: mean(counted.1) });
            assert!(other <= 2 && (50..300).contains(&seen), "{name}: {other}, {seen}");
        }
    }
}

/// In a closed box no ray escapes from within, and all points count.
#[test]
fn where_nothing_is_seen_all_points_count() {
    let triangles = procedural("cornell", None);
    let tree = build(Builder::Sah, &triangles, &|_| ());
    let mut rays = AmbientRays::new(&triangles, 400).unwrap();
    let escapes = |rays: &AmbientRays<'_>, point: &[Ray; RAYS_OF_POINT]| {
        point.iter().any(|ray| !rays.walk(&tree, ray, &mut Vec::new()).occluded)
    };
    let (seen, hidden): (Vec<_>, Vec<_>) = rays.points.iter().partition(|point| escapes(&rays, point));
    assert!(seen.len() > 100 && hidden.len() > 100, "{} {}", seen.len(), hidden.len());
    let mut cost_of = |points: Vec<[Ray; RAYS_OF_POINT]>| {
        rays.points = points;
        rays.cost(&tree)
    };
    let [of_seen, of_hidden] = [cost_of(seen.clone()), cost_of(hidden.clone())];
    assert_ne!(of_seen, of_hidden);
    assert_eq!(cost_of([&seen[..20], &hidden[..100]].concat()), cost_of(seen[..20].to_vec()));
    assert_eq!(cost_of(Vec::new()), None);
    let few = cost_of([&seen[..5], &hidden[..100]].concat());
    assert_ne!(few, cost_of(seen[..5].to_vec()), "all of them");
}

/// Two triangles, one with three times the area: starts by area, on both sides, with a mean cosine of 2/3 (the mean of
/// 65,536 rays has a standard deviation of 0.001).
#[test]
fn rays_are_ambient_rays() {
    let of = |a: [f32; 3], width: f32| Triangle::new(a, 0, [width, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let triangles = [of([0.0; 3], 3.0), of([10.0, 0.0, 0.0], 1.0)];
    let rays = AmbientRays::new(&triangles, 1 << 14).unwrap().points.concat();
    let share =
        |test: &dyn Fn(&Ray) -> bool| rays.iter().filter(|ray| test(ray)).count() as f64 / rays.len() as f64;
    assert_eq!(rays.len(), 1 << 16);
    assert!((share(&|ray| ray.origin.x < 5.0) - 0.75).abs() < 1e-3);
    assert!((share(&|ray| ray.origin.y > 0.0) - 0.5).abs() < 0.02);
    // Half of a right triangle's area lies within 1 - sqrt(1/2) of its right angle's side.
    assert!((share(&|ray| ray.origin.z < 1.0 - 0.5f32.sqrt()) - 0.5).abs() < 0.02);
    assert!(rays.iter().all(|ray| ray.origin.y * ray.direction.y > 0.0), "off the surface they start on");
    let cosine: f64 = rays.iter().map(|ray| f64::from(ray.direction.normalize().y.abs())).sum();
    assert!((cosine / rays.len() as f64 - 2.0 / 3.0).abs() < 0.009, "{cosine}");
    let sideways: f64 = rays.iter().map(|ray| f64::from(ray.direction.normalize().x)).sum();
    assert!((sideways / rays.len() as f64).abs() < 0.02, "{sideways}");
}

/// Needles across the whole scene: without a limit each ray would meet thousands of boxes.
#[test]
fn a_ray_among_needles_is_left_alone() {
    let mut random = Random::new(83);
    let needle = |id| {
        let along = random.point();
        triangle(id, random.point(), along, along + random.point() * 1e-5)
    };
    let triangles: Vec<Triangle> = (0..10_000).map(needle).collect();
    let tree = build(Builder::Sah, &triangles, &|_| ());
    let rays = AmbientRays::new(&triangles, 64).unwrap();
    let mut stack = Vec::new();
    let steps: Vec<u64> = (rays.points.iter().flatten())
        .map(|ray| rays.walk(&tree, ray, &mut stack))
        .map(|walk| walk.visits + walk.tests)
        .collect();
    let most = *steps.iter().max().unwrap();
    assert!((MOST_STEPS..MOST_STEPS + u64::from(LEAF_LIMIT)).contains(&most), "{most}");
    assert!(2 * steps.iter().filter(|&&steps| steps >= MOST_STEPS).count() > steps.len(), "{steps:?}");
}

/// Camera rays see the closest triangle, and what their ambient rays take is what a plain recount finds.
#[test]
fn a_look_is_that_of_all_triangles_in_turn() {
    for (name, triangles) in [("maison", procedural("maison", None)), ("soup", soup(82, 500, 0.4))] {
        let tree = build(Builder::Sah, &triangles, &|_| ());
        let ordered: Vec<Triangle> = tree.order.iter().map(|&place| triangles[place as usize]).collect();
        let root = tree.nodes.last().unwrap().bounds;
        let (pad, root_place) = (pad_of(&root), tree.nodes.len() as u32 - 1);
        let mut random = Random::new(83);
        let mut point = |scale: f32| Vec3::from([0; 3].map(|_| scale * (random.unit() - 0.5)));
        let eye = root.center() + 3.0 * (root.max - root.min);
        let rays: Vec<(Vec3, Vec3)> =
            (0..400).map(|_| (eye, root.center() + point(2.0) * (root.max - root.min) - eye)).collect();
        let (mut met, mut steps) = (0u64, 0u64);
        for (number, &(origin, direction)) in rays.iter().enumerate() {
            let ray = Ray::new(origin, direction);
            let hits = ordered
                .iter()
                .enumerate()
                .filter_map(|(place, triangle)| Some((ray.meets_at(triangle)?, place)));
            let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0));
            let found = closest(&tree, &ordered, pad, &ray);
            assert_eq!(found.map(|hit| hit.0), nearest.map(|hit| hit.0), "{name}");
            let Some((t, place)) = found else { continue };
            let [ab, ac] = [ordered[place].ab, ordered[place].ac].map(|edge| Vec3::from(edge).as_dvec3());
            let normal = ab.cross(ac).normalize();
            let facing = if normal.dot(direction.as_dvec3()) < 0.0 { normal } else { -normal };
            let start = origin + t * direction + offset_of(&root) * facing.as_vec3();
            let ambient = Ray::new(start, ambient_direction(facing, number as u64, 0).unwrap());
            assert!(
                ambient.direction.as_dvec3().dot(facing) > -1e-6,
                "{name}: it leaves the side that is seen"
            );
            let mut tested = 0;
            let mut test = |place: u32| {
                tested += 1;
                ambient.meets(&triangles[place as usize])
            };
            let (opened, _) = recount(&tree, root_place, &ambient, pad, &mut test);
            met += 1;
            steps += opened + tested;
        }
        let seen = look(&tree, &ordered, &rays, f32::INFINITY);
        assert!(met > 20 && met < 400, "{name}: {met}");
        assert_eq!(seen.part, met as f64 / 400.0, "{name}");
        assert_eq!(seen.steps, steps as f64 / met as f64, "{name}");
        let short = look(&tree, &ordered, &rays, 0.01 * (root.max - root.min).length());
        assert!(short.part == seen.part && short.steps < seen.steps, "{name}: {short:?}, {seen:?}");
        let nothing = look(&tree, &ordered, &[(eye, eye - root.center())], f32::INFINITY);
        assert_eq!((nothing.part, nothing.steps), (0.0, 0.0));
    }
}
