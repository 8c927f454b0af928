//! Nodes with both children's boxes as centres and halves, tested in fewer operations. Twin of shaders/traverse/grown.glsl.

use glam::Vec3;

use crate::layout::{CentredNode, CompactNode, PairNode};
use crate::reference::ray::Ray;
use crate::reference::slabs::at_least_smallest;

/// A ray crosses the plane at p across an axis at p inverse + base.
#[derive(Clone, Copy, Debug)]
pub struct GrownRay {
    inverse: Vec3,
    base: Vec3,
}

pub fn grown_ray_of(ray: &Ray) -> GrownRay {
    let inverse = ray.direction.map(|d| 1.0 / at_least_smallest(d));
    GrownRay { inverse, base: -ray.origin * inverse }
}

/// Where the ray enters and leaves the slab of each axis. `sum`(a, b, c): a b + c, rounded once or twice.
fn crossings_by(
    ray: &GrownRay,
    center: [f32; 3],
    half: [f32; 3],
    sum: impl Fn(f32, f32, f32) -> f32,
) -> [[f32; 3]; 2] {
    let middle = [0, 1, 2].map(|axis| sum(center[axis], ray.inverse[axis], ray.base[axis]));
    [-1.0, 1.0]
        .map(|sign| [0, 1, 2].map(|axis| sum(sign * half[axis], ray.inverse[axis].abs(), middle[axis])))
}

/// Whether these crossings are those of a box that the ray meets up to `t_max`, if it has an end: compared as integers.
fn meets_grown([near, far]: [[f32; 3]; 2], t_max: Option<f32>) -> bool {
    let bits = |x: f32| x.to_bits() as i32;
    let enter = near.map(bits).into_iter().fold(0, i32::max);
    enter <= far.map(bits).into_iter().fold(t_max.map_or(i32::MAX, bits), i32::min)
}

/// Half the sizes of a compact node's box, from the two words that they share.
fn shared_halves(xz: u32, yz: u32) -> [f32; 3] {
    [xz >> 1, yz << 10, xz << 20 | yz >> 12].map(f32::from_bits)
}

/// A compact node with the halves that are read from it.
pub fn centred(node: &CompactNode) -> CentredNode {
    let CompactNode { left_center, left, right_center, right, .. } = *node;
    CentredNode {
        left_center,
        left,
        left_half: shared_halves(node.left_half_xz, node.left_half_yz),
        right,
        right_center,
        pad0: 0,
        right_half: shared_halves(node.right_half_xz, node.right_half_yz),
        pad1: 0,
    }
}

/// A node's children, and whether the ray meets them up to this distance.
pub fn met_children(ray: &GrownRay, node: &CentredNode, limit: f32) -> [(i32, bool); 2] {
    let t_max = (limit < f32::MAX).then_some(limit);
    let meets = |center, half| meets_grown(crossings_by(ray, center, half, |a, b, c| a * b + c), t_max);
    [
        (node.left, meets(node.left_center, node.left_half)),
        (node.right, meets(node.right_center, node.right_half)),
    ]
}

