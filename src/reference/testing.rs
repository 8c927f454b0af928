//! Scenes and rays for the tests of this module: seeded, the same on every machine.

use glam::Vec3;

use super::{Choices, Inputs, Traversal};
use crate::bvh::stack::stack_bound;
use crate::bvh::{Tree, midpoint};
use crate::layout::{Corners, Frame, SAMPLER_PCG, Triangle};
use crate::pack::{self, NodeArrays};
use crate::reference::ray::Ray;
use crate::reference::watertight::edges_of;
use crate::scene::condition::{Placement, place};
use crate::scene::procedural::{Request, find};

/// SplitMix64 of Steele, Lea and Flood (2014): shares nothing with the generators under test.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 32) as u32
    }

    /// In 0..n.
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(n)) >> 32) as u32
    }

    /// In [0, 1), multiples of 2^-24.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 * 2f32.powi(-24)
    }

    /// In [-1, 1).
    pub fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Of unit length within rounding, evenly spread.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let point = self.point().as_dvec3();
            if (0.01..1.0).contains(&point.length_squared()) {
                return point.normalize().as_vec3();
            }
        }
    }

    pub fn axis(&mut self) -> Vec3 {
        let axis = [Vec3::X, Vec3::Y, Vec3::Z][self.below(3) as usize];
        if self.below(2) == 0 { axis } else { -axis }
    }
}

/// What a scene is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Triangles of all sizes anywhere.
    Soup,
    /// Tiny ones, a thousand times their size from the origin.
    FarOff,
    /// Axis-aligned quads on a coarse grid: flat boxes, shared edges, coplanar overlaps.
    Quads,
    /// A thousand times as long as wide.
    Slivers,
    /// Many a thousand times as long as wide, overlapping in a few axis-aligned planes: there the error of t
    /// exceeds the depth of the boxes.
    FlatSlivers,
    /// Each triangle several times, under different ids.
    Duplicates,
}

pub const KINDS: [Kind; 6] =
    [Kind::Soup, Kind::FarOff, Kind::Quads, Kind::Slivers, Kind::FlatSlivers, Kind::Duplicates];

pub fn triangle(id: u32, a: Vec3, ab: Vec3, ac: Vec3) -> Triangle {
    Triangle::new(a.to_array(), id, ab.to_array(), ac.to_array())
}

pub fn soup(seed: u64, count: usize, size: f32) -> Vec<Triangle> {
    let mut random = Random::new(seed);
    (0..count as u32)
        .map(|id| {
            let size = size * random.unit().max(0.01);
            triangle(id, random.point(), random.point() * size, random.point() * size)
        })
        .collect()
}

pub fn triangles_of(kind: Kind, seed: u64, count: usize) -> Vec<Triangle> {
    let mut random = Random::new(seed);
    match kind {
        Kind::Soup => soup(seed, count, 1.0),
        Kind::FarOff => {
            let place = Vec3::new(10.0, -7.0, 3.0);
            let far = |t: Triangle| {
                triangle(
                    t.id,
                    place + Vec3::from(t.a) * 0.1,
                    Vec3::from(t.ab) * 0.01,
                    Vec3::from(t.ac) * 0.01,
                )
            };
            soup(seed, count, 1.0).into_iter().map(far).collect()
        }
        Kind::Quads => (0..count as u32)
            .map(|id| {
                let x = random.below(3);
                let sides = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::X];
                let (u, v) = (sides[x as usize] * 0.25, sides[x as usize + 1] * 0.25);
                let a = (random.point() * 4.0).round() * 0.25;
                if id % 2 == 0 { triangle(id, a, u, u + v) } else { triangle(id, a, u + v, v) }
            })
            .collect(),
        Kind::Slivers => (0..count as u32)
            .map(|id| {
                let along = random.direction();
                let ac = along * random.unit() + random.point() * 1e-3;
                triangle(id, random.point(), along, ac)
            })
            .collect(),
        Kind::FlatSlivers => (0..count as u32)
            .map(|id| {
                // Side by side along one line askew, so that a ray meets several; some are wide.
                let width = if random.below(3) == 0 { 1.0 } else { 1e-3 };
                let line = Vec3::new(0.8, 0.0, 0.6);
                let mut across = || Vec3::new(-0.6, 0.0, 0.8) * (random.signed() * width);
                let [near, far, aside] = [across(), across(), across()];
                let height = Vec3::Y * ((random.signed() * 2.0).round() * 0.25);
                let along = line * (random.unit() + 0.1) + far;
                let a = line * random.signed() + near + height;
                triangle(id, a, along, along * random.unit() + aside)
            })
            .collect(),
        Kind::Duplicates => {
            let few = soup(seed, count.div_ceil(4), 1.0);
            // Ids against the order of the array, so that it cannot decide ties.
            (0..count).map(|i| Triangle { id: (count - 1 - i) as u32, ..few[i % few.len()] }).collect()
        }
    }
}

