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

    #[test]
    fn the_bound_is_what_a_full_traversal_holds() {
        let right_chain = format!("{}{}", ".".repeat(40), "^".repeat(39));
        let left_chain = format!(".{}", ".^".repeat(39));
        for word in [".", "..^", "..^.^", "...^^", "..^..^^", &right_chain, &left_chain] {
            let tree = tree(word);
            assert_eq!(stack_bound(&tree), replay(&tree), "{word}");
        }
        assert_eq!(stack_bound(&tree(&right_chain)), 40);
        assert_eq!(stack_bound(&tree(&left_chain)), 2);
    }
}
