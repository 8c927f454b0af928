//! Wide nodes with boxes of 8 bits a side (Ylitie, Karras and Laine 2017, section 3), rounded outwards: a child's
//! box contains its padded box, in exact arithmetic.

use std::cmp::Ordering;

use glam::Vec3;

use super::{grown, packed_leaf};
use crate::bvh::wide::{Slot, WIDTH, WideTree};
use crate::bvh::{Aabb, Content, Tree};
use crate::layout::{LEAF_BITS, LEAF_LIMIT, WideNode};

/// Nodes for `wide`: the root first.
pub fn wide_nodes(wide: &WideTree, tree: &Tree, pad: f32) -> Vec<WideNode> {
    wide.nodes.iter().map(|slots| packed(slots, tree, pad)).collect()
}

fn packed(slots: &[Slot; WIDTH], tree: &Tree, pad: f32) -> WideNode {
    let boxes = slots.map(|slot| {
        slot.node().map(|node| {
            let (min, max) = grown(&tree.nodes[node as usize].bounds, pad);
            Aabb { min: min.into(), max: max.into() }
        })
    });
    let Some(all) = boxes.iter().flatten().copied().reduce(|all, bounds| all.union(&bounds)) else {
        return WideNode::default();
    };
    let axes = [0, 1, 2].map(|axis| {
        let sides = boxes.map(|bounds| bounds.map(|bounds| (bounds.min[axis], bounds.max[axis])));
        Axis::of(all.min[axis], all.max[axis], &sides)
    });
    let filled = boxes.iter().enumerate().map(|(slot, bounds)| u32::from(bounds.is_some()) << slot).sum();
    let scales = [axes[0].exponent, axes[1].exponent, axes[2].exponent, filled];
    let children = slots.map(|slot| match slot {
        Slot::Empty => 0,
        Slot::Inner { index, .. } => index as i32,
        Slot::Leaf { first, count, .. } => packed_leaf(first, count),
    });
    let [x, y, z] =
        axes.map(|axis| [word(&axis.mins, 0), word(&axis.mins, 4), word(&axis.maxs, 0), word(&axis.maxs, 4)]);
    WideNode {
        origin: all.min.to_array(),
        scales: scales.iter().enumerate().map(|(byte, value)| value << (8 * byte)).sum(),
        min_x0: x[0],
        min_x4: x[1],
        min_y0: y[0],
        min_y4: y[1],
        min_z0: z[0],
        min_z4: z[1],
        max_x0: x[2],
        max_x4: x[3],
        max_y0: y[2],
        max_y4: y[3],
        max_z0: z[2],
        max_z4: z[3],
        child0: children[0],
        child1: children[1],
        child2: children[2],
        child3: children[3],
        child4: children[4],
        child5: children[5],
        child6: children[6],
        child7: children[7],
    }
}

fn word(bytes: &[u8; WIDTH], first: usize) -> u32 {
    u32::from_le_bytes([bytes[first], bytes[first + 1], bytes[first + 2], bytes[first + 3]])
}

/// The sides of the children along an axis.
struct Axis {
    /// Biased, as in a 32-bit float.
    exponent: u32,
    mins: [u8; WIDTH],
    maxs: [u8; WIDTH],
}

/// Exponents of scales: from 2^-100, so that no product is denormal, to the largest of all.
const EXPONENTS: std::ops::RangeInclusive<u32> = 27..=254;

impl Axis {
    /// With the smallest scale that reaches `far` from `origin`, each side rounded outwards.
    fn of(origin: f32, far: f32, sides: &[Option<(f32, f32)>; WIDTH]) -> Self {
        let extent = f64::from(far) - f64::from(origin);
        let (least, most) = (*EXPONENTS.start(), *EXPONENTS.end());
        let guess = (extent / 255.0).log2().floor() + 127.0;
        let mut exponent = (guess.max(f64::from(least)) as u32).clamp(least, most);
        while exponent < most && compare_side(origin, exponent, 255, far).is_lt() {
            exponent += 1;
        }
        let mut axis = Self { exponent, mins: [0; WIDTH], maxs: [0; WIDTH] };
        let steps = |to: f32| (f64::from(to) - f64::from(origin)) / f64::from(scale_of(exponent));
        for (slot, sides) in sides.iter().enumerate() {
            if let Some((min, max)) = *sides {
                axis.mins[slot] = lower(origin, exponent, min, steps(min) as u8);
                axis.maxs[slot] = upper(origin, exponent, max, steps(max) as u8);
            }
        }
        axis
    }
}

