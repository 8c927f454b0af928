//! A scene as the device gets it: placed, its tree built, packed.

use std::collections::HashSet;
use std::sync::OnceLock;
use std::time::Instant;

use crate::bvh::quad::QuadTree;
use crate::bvh::quality::Quality;
use crate::bvh::wide::WideTree;
use crate::bvh::{self, Builder, Built, Tree, Wanted, Weighed};
use crate::error::{Error, Result};
use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_64;

use crate::layout::{Corners, Triangle};
use crate::pack;
use crate::reference::surface::normal_of;
use crate::render::choices::Method;
use crate::scene::condition::{self, Placement};
use crate::scene::{Mesh, Scene};

/// Triangles up to which the edges of faces are counted.
const FEW_TRIANGLES: usize = 256;

/// Placed triangles and the tree over them.
pub struct Geometry {
    pub builder: Builder,
    /// How two trees were tried, where nobody named a builder.
    pub weighed: Option<Weighed>,
    pub placement: Placement,
    /// In the order of the tree's leaves.
    pub triangles: Vec<Triangle>,
    pub tree: Tree,
    corners: OnceLock<Vec<Corners>>,
    collapsed: pack::Collapsed,
    quality: OnceLock<Quality>,
    /// By how much robust slabs grow boxes, device units.
    pub box_pad: f32,
    /// Entries that `stackN` can need.
    pub stack_bound: u32,
    /// Time from the placed triangles to the tree, the choice of its builder included.
    pub build_ms: f64,
    /// Whether two triangles share an edge, so that rays must not pass between them.
    pub shares_edges: bool,
    /// Edges of all faces ([`pack::pairs`]), counted where there are few triangles.
    pub face_edges: Option<u32>,
    /// Triangles left out because 32-bit floats see no area in them.
    pub without_area: usize,
    /// Triangles left out because each has the corners of one that comes before it.
    pub copies: usize,
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
        builder: impl Into<Wanted>,
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
        if conditioned && !placed.par_iter().all(has_area) {
            placed.retain(has_area);
        }
        let without_area = scene.mesh.triangles.len() - placed.len();
        let copies = if conditioned { leave_out_copies(&scene.mesh, &placement, &mut placed) } else { 0 };
        if placed.is_empty() {
            return Err(Error::input(format!(
                "{} has {without_area} triangles, but 32-bit floats see no area in any of them: give it wider triangles.",
                scene.path
            )));
        }
        let start = Instant::now();
        let Built { tree, builder, weighed } = bvh::build_wanted(builder.into(), &placed, progress);
        let triangles = pack::triangles(&tree, &placed);
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let (box_pad, (stack_bound, shares_edges)) = rayon::join(
            || pack::box_pad(&placed),
            || (bvh::stack::stack_bound(&tree), shares_edges(&scene.mesh, &placement)),
        );
        let geometry = Self {
            builder,
            weighed,
            placement,
            box_pad,
            stack_bound,
            triangles,
            tree,
            corners: OnceLock::new(),
            collapsed: pack::Collapsed::default(),
            quality: OnceLock::new(),
            build_ms,
            without_area,
            shares_edges,
            face_edges: None,
            copies,
        };
        let few = geometry.triangles.len() <= FEW_TRIANGLES;
        let face_edges = few.then(|| pack::edges_of(&pack::pairs(geometry.corners(&scene.mesh))));
        Ok(Self { face_edges, ..geometry })
    }
}

impl Geometry {
    /// Time that the tree alone takes to build, ms.
    pub fn tree_ms(&self) -> f64 {
        self.build_ms - self.weighed.map_or(0.0, |weighed| weighed.beside_ms)
    }

    /// The tree collapsed to eight children a node, made when first asked for.
    pub fn wide(&self) -> &WideTree {
        self.collapsed.wide(&self.tree)
    }

    /// The same to four children a node.
    pub fn quad(&self) -> &QuadTree {
        self.collapsed.quad(&self.tree)
    }

    pub fn collapsed(&self) -> &pack::Collapsed {
        &self.collapsed
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
        match method {
            Method::Wide => self.wide().largest_leaf(),
            Method::Bundle => self.quad().largest_leaf(),
            _ => self.tree.largest_leaf(),
        }
    }

    /// Entries that a ray's stack can need with this method; 0 without a stack.
    pub fn stack_bound_of(&self, method: Method) -> u32 {
        match method {
            Method::Brute | Method::Threaded => 0,
            Method::Stack(_) => self.stack_bound,
            Method::SinglePush => bvh::stack::single_push_bound(&self.tree),
            // Of two children one is visited at once, whichever it is, and the other waits.
            Method::Ordered | Method::Entry | Method::Packet | Method::Postponed => self.tree.depth(),
            Method::Wide => self.wide().stack_bound(),
            Method::Bundle => self.quad().stack_bound(),
        }
    }
}

/// Triangles that are looked at for a shared edge; scenes without one have next to none.
const LOOKED_AT: usize = 1 << 20;

