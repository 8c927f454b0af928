//! Whether a tree is one: links, order and boxes.

use glam::Vec3;

use super::thread::END;
use super::{Aabb, Content, Tree};
use crate::layout::Triangle;

/// Checks that `tree` is a tree over exactly these triangles, in post-order, and that every box contains
/// what is below it. A triangle may stand in several leaves: then their boxes together must cover it.
/// Says what is wrong first.
pub fn validate(tree: &Tree, triangles: &[Triangle]) -> Result<(), String> {
    if tree.nodes.is_empty() {
        return Err("the tree has no node".into());
    }
    let counts = count_references(tree, triangles.len())?;
    let mut shared = Vec::new();
    let mut parents = vec![0u32; tree.nodes.len()];
    let mut next_triangle = 0;
    for (index, node) in tree.nodes.iter().enumerate() {
        match node.content {
            Content::Inner { left, right } => {
                if right as usize + 1 != index || left >= right {
                    return Err(format!("node {index} has children {left} and {right}, not in post-order"));
                }
                for child in [left, right] {
                    parents[child as usize] += 1;
                    if !node.bounds.contains(&tree.nodes[child as usize].bounds) {
                        return Err(format!(
                            "the box of node {index} does not contain that of its child {child}"
                        ));
                    }
                }
            }
            Content::Leaf { first, count } => {
                if first != next_triangle || count == 0 {
                    return Err(format!(
                        "leaf {index} holds {count} triangles from {first}, not from {next_triangle}"
                    ));
                }
                next_triangle = first.saturating_add(count);
                let Some(held) = tree.order.get(first as usize..next_triangle as usize) else {
                    return Err(format!("leaf {index} reaches beyond the order"));
                };
                check_leaf(index, &node.bounds, held, &counts, triangles)?;
                let several = held.iter().filter(|&&triangle| counts[triangle as usize] > 1);
                shared.extend(several.map(|&triangle| (triangle, node.bounds)));
            }
        }
    }
    if next_triangle as usize != tree.order.len() {
        return Err(format!("the leaves hold {next_triangle} triangles of {}", tree.order.len()));
    }
    let root = tree.nodes.len() - 1;
    let wrong = parents.iter().enumerate().find(|&(index, &count)| count != u32::from(index != root));
    if let Some((index, count)) = wrong {
        return Err(format!("node {index} has {count} parents"));
    }
    shared.sort_by_key(|&(triangle, _)| triangle);
    shared.chunk_by(|a, b| a.0 == b.0).try_for_each(|parts| {
        let triangle = parts[0].0;
        check_cover(triangle, &triangles[triangle as usize], parts)
    })
}

/// How many times each triangle stands in the order; it must at least once.
fn count_references(tree: &Tree, triangles: usize) -> Result<Vec<u32>, String> {
    let mut counts = vec![0u32; triangles];
    for &triangle in &tree.order {
        match counts.get_mut(triangle as usize) {
            None => return Err(format!("the order names triangle {triangle} of {triangles}")),
            Some(count) => *count += 1,
        }
    }
    match counts.iter().position(|&count| count == 0) {
        Some(missing) => Err(format!("triangle {missing} is in no leaf")),
        None => Ok(counts),
    }
}

/// A leaf contains the triangles that are in no other, and meets the rest.
fn check_leaf(
    leaf: usize,
    bounds: &Aabb,
    held: &[u32],
    counts: &[u32],
    triangles: &[Triangle],
) -> Result<(), String> {
    for (place, &triangle) in held.iter().enumerate() {
        let own = Aabb::of(&triangles[triangle as usize]);
        if held[..place].contains(&triangle) {
            return Err(format!("triangle {triangle} stands twice in leaf {leaf}"));
        }
        if counts[triangle as usize] == 1 && !bounds.contains(&own) {
            return Err(format!("the box of leaf {leaf} does not contain triangle {triangle}"));
        }
        let common = bounds.intersection(&own);
        if !common.min.cmple(common.max).all() {
            return Err(format!("the box of leaf {leaf} does not meet triangle {triangle}"));
        }
    }
    Ok(())
}

/// Steps of the grid of points that are looked for on a triangle, along each edge.
const COVER_STEPS: u32 = 32;

/// Checks that each of many points on a triangle lies in one of the boxes of its leaves.
fn check_cover(place: u32, triangle: &Triangle, parts: &[(u32, Aabb)]) -> Result<(), String> {
    let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::from);
    // The corners are rounded, and with them the triangle's own box.
    let own = Aabb::of(triangle);
    for i in 0..=COVER_STEPS {
        for j in 0..=COVER_STEPS - i {
            let (u, v) = (i as f32 / COVER_STEPS as f32, j as f32 / COVER_STEPS as f32);
            let point = (a + (u * ab + v * ac)).clamp(own.min, own.max);
            let held = parts.iter().any(|(_, part)| part.contains(&Aabb { min: point, max: point }));
            if !held {
                return Err(format!("triangle {place} is in no leaf at {point}"));
            }
        }
    }
    Ok(())
}