/// A ray to a point in, at the rim of, or near a triangle; one in four along an axis.
pub fn aimed_ray(random: &mut Random, target: &Triangle) -> Ray {
    let (a, ab, ac) = (Vec3::from(target.a), Vec3::from(target.ab), Vec3::from(target.ac));
    let (u, v) = match random.below(8) {
        0 => (0.0, random.unit()),
        1 => (random.unit(), 0.0),
        2 => [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5)][random.below(4) as usize],
        3 => (random.signed() * 2.0, random.signed() * 2.0),
        _ => {
            let (u, v) = (random.unit(), random.unit());
            if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) }
        }
    };
    let point = a + u * ab + v * ac;
    let (origin, direction) = if random.below(4) == 0 {
        let axis = random.axis();
        (point - axis * (random.unit() * 4.0), axis)
    } else {
        let origin = random.point() * if random.below(4) == 0 { 8.0 } else { 1.5 };
        (origin, point - origin)
    };
    let t_max = match random.below(8) {
        0 => 1.0,
        1 => random.unit() * 2.0,
        _ => f32::MAX,
    };
    Ray { origin, direction, t_max }
}

/// A ray at a point of an edge, a corner or the inside, nearly in the triangle's plane, from near to ten times the
/// scene's size.
pub fn grazing_ray(random: &mut Random, target: &Triangle) -> Ray {
    let [a, ab, ac] = [target.a, target.ab, target.ac].map(Vec3::from);
    let (u, v) =
        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.3, 0.3), (0.2, 0.8)][random.below(6) as usize];
    let point = a + u * ab + v * ac;
    let in_plane = match random.below(4) {
        0 => ab,
        1 => ac,
        2 => ac - ab,
        _ => ab * random.signed() + ac * random.signed(),
    };
    let tilt = 2f32.powi(-(random.below(26) as i32));
    let direction = in_plane.normalize_or(Vec3::X) + ab.cross(ac).normalize_or(Vec3::Y) * tilt;
    let distance = [0.5, 2.0, 8.0, 20.0][random.below(4) as usize] * random.unit();
    Ray { origin: point - direction * distance, direction, t_max: f32::MAX }
}

/// A procedural scene, placed as a render places it.
pub fn procedural(name: &str, triangles: Option<u64>) -> Vec<Triangle> {
    let mesh = (find(name).unwrap().generate)(&Request { triangles, seed: 1 }).unwrap();
    place(&mesh, &Placement::conditioned(&mesh.bounds()))
}

/// A triangle's corners as they round.
pub fn corners_of(triangle: &Triangle) -> Corners {
    let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::from);
    let (b, c) = ((a + ab).to_array(), (a + ac).to_array());
    Corners { a: triangle.a, id: triangle.id, b, c, ..Corners::default() }
}

/// Triangles by their corners, and by the edges between those, as a render places them.
pub fn by_corners(triangles: &[Triangle]) -> (Vec<Corners>, Vec<Triangle>) {
    let corners: Vec<_> = triangles.iter().map(corners_of).collect();
    let triangles = corners.iter().map(edges_of).collect();
    (corners, triangles)
}