fn scale_of(exponent: u32) -> f32 {
    f32::from_bits(exponent << 23)
}

/// How the exact side origin + q scale compares with a number.
fn compare_side(origin: f32, exponent: u32, q: u8, with: f32) -> Ordering {
    // The difference and its rounding error (Knuth 1969, section 4.2.2): together they are exact.
    let (a, b) = (f64::from(with) + 0.0, f64::from(origin));
    let difference = a - b;
    let of_b = a - difference;
    let of_a = difference + of_b;
    let error = (a - of_a) + (of_b - b);
    let product = f64::from(q) * f64::from(scale_of(exponent));
    product.total_cmp(&difference).then(0.0f64.total_cmp(&error))
}

/// The largest q whose side is at most `min`; that of 0 is the origin, which is.
fn lower(origin: f32, exponent: u32, min: f32, guess: u8) -> u8 {
    let mut q = guess;
    while q > 0 && compare_side(origin, exponent, q, min).is_gt() {
        q -= 1;
    }
    while q < u8::MAX && compare_side(origin, exponent, q + 1, min).is_le() {
        q += 1;
    }
    q
}

/// The smallest q whose side is at least `max`; that of 255 is.
fn upper(origin: f32, exponent: u32, max: f32, guess: u8) -> u8 {
    let mut q = guess;
    while q < u8::MAX && compare_side(origin, exponent, q, max).is_lt() {
        q += 1;
    }
    while q > 0 && compare_side(origin, exponent, q - 1, max).is_ge() {
        q -= 1;
    }
    q
}

/// The units of a node's sides along the axes.
pub fn wide_scale(node: &WideNode) -> Vec3 {
    let [x, y, z, _] = node.scales.to_le_bytes().map(|exponent| scale_of(u32::from(exponent)));
    Vec3::new(x, y, z)
}

/// The sides of a slot's box, in units from the node's origin: least and most along each axis.
pub fn wide_sides(node: &WideNode, slot: usize) -> [[u8; 3]; 2] {
    let mins = [[node.min_x0, node.min_x4], [node.min_y0, node.min_y4], [node.min_z0, node.min_z4]];
    let maxs = [[node.max_x0, node.max_x4], [node.max_y0, node.max_y4], [node.max_z0, node.max_z4]];
    [mins, maxs].map(|sides| sides.map(|words| words[slot / 4].to_le_bytes()[slot % 4]))
}

/// The reference in a slot; none where it is empty.
pub fn wide_child(node: &WideNode, slot: usize) -> Option<i32> {
    let children = [
        node.child0,
        node.child1,
        node.child2,
        node.child3,
        node.child4,
        node.child5,
        node.child6,
        node.child7,
    ];
    (node.scales >> (24 + slot) & 1 == 1).then(|| children[slot])
}

/// Whether a slot's box contains another.
fn slot_contains(node: &WideNode, slot: usize, inner: &Aabb) -> bool {
    let [mins, maxs] = wide_sides(node, slot);
    let exponents = node.scales.to_le_bytes();
    (0..3).all(|axis| {
        let compare = |q, with| compare_side(node.origin[axis], u32::from(exponents[axis]), q, with);
        compare(mins[axis], inner.min[axis]).is_le() && compare(maxs[axis], inner.max[axis]).is_ge()
    })
}

