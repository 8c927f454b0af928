//! Nodes of eight children with boxes of 8 bits a side; a group of children waits on the stack as a node and a
//! mask. Twin of shaders/traverse/wide.glsl.

use std::ops::RangeInclusive;

use glam::Vec3;

use super::pair::{ROOT, leaf_of};
use crate::bvh::wide::WIDTH;
use crate::layout::WideNode;
use crate::pack::{wide_child, wide_scale, wide_sides};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, slabs_of};

/// Where a traversal stands: a node's children that are still to be visited, bit i for the child that comes i-th.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    node: i32,
    waiting: u32,
}

/// A ray in a node's own units: it crosses side q across an axis at q step + near, or + far if it leaves there.
#[derive(Clone, Copy, Debug)]
struct Crossings {
    step: Vec3,
    near: Vec3,
    far: Vec3,
}

/// Errors of a crossing, as parts of |(origin - o) / d| + 256 |scale / d|. Of u = 2^-24 the difference, its product,
/// the term of q and the sum leave 6.3 and 4.2 against the same side in [`slab_interval`], its own two
/// roundings counted: less than 8 of each. An exit also grows by EXIT_SLACK, 16 u of what it is: 32 are enough.
///
/// [`slab_interval`]: crate::reference::slabs::slab_interval
const ENTER_ERROR: f32 = 8.0 / 16_777_216.0;
const EXIT_ERROR: f32 = 32.0 / 16_777_216.0;

fn crossings_of(node: &WideNode, slabs: &Slabs) -> Crossings {
    let step = wide_scale(node) * slabs.inverse;
    let first = (Vec3::from(node.origin) - slabs.origin) * slabs.inverse;
    let size = first.abs() + 256.0 * step.abs();
    Crossings { step, near: first - size * ENTER_ERROR, far: first + size * EXIT_ERROR }
}

/// Where the ray enters a slot's box, but not before its start, and leaves it: never later nor sooner than
/// `slab_interval` says of any box in it. `sum`(q, step, base): q step + base, rounded once or twice.
fn slot_interval(
    node: &WideNode,
    slot: usize,
    slabs: &Slabs,
    crossings: &Crossings,
    sum: impl Fn(f32, f32, f32) -> f32,
) -> [f32; 2] {
    let [mins, maxs] = wide_sides(node, slot);
    let (mut enter, mut leave) = (0.0f32, f32::INFINITY);
    for axis in 0..3 {
        let backwards = slabs.inverse[axis] < 0.0;
        let (near, far) = if backwards { (maxs[axis], mins[axis]) } else { (mins[axis], maxs[axis]) };
        enter = enter.max(sum(f32::from(near), crossings.step[axis], crossings.near[axis]));
        leave = leave.min(sum(f32::from(far), crossings.step[axis], crossings.far[axis]));
    }
    [enter, leave]
}

/// Slots that the ray meets before t_max, bit i for slot i. An infinity or a NaN, from a scene or a ray beyond all
/// bounds, never rules a box out.
fn met_slots(node: &WideNode, slabs: &Slabs, t_max: f32) -> u32 {
    let crossings = crossings_of(node, slabs);
    let misses = |slot: usize| {
        let [enter, leave] = slot_interval(node, slot, slabs, &crossings, |q, step, base| q * step + base);
        enter > leave.min(t_max)
    };
    (0..WIDTH).filter(|&slot| wide_child(node, slot).is_some() && !misses(slot)).map(|slot| 1 << slot).sum()
}

/// Axes along which the ray runs backwards, a bit each: slots come in the order of slot ^ octant.
fn octant_of(slabs: &Slabs) -> u32 {
    (0..3).map(|axis| u32::from(slabs.inverse[axis] < 0.0) << axis).sum()
}

/// Moves bit i to i ^ octant.
fn nearest_first(slots: u32, octant: u32) -> u32 {
    (0..WIDTH as u32).map(|slot| (slots >> slot & 1) << (slot ^ octant)).sum()
}

/// The reference in a slot that the ray meets.
fn child(node: &WideNode, slot: u32) -> i32 {
    wide_child(node, slot as usize).unwrap_or(ROOT)
}