/// The boxes by their sides, for the test of a triangle's own box.
pub fn sides_of(node: &CentredNode) -> PairNode {
    let sides = |center: [f32; 3], half: [f32; 3]| {
        let (center, half) = (Vec3::from(center), Vec3::from(half));
        ((center - half).to_array(), (center + half).to_array())
    };
    let (left_min, left_max) = sides(node.left_center, node.left_half);
    let (right_min, right_max) = sides(node.right_center, node.right_half);
    PairNode {
        left_min,
        left: node.left,
        left_max,
        right: node.right,
        right_min,
        pad0: 0,
        right_max,
        pad1: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::pack::{box_pad, centred_nodes, compact_nodes, grown_pad, packed_halves};
    use crate::reference::intersect::padded_box_of;
    use crate::reference::slabs::{slab_interval, slabs_of};
    use crate::reference::testing::{KINDS, REACH, Random, aimed_ray, triangles_of};
    use crate::reference::traverse::children::{leaf_of, meets};

    /// Where a triangle's own box is met, every box around it is, and no later: with products rounded or fused, inverses off by as
    /// much as a division may be, and wherever the ray starts.
    #[test]
    fn boxes_around_a_triangle_that_is_met_are_met() {
        let mut met = 0u32;
        for kind in KINDS {
            let triangles = triangles_of(kind, 70, 300);
            let tree = crate::bvh::build(Builder::Sah, &triangles, &|_| {});
            let packed = crate::pack::triangles(&tree, &triangles);
            let pad = box_pad(&triangles);
            let largest = pad * 2f32.powi(21);
            for distance in [0.0, 1.0, 30.0, 1e4] {
                let reach = REACH + f64::from(largest * distance);
                let pad_of_nodes = grown_pad(pad, largest, reach);
                let compact = compact_nodes(&tree, pad_of_nodes).iter().map(centred).collect();
                for nodes in [centred_nodes(&tree, pad_of_nodes), compact] {
                    met += check_nodes(&nodes, &packed, pad, largest * distance, 80);
                }
            }
        }
        assert!(met > 10_000, "{met} boxes were met");
    }

    /// Halves that share two words are no smaller than they were, and hardly larger.
    #[test]
    fn compact_halves_are_rounded_up() {
        let mut random = Random::new(72);
        let mut any = || match random.below(8) {
            0 => 0.0,
            1 => f32::from_bits(random.bits() & 0x007f_ffff),
            2 => 2f32.powi(random.below(200) as i32 - 100),
            // Any float up to 2^127.
            _ => f32::from_bits(random.bits() % 0x7f00_0000),
        };
        for _ in 0..100_000 {
            let halves = [any(), any(), any()];
            let [xz, yz] = packed_halves(halves);
            for (half, read) in halves.into_iter().zip(shared_halves(xz, yz)) {
                let most = f64::from(half) * (1.0 + 2f64.powi(-12)) + 2f64.powi(-126 - 12);
                assert!(read >= half && f64::from(read) <= most, "{halves:?}: {half:e} is read as {read:e}");
            }
        }
    }

    /// But for an exit at -0, which boxes are grown out of.
    #[test]
    fn integers_compare_as_the_floats_do() {
        let values = [-f32::MAX, -1.0, -1e-40, -0.0, 0.0, 1e-40, 1.0, 2.0, f32::MAX];
        let mut met = 0;
        for near in values.into_iter().flat_map(|x| values.map(|y| [x, y])) {
            for far in values.into_iter().flat_map(|x| values.map(|y| [x, y])) {
                let interval = [near[0].max(near[1]), far[0].min(far[1])];
                let crossings = [[near[0], near[1], -f32::MAX], [far[0], far[1], f32::MAX]];
                if far.iter().any(|x| x.to_bits() == (-0.0f32).to_bits()) {
                    continue;
                }
                for t_max in [0.0, 1.0, f32::MAX] {
                    let expected = meets(interval, t_max);
                    assert_eq!(meets_grown(crossings, Some(t_max)), expected, "{crossings:?} {t_max}");
                    met += u32::from(expected);
                }
                assert_eq!(meets_grown(crossings, None), meets(interval, f32::MAX), "{crossings:?}");
            }
        }
        assert!(met > 1000, "{met}");
    }

    fn check_nodes(
        nodes: &[CentredNode],
        triangles: &[crate::layout::Triangle],
        pad: f32,
        back: f32,
        rays: u32,
    ) -> u32 {
        // Of each node its place above, and which child it is.
        let mut above = vec![None; nodes.len()];
        let mut leaves = Vec::new();
        for (place, node) in nodes.iter().enumerate() {
            for (side, child) in [node.left, node.right].into_iter().enumerate() {
                match usize::try_from(child) {
                    Ok(child) => above[child] = Some((place, side)),
                    Err(_) => leaves.push((place, side, leaf_of(child))),
                }
            }
        }
        let mut random = Random::new(71);
        let mut met = 0;
        for _ in 0..rays {
            let target = random.below(triangles.len() as u32) as usize;
            let mut ray = aimed_ray(&mut random, &triangles[target]);
            ray.origin -= ray.direction.normalize_or_zero() * back;
            let slabs = slabs_of(&ray, true);
            let exact = grown_ray_of(&ray);
            for ulps in [-2i32, 0, 2] {
                let inverse = exact.inverse.map(|x| f32::from_bits(x.to_bits().wrapping_add_signed(ulps)));
                let grown_ray = GrownRay { inverse, base: -ray.origin * inverse };
                for (place, side, leaf) in &leaves {
                    for index in leaf.clone() {
                        let (pmin, pmax) = padded_box_of(&triangles[index as usize], pad);
                        let own = slab_interval(&slabs, pmin, pmax);
                        if !meets(own, f32::INFINITY) {
                            continue;
                        }
                        met += 1;
                        let mut step = Some((*place, *side));
                        while let Some((place, side)) = step {
                            let node = &nodes[place];
                            let [center, half] =
                                [[node.left_center, node.left_half], [node.right_center, node.right_half]]
                                    [side];
                            for fused in [false, true] {
                                let crossings =
                                    crossings_by(&grown_ray, center, half, |a, b, c| match fused {
                                        true => a.mul_add(b, c),
                                        false => a * b + c,
                                    });
                                assert!(meets_grown(crossings, None), "{ray:?}: {crossings:?}");
                                let [near, far] = crossings.map(Vec3::from);
                                let around = [near.max_element(), far.min_element()];
                                assert!(
                                    around[0].max(0.0) <= own[0].max(0.0) && around[1] >= own[1],
                                    "{ray:?}: {around:?} around {own:?}"
                                );
                            }
                            step = above[place];
                        }
                    }
                }
            }
        }
        met
    }
}