/// Whether two triangles, as they are placed, have the positions of an edge in common. Taken for granted where that would take long to find out.
fn shares_edges(mesh: &Mesh, placement: &Placement) -> bool {
    // Both zeros are one position.
    let bits = |corner: u32| {
        (placement.point(mesh.positions[corner as usize]).as_vec3() + 0.0).to_array().map(f32::to_bits)
    };
    let mut edges = HashSet::new();
    let mut is_new = |from: u32, to: u32| {
        let [from, to] = [bits(from), bits(to)];
        edges.insert(if from < to { [from, to] } else { [to, from] })
    };
    let apart = |&[a, b, c]: &[u32; 3]| is_new(a, b) && is_new(b, c) && is_new(c, a);
    mesh.triangles.len() > LOOKED_AT || !mesh.triangles.iter().all(apart)
}

/// Whether a placed triangle has a normal in the shaders' arithmetic. A ray that met one without by rounding
/// would go on with NaNs.
fn has_area(triangle: &Triangle) -> bool {
    let normal = normal_of(triangle);
    normal.is_finite() && (normal.length() - 1.0).abs() < 1e-3
}

/// Leaves out triangles whose corners are, bit for bit and in the same order, those of one before them, and tells how
/// many. No intersector gives them another hit, and of equal hits the smaller id wins, so that no picture changes; but a ray
/// that meets one would have to visit them all.
fn leave_out_copies(mesh: &Mesh, placement: &Placement, placed: &mut Vec<Triangle>) -> usize {
    let corners = |triangle: &Triangle| condition::corners_of(mesh, placement, triangle.id);
    let key = |(place, triangle): (usize, &Triangle)| {
        (xxh3_64(bytemuck::bytes_of(&corners(triangle).map(|corner| corner.map(f32::to_bits)))), place)
    };
    let mut keys: Vec<(u64, usize)> = placed.par_iter().enumerate().map(key).collect();
    keys.par_sort_unstable();
    let mut is_copy = vec![false; placed.len()];
    for same in keys.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        let first = corners(&placed[same[0].1]);
        for &(_, place) in &same[1..] {
            is_copy[place] = corners(&placed[place]) == first;
        }
    }
    let before = placed.len();
    if !is_copy.contains(&true) {
        return 0;
    }
    let mut places = is_copy.iter();
    placed.retain(|_| places.next() != Some(&true));
    before - placed.len()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::render::seeds::hash;
    use crate::scene::obj::Report;

    /// The box that the watertight intersector makes of a triangle's corners is the tree's only if both have the same edges.
    #[test]
    fn corners_have_the_edges_of_their_triangles() {
        use crate::scene::procedural::{Request, find};
        for name in ["maison", "hairball"] {
            let kind = find(name).expect("a scene of this name");
            let mesh = (kind.generate)(&Request { triangles: None, seed: 1 }).expect("the scene");
            let (bounds, hash) = (mesh.bounds(), mesh.hash());
            let report = crate::scene::obj::Report::default();
            let scene = Scene { path: name.into(), mesh, bounds, hash, report, load_ms: 0.0 };
            for builder in [Builder::Midpoint, Builder::Sbvh] {
                let geometry = Geometry::build(&scene, true, builder, &|_| {}).expect("a tree");
                let edges = geometry.corners(&scene.mesh).iter().map(crate::reference::watertight::edges_of);
                assert!(edges.eq(geometry.triangles.iter().copied()), "{name} {builder}");
            }
        }
    }

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

    /// A copy is one in place and order of its corners, and the first stays. Corners decide, not edges: those of the
    /// last triangle round to the first one's.
    #[test]
    fn copies_are_left_out_and_nothing_else() {
        let far = DVec3::new(1.0, 0.0, 0.0);
        let (near, nearer) = (DVec3::new(1e-9, 0.0, 0.0), DVec3::new(2e-9, 0.0, 0.0));
        let up = DVec3::new(-1.0, 1.0, 0.0);
        let mesh = Mesh {
            positions: vec![far, near, up, far, near, up, nearer, far + DVec3::X * 1e-12],
            triangles: vec![[0, 1, 2], [3, 4, 5], [1, 2, 0], [2, 1, 0], [0, 1, 5], [0, 6, 2], [7, 1, 2]],
        };
        let (bounds, hash, report) = (mesh.bounds(), mesh.hash(), Report::default());
        let scene = Scene { path: "copies".into(), mesh, bounds, hash, report, load_ms: 0.0 };
        let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).unwrap();
        assert_eq!((geometry.copies, geometry.without_area), (3, 0));
        let mut ids: Vec<u32> = geometry.triangles.iter().map(|triangle| triangle.id).collect();
        ids.sort_unstable();
        assert_eq!(ids, [0, 2, 3, 5]);
        let kept = geometry.triangles.iter().find(|triangle| triangle.id == 5).unwrap();
        let first = geometry.triangles.iter().find(|triangle| triangle.id == 0).unwrap();
        assert_eq!((kept.a, kept.ab, kept.ac), (first.a, first.ab, first.ac));
        let raw = Geometry::build(&scene, false, Builder::Sah, &|_| {}).unwrap();
        assert_eq!((raw.copies, raw.triangles.len()), (0, 7));
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
