//! A plan as the shaders' twin takes it.

use super::choices::{Method, Offset, Preset, Slabs};
use super::plan::{Plan, sampler_code};
use crate::pack::NodeArrays;
use crate::reference::{Choices, Inputs, Traversal};

/// Packed arrays for the twin.
pub struct Twin {
    tree: NodeArrays,
}

impl Twin {
    pub fn new(plan: &Plan<'_>) -> Self {
        Self { tree: NodeArrays::new(&plan.geometry.tree, plan.node_pad()) }
    }

    /// What the twin needs to do as the plan's kernels; `plan` is the one that it was made for, or one with the same tree.
    pub fn inputs<'a>(&'a self, plan: &'a Plan<'_>) -> Inputs<'a> {
        Inputs {
            frame: &plan.frame,
            triangles: &plan.geometry.triangles,
            corners: plan.corners.unwrap_or(&[]),
            tree: &self.tree,
            choices: Choices {
                traversal: match plan.settings.method {
                    Method::Brute => Traversal::Brute,
                    Method::Stack(size) => Traversal::Stack { size },
                    Method::Threaded => Traversal::Threaded,
                    Method::SinglePush => Traversal::SinglePush,
                    Method::Ordered => Traversal::Ordered,
                    Method::Packet => Traversal::Packet,
                    Method::Postponed => Traversal::Postponed,
                    Method::Wide => Traversal::Wide,
                },
                original: plan.settings.preset.is_original(),
                facing: plan.settings.preset != Preset::Original,
                ulp_offset: plan.settings.offset == Offset::Ulp,
                watertight: plan.corners.is_some(),
                robust_slabs: plan.settings.slabs == Slabs::Robust,
                sampler: sampler_code(plan.settings.sampler),
            },
        }
    }
}
