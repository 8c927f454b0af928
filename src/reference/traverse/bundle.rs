//! Rays that share one stack, several of them a lane: a node is visited if any of them may want it, and all that are not yet
//! occluded are tested against its four children. Twin of shaders/traverse/bundle.glsl.

use super::pair::{ROOT, leaf_of};
use crate::pack::quad_children;
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, slab_interval, slabs_of};

fn slabs_of_all(inputs: &Inputs, rays: &[Ray]) -> Vec<Slabs> {
    rays.iter()
        .map(|ray| slabs_of(ray, true))
        .inspect(|_| debug_assert!(!inputs.tree.quad.is_empty()))
        .collect()
}

/// The closest hits of a packet, each starting from what is known of it already. Children come in the order in which the
/// first ray enters them.
pub fn closest_hits(inputs: &Inputs, rays: &[Ray], mut hits: Vec<Hit>) -> Vec<Hit> {
    let slabs = slabs_of_all(inputs, rays);
    let mut stack = vec![ROOT];
    while let Some(reference) = stack.pop() {
        if reference < 0 {
            for (lane, ray) in rays.iter().enumerate() {
                for index in leaf_of(reference) {
                    closest_of_triangle(inputs, ray, &slabs[lane], index, &mut hits[lane]);
                }
            }
            continue;
        }
        let mut met = Vec::new();
        for (min, max, child) in quad_children(inputs.load_quad(reference)) {
            let enters = (0..rays.len()).filter_map(|lane| {
                let [enter, leave] = slab_interval(&slabs[lane], min.into(), max.into());
                let enter = enter.max(0.0);
                (enter <= leave.min(box_limit(inputs, hits[lane].t))).then_some(enter)
            });
            if let Some(first) = enters.reduce(f32::min) {
                met.push((first, child));
            }
        }
        met.sort_by(|a, b| b.0.total_cmp(&a.0));
        stack.extend(met.into_iter().map(|(_, child)| child));
    }
    hits
}

/// Whether each ray of a packet meets any triangle. An occluded ray wants nothing more.
pub fn any_hits(inputs: &Inputs, rays: &[Ray]) -> Vec<bool> {
    let slabs = slabs_of_all(inputs, rays);
    let mut occluded = vec![false; rays.len()];
    let mut stack = vec![ROOT];
    while let (Some(reference), true) = (stack.pop(), occluded.contains(&false)) {
        if reference < 0 {
            for lane in (0..rays.len()).filter(|&lane| !occluded[lane]).collect::<Vec<_>>() {
                occluded[lane] =
                    leaf_of(reference).any(|index| any_of_triangle(inputs, &rays[lane], &slabs[lane], index));
            }
            continue;
        }
        for (min, max, child) in quad_children(inputs.load_quad(reference)).into_iter().rev() {
            let meets = |lane: usize| {
                let [enter, leave] = slab_interval(&slabs[lane], min.into(), max.into());
                enter.max(0.0) <= leave.min(box_limit(inputs, rays[lane].t_max))
            };
            if (0..rays.len()).any(|lane| !occluded[lane] && meets(lane)) {
                stack.push(child);
            }
        }
    }
    occluded
}
