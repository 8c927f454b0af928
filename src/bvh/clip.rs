//! The box of the part of a triangle that lies in a cell, for spatial splits: grown so that no hit
//! that the intersector reports is lost between the parts.
//!
//! # What a part's box must contain
//!
//! A guarded intersector accepts a triangle and reports a distance t, brought into the triangle's own box. What follows is
//! about that of Möller and Trumbore, in f32; the other one's bound is smaller. A traversal finds that hit if the ray's point at t lies well inside the box of one
//! of the triangle's parts: then the slab test enters the box before t and leaves it after. Rounding moves the
//! point in two ways.
//!
//! *Off the triangle's plane.* With n = ab x ac, t is the quotient of n . s and n . d, both computed as triple
//! products: off by at most gamma(6) and gamma(5) times the product of the three lengths (times 1.155, the largest
//! permanent of three unit vectors). So the point at t is off the plane by at most 16 e S / sin(a), where
//! e = 2^-24, S is the larger of the distances from the triangle's corner to the ray's origin and from there to
//! the point, and a is the triangle's angle at that corner: abs(n) = abs(ab) abs(ac) sin(a). The angle
//! between ray and plane does not enter.
//!
//! *Along the plane.* There it does: u, v and t are off by that over the sine of the angle between ray and plane.
//! A ray that grazes the plane may be said to hit a triangle well beside it, anywhere in the triangle's own box.
//! So what is cut is not the triangle but **its plane within its own box**. (In a plane of constant x, y or z, u and v are
//! off by no more than 16 e S / sin(a) either, but what the conservative intersector grants them is not.)
//!
//! The slab test of a face adds 4 e S. Together that is 20 e S / sin(a), and [`slack`] covers it where S is at most
//! 25 times the scene's largest coordinate: for origins within some ten sizes of the scene. From farther away,
//! rounding may move a hit by more than the slack, and then a hit may be lost. Nor is a hit covered that t is brought to
//! from far: one whose ray meets the plane outside the own box by more than the slack, nearly along a face of the box.
//!
//! *The watertight intersector* reports a t at which the ray is within 15 e (L + R) of the triangle itself in each axis, at any
//! angle to it: src/reference/watertight.rs derives it, with L the scene's largest coordinate and R the origin's. With the slab
//! test's part it is 19 e (L + R), within the slack, 512 e L, for R up to 25 L.
//!
//! The nearest point of the plane may lie in the next cell: so the plane is clipped to the cell grown by the slack,
//! and the box of that is grown by the slack once more. It never reaches beyond the triangle's own box,
//! for there t is brought by the slab test itself.

use glam::{DVec3, Vec3};

use super::Aabb;
use crate::layout::Triangle;

/// Triangles with a smaller sine at the corner that edges start from are not split: their slack would be worth
/// no split.
const SMALLEST_SINE: f64 = 1.0 / 1024.0;

/// By how much parts of a triangle are grown, in the scene's units: 2^-15 of `largest`, the scene's largest
/// coordinate, over the sine at the corner. 0 for a triangle that is not to be split.
pub fn slack(triangle: &Triangle, largest: f32) -> f32 {
    let [ab, ac] = [triangle.ab, triangle.ac].map(|edge| Vec3::from(edge).as_dvec3());
    let sine = ab.cross(ac).length() / (ab.length() * ac.length());
    if sine >= SMALLEST_SINE && largest.is_finite() {
        (f64::from(largest) * 2f64.powi(-15) / sine) as f32
    } else {
        0.0
    }
}

/// The corners of a convex polygon: at most three and one for each of six planes that clip.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; 9],
    count: usize,
}

impl Polygon {
    fn of(corners: &[DVec3]) -> Self {
        let mut polygon = Self { corners: [DVec3::ZERO; 9], count: 0 };
        corners.iter().for_each(|&corner| polygon.push(corner));
        polygon
    }

    fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: DVec3) {
        self.corners[self.count] = corner;
        self.count += 1;
    }

    /// What of it lies on one side of a plane (Sutherland and Hodgman, 1974): above `at` along `axis`, or below if
    /// `side` is -1.
    fn clipped(self, axis: usize, at: f64, side: f64) -> Self {
        let height = |corner: DVec3| (corner[axis] - at) * side;
        if self.corners().iter().all(|&corner| height(corner) >= 0.0) {
            return self;
        }
        let mut kept = Self::of(&[]);
        for (place, &corner) in self.corners().iter().enumerate() {
            let before = self.corners[(place + self.count - 1) % self.count];
            let (from, to) = (height(before), height(corner));
            if (from >= 0.0) != (to >= 0.0) && kept.count < kept.corners.len() {
                let mut crossing = before + (corner - before) * (from / (from - to));
                crossing[axis] = at;
                kept.push(crossing);
            }
            if to >= 0.0 && kept.count < kept.corners.len() {
                kept.push(corner);
            }
        }
        kept
    }
}

/// The box of what lies in `cell` (which lies in the triangle's own box), grown by `slack`; none if nothing
/// does.
pub fn part_bounds(triangle: &Triangle, slack: f32, cell: &Aabb) -> Option<Aabb> {
    let own = Aabb::of(triangle);
    let room = f64::from(slack);
    // The nearest point of the plane may lie in the next cell, and beyond the own box.
    let (low, high) = (cell.min.as_dvec3() - room, cell.max.as_dvec3() + room);
    let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::from);
    let normal = ab.as_dvec3().cross(ac.as_dvec3());
    let across = normal.abs().max_position();
    let plane = rectangle(a.as_dvec3(), normal, across, low, high);
    let polygon = plane.clipped(across, low[across], 1.0).clipped(across, high[across], -1.0);
    if polygon.count == 0 {
        return None;
    }
    let nowhere = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) =
        polygon.corners().iter().fold(nowhere, |(min, max), &corner| (min.min(corner), max.max(corner)));
    // Rounded outwards.
    let min = (min - room).as_vec3().map(f32::next_down);
    let max = (max + room).as_vec3().map(f32::next_up);
    Some(Aabb { min, max }.intersection(&own))
}

