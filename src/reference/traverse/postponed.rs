//! Rays of a group, each with its own stack; leaves wait until half of the rays need something else than a node. Twin of
//! shaders/traverse/postponed.glsl, but for the rays that a lane takes one after the other.

use super::grown::{GrownRay, grown_ray_of, met_children, sides_of};
use super::pair::{ROOT, leaf_of, meets_pair, pair_intervals};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, slabs_of};

/// A ray's way through the tree.
struct Walk {
    /// References and where the ray enters their boxes.
    stack: Vec<(i32, f32)>,
    /// A node, or a leaf if another one waits already.
    at: Option<i32>,
    /// The leaf that waits.
    leaf: Option<i32>,
}

impl Walk {
    fn of_root() -> Self {
        Self { stack: Vec::new(), at: Some(ROOT), leaf: None }
    }

    fn stop(&mut self) {
        *self = Self { stack: Vec::new(), at: None, leaf: None };
    }

    fn ended(&self) -> bool {
        self.stack.is_empty() && self.at.is_none() && self.leaf.is_none()
    }

    /// Lets a leaf wait where none does; then, where the ray is nowhere, takes the next reference unless it lies behind
    /// t_max.
    fn take_next(&mut self, t_max: f32) {
        if self.leaf.is_none() && self.at.is_some_and(|reference| reference < 0) {
            self.leaf = self.at.take();
        }
        if self.at.is_none() {
            let next = self.stack.pop().filter(|(_, enter)| enter.max(0.0) <= t_max);
            self.at = next.map(|(reference, _)| reference);
        }
    }

    fn can_walk(&self) -> bool {
        match self.at {
            Some(reference) => reference >= 0 || self.leaf.is_none(),
            None => !self.stack.is_empty(),
        }
    }

    /// Visits the node where the ray is, if it is at one, for its closest hit: the near child first.
    fn step_near(&mut self, inputs: &Inputs, slabs: &Slabs, t_max: f32) {
        if let Some(reference) = self.at.filter(|&reference| reference >= 0) {
            let node = sides_of(inputs.load_grown(reference));
            let intervals = pair_intervals(slabs, &node);
            let meets = meets_pair(&intervals, t_max);
            let left = meets[0].then_some((node.left, intervals[0][0]));
            let right = meets[1].then_some((node.right, intervals[1][0]));
            let right_first = intervals[1][0] < intervals[0][0];
            let (near, far) = if right_first { (right, left) } else { (left, right) };
            self.go_to(near, far);
        }
    }

    /// The same for any hit: the left child first.
    fn step_left(&mut self, inputs: &Inputs, ray: &GrownRay, t_max: f32) {
        if let Some(reference) = self.at.filter(|&reference| reference >= 0) {
            let children = met_children(ray, inputs.load_grown(reference), t_max);
            // Nothing lies behind an any hit.
            let [left, right] = children.map(|(child, met)| met.then_some((child, 0.0)));
            self.go_to(left, right);
        }
    }

    fn go_to(&mut self, first: Option<(i32, f32)>, second: Option<(i32, f32)>) {
        self.at = first.or(second).map(|(reference, _)| reference);
        self.stack.extend(first.and(second));
    }
}

/// Whether the group goes on through the tree: a ray can, and less than half of them need something else.
fn goes_on(walks: &[Walk], with_ray: impl Fn(usize) -> bool) -> bool {
    let lanes = || (0..walks.len()).filter(|&lane| with_ray(lane));
    let need_else = lanes().filter(|&lane| walks[lane].leaf.is_some() || !walks[lane].can_walk()).count();
    lanes().any(|lane| walks[lane].can_walk()) && 2 * need_else < lanes().count()
}

/// The closest hits of a group's rays, each starting from what is known of it already.
pub fn closest_hits(inputs: &Inputs, rays: &[Ray], mut hits: Vec<Hit>) -> Vec<Hit> {
    let slabs: Vec<Slabs> = rays.iter().map(|ray| slabs_of(ray, inputs.choices.robust_slabs)).collect();
    let mut walks: Vec<Walk> = rays.iter().map(|_| Walk::of_root()).collect();
    while !walks.iter().all(Walk::ended) {
        let with_ray: Vec<bool> = walks.iter().map(|walk| !walk.ended()).collect();
        loop {
            for (lane, walk) in walks.iter_mut().enumerate() {
                let limit = box_limit(inputs, hits[lane].t);
                walk.step_near(inputs, &slabs[lane], limit);
                walk.take_next(limit);
            }
            if !goes_on(&walks, |lane| with_ray[lane]) {
                break;
            }
        }
        for (lane, walk) in walks.iter_mut().enumerate() {
            if let Some(leaf) = walk.leaf.take() {
                for index in leaf_of(leaf) {
                    closest_of_triangle(inputs, &rays[lane], &slabs[lane], index, &mut hits[lane]);
                }
                walk.take_next(box_limit(inputs, hits[lane].t));
            }
        }
    }
    hits
}

/// Whether each ray of a group meets any triangle.
pub fn any_hits(inputs: &Inputs, rays: &[Ray]) -> Vec<bool> {
    let slabs: Vec<Slabs> = rays.iter().map(|ray| slabs_of(ray, inputs.choices.robust_slabs)).collect();
    let box_rays: Vec<GrownRay> = rays.iter().map(grown_ray_of).collect();
    let mut walks: Vec<Walk> = rays.iter().map(|_| Walk::of_root()).collect();
    let mut occluded = vec![false; rays.len()];
    while !walks.iter().all(Walk::ended) {
        let with_ray: Vec<bool> = walks.iter().map(|walk| !walk.ended()).collect();
        loop {
            for (lane, walk) in walks.iter_mut().enumerate() {
                let limit = box_limit(inputs, rays[lane].t_max);
                walk.step_left(inputs, &box_rays[lane], limit);
                walk.take_next(limit);
            }
            if !goes_on(&walks, |lane| with_ray[lane]) {
                break;
            }
        }
        for (lane, walk) in walks.iter_mut().enumerate() {
            if let Some(leaf) = walk.leaf.take() {
                occluded[lane] =
                    leaf_of(leaf).any(|index| any_of_triangle(inputs, &rays[lane], &slabs[lane], index));
                if occluded[lane] {
                    walk.stop();
                } else {
                    walk.take_next(box_limit(inputs, rays[lane].t_max));
                }
            }
        }
    }
    occluded
}
