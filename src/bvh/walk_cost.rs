//! What ambient rays cost in a tree, counted. The surface area heuristic supposes rays that come from afar and meet nothing;
//! ambient rays start within the scene, and any hit ends them.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::hash::unit;
use super::{Aabb, Content, Tree};
use crate::layout::Triangle;

/// Rays that are counted.
pub const RAYS: usize = 4096;

/// Cost of opening a node, which tests both children's boxes, and of testing a triangle, in the same unit.
const VISIT_COST: f64 = 1.0;
const TEST_COST: f64 = 1.0;

/// Means over rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkCost {
    /// Nodes opened: both children's boxes are tested.
    pub visits: f64,
    /// Triangles tested.
    pub tests: f64,
}

impl WalkCost {
    pub fn total(&self) -> f64 {
        self.visits * VISIT_COST + self.tests * TEST_COST
    }
}

#[derive(Clone, Copy, Debug)]
struct Ray {
    origin: Vec3,
    direction: Vec3,
    inverse: Vec3,
}

/// What a ray's walk took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Walk {
    visits: u64,
    tests: u64,
    occluded: bool,
}

/// Ambient rays of a scene: the same on every machine.
pub struct AmbientRays<'a> {
    triangles: &'a [Triangle],
    rays: Vec<Ray>,
    /// By how much boxes are grown, as those of robust slabs.
    pad: f32,
}

impl<'a> AmbientRays<'a> {
    /// About `count` rays from points spread evenly over the triangles' area, on either side, their directions with density
    /// cos(theta) / pi about the normal. None if no triangle has an area.
    pub fn new(triangles: &'a [Triangle], count: usize) -> Option<Self> {
        let areas: Vec<f64> = triangles.par_iter().map(area).collect();
        let total: f64 = areas.iter().sum();
        if total <= 0.0 || !total.is_finite() {
            return None;
        }
        let all = triangles
            .par_iter()
            .map(Aabb::of)
            .filter(|bounds| bounds.min.is_finite() && bounds.max.is_finite())
            .reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
        let largest = all.min.abs().max(all.max.abs()).max_element();
        // As far off the surface as the offset `ulp`.
        let offset = largest * 2f32.powi(-16);
        let mut picked = Vec::with_capacity(count);
        let (mut sum, step) = (0.0, total / count as f64);
        for (triangle, area) in triangles.iter().zip(areas) {
            sum += area;
            // One point in each equal part of the whole area.
            while picked.len() < count && (picked.len() as f64 + unit(picked.len() as u64, 0)) * step < sum {
                picked.push((picked.len() as u64, triangle));
            }
        }
        let rays = picked.into_par_iter().filter_map(|(number, triangle)| ray_from(triangle, number, offset));
        Some(Self { triangles, rays: rays.collect(), pad: largest * 2f32.powi(-21) })
    }

    /// What the rays cost in a tree of these triangles; none without rays.
    pub fn cost(&self, tree: &Tree) -> Option<WalkCost> {
        // Whole numbers, which add up to the same in any order.
        let (visits, tests) = self
            .rays
            .par_iter()
            .map_init(Vec::new, |stack, ray| self.walk(tree, ray, stack))
            .map(|walk| (walk.visits, walk.tests))
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let mean = |sum: u64| sum as f64 / self.rays.len() as f64;
        (!self.rays.is_empty()).then(|| WalkCost { visits: mean(visits), tests: mean(tests) })
    }

    /// Any hit as `ordered` finds it: of two children that are met the larger one first.
    fn walk(&self, tree: &Tree, ray: &Ray, stack: &mut Vec<u32>) -> Walk {
        let mut walk = Walk::default();
        stack.clear();
        stack.extend(tree.nodes.len().checked_sub(1).map(|root| root as u32));
        while let Some(index) = stack.pop() {
            match tree.nodes[index as usize].content {
                Content::Inner { left, right } => {
                    walk.visits += 1;
                    let [a, b] = [left, right].map(|child| &tree.nodes[child as usize].bounds);
                    let swapped = b.half_area() > a.half_area();
                    let pair = if swapped { [(left, a), (right, b)] } else { [(right, b), (left, a)] };
                    let met = pair.into_iter().filter(|(_, bounds)| ray.meets_box(bounds, self.pad));
                    stack.extend(met.map(|(child, _)| child));
                }
                Content::Leaf { first, count } => {
                    for &place in &tree.order[first as usize..(first + count) as usize] {
                        walk.tests += 1;
                        if ray.meets(&self.triangles[place as usize]) {
                            return Walk { occluded: true, ..walk };
                        }
                    }
                }
            }
        }
        walk
    }
}

/// 0 where it is not finite.
fn area(triangle: &Triangle) -> f64 {
    let [ab, ac] = [triangle.ab, triangle.ac].map(|edge| Vec3::from(edge).as_dvec3());
    let area = 0.5 * ab.cross(ac).length();
    if area.is_finite() && Vec3::from(triangle.a).is_finite() { area } else { 0.0 }
}

