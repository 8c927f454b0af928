//! How many entries the stack of a traversal can need.

use super::{Content, Tree};

/// Entries that a ray which meets every box needs in `stackN`: a popped inner node pushes its left child,
/// then its right, and the right one is popped first.
pub fn stack_bound(tree: &Tree) -> u32 {
    let mut needs = vec![1u32; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        if let Content::Inner { left, right } = node.content {
            needs[index] = 2.max(1 + needs[right as usize]).max(needs[left as usize]);
        }
    }
    needs.last().copied().unwrap_or(0)
}

/// Entries that a ray which meets every box needs in `single-push`: of two children the right one is visited at once
/// and the left one waits.
pub fn single_push_bound(tree: &Tree) -> u32 {
    let mut needs = vec![0u32; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate() {
        if let Content::Inner { left, right } = node.content {
            needs[index] = (1 + needs[right as usize]).max(needs[left as usize]);
        }
    }
    needs.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Aabb, TreeNode};

    /// A tree from a word in post-order: `.` is a leaf, `^` joins the last two subtrees.
    fn tree(word: &str) -> Tree {
        let mut nodes = Vec::new();
        let mut open = Vec::new();
        let mut leaves = 0;
        for letter in word.chars() {
            let content = if letter == '.' {
                leaves += 1;
                Content::Leaf { first: leaves - 1, count: 1 }
            } else {
                let right = open.pop().unwrap();
                Content::Inner { left: open.pop().unwrap(), right }
            };
            open.push(nodes.len() as u32);
            nodes.push(TreeNode { bounds: Aabb::EMPTY, content });
        }
        Tree { nodes, order: (0..leaves).collect() }
    }

    /// The most entries that a traversal which meets every box ever holds.
    fn replay(tree: &Tree) -> u32 {
        let mut stack = vec![tree.nodes.len() as u32 - 1];
        let mut most = 1;
        while let Some(index) = stack.pop() {
            if let Content::Inner { left, right } = tree.nodes[index as usize].content {
                stack.extend([left, right]);
                most = most.max(stack.len());
            }
        }
        most as u32
    }

    /// The same for `single-push`.
    fn replay_single_push(tree: &Tree) -> u32 {
        let mut stack = Vec::new();
        let mut at = Some(tree.nodes.len() as u32 - 1);
        let mut most = 0;
        while let Some(index) = at {
            at = match tree.nodes[index as usize].content {
                Content::Inner { left, right } => {
                    stack.push(left);
                    most = most.max(stack.len());
                    Some(right)
                }
                Content::Leaf { .. } => stack.pop(),
            };
        }
        most as u32
    }

    /// The same for the methods that visit one child of a node and put the other on the stack, `right_first` telling
    /// for each node which; `waits`: a leaf waits beside the stack while the next entry is taken, as in `postponed`.
    fn replay_pairs(tree: &Tree, right_first: impl Fn(u32) -> bool, waits: bool) -> u32 {
        let mut stack = Vec::new();
        let mut at = Some(tree.nodes.len() as u32 - 1);
        let mut leaf = None;
        let mut most = 0;
        while at.is_some() || leaf.is_some() {
            at = match at.map(|index| (index, tree.nodes[index as usize].content)) {
                Some((index, Content::Inner { left, right })) => {
                    let (near, far) = if right_first(index) { (right, left) } else { (left, right) };
                    stack.push(far);
                    most = most.max(stack.len());
                    Some(near)
                }
                // A leaf that waits already is tested, and this one takes its place.
                Some((index, Content::Leaf { .. })) if waits => {
                    leaf = Some(index);
                    stack.pop()
                }
                Some(_) => stack.pop(),
                None => {
                    leaf = None;
                    None
                }
            };
        }
        most as u32
    }

    #[test]
    fn no_order_of_children_needs_more_than_the_depth() {
        let right_chain = format!("{}{}", ".".repeat(40), "^".repeat(39));
        let left_chain = format!(".{}", ".^".repeat(39));
        for word in [".", "..^", "..^.^", "...^^", "..^..^^", &right_chain, &left_chain] {
            let tree = tree(word);
            let orders: [&dyn Fn(u32) -> bool; 4] =
                [&|_| false, &|_| true, &|index| index % 2 == 0, &|index| index % 3 == 0];
            for waits in [false, true] {
                let needs = orders.map(|order| replay_pairs(&tree, order, waits));
                assert!(needs.iter().all(|&need| need <= tree.depth()), "{word}: {needs:?}");
                assert_eq!(needs[0].max(needs[1]), tree.depth(), "{word}");
            }
        }
    }

    #[test]
    fn the_bound_is_what_a_full_traversal_holds() {
        let right_chain = format!("{}{}", ".".repeat(40), "^".repeat(39));
        let left_chain = format!(".{}", ".^".repeat(39));
        for word in [".", "..^", "..^.^", "...^^", "..^..^^", &right_chain, &left_chain] {
            let tree = tree(word);
            assert_eq!(stack_bound(&tree), replay(&tree), "{word}");
            assert_eq!(single_push_bound(&tree), replay_single_push(&tree), "{word}");
        }
        assert_eq!(stack_bound(&tree(&right_chain)), 40);
        assert_eq!(stack_bound(&tree(&left_chain)), 2);
        assert_eq!(single_push_bound(&tree(&right_chain)), 39);
        assert_eq!(single_push_bound(&tree(&left_chain)), 1);
    }
}
