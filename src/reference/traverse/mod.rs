//! One method a file, as in shaders/traverse/. The loops have no limit here, so every ray is finished.

pub mod beam;
pub mod brute;
pub mod bundle;
pub mod children;
pub mod edges;
pub mod entry;
pub mod grown;
pub mod near_first;
pub mod ordered;
pub mod packet;
pub mod pair;
pub mod postponed;
pub mod rough;
pub mod sides;
pub mod single_push;
pub mod stack;
pub mod threaded;
pub mod wide;

use super::ray::{Hit, Ray};
use super::{Inputs, Traversal};

/// The closest hit, starting from what is known already, and whether the stack overflowed.
pub fn closest_hit(inputs: &Inputs, ray: &Ray, hit: Hit) -> (Hit, bool) {
    match inputs.choices.traversal {
        Traversal::Brute => (brute::closest_hit(inputs, ray, hit), false),
        Traversal::Stack { size } => stack::closest_hit(inputs, ray, hit, size),
        Traversal::Threaded => (threaded::closest_hit(inputs, ray, hit), false),
        Traversal::SinglePush => (single_push::closest_hit(inputs, ray, hit), false),
        Traversal::Packet => (packet::closest_hits(inputs, &[*ray], vec![hit])[0], false),
        Traversal::Postponed => (postponed::closest_hits(inputs, &[*ray], vec![hit])[0], false),
        Traversal::Entry => (entry::closest_hit(inputs, ray, hit), false),
        Traversal::Ordered => (ordered::closest_hit(inputs, ray, hit), false),
        Traversal::Wide => (wide::closest_hit(inputs, ray, hit), false),
        Traversal::Bundle => (bundle::closest_hits(inputs, &[*ray], vec![hit])[0], false),
    }
}

/// Whether the ray meets any triangle, and whether the stack overflowed.
pub fn any_hit(inputs: &Inputs, ray: &Ray) -> (bool, bool) {
    match inputs.choices.traversal {
        Traversal::Brute => (brute::any_hit(inputs, ray), false),
        Traversal::Stack { size } => stack::any_hit(inputs, ray, size),
        Traversal::Threaded => (threaded::any_hit(inputs, ray), false),
        Traversal::SinglePush => (single_push::any_hit(inputs, ray), false),
        Traversal::Packet => (packet::any_hits(inputs, &[*ray])[0], false),
        Traversal::Postponed => (postponed::any_hits(inputs, &[*ray])[0], false),
        Traversal::Entry => (entry::any_hit(inputs, ray), false),
        Traversal::Ordered => (ordered::any_hit(inputs, ray), false),
        Traversal::Wide => (wide::any_hit(inputs, ray), false),
        Traversal::Bundle => (bundle::any_hits(inputs, &[*ray])[0], false),
    }
}

#[cfg(test)]
mod builder_tests;
#[cfg(test)]
mod tests;
