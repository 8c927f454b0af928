//! A scene as the device gets it: placed, its tree built, packed.

use std::time::Instant;

use crate::bvh::{self, Tree};
use crate::error::{Error, Result};
use crate::layout::Triangle;
use crate::pack;
use crate::scene::Scene;
use crate::scene::condition::{self, Placement};

/// Placed triangles and the tree over them.
pub struct Geometry {
    pub placement: Placement,
    /// In the order of the tree's leaves.
    pub triangles: Vec<Triangle>,
    pub tree: Tree,
    /// By how much robust slabs grow boxes, device units.
    pub box_pad: f32,
    /// Entries that `stackN` can need.
    pub stack_bound: u32,
    pub build_ms: f64,
    /// Triangles left out because 32-bit floats see no area in them.
    pub without_area: usize,
}

impl Geometry {
    /// Places the scene (`conditioned`: moved and scaled; otherwise in the file's units) and builds the
    /// midpoint tree.
    pub fn build(scene: &Scene, conditioned: bool) -> Result<Self> {
        let most = pack::MOST_TRIANGLES;
        if scene.mesh.triangles.len() > most {
            return Err(Error::input(format!(
                "{} has {} triangles, more than the {most} that a tree can number: split it.",
                scene.path,
                scene.mesh.triangles.len()
            )));
        }
        let placement = if conditioned { Placement::conditioned(&scene.bounds) } else { Placement::IDENTITY };
        let mut placed = condition::place(&scene.mesh, &placement);
        // The original took them as they were.
        if conditioned {
            placed.retain(condition::has_area);
        }
        let without_area = scene.mesh.triangles.len() - placed.len();
        if placed.is_empty() {
            return Err(Error::input(format!(
                "{} has {without_area} triangles, but 32-bit floats see no area in any of them: give it wider triangles.",
                scene.path
            )));
        }
        let start = Instant::now();
        let tree = bvh::midpoint::build(&placed);
        let triangles = pack::triangles(&tree, &placed);
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Self {
            placement,
            box_pad: pack::box_pad(&placed),
            stack_bound: bvh::stack::stack_bound(&tree),
            triangles,
            tree,
            build_ms,
            without_area,
        })
    }
}
