//! Sewing a tree: where a traversal goes on when it is done with a node.

use super::{Content, Tree};

/// No node follows.
pub const END: i32 = -1;

/// For each node the next one after its whole subtree, [`END`] after the last: the right child is visited
/// first and skips to the left one, which skips to where its parent does.
pub fn skips(tree: &Tree) -> Vec<i32> {
    let mut skips = vec![END; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        if let Content::Inner { left, right } = node.content {
            skips[right as usize] = left as i32;
            skips[left as usize] = skips[index];
        }
    }
    skips
}
