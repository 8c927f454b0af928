//! The solids that the scenes are put together from.

use crate::scene::Mesh;
use glam::{DVec3, dvec3};

/// Faces of a block, as a set of bits: those on the low and the high side of each local axis.
pub mod faces {
    /// The face at the least x.
    pub const X0: u8 = 1;
    /// The face at the greatest x.
    pub const X1: u8 = 2;
    /// The face at the least y.
    pub const Y0: u8 = 4;
    /// The face at the greatest y.
    pub const Y1: u8 = 8;
    /// The face at the least z.
    pub const Z0: u8 = 16;
    /// The face at the greatest z.
    pub const Z1: u8 = 32;
    /// All six faces.
    pub const ALL: u8 = 63;
}

/// A right-handed local system of coordinates: y is up, z points out of a facade, and x runs along
/// it to the right as seen from outside.
#[derive(Clone, Copy)]
pub struct Frame {
    origin: DVec3,
    x: DVec3,
    z: DVec3,
}

impl Frame {
    /// The scene's own coordinates.
    pub const WORLD: Frame = Frame { origin: DVec3::ZERO, x: DVec3::X, z: DVec3::Z };

    /// The facade at `distance` (scene units) from the vertical axis: 0 looks to +z, 1 to +x, 2 to
    /// -z and 3 to -x. Whole quarter turns keep the coordinates exact.
    pub fn facade(side: usize, distance: f64) -> Self {
        let (x, z) = match side % 4 {
            0 => (DVec3::X, DVec3::Z),
            1 => (DVec3::NEG_Z, DVec3::X),
            2 => (DVec3::NEG_X, DVec3::NEG_Z),
            _ => (DVec3::Z, DVec3::NEG_X),
        };
        Self { origin: z * distance, x, z }
    }

    /// The place in the scene of the local point (`x`, `y`, `z`), in scene units.
    pub fn at(&self, x: f64, y: f64, z: f64) -> DVec3 {
        self.origin + self.x * x + DVec3::Y * y + self.z * z
    }
}

/// A mesh under construction.
///
/// Every coordinate is rounded to a fixed number of decimals as it comes in: files stay small, and
/// the last bits of a platform's sine never reach them.
pub struct Builder {
    mesh: Mesh,
    scale: f64,
}

impl Builder {
    /// An empty mesh whose coordinates keep `decimals` decimals.
    pub fn new(decimals: i32) -> Self {
        Self { mesh: Mesh { positions: Vec::new(), triangles: Vec::new() }, scale: 10f64.powi(decimals) }
    }

    /// Keeps `decimals` decimals from now on.
    pub fn keep_decimals(&mut self, decimals: i32) {
        self.scale = 10f64.powi(decimals);
    }

    /// The finished mesh.
    pub fn finish(self) -> Mesh {
        self.mesh
    }

    /// The number of triangles so far.
    pub fn count(&self) -> u64 {
        self.mesh.triangles.len() as u64
    }

    /// Adds a vertex at `p` (scene units) and returns its index.
    pub fn vertex(&mut self, p: DVec3) -> u32 {
        let index = self.mesh.positions.len() as u32;
        // Adding zero turns a negative zero, which would be written as "-0", into a plain one.
        let rounded = (p * self.scale).round() / self.scale + DVec3::ZERO;
        self.mesh.positions.push(rounded);
        index
    }

    /// Adds a triangle of vertices that are there already.
    pub fn triangle(&mut self, corners: [u32; 3]) {
        self.mesh.triangles.push(corners);
    }

    /// Adds a quadrilateral of vertices that are there already: two triangles.
    pub fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// Adds a quadrilateral of four new vertices: two triangles.
    pub fn patch(&mut self, corners: [DVec3; 4]) {
        let corners = corners.map(|p| self.vertex(p));
        self.quad(corners);
    }

