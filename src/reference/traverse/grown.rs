//! Nodes with both children's boxes as centres and halves, tested in fewer operations. Twin of shaders/traverse/grown.glsl.

use glam::Vec3;

use super::children::Children;
use crate::layout::{CentredNode, PairNode};
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

/// `sum`(a, b, c): a b + c, rounded once or twice.
fn interval_by(
    ray: &GrownRay,
    center: [f32; 3],
    half: [f32; 3],
    sum: impl Fn(f32, f32, f32) -> f32,
) -> [f32; 2] {
    let middle = [0, 1, 2].map(|axis| sum(center[axis], ray.inverse[axis], ray.base[axis]));
    let side = |sign: f32| {
        Vec3::from([0, 1, 2].map(|axis| sum(sign * half[axis], ray.inverse[axis].abs(), middle[axis])))
    };
    [side(-1.0).max_element(), side(1.0).min_element()]
}

pub fn children(ray: &GrownRay, node: &CentredNode) -> Children {
    let interval = |center, half| interval_by(ray, center, half, |a, b, c| a * b + c);
    [
        (node.left, interval(node.left_center, node.left_half)),
        (node.right, interval(node.right_center, node.right_half)),
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
    use crate::pack::{box_pad, centred_nodes, grown_pad};
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
                let nodes = centred_nodes(&tree, grown_pad(pad, largest, reach));
                met += check_nodes(&nodes, &packed, pad, largest * distance, 80);
            }
        }
        assert!(met > 10_000, "{met} boxes were met");
    }

    /// The shader compares crossings as integers. The verdict is that of the floats but for an exit at -0, which boxes are grown out
    /// of, and without a comparison with the ray's end only where there is none.
    #[test]
    fn integers_compare_as_the_floats_do() {
        let as_integers = |near: [f32; 2], far: [f32; 2], t_max: Option<f32>| {
            let bits = |x: f32| x.to_bits() as i32;
            let enter = bits(near[0]).max(bits(near[1])).max(0);
            let leave = bits(far[0]).min(bits(far[1]));
            enter <= t_max.map_or(leave, |t_max| leave.min(bits(t_max)))
        };
        let values = [-f32::MAX, -1.0, -1e-40, -0.0, 0.0, 1e-40, 1.0, 2.0, f32::MAX];
        let mut met = 0;
        for near in values.into_iter().flat_map(|x| values.map(|y| [x, y])) {
            for far in values.into_iter().flat_map(|x| values.map(|y| [x, y])) {
                let interval = [near[0].max(near[1]), far[0].min(far[1])];
                if far.iter().any(|x| x.to_bits() == (-0.0f32).to_bits()) {
                    continue;
                }
                for t_max in [0.0, 1.0, f32::MAX] {
                    let expected = meets(interval, t_max);
                    assert_eq!(as_integers(near, far, Some(t_max)), expected, "{near:?} {far:?} {t_max}");
                    met += u32::from(expected);
                }
                assert_eq!(as_integers(near, far, None), meets(interval, f32::MAX), "{near:?} {far:?}");
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
                                let around = interval_by(&grown_ray, center, half, |a, b, c| match fused {
                                    true => a.mul_add(b, c),
                                    false => a * b + c,
                                });
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
