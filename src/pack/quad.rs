//! Quad nodes: the boxes of four children, component by component.

use super::{OUT_OF_REACH, grown, packed_leaf};
use crate::bvh::Tree;
use crate::bvh::quad::{QUAD_WIDTH, QuadSlot, QuadTree};
use crate::layout::QuadNode;

/// Nodes for `bundle`: the root first. Boxes are grown by twice the pad, so that a triangle's own box lies within its
/// leaf's with room to spare: where a ray leaves the triangle's box at 0, it leaves these above 0
/// (see shaders/traverse/bundle_any.glsl).
pub fn quad_nodes(quad: &QuadTree, tree: &Tree, pad: f32) -> Vec<QuadNode> {
    quad.nodes.iter().map(|slots| packed(slots, tree, pad)).collect()
}

fn packed(slots: &[QuadSlot], tree: &Tree, pad: f32) -> QuadNode {
    let reference = |slot: &QuadSlot| match *slot {
        QuadSlot::Inner { index, .. } => index as i32,
        QuadSlot::Leaf { first, count, .. } => packed_leaf(first, count),
    };
    let lone = slots.first().map_or(0, reference);
    let mut sides = [[[OUT_OF_REACH; QUAD_WIDTH]; 3]; 2];
    let mut children = [lone; QUAD_WIDTH];
    for (place, slot) in slots.iter().enumerate() {
        let (min, max) = grown(&tree.nodes[slot.node() as usize].bounds, 2.0 * pad);
        for axis in 0..3 {
            sides[0][axis][place] = min[axis];
            sides[1][axis][place] = max[axis];
        }
        children[place] = reference(slot);
    }
    let [min, max] = sides;
    let words: [[u32; 4]; 8] = [
        min[0].map(f32::to_bits),
        max[0].map(f32::to_bits),
        min[1].map(f32::to_bits),
        max[1].map(f32::to_bits),
        min[2].map(f32::to_bits),
        max[2].map(f32::to_bits),
        children.map(|child| child as u32),
        [0; 4],
    ];
    bytemuck::cast(words)
}

/// The boxes of a node's children, minima and maxima, with what they refer to.
pub fn quad_children(node: &QuadNode) -> [([f32; 3], [f32; 3], i32); QUAD_WIDTH] {
    let words: [[u32; 4]; 8] = bytemuck::cast(*node);
    let side = |word: usize, place: usize| f32::from_bits(words[word][place]);
    [0, 1, 2, 3].map(|place| {
        let min = [side(0, place), side(2, place), side(4, place)];
        let max = [side(1, place), side(3, place), side(5, place)];
        (min, max, words[6][place] as i32)
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::bvh::{Aabb, midpoint};
    use crate::layout::{LEAF_BITS, LEAF_LIMIT};
    use crate::reference::testing::{KINDS, triangles_of};

    /// Every place stands in one leaf, and every box on the way there holds its triangle's padded box.
    #[test]
    fn boxes_hold_the_triangles_below_them() {
        for kind in KINDS {
            for count in [1, 2, 5, 100, 3000] {
                let triangles = triangles_of(kind, 80 + count as u64, count);
                let tree = midpoint::build(&triangles);
                let pad = 1e-6;
                let nodes = quad_nodes(&QuadTree::new(&tree), &tree, pad);
                let mut seen = vec![0; tree.order.len()];
                let everything = Aabb { min: Vec3::splat(f32::MIN), max: Vec3::splat(f32::MAX) };
                let mut open = vec![(0usize, everything)];
                while let Some((node, around)) = open.pop() {
                    for (min, max, child) in quad_children(&nodes[node]) {
                        if min[0] == OUT_OF_REACH {
                            continue;
                        }
                        let bounds = around.intersection(&Aabb { min: min.into(), max: max.into() });
                        if child >= 0 {
                            open.push((child as usize, bounds));
                            continue;
                        }
                        let packed = (-1 - child) as u32;
                        let first = packed >> LEAF_BITS;
                        for place in first..=first + (packed & (LEAF_LIMIT - 1)) {
                            seen[place as usize] += 1;
                            let own = Aabb::of(&triangles[tree.order[place as usize] as usize]);
                            let (min, max) = grown(&own, pad);
                            assert!(
                                bounds.contains(&Aabb { min: min.into(), max: max.into() }),
                                "{kind:?} {count}"
                            );
                        }
                    }
                }
                assert!(seen.iter().all(|&times| times == 1), "{kind:?} {count}");
            }
        }
    }
}