/// The plane through `a` over the rectangle from `low` to `high` in the two axes other than `across`.
fn rectangle(a: DVec3, normal: DVec3, across: usize, low: DVec3, high: DVec3) -> Polygon {
    let (i, j) = ((across + 1) % 3, (across + 2) % 3);
    let sides = [(low[i], low[j]), (high[i], low[j]), (high[i], high[j]), (low[i], high[j])];
    Polygon::of(&sides.map(|(x, y)| {
        let mut corner = DVec3::ZERO;
        corner[i] = x;
        corner[j] = y;
        corner[across] = a[across] - (normal[i] * (x - a[i]) + normal[j] * (y - a[j])) / normal[across];
        corner
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack;
    use crate::reference::intersect::{intersect_moller, intersect_watertight};
    use crate::reference::slabs::{meets_box, slabs_of};
    use crate::reference::testing::{REACH, Random, aimed_ray, corners_of, grazing_ray, triangle};
    use crate::reference::watertight::edges_of;

    #[test]
    fn needles_are_not_split() {
        let with = |ac: Vec3| slack(&triangle(0, Vec3::ZERO, Vec3::X, ac), 1.0);
        assert_eq!(with(Vec3::Y), 2f32.powi(-15));
        assert_eq!(with(Vec3::new(1.0, 0.0005, 0.0)), 0.0);
        assert!(with(Vec3::new(1.0, 0.01, 0.0)) > 99.0 * 2f32.powi(-15));
        assert_eq!(with(Vec3::ZERO), 0.0);
        assert_eq!(slack(&triangle(0, Vec3::ZERO, Vec3::X, Vec3::Y), f32::INFINITY), 0.0);
    }

    /// Every point of a triangle lies in the part of the cell that it lies in, and every part in its cell
    /// grown twice by the slack.
    #[test]
    fn parts_hold_their_points_and_little_else() {
        let mut random = Random::new(40);
        for round in 0..2000 {
            let flat = if round % 2 == 0 { Vec3::ONE } else { Vec3::ONE - random.axis().abs() };
            let one = triangle(0, random.point(), random.point() * flat, random.point() * flat);
            let slack = slack(&one, 2.0);
            if slack == 0.0 {
                continue;
            }
            let own = Aabb::of(&one);
            let axis = random.below(3) as usize;
            let mut cell = own;
            let at = own.min[axis] + (own.max[axis] - own.min[axis]) * random.unit();
            cell.max[axis] = at;
            let bounds = part_bounds(&one, slack, &cell);
            for _ in 0..50 {
                let (u, v) = (random.unit(), random.unit());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let point = Vec3::from(one.a) + u * Vec3::from(one.ab) + v * Vec3::from(one.ac);
                let point = point.clamp(own.min, own.max);
                if point[axis] <= at {
                    let bounds = bounds.expect("the part is not empty");
                    assert!(bounds.contains(&Aabb { min: point, max: point }), "{point} {bounds:?}");
                }
            }
            if let Some(bounds) = bounds {
                let room = Vec3::splat(2.1 * slack);
                let near = Aabb { min: cell.min - room, max: cell.max + room };
                assert!(near.contains(&bounds) && own.contains(&bounds), "{bounds:?} {cell:?}");
            }
        }
    }

    /// Cuts a triangle at random planes, as a builder does.
    fn parts_of(random: &mut Random, one: &Triangle, slack: f32) -> Vec<Aabb> {
        let own = Aabb::of(one);
        let mut parts = vec![(own, own)];
        for _ in 0..40 {
            let place = random.below(parts.len() as u32) as usize;
            let axis = random.below(3) as usize;
            let (mut low, mut high) = (parts[place].0, parts[place].0);
            let at = low.min[axis] + (low.max[axis] - low.min[axis]) * random.unit();
            low.max[axis] = at;
            high.min[axis] = at;
            let bounds = [low, high].map(|cell| part_bounds(one, slack, &cell));
            if let [Some(left), Some(right)] = bounds {
                parts[place] = (low, left);
                parts.push((high, right));
            }
        }
        parts.into_iter().map(|(_, bounds)| bounds).collect()
    }

    /// A hit that an intersector reports is found by way of a part, even by a traversal that asks for
    /// nothing beyond its distance.
    #[test]
    fn every_hit_lies_in_a_part() {
        let mut random = Random::new(41);
        let (mut hits, mut cut) = ([0, 0, 0], 0);
        for round in 0..6000 {
            // In planes along axes, nearly so, and askew.
            let thin = [1.0, 0.9999, 0.0][round % 3];
            let flat = Vec3::ONE - random.axis().abs() * thin;
            let (ab, ac) = (random.point() * flat, random.point() * flat);
            let ac = if round % 4 == 0 { ab * random.unit() + ac * 0.02 } else { ac };
            let corners = corners_of(&triangle(0, random.point() * 0.5, ab * 0.5, ac * 0.5));
            let one = edges_of(&corners);
            let slack = slack(&one, 1.0);
            if slack == 0.0 {
                continue;
            }
            let pads = [2f32.powi(-21), pack::watertight_pad(1.0, REACH)];
            let parts = parts_of(&mut random, &one, slack);
            cut += parts.len() - 1;
            for i in 0..600 {
                let ray =
                    if i % 2 == 0 { grazing_ray(&mut random, &one) } else { aimed_ray(&mut random, &one) };
                let slabs = slabs_of(&ray, true);
                let found = [
                    intersect_moller(&ray, &slabs, &one, false, pads[0], ray.t_max),
                    intersect_moller(&ray, &slabs, &one, true, pads[0], ray.t_max),
                    intersect_watertight(&ray, &slabs, &corners, pads[1], ray.t_max),
                ];
                for (intersector, found) in found.into_iter().enumerate() {
                    let (Some([t, ..]), pad) = (found, pads[intersector / 2]) else { continue };
                    hits[intersector] += 1;
                    let found = parts.iter().any(|part| meets_box(&slabs, part.min - pad, part.max + pad, t));
                    assert!(found, "lost at {t}: {ray:?} {one:?}, slack {slack}, intersector {intersector}");
                }
            }
        }
        println!("{hits:?} hits, {cut} cuts");
        assert!(hits.into_iter().all(|hits| hits > 100_000) && cut > 10_000, "{hits:?} hits, {cut} cuts");
    }
}
