//! A scene as the device gets it: placed, its tree built, packed.

use std::sync::OnceLock;
use std::time::Instant;

use crate::bvh::quality::Quality;
use crate::bvh::wide::WideTree;
use crate::bvh::{self, Builder, Tree};
use crate::error::{Error, Result};
use rayon::prelude::*;

use crate::layout::{Corners, Triangle};
use crate::pack;
use crate::reference::surface::normal_of;
use crate::render::choices::Method;
use crate::scene::condition::{self, Placement};
use crate::scene::{Mesh, Scene};

/// Placed triangles and the tree over them.
pub struct Geometry {
    pub builder: Builder,
    pub placement: Placement,
    /// In the order of the tree's leaves.
    pub triangles: Vec<Triangle>,
    pub tree: Tree,
    corners: OnceLock<Vec<Corners>>,
    wide: OnceLock<WideTree>,
    quality: OnceLock<Quality>,
    /// By how much robust slabs grow boxes, device units.
    pub box_pad: f32,
    /// Entries that `stackN` can need.
    pub stack_bound: u32,
    pub build_ms: f64,
    /// Triangles left out because 32-bit floats see no area in them.
    pub without_area: usize,
}

impl Geometry {
    /// What can be said of the tree without tracing a ray.
    pub fn quality(&self) -> &Quality {
        self.quality.get_or_init(|| Quality::of(&self.tree))
    }

    /// Places the scene (`conditioned`: moved and scaled; otherwise in the file's units) and builds the
    /// tree. `progress` hears of the part of the tree that is built, from any thread.
    pub fn build(
        scene: &Scene,
        conditioned: bool,
        builder: Builder,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Self> {
        let most = pack::MOST_TRIANGLES;
        if scene.mesh.triangles.len() > most {
            return Err(Error::input(format!(
                "{} has {} triangles, more than the {most} that a tree can number: split it.",
                scene.path,
                scene.mesh.triangles.len()
            )));
        }
        if scene.mesh.triangles.is_empty() {
            return Err(Error::input(format!(
                "{} has no triangles: give a scene that has some.",
                scene.path
            )));
        }
        let placement = if conditioned { Placement::conditioned(&scene.bounds) } else { Placement::IDENTITY };
        let mut placed = condition::place(&scene.mesh, &placement);
        // The original took them as they were.
        if conditioned {
            placed.retain(has_area);
        }
        let without_area = scene.mesh.triangles.len() - placed.len();
        if placed.is_empty() {
            return Err(Error::input(format!(
                "{} has {without_area} triangles, but 32-bit floats see no area in any of them: give it wider triangles.",
                scene.path
            )));
        }
        let start = Instant::now();
        let tree = bvh::build(builder, &placed, progress);
        let triangles = pack::triangles(&tree, &placed);
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Self {
            builder,
            placement,
            box_pad: pack::box_pad(&placed),
            stack_bound: bvh::stack::stack_bound(&tree),
            triangles,
            tree,
            corners: OnceLock::new(),
            wide: OnceLock::new(),
            quality: OnceLock::new(),
            build_ms,
            without_area,
        })
    }
}

impl Geometry {
    /// The tree collapsed to eight children a node, made when first asked for.
    pub fn wide(&self) -> &WideTree {
        self.wide.get_or_init(|| WideTree::new(&self.tree))
    }

    /// The largest coordinate, device units.
    pub fn largest(&self) -> f32 {
        // Powers of two round nothing.
        self.box_pad * 2f32.powi(21)
    }

    /// The triangles by their corners, in the same order, made when first asked for: `mesh` is that of the scene.
    pub fn corners(&self, mesh: &Mesh) -> &[Corners] {
        let ids = || self.triangles.par_iter().map(|triangle| triangle.id);
        self.corners.get_or_init(|| condition::place_corners(mesh, &self.placement, ids()))
    }

    /// Most triangles in a leaf that this method meets.
    pub fn largest_leaf_of(&self, method: Method) -> u32 {
        if method == Method::Wide { self.wide().largest_leaf() } else { self.tree.largest_leaf() }
    }

    /// Entries that a ray's stack can need with this method; 0 without a stack.
    pub fn stack_bound_of(&self, method: Method) -> u32 {
        match method {
            Method::Brute | Method::Threaded => 0,
            Method::Stack(_) => self.stack_bound,
            Method::SinglePush => bvh::stack::single_push_bound(&self.tree),
            // Of two children one is visited at once, whichever it is, and the other waits.
            Method::Ordered | Method::Packet | Method::Postponed => self.tree.depth(),
            Method::Wide => self.wide().stack_bound(),
        }
    }
}

/// Whether a placed triangle has a normal in the shaders' arithmetic. A ray that met one without by rounding
/// would go on with NaNs.
fn has_area(triangle: &Triangle) -> bool {
    let normal = normal_of(triangle);
    normal.is_finite() && (normal.length() - 1.0).abs() < 1e-3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::seeds::hash;

    fn with(ab: [f32; 3], ac: [f32; 3]) -> Triangle {
        Triangle { ab, ac, ..Triangle::default() }
    }

    #[test]
    fn tiny_and_thin_triangles_have_an_area_and_lines_have_none() {
        assert!(has_area(&with([1e-30, 0.0, 0.0], [0.0, 1e-30, 0.0])));
        assert!(has_area(&with([1.0, 0.0, 0.0], [1.0, 1e-18, 0.0])));
        assert!(!has_area(&with([1.0, 2.0, 3.0], [2.0, 4.0, 6.0])));
        assert!(!has_area(&with([0.0; 3], [0.0, 1.0, 0.0])));
    }

    /// Edges that differ by their last bits: where the host sees an area, the shader must have a normal.
    #[test]
    fn nearly_collinear_triangles_have_a_normal_or_are_left_out() {
        let mut left_out = 0;
        for i in 0..20_000u32 {
            let number = |k: u32| hash(7 * i + k, 3) as f32 / u32::MAX as f32 + 0.1;
            let ab = [number(0), number(1), number(2)];
            let ac = ab.map(|edge| edge * number(3));
            let triangle = with(ab, ac);
            if has_area(&triangle) {
                let normal = normal_of(&triangle);
                assert!((normal.length() - 1.0).abs() < 1e-3, "{triangle:?}");
            } else {
                left_out += 1;
            }
        }
        assert!(left_out > 100, "{left_out}");
    }
}