/// Checks that packed wide nodes are one tree, that their leaves hold every place of the binary tree's order once,
/// and that the box of each slot contains the padded boxes of the binary tree's leaves that it has a part of. Says
/// what is wrong first.
pub fn validate_wide(nodes: &[WideNode], tree: &Tree, pad: f32) -> Result<(), String> {
    let held = boxes_of_places(tree, pad);
    let mut seen = vec![false; held.len()];
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut below = vec![[Aabb::EMPTY; WIDTH]; nodes.len()];
    for (place, node) in nodes.iter().enumerate() {
        for (slot, inside) in below[place].iter_mut().enumerate() {
            match wide_child(node, slot) {
                None => {}
                Some(child) if child >= 0 => {
                    let known = parents.get_mut(child as usize);
                    match known.filter(|parent| child as usize > place && parent.is_none()) {
                        Some(parent) => *parent = Some(place * WIDTH + slot),
                        None => {
                            return Err(format!(
                                "slot {slot} of node {place} names node {child}, which is no child"
                            ));
                        }
                    }
                }
                Some(leaf) => {
                    let packed_leaf = (-1 - leaf) as usize;
                    let first = packed_leaf >> LEAF_BITS;
                    for at in first..=first + (packed_leaf & (LEAF_LIMIT as usize - 1)) {
                        match seen.get_mut(at) {
                            None => {
                                return Err(format!("node {place} holds triangle {at} of {}", held.len()));
                            }
                            Some(seen) if *seen => return Err(format!("triangle {at} is held twice")),
                            Some(seen) => *seen = true,
                        }
                        *inside = inside.union(&held[at]);
                    }
                }
            }
        }
    }
    if let Some(missing) = seen.iter().position(|seen| !seen) {
        return Err(format!("triangle {missing} is in no leaf"));
    }
    for place in (0..nodes.len()).rev() {
        let mut all = Aabb::EMPTY;
        for (slot, inside) in below[place].iter().enumerate() {
            if wide_child(&nodes[place], slot).is_some() && !slot_contains(&nodes[place], slot, inside) {
                return Err(format!("slot {slot} of node {place} does not contain what is below it"));
            }
            all = all.union(inside);
        }
        match parents[place] {
            Some(parent) => below[parent / WIDTH][parent % WIDTH] = all,
            None if place > 0 => return Err(format!("node {place} has no parent")),
            None => {}
        }
    }
    Ok(())
}

