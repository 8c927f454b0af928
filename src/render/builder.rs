//! Which tree a render takes, and why. Trees change no counts, so the device may have a say.

use super::choices::{Method, Preset, Wishes};
use super::geometry::Geometry;
use crate::bvh::{Builder, Wanted};

/// Samples of a camera ray from which two trees are tried. That takes about as long as building the first again, so it is left
/// alone where there are few rays. An H100 traces up to 1.15 times as fast for it.
const TRIES_FROM_SAMPLES: u32 = 64;

/// The tree's builder, chosen before there is a tree, or that trees are to be tried.
pub fn choose_builder(wishes: &Wishes) -> Wanted {
    let original = wishes.preset.is_some_and(Preset::is_original);
    // On Mesa's software device the rays of `bundle`, which a CPU device takes, meet as many nodes together in either tree.
    let together = wishes.on_cpu && matches!(wishes.method, None | Some(Method::Bundle));
    match wishes.builder {
        // `brute` reads the triangles alone, each once.
        _ if wishes.method == Some(Method::Brute) => Builder::Midpoint.into(),
        Some(builder) => builder.into(),
        None if original => Builder::Midpoint.into(),
        None if together || wishes.fewer_samples(TRIES_FROM_SAMPLES) => Builder::Sah.into(),
        None => Wanted::Cheaper,
    }
}

/// Why the geometry has its tree, where these were the wishes.
pub fn why_builder(wishes: &Wishes, geometry: &Geometry) -> String {
    if wishes.method == Some(Method::Brute) {
        return "brute reads no tree, so the one that is built fastest".into();
    }
    if wishes.builder.is_some() {
        return "asked for".into();
    }
    let Some(weighed) = &geometry.weighed else {
        let why = match geometry.builder {
            Builder::Midpoint => "as the original",
            _ => "the surface area heuristic: fewer boxes to visit than a split at the middle",
        };
        return why.into();
    };
    let Some(costs) = &weighed.costs else {
        return "the surface area heuristic: reinsertion found no tree worth counting".into();
    };
    let (taken, other, name) = match geometry.builder {
        Builder::Reinsert => (costs.reinsert, costs.sah, Builder::Sah),
        _ => (costs.sah, costs.reinsert, Builder::Reinsert),
    };
    format!(
        "an ambient ray visits {:.1} nodes and tests {:.1} triangles, as counted; {:.1} and {:.1} with {name}",
        taken.visits, taken.tests, other.visits, other.tests
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vk::DeviceKind;

    #[test]
    fn trees_are_tried_where_many_rays_part() {
        let many = Wishes { samples: Some(64), ..Wishes::default() };
        let ordered = Wishes { method: Some(Method::Ordered), ..Wishes::default() };
        let sah = Wanted::Builder(Builder::Sah);
        for (wishes, expected) in [
            (Wishes::default(), Wanted::Cheaper),
            (many, Wanted::Cheaper),
            (Wishes { samples: Some(63), ..many }, sah),
            (many.on(DeviceKind::Cpu), sah),
            (many.on(DeviceKind::Discrete), Wanted::Cheaper),
            (ordered.on(DeviceKind::Cpu), Wanted::Cheaper),
            (Wishes { builder: Some(Builder::Ploc), ..many }, Builder::Ploc.into()),
            (
                Wishes { method: Some(Method::Brute), builder: Some(Builder::Ploc), ..many },
                Builder::Midpoint.into(),
            ),
            (Wishes { preset: Some(Preset::Original), ..many }, Builder::Midpoint.into()),
        ] {
            assert_eq!(choose_builder(&wishes), expected, "{wishes:?}");
        }
    }
}
