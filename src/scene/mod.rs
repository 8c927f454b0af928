//! Triangle scenes: reading them, making them, placing a camera. No GPU in here.

pub mod camera;
pub mod condition;
pub mod digits;
pub mod obj;
pub mod procedural;
pub mod rays;

use std::path::Path;
use std::time::Instant;

use glam::DVec3;

use crate::error::Result;

/// Triangles over shared vertices, in the units of their file; counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: DVec3,
    pub max: DVec3,
}

impl Bounds {
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).length()
    }
}

impl Mesh {
    /// The box of all vertices; empty meshes have an empty one.
    pub fn bounds(&self) -> Bounds {
        let empty = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
        self.positions
            .iter()
            .fold(empty, |bounds, &p| Bounds { min: bounds.min.min(p), max: bounds.max.max(p) })
    }

    /// Names the geometry: equal meshes have equal hashes on every machine.
    pub fn hash(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        for position in &self.positions {
            for value in position.to_array() {
                hasher.update(&value.to_le_bytes());
            }
        }
        for triangle in &self.triangles {
            for index in triangle {
                hasher.update(&index.to_le_bytes());
            }
        }
        hasher.digest()
    }
}

/// A scene that was read from a file.
pub struct Scene {
    /// The path as it was given.
    pub path: String,
    pub mesh: Mesh,
    pub bounds: Bounds,
    pub hash: u64,
    pub report: obj::Report,
    pub load_ms: f64,
}

impl Scene {
    pub fn load(path: &Path) -> Result<Self> {
        let start = Instant::now();
        let obj::Loaded { mesh, report } = obj::load(path)?;
        let bounds = mesh.bounds();
        let hash = mesh.hash();
        let path = path.display().to_string();
        Ok(Self { path, mesh, bounds, hash, report, load_ms: start.elapsed().as_secs_f64() * 1e3 })
    }
}