/// Checks a sewn tree: a traversal that meets every box visits every node once and ends, and one that
/// skips a node goes on where a stack would.
pub fn validate_skips(tree: &Tree, skips: &[i32]) -> Result<(), String> {
    if skips.len() != tree.nodes.len() {
        return Err(format!("{} skips for {} nodes", skips.len(), tree.nodes.len()));
    }
    let mut stack = vec![END, tree.nodes.len() as i32 - 1];
    while let Some(index) = stack.pop() {
        let Some(node) = usize::try_from(index).ok().map(|index| &tree.nodes[index]) else { break };
        let next = stack.last().copied().unwrap_or(END);
        if skips[index as usize] != next {
            return Err(format!("node {index} skips to {}, not to {next}", skips[index as usize]));
        }
        if let Content::Inner { left, right } = node.content {
            stack.extend([left as i32, right as i32]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{TreeNode, midpoint, thread};

    fn scene() -> Vec<Triangle> {
        (0..20)
            .map(|i| Triangle {
                a: [(i * 7 % 20) as f32, (i * 3 % 11) as f32, i as f32],
                id: i,
                ab: [1.0, 0.0, 0.5],
                ac: [0.0, 1.0, 0.0],
                ..Triangle::default()
            })
            .collect()
    }

    /// Breaks a good tree and expects the validator to say `complaint`.
    fn rejects(complaint: &str, break_it: impl Fn(&mut Tree)) {
        let triangles = scene();
        let mut tree = midpoint::build(&triangles);
        validate(&tree, &triangles).unwrap();
        break_it(&mut tree);
        let said = validate(&tree, &triangles).expect_err(complaint);
        assert!(said.contains(complaint), "{said}");
    }

    #[test]
    fn broken_trees_are_rejected() {
        rejects("is in no leaf", |tree| tree.order[3] = tree.order[4]);
        rejects("names triangle 20", |tree| tree.order[3] = 20);
        rejects("does not contain triangle", |tree| tree.order.swap(0, 19));
        rejects("of its child", |tree| tree.nodes[38].bounds.max.x -= 5.0);
        rejects("not in post-order", |tree| {
            let Content::Inner { left, right } = tree.nodes[38].content else { unreachable!() };
            tree.nodes[38].content = Content::Inner { left: right, right: left };
        });
        rejects("parents", |tree| {
            let Content::Inner { left, right } = tree.nodes[38].content else { unreachable!() };
            tree.nodes[38].content = Content::Inner { left: left - 1, right };
        });
        rejects("from 0, not from 1", |tree| tree.nodes[1].content = Content::Leaf { first: 0, count: 1 });
        rejects("the tree has no node", |tree| tree.nodes.clear());
        rejects("not in post-order", |tree| {
            tree.nodes.pop();
            let last = tree.nodes.len() - 1;
            tree.nodes[last].content = Content::Inner { left: 900, right: last as u32 - 1 };
        });
    }

    /// Each leaf holds one triangle that is whole and a part of one that is not.
    #[test]
    fn parts_must_cover_their_triangle() {
        let triangle = |x: f32, width: f32| Triangle {
            a: [x, 0.0, 0.0],
            ab: [width, 0.0, 0.0],
            ac: [0.0, 1.0, 0.0],
            ..Triangle::default()
        };
        let triangles = [triangle(0.0, 2.0), triangle(0.0, 0.5), triangle(1.25, 0.5)];
        let leaf = |x: f32, first| TreeNode {
            bounds: Aabb { min: Vec3::X * x, max: Vec3::new(x + 1.0, 1.0, 0.0) },
            content: Content::Leaf { first, count: 2 },
        };
        let root = Aabb { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 0.0) };
        let inner = TreeNode { bounds: root, content: Content::Inner { left: 0, right: 1 } };
        let good = Tree { nodes: vec![leaf(0.0, 0), leaf(1.0, 2), inner], order: vec![0, 1, 0, 2] };
        validate(&good, &triangles).unwrap();
        let rejects = |complaint: &str, break_it: &dyn Fn(&mut Tree)| {
            let mut tree = good.clone();
            break_it(&mut tree);
            let said = validate(&tree, &triangles).expect_err(complaint);
            assert!(said.contains(complaint), "{said}");
        };
        rejects("triangle 0 is in no leaf at", &|tree| tree.nodes[1].bounds.min.x = 1.1);
        rejects("triangle 0 is in no leaf at", &|tree| tree.nodes[0].bounds.max.x = 0.8);
        rejects("triangle 2 is in no leaf", &|tree| tree.order[3] = 1);
        rejects("does not meet triangle 0", &|tree| tree.nodes[1].bounds.min.y = 1.5);
        rejects("stands twice in leaf", &|tree| {
            tree.order = vec![0, 1, 0, 0, 2];
            tree.nodes[1].content = Content::Leaf { first: 2, count: 3 };
        });
        rejects("does not contain triangle 2", &|tree| tree.nodes[1].bounds.max.y = 0.9);
    }

    #[test]
    fn broken_threads_are_rejected() {
        let tree = midpoint::build(&scene());
        let good = thread::skips(&tree);
        validate_skips(&tree, &good).unwrap();
        for index in 0..good.len() {
            let mut broken = good.clone();
            broken[index] = if broken[index] == 5 { 6 } else { 5 };
            validate_skips(&tree, &broken).expect_err("a wrong skip");
        }
        validate_skips(&tree, &good[1..]).expect_err("a missing skip");
    }
}
