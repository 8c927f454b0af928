//! Rays that share one stack: a node is visited if any of them meets it. Twin of shaders/traverse/packet.glsl.

use super::pair::{ROOT, leaf_of, meets_pair, pair_intervals};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, slabs_of};

/// A reference that waits on the stack, and which of the rays want it.
type Entry = (i32, Vec<bool>);

fn slabs_of_all(inputs: &Inputs, rays: &[Ray]) -> Vec<Slabs> {
    rays.iter().map(|ray| slabs_of(ray, inputs.choices.robust_slabs)).collect()
}

fn anyone(wanted: &[bool]) -> bool {
    wanted.contains(&true)
}

/// The closest hits of a packet, each starting from what is known of it already.
pub fn closest_hits(inputs: &Inputs, rays: &[Ray], mut hits: Vec<Hit>) -> Vec<Hit> {
    let slabs = slabs_of_all(inputs, rays);
    let mut stack: Vec<Entry> = vec![(ROOT, vec![true; rays.len()])];
    while let Some((reference, wanted)) = stack.pop() {
        if reference < 0 {
            for lane in (0..rays.len()).filter(|&lane| wanted[lane]) {
                for index in leaf_of(reference) {
                    closest_of_triangle(inputs, &rays[lane], &slabs[lane], index, &mut hits[lane]);
                }
            }
            continue;
        }
        let node = inputs.load_pair(reference);
        let mut met = [vec![false; rays.len()], vec![false; rays.len()]];
        let (mut both, mut right_nearer) = (0, 0);
        for lane in (0..rays.len()).filter(|&lane| wanted[lane]) {
            let intervals = pair_intervals(&slabs[lane], node);
            let meets = meets_pair(&intervals, box_limit(inputs, hits[lane].t));
            [met[0][lane], met[1][lane]] = meets;
            both += u32::from(meets == [true; 2]);
            right_nearer += u32::from(meets == [true; 2] && intervals[1][0] < intervals[0][0]);
        }
        let [left, right] = met;
        let (left, right) = ((node.left, left), (node.right, right));
        // With one child met by nobody, the order does not matter.
        let far_to_near = if 2 * right_nearer > both { [left, right] } else { [right, left] };
        stack.extend(far_to_near.into_iter().filter(|(_, wanted)| anyone(wanted)));
    }
    hits
}

/// Whether each ray of a packet meets any triangle. An occluded ray wants nothing more.
pub fn any_hits(inputs: &Inputs, rays: &[Ray]) -> Vec<bool> {
    let slabs = slabs_of_all(inputs, rays);
    let mut occluded = vec![false; rays.len()];
    let mut stack: Vec<Entry> = vec![(ROOT, vec![true; rays.len()])];
    while let Some((reference, mut wanted)) = stack.pop() {
        for (wanted, occluded) in wanted.iter_mut().zip(&occluded) {
            *wanted &= !occluded;
        }
        if !anyone(&wanted) {
            continue;
        }
        if reference < 0 {
            for lane in (0..rays.len()).filter(|&lane| wanted[lane]) {
                occluded[lane] =
                    leaf_of(reference).any(|index| any_of_triangle(inputs, &rays[lane], &slabs[lane], index));
            }
            continue;
        }
        let node = inputs.load_pair(reference);
        let mut met = [vec![false; rays.len()], vec![false; rays.len()]];
        for lane in (0..rays.len()).filter(|&lane| wanted[lane]) {
            let intervals = pair_intervals(&slabs[lane], node);
            [met[0][lane], met[1][lane]] = meets_pair(&intervals, box_limit(inputs, rays[lane].t_max));
        }
        let [left, right] = met;
        let far_to_near = [(node.right, right), (node.left, left)];
        stack.extend(far_to_near.into_iter().filter(|(_, wanted)| anyone(wanted)));
    }
    occluded
}
