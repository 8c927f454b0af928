//! The original's builder: split the longest axis of the node's box at its middle.
//!
//! Leaves hold one triangle, so a subtree of n triangles has 2n - 1 nodes, and its place in the array is
//! known before it is built: subtrees are built in parallel, each in its own slice.

use std::mem::swap;

use glam::Vec3;
use rayon::prelude::*;

use super::{Aabb, Content, Tree, TreeNode};
use crate::layout::Triangle;

/// Below this many triangles a subtree is built by the thread that comes to it.
const PARALLEL_FROM: usize = 4096;

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    triangle: u32,
}

/// Builds the tree of at least one triangle.
pub fn build(triangles: &[Triangle]) -> Tree {
    let mut items: Vec<Item> = triangles
        .par_iter()
        .enumerate()
        .map(|(place, triangle)| Item { bounds: Aabb::of(triangle), triangle: place as u32 })
        .collect();
    let empty = TreeNode { bounds: Aabb::EMPTY, content: Content::Leaf { first: 0, count: 0 } };
    let mut nodes = vec![empty; (2 * items.len()).saturating_sub(1)];
    if !items.is_empty() {
        build_subtree(&mut items, 0, &mut nodes, 0);
    }
    Tree { nodes, order: items.iter().map(|item| item.triangle).collect() }
}

/// Builds the subtree of `items` into `nodes`. The slices start at places `first_item` and `first_node` of
/// the whole arrays.
fn build_subtree(items: &mut [Item], first_item: usize, nodes: &mut [TreeNode], first_node: usize) {
    let last = nodes.len() - 1;
    let bounds = bounds_of(items);
    if items.len() == 1 {
        nodes[last] = TreeNode { bounds, content: Content::Leaf { first: first_item as u32, count: 1 } };
        return;
    }
    let split = split(items, &bounds);
    let left_nodes = 2 * split - 1;
    let left = (first_node + left_nodes - 1) as u32;
    let right = (first_node + last - 1) as u32;
    nodes[last] = TreeNode { bounds, content: Content::Inner { left, right } };
    let parallel = items.len() >= PARALLEL_FROM;
    let (left_items, right_items) = items.split_at_mut(split);
    let (left_slice, rest) = nodes.split_at_mut(left_nodes);
    let right_slice = &mut rest[..last - left_nodes];
    let mut build_left = || build_subtree(left_items, first_item, left_slice, first_node);
    let mut build_right =
        || build_subtree(right_items, first_item + split, right_slice, first_node + left_nodes);
    if parallel {
        rayon::join(build_left, build_right);
    } else {
        build_left();
        build_right();
    }
}

fn bounds_of(items: &[Item]) -> Aabb {
    let union = |a: Aabb, b: Aabb| a.union(&b);
    if items.len() >= 16 * PARALLEL_FROM {
        items.par_iter().map(|item| item.bounds).reduce(|| Aabb::EMPTY, union)
    } else {
        items.iter().map(|item| item.bounds).fold(Aabb::EMPTY, union)
    }
}

/// Orders the items into two sides and returns how many are on the left; both get at least one.
fn split(items: &mut [Item], bounds: &Aabb) -> usize {
    let size = bounds.max - bounds.min;
    let axis = if size.x > size.y && size.x > size.z {
        0
    } else if size.y > size.z {
        1
    } else {
        2
    };
    let middle = center(bounds)[axis];
    let split = partition(items, |item| center(&item.bounds)[axis] < middle);
    if split == 0 || split == items.len() { items.len() / 2 } else { split }
}

fn center(bounds: &Aabb) -> Vec3 {
    (bounds.min + bounds.max) * 0.5
}

/// Two-ended partition in the manner of `std::partition` for bidirectional iterators: which items are
/// swapped decides the order within the sides, and with it the original's tree.
fn partition(items: &mut [Item], goes_left: impl Fn(&Item) -> bool) -> usize {
    let mut first = 0;
    let mut last = items.len();
    loop {
        while first < last && goes_left(&items[first]) {
            first += 1;
        }
        loop {
            if first >= last {
                return first;
            }
            last -= 1;
            if goes_left(&items[last]) {
                break;
            }
        }
        let (head, tail) = items.split_at_mut(last);
        swap(&mut head[first], &mut tail[0]);
        first += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::validate::validate;

    fn at(x: f32, id: u32) -> Triangle {
        Triangle { a: [x, 0.0, 0.0], id, ab: [0.1, 0.0, 0.0], ac: [0.0, 0.1, 0.0], ..Triangle::default() }
    }

    #[test]
    fn partition_swaps_from_both_ends() {
        let mut items: Vec<Item> = [5.0, 1.0, 6.0, 2.0, 7.0, 3.0]
            .iter()
            .enumerate()
            .map(|(place, &x)| Item { bounds: Aabb::of(&at(x, 0)), triangle: place as u32 })
            .collect();
        let split = partition(&mut items, |item| item.bounds.min.x < 4.0);
        let order: Vec<u32> = items.iter().map(|item| item.triangle).collect();
        assert_eq!((split, order), (3, vec![5, 1, 3, 2, 4, 0]));
    }

    #[test]
    fn splits_at_the_middle_and_halves_what_does_not_split() {
        let triangles: Vec<Triangle> = [0.0, 1.0, 9.0, 10.0].iter().map(|&x| at(x, 0)).collect();
        let tree = build(&triangles);
        assert_eq!(tree.order, [0, 1, 2, 3]);
        assert_eq!(tree.nodes[6].content, Content::Inner { left: 2, right: 5 });
        let same = vec![at(1.0, 0); 5];
        let tree = build(&same);
        assert_eq!(tree.nodes.len(), 9);
        assert_eq!(tree.depth(), 3);
        validate(&tree, &same).unwrap();
    }

    #[test]
    fn one_triangle_is_one_leaf() {
        let tree = build(&[at(0.0, 0)]);
        assert_eq!((tree.nodes.len(), tree.depth()), (1, 0));
        validate(&tree, &[at(0.0, 0)]).unwrap();
    }
}