/// An ambient ray from a point of the triangle; none in the rare case that its direction cannot be had.
fn ray_from(triangle: &Triangle, number: u64, offset: f32) -> Option<Ray> {
    let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::from);
    let (u, v) = (unit(number, 1) as f32, unit(number, 2) as f32);
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    let side = if unit(number, 3) < 0.5 { 1.0 } else { -1.0 };
    let normal = side * ab.as_dvec3().cross(ac.as_dvec3()).normalize();
    // The normal and a point of the unit sphere add up to a direction with that density. The point by rejection: roots
    // are rounded alike everywhere, sines are not.
    let points =
        (2..32).map(|go| DVec3::from([3 * go, 3 * go + 1, 3 * go + 2].map(|k| 2.0 * unit(number, k) - 1.0)));
    let direction = points
        .filter(|point| (1e-4..=1.0).contains(&point.length_squared()))
        .map(|point| normal + point.normalize())
        .find(|direction| direction.length_squared() > 1e-6)?;
    let direction = direction.as_vec3();
    // No division by zero.
    let inverse = 1.0 / direction.map(|d| if d.abs() < 1e-20 { 1e-20 } else { d });
    Some(Ray { origin: a + u * ab + v * ac + offset * normal.as_vec3(), direction, inverse })
}

impl Ray {
    fn meets_box(&self, bounds: &Aabb, pad: f32) -> bool {
        let one = (bounds.min - pad - self.origin) * self.inverse;
        let other = (bounds.max + pad - self.origin) * self.inverse;
        one.min(other).max_element().max(0.0) <= one.max(other).min_element()
    }

    /// Möller and Trumbore (1997).
    fn meets(&self, triangle: &Triangle) -> bool {
        let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::from);
        let p = self.direction.cross(ac);
        let det = ab.dot(p);
        let s = (self.origin - a) * det.signum();
        let q = s.cross(ab);
        let (u, v) = (s.dot(p), self.direction.dot(q));
        det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= det.abs() && ac.dot(q) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Builder, build};
    use crate::reference::testing::{procedural, soup};

    /// The same walk, by recursion and on boxes that are grown beforehand; f64 tests of triangles. Whether a triangle was met.
    fn recount(
        tree: &Tree,
        index: u32,
        ray: &Ray,
        pad: f32,
        test: &mut dyn FnMut(u32) -> bool,
    ) -> (u64, bool) {
        let (left, right) = match tree.nodes[index as usize].content {
            Content::Leaf { first, count } => {
                return (0, (first..first + count).any(|k| test(tree.order[k as usize])));
            }
            Content::Inner { left, right } => (left, right),
        };
        let bounds = |child: u32| tree.nodes[child as usize].bounds;
        let mut children = [right, left];
        // Of equal ones the left one first, as `pack::pair_nodes` has them.
        children.reverse();
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
            let rays = AmbientRays::new(&triangles, 1000).unwrap();
            for builder in [Builder::Sah, Builder::Reinsert, Builder::Midpoint] {
                let tree = build(builder, &triangles, &|_| ());
                let (mut visits, mut tests, mut occluded, mut other) = (0, 0, 0, 0);
                for ray in &rays.rays {
                    let mut tested = 0;
                    let mut test = |place: u32| {
                        tested += 1;
                        ray.meets(&triangles[place as usize])
                    };
                    let root = tree.nodes.len() as u32 - 1;
                    let (opened, met) = recount(&tree, root, ray, rays.pad, &mut test);
                    let walk = rays.walk(&tree, ray, &mut Vec::new());
                    assert_eq!(
                        walk,
                        Walk { visits: opened, tests: tested, occluded: met },
                        "{name}, {builder}"
                    );
                    assert_eq!(
                        met,
                        triangles.iter().any(|triangle| ray.meets(triangle)),
                        "{name}, {builder}"
                    );
                    other +=
                        usize::from(met != triangles.iter().any(|triangle| meets_exactly(ray, triangle)));
                    occluded += usize::from(met);
                    visits += opened;
                    tests += tested;
                }
                let count = rays.rays.len();
                let mean = |sum: u64| sum as f64 / count as f64;
                let cost = rays.cost(&tree).unwrap();
                println!("{name}, {builder}: {cost:?}, {occluded} occluded, {other} otherwise in f64");
                assert_eq!(cost, WalkCost { visits: mean(visits), tests: mean(tests) });
                assert!(
                    other <= 2 && occluded > count / 10 && occluded < count,
                    "{name}: {other}, {occluded}"
                );
            }
        }
    }

    /// Two triangles, one with three times the area: starts by area, on both sides, with a mean cosine of 2/3 (of 16,384 rays: 0.0018
    /// standard deviations of the mean).
    #[test]
    fn rays_are_ambient_rays() {
        let of = |a: [f32; 3], width: f32| Triangle::new(a, 0, [width, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let triangles = [of([0.0; 3], 3.0), of([10.0, 0.0, 0.0], 1.0)];
        let rays = AmbientRays::new(&triangles, 1 << 14).unwrap().rays;
        let share = |test: &dyn Fn(&Ray) -> bool| {
            rays.iter().filter(|ray| test(ray)).count() as f64 / rays.len() as f64
        };
        assert_eq!(rays.len(), 1 << 14);
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
}
