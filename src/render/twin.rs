//! What the shaders' twin on the CPU needs to render a plan.

use super::choices::{Intersector, Method, Offset, Preset, Slabs};
use super::plan::Plan;
use super::specialize::sampler_code;
use crate::kernels::NodeLayout;
use crate::pack::{NodeArrays, compact_nodes};
use crate::reference::exact::{Rules, Shapes, Truth};
use crate::reference::traverse::grown::centred;
use crate::reference::{Choices, Inputs, Traversal};

/// Packed arrays of a plan for the twin.
pub struct Twin {
    tree: NodeArrays,
}

/// f64 brute force that judges answers of the plan's kernels.
pub fn truth<'a>(plan: &'a Plan<'_>) -> Truth<'a> {
    let triangles = match (plan.settings.intersector, plan.corners) {
        (Intersector::Watertight, Some(corners)) => Shapes::Corners(corners),
        (Intersector::Conservative, _) => Shapes::Conservative(&plan.geometry.triangles),
        _ => Shapes::Edges(&plan.geometry.triangles),
    };
    Truth { triangles, rules: Rules { box_pad: plan.frame.box_pad, robust_slabs: true } }
}

impl Twin {
    pub fn new(plan: &Plan<'_>) -> Self {
        let (tree, pad) = (&plan.geometry.tree, plan.node_pad());
        let mut arrays = NodeArrays::new(tree, pad, pad);
        if plan.node_layout() == NodeLayout::Compact {
            arrays.grown = compact_nodes(tree, pad).iter().map(centred).collect();
        }
        Self { tree: arrays }
    }

    pub fn inputs<'a>(&'a self, plan: &'a Plan<'_>) -> Inputs<'a> {
        Inputs {
            frame: &plan.frame,
            triangles: &plan.geometry.triangles,
            corners: plan.corners.unwrap_or(&[]),
            tree: &self.tree,
            choices: Self::choices(plan),
        }
    }

    /// What the plan's kernels are specialized for.
    pub fn choices(plan: &Plan<'_>) -> Choices {
        Choices {
            traversal: match plan.settings.method {
                Method::Brute => Traversal::Brute,
                Method::Stack(size) => Traversal::Stack { size },
                Method::Threaded => Traversal::Threaded,
                Method::SinglePush => Traversal::SinglePush,
                Method::Ordered => Traversal::Ordered,
                Method::Entry => Traversal::Entry,
                Method::Packet => Traversal::Packet,
                Method::Postponed => Traversal::Postponed,
                Method::Wide => Traversal::Wide,
                Method::Bundle => Traversal::Bundle,
            },
            original: plan.settings.preset.is_original(),
            facing: plan.settings.preset != Preset::Original,
            ulp_offset: plan.settings.offset == Offset::Ulp,
            watertight: plan.settings.intersector == Intersector::Watertight,
            conservative: plan.settings.intersector == Intersector::Conservative,
            robust_slabs: plan.settings.slabs == Slabs::Robust,
            sampler: sampler_code(plan.settings.sampler),
        }
    }
}