/// The largest coordinate of an origin of [`aimed_ray`] and [`grazing_ray`] for the scenes here.
pub const REACH: f64 = 40.0;

/// Triangles packed for every traversal, and a frame without a camera.
pub struct Scene {
    pub frame: Frame,
    pub triangles: Vec<Triangle>,
    /// The same by their corners, where the intersector is watertight.
    pub corners: Vec<Corners>,
    pub tree: NodeArrays,
    /// Entries that a stack needs.
    pub stack_bound: u32,
}

impl Scene {
    pub fn of(triangles: Vec<Triangle>) -> Self {
        Self::with(&midpoint::build(&triangles), &triangles)
    }

    /// The same for the watertight intersector.
    pub fn watertight(triangles: &[Triangle]) -> Self {
        let (corners, triangles) = by_corners(triangles);
        Self::watertight_with(&midpoint::build(&triangles), &corners, &triangles)
    }

    /// A tree over [`by_corners`], for the watertight intersector.
    pub fn watertight_with(tree: &Tree, corners: &[Corners], triangles: &[Triangle]) -> Self {
        let pad = pack::watertight_pad(pack::box_pad(triangles) * 2f32.powi(21), REACH);
        let corners = tree.order.iter().map(|&place| corners[place as usize]).collect();
        Self { corners, ..Self::padded(tree, triangles, pad) }
    }

    /// A tree over these triangles.
    pub fn with(tree: &Tree, triangles: &[Triangle]) -> Self {
        Self::padded(tree, triangles, pack::box_pad(triangles))
    }

    fn padded(tree: &Tree, triangles: &[Triangle], box_pad: f32) -> Self {
        let frame = Frame {
            node_count: tree.nodes.len() as u32,
            triangle_count: tree.order.len() as u32,
            box_pad,
            largest: pack::box_pad(triangles) * 2f32.powi(21),
            ambient_t_max: f32::MAX,
            camera_t_max: f32::MAX,
            seed: 1,
            pixel_shift: 0.5,
            ..Frame::default()
        };
        Self {
            frame,
            triangles: pack::triangles(tree, triangles),
            corners: Vec::new(),
            tree: NodeArrays::new(
                tree,
                box_pad,
                pack::grown_pad(box_pad, pack::box_pad(triangles) * 2f32.powi(21), REACH),
            ),
            stack_bound: stack_bound(tree),
        }
    }

    /// Looks from `eye` along `forward` at a picture of `width` x `height` pixels, a right angle wide.
    pub fn look(mut self, eye: Vec3, forward: Vec3, up: Vec3, size: [u32; 2]) -> Self {
        let right = forward.cross(up);
        let step = 2.0 / size[0] as f32;
        self.frame.origin = eye.to_array();
        self.frame.width = size[0];
        self.frame.height = size[1];
        self.frame.direction = (forward - right + up * (step * 0.5 * size[1] as f32)).to_array();
        self.frame.direction_dx = (right * step).to_array();
        self.frame.direction_dy = (-up * step).to_array();
        self
    }

    pub fn choices(&self, original: bool) -> Choices {
        let traversal = Traversal::Threaded;
        Choices {
            traversal,
            original,
            watertight: !self.corners.is_empty(),
            conservative: false,
            robust_slabs: !original,
            sampler: SAMPLER_PCG,
            facing: !original,
            ulp_offset: false,
        }
    }

    pub fn inputs(&self) -> Inputs<'_> {
        Inputs {
            frame: &self.frame,
            triangles: &self.triangles,
            corners: &self.corners,
            tree: &self.tree,
            choices: self.choices(false),
        }
    }

    /// The same with another traversal.
    pub fn by(&self, traversal: Traversal) -> Inputs<'_> {
        let inputs = self.inputs();
        Inputs { choices: Choices { traversal, ..inputs.choices }, ..inputs }
    }
}
