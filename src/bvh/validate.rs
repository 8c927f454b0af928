//! Whether a tree is one: links, order and boxes.

use super::thread::END;
use super::{Aabb, Content, Tree};
use crate::layout::Triangle;

/// Checks that `tree` is a tree over exactly these triangles, in post-order, and that every box contains
/// what is below it. Says what is wrong first.
pub fn validate(tree: &Tree, triangles: &[Triangle]) -> Result<(), String> {
    if tree.nodes.is_empty() {
        return Err("the tree has no node".into());
    }
    check_order(tree, triangles.len())?;
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
                check_leaf(tree, index, first, next_triangle, triangles)?;
            }
        }
    }
    if next_triangle as usize != tree.order.len() {
        return Err(format!("the leaves hold {next_triangle} triangles of {}", tree.order.len()));
    }
    let root = tree.nodes.len() - 1;
    match parents.iter().enumerate().find(|&(index, &count)| count != u32::from(index != root)) {
        Some((index, count)) => Err(format!("node {index} has {count} parents")),
        None => Ok(()),
    }
}

/// Every triangle must stand in the order exactly once.
fn check_order(tree: &Tree, triangles: usize) -> Result<(), String> {
    let mut seen = vec![false; triangles];
    for &triangle in &tree.order {
        match seen.get_mut(triangle as usize) {
            None => return Err(format!("the order names triangle {triangle} of {triangles}")),
            Some(seen) if *seen => return Err(format!("triangle {triangle} stands twice in the order")),
            Some(seen) => *seen = true,
        }
    }
    match seen.iter().position(|seen| !seen) {
        Some(missing) => Err(format!("triangle {missing} is in no leaf")),
        None => Ok(()),
    }
}

fn check_leaf(tree: &Tree, leaf: usize, first: u32, end: u32, triangles: &[Triangle]) -> Result<(), String> {
    let Some(held) = tree.order.get(first as usize..end as usize) else {
        return Err(format!("leaf {leaf} reaches beyond the order"));
    };
    let bounds = &tree.nodes[leaf].bounds;
    match held.iter().find(|&&triangle| !bounds.contains(&Aabb::of(&triangles[triangle as usize]))) {
        Some(triangle) => Err(format!("the box of leaf {leaf} does not contain triangle {triangle}")),
        None => Ok(()),
    }
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
    use crate::bvh::{midpoint, thread};

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
        rejects("stands twice", |tree| tree.order[3] = tree.order[4]);
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