    /// Adds the faces `which` of a block with eight corners, of which bit 0 tells the side in x,
    /// bit 1 in y and bit 2 in z: two triangles a face.
    pub fn hexahedron(&mut self, corners: [DVec3; 8], which: u8) {
        const QUADS: [[usize; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let v = corners.map(|p| self.vertex(p));
        for (bit, quad) in QUADS.iter().enumerate() {
            if which & (1 << bit) != 0 {
                self.quad(quad.map(|corner| v[corner]));
            }
        }
    }

    /// Adds the faces `which` of the block between the local points `low` and `high`.
    pub fn faces_of_block(&mut self, frame: &Frame, low: [f64; 3], high: [f64; 3], which: u8) {
        let pick = |corner: usize, axis: usize| {
            if corner & (1 << axis) == 0 { low[axis] } else { high[axis] }
        };
        let corners = std::array::from_fn(|i| frame.at(pick(i, 0), pick(i, 1), pick(i, 2)));
        self.hexahedron(corners, which);
    }

    /// Adds the closed block between the local points `low` and `high`: twelve triangles.
    pub fn block(&mut self, frame: &Frame, low: [f64; 3], high: [f64; 3]) {
        self.faces_of_block(frame, low, high, faces::ALL);
    }

    /// Adds a beam of the given `width` and `height` (scene units) whose underside runs from `a`
    /// to `b`: twelve triangles. Its ends are vertical.
    pub fn beam(&mut self, a: DVec3, b: DVec3, width: f64, height: f64) {
        let along = b - a;
        let side = dvec3(-along.z, 0.0, along.x).normalize() * (width / 2.0);
        let up = DVec3::Y * height;
        let corners = [
            a - side,
            b - side,
            a - side + up,
            b - side + up,
            a + side,
            b + side,
            a + side + up,
            b + side + up,
        ];
        self.hexahedron(corners, faces::ALL);
    }

    /// Adds the convex prism over the polygon `base`, swept along `sweep`: closed, 4n - 4
    /// triangles. The base turns counter-clockwise as seen from the side that the sweep goes to.
    pub fn prism(&mut self, base: &[DVec3], sweep: DVec3) {
        let n = base.len() as u32;
        let low: Vec<u32> = base.iter().map(|&p| self.vertex(p)).collect();
        let high: Vec<u32> = base.iter().map(|&p| self.vertex(p + sweep)).collect();
        for i in 2..n as usize {
            self.triangle([low[0], low[i], low[i - 1]]);
            self.triangle([high[0], high[i - 1], high[i]]);
        }
        for i in 0..n as usize {
            let j = (i + 1) % n as usize;
            self.quad([low[i], low[j], high[j], high[i]]);
        }
    }

    /// Adds a surface of revolution about the vertical through `foot`: `profile` lists (radius,
    /// height above the foot) from the bottom up, in scene units, and ends of radius 0 become
    /// poles. Open where an end has a radius, so such an end has to lie inside another solid.
    pub fn lathe(&mut self, foot: DVec3, profile: &[(f64, f64)], segments: u32) {
        let mut below: Option<Vec<u32>> = None;
        for &(radius, height) in profile {
            let ring: Vec<u32> = if radius == 0.0 {
                vec![self.vertex(foot + DVec3::Y * height)]
            } else {
                (0..segments)
                    .map(|i| {
                        // Half a step off, so that four segments make a square along the axes.
                        let angle = (f64::from(i) + 0.5) / f64::from(segments);
                        let (sine, cosine) = (angle * std::f64::consts::TAU).sin_cos();
                        self.vertex(foot + dvec3(radius * cosine, height, -radius * sine))
                    })
                    .collect()
            };
            if let Some(low) = &below {
                self.band(low, &ring);
            }
            below = Some(ring);
        }
    }

    /// Joins two rings of a surface of revolution, either of which may be a single pole.
    fn band(&mut self, low: &[u32], high: &[u32]) {
        let n = low.len().max(high.len());
        for i in 0..n {
            let j = (i + 1) % n;
            match (low.len(), high.len()) {
                (1, _) => self.triangle([low[0], high[j], high[i]]),
                (_, 1) => self.triangle([low[i], low[j], high[0]]),
                _ => self.quad([low[i], low[j], high[j], high[i]]),
            }
        }
    }

    /// Adds a surface of `columns` times `rows` quadrilaterals whose corner (i, j) lies at
    /// `place(i, j)`; it faces the side from which i runs right and j up.
    pub fn grid(&mut self, columns: u32, rows: u32, place: impl Fn(u32, u32) -> DVec3) {
        let start = self.mesh.positions.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                self.vertex(place(i, j));
            }
        }
        let at = |i: u32, j: u32| start + j * (columns + 1) + i;
        for j in 0..rows {
            for i in 0..columns {
                self.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
}