/// For each place of the order the padded box of the leaf that holds it.
fn boxes_of_places(tree: &Tree, pad: f32) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; tree.order.len()];
    for node in &tree.nodes {
        if let Content::Leaf { first, count } = node.content {
            let (min, max) = grown(&node.bounds, pad);
            boxes[first as usize..(first + count) as usize].fill(Aabb { min: min.into(), max: max.into() });
        }
    }
    boxes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::midpoint;
    use crate::layout::Triangle;
    use crate::pack::box_pad;
    use crate::reference::testing::{KINDS, Random, triangles_of};

    fn moved(triangle: &Triangle, scale: f32, shift: Vec3) -> Triangle {
        let edge = |edge: [f32; 3]| (Vec3::from(edge) * scale).to_array();
        let a = (Vec3::from(triangle.a) + shift) * scale;
        Triangle { a: a.to_array(), ab: edge(triangle.ab), ac: edge(triangle.ac), ..*triangle }
    }

    #[test]
    fn boxes_contain_their_children_at_any_scale_and_place() {
        let mut random = Random::new(80);
        for kind in KINDS {
            for count in [1, 2, 30, 1000] {
                let triangles = triangles_of(kind, 81 + count as u64, count);
                for scale in [1e-6, 1.0, 3e5, 1e6, 1e30] {
                    for shift in [0.0, 1.0, 1e3, 1e6] {
                        let shift = random.point() * shift;
                        let placed: Vec<_> = triangles.iter().map(|t| moved(t, scale, shift)).collect();
                        let tree = midpoint::build(&placed);
                        for pad in [0.0, box_pad(&placed)] {
                            let nodes = wide_nodes(&WideTree::new(&tree), &tree, pad);
                            validate_wide(&nodes, &tree, pad)
                                .unwrap_or_else(|e| panic!("{kind:?} {count} * {scale} + {shift}: {e}"));
                        }
                    }
                }
            }
        }
    }

    /// Sides of small and large floats, of all of them, and of some far from zero: rounded outwards, and no farther than they must.
    #[test]
    fn sides_are_rounded_outwards_and_not_too_far() {
        let mut random = Random::new(82);
        for round in 0..200_000 {
            let mut number = || match round % 4 {
                0 => random.signed(),
                1 => f32::from_bits(random.bits()),
                2 => 1e6 + (random.signed() * 8.0).round() / 16.0,
                _ => random.signed() * f32::MAX,
            };
            let mut sides = [None; WIDTH];
            for side in &mut sides {
                let (a, b) = (number(), number());
                if a.is_finite() && b.is_finite() {
                    *side = Some((a.min(b), a.max(b)));
                }
            }
            let all = |pick: fn((f32, f32)) -> f32| sides.iter().flatten().map(move |&side| pick(side));
            let (origin, far) =
                (all(|s| s.0).fold(f32::INFINITY, f32::min), all(|s| s.1).fold(f32::NEG_INFINITY, f32::max));
            if !origin.is_finite() {
                continue;
            }
            let axis = Axis::of(origin, far, &sides);
            for (slot, sides) in sides.iter().enumerate() {
                let Some((min, max)) = *sides else { continue };
                let compare = |q, with| compare_side(origin, axis.exponent, q, with);
                let (low, high) = (axis.mins[slot], axis.maxs[slot]);
                assert!(compare(low, min).is_le() && compare(high, max).is_ge(), "{origin} {min} {max}");
                assert!(low == 255 || compare(low + 1, min).is_gt(), "{origin} {min} {max}");
                assert!(high == 0 || compare(high - 1, max).is_lt(), "{origin} {min} {max}");
            }
            assert!(axis.exponent == 27 || compare_side(origin, axis.exponent - 1, 255, far).is_lt());
        }
    }

    /// Breaks good nodes and expects the validator to say `complaint`.
    fn rejects(complaint: &str, break_it: impl Fn(&mut Vec<WideNode>)) {
        let tree = midpoint::build(&triangles_of(crate::reference::testing::Kind::Soup, 83, 300));
        let mut nodes = wide_nodes(&WideTree::new(&tree), &tree, 1e-6);
        validate_wide(&nodes, &tree, 1e-6).unwrap();
        break_it(&mut nodes);
        let said = validate_wide(&nodes, &tree, 1e-6).expect_err(complaint);
        assert!(said.contains(complaint), "{said}");
    }

    /// The first node with a leaf in slot 0.
    fn with_leaf(nodes: &mut [WideNode]) -> &mut WideNode {
        nodes.iter_mut().find(|node| wide_child(node, 0).is_some_and(|child| child < 0)).unwrap()
    }

    #[test]
    fn broken_nodes_are_rejected() {
        rejects("does not contain", |nodes| with_leaf(nodes).max_y0 &= !255);
        rejects("does not contain", |nodes| nodes[0].origin[0] += 0.1);
        rejects("does not contain", |nodes| nodes[0].scales -= 1);
        rejects("is in no leaf", |nodes| with_leaf(nodes).scales &= !(1 << 24));
        rejects("held twice", |nodes| {
            let leaf = with_leaf(nodes).child0;
            nodes.push(WideNode { scales: 1 << 24, child0: leaf, ..WideNode::default() });
        });
        rejects("of 300", |nodes| with_leaf(nodes).child0 -= 300 * LEAF_LIMIT as i32);
        rejects("no child", |nodes| {
            let node =
                nodes.iter_mut().find(|node| wide_child(node, 0).is_some_and(|child| child > 0)).unwrap();
            node.child0 = 0;
        });
        rejects("no child", |nodes| {
            nodes.pop();
        });
        rejects("has no parent", |nodes| nodes.push(WideNode::default()));
    }
}