/// Walks the tree: `visit` gives a node's children that are to be visited next, `leaf` whether to go on.
fn walk(
    inputs: &Inputs,
    octant: u32,
    visit: impl Fn(&WideNode, &Hit) -> u32,
    hit: &mut Hit,
    leaf: impl Fn(RangeInclusive<u32>, &mut Hit) -> bool,
) {
    let mut stack = Vec::new();
    let mut group = Group::default();
    let mut reference = ROOT;
    loop {
        if reference >= 0 {
            if group.waiting != 0 {
                stack.push(group);
            }
            group = Group { node: reference, waiting: visit(inputs.load_wide(reference), hit) };
        } else if !leaf(leaf_of(reference), hit) {
            return;
        }
        if group.waiting == 0 {
            let Some(popped) = stack.pop() else { return };
            group = popped;
        }
        let place = group.waiting.trailing_zeros();
        group.waiting &= group.waiting - 1;
        reference = child(inputs.load_wide(group.node), place ^ octant);
    }
}

pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit) -> Hit {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let octant = octant_of(&slabs);
    let visit =
        |node: &WideNode, hit: &Hit| nearest_first(met_slots(node, &slabs, box_limit(inputs, hit.t)), octant);
    walk(inputs, octant, visit, &mut hit, |triangles, hit| {
        triangles.for_each(|index| closest_of_triangle(inputs, ray, &slabs, index, hit));
        true
    });
    hit
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let limit = box_limit(inputs, ray.t_max);
    let mut occluded = false;
    let mut stack = vec![ROOT];
    while let (false, Some(reference)) = (occluded, stack.pop()) {
        if reference < 0 {
            occluded = leaf_of(reference).any(|index| any_of_triangle(inputs, ray, &slabs, index));
        } else {
            let node = inputs.load_wide(reference);
            let met = met_slots(node, &slabs, limit);
            stack.extend(
                (0..WIDTH as u32).rev().filter(|slot| met >> slot & 1 == 1).map(|slot| child(node, slot)),
            );
        }
    }
    occluded
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::midpoint;
    use crate::bvh::wide::{Slot, WideTree};
    use crate::pack::{box_pad, wide_nodes};
    use crate::reference::slabs::slab_interval;
    use crate::reference::testing::{KINDS, Random, aimed_ray, triangles_of};

    #[test]
    fn a_slot_is_entered_no_later_and_left_no_sooner_than_what_is_in_it() {
        let mut random = Random::new(90);
        for kind in KINDS {
            let triangles = triangles_of(kind, 91, 200);
            let tree = midpoint::build(&triangles);
            let (wide, pad) = (WideTree::new(&tree), box_pad(&triangles));
            let nodes = wide_nodes(&wide, &tree, pad);
            for _ in 0..3000 {
                let target = &triangles[random.below(200) as usize];
                let mut ray = aimed_ray(&mut random, target);
                if random.below(4) == 0 {
                    // From a face of the node at hand, or nearly.
                    ray.origin.x = nodes[random.below(nodes.len() as u32) as usize].origin[0];
                }
                let slabs = slabs_of(&ray, true);
                let at = random.below(nodes.len() as u32) as usize;
                let crossings = crossings_of(&nodes[at], &slabs);
                for (slot, held) in wide.nodes[at].iter().enumerate() {
                    let Some(inside) = Slot::node(*held) else { continue };
                    let bounds = &tree.nodes[inside as usize].bounds;
                    let [enter, leave] = slab_interval(&slabs, bounds.min - pad, bounds.max + pad);
                    for sum in [f32::mul_add, |q: f32, step: f32, base: f32| q * step + base] {
                        let [before, after] = slot_interval(&nodes[at], slot, &slabs, &crossings, sum);
                        assert!(before <= enter.max(0.0) && after >= leave, "{kind:?} {ray:?} {bounds:?}");
                    }
                }
            }
        }
    }

    /// What is infinite or no number rules nothing out.
    #[test]
    fn nothing_is_missed_beyond_all_bounds() {
        for (origin, direction) in [(f32::MAX, 1e-38), (1e30, 0.0), (-1e38, 1.0)] {
            let ray = Ray { origin: Vec3::splat(origin), direction: Vec3::splat(direction), t_max: f32::MAX };
            for robust in [false, true] {
                let slabs = slabs_of(&ray, robust);
                let node =
                    WideNode { scales: 0x01fe_fefe, max_x0: 9, max_y0: 9, max_z0: 9, ..WideNode::default() };
                let met = met_slots(&node, &slabs, f32::MAX);
                let inside = slab_interval(&slabs, Vec3::ZERO, Vec3::splat(1e38));
                assert!(met == 1 || inside[0].max(0.0) > inside[1], "{origin} {direction} {robust}");
            }
        }
    }
}
