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
        if cfg!(target_endian = "little") {
            // The same bytes in two pieces: number by number takes ten times as long.
            hasher.update(bytemuck::cast_slice(&self.positions));
            hasher.update(bytemuck::cast_slice(&self.triangles));
        } else {
            let numbers = self.positions.iter().flat_map(|position| position.to_array());
            numbers.for_each(|number| hasher.update(&number.to_le_bytes()));
            self.triangles.iter().flatten().for_each(|index| hasher.update(&index.to_le_bytes()));
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
        let (bounds, hash) = rayon::join(|| mesh.bounds(), || mesh.hash());
        let path = path.display().to_string();
        Ok(Self { path, mesh, bounds, hash, report, load_ms: start.elapsed().as_secs_f64() * 1e3 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hash names geometry in files of other runs and machines.
    #[test]
    fn a_hash_is_that_of_the_numbers_little_endian() {
        let mesh = Mesh {
            positions: vec![DVec3::new(1.0, -2.5, 0.0), DVec3::Y, DVec3::Z * 1e-9],
            triangles: vec![[0, 1, 2], [2, 1, 0]],
        };
        let mut bytes = Vec::new();
        mesh.positions.iter().for_each(|p| p.to_array().iter().for_each(|n| bytes.extend(n.to_le_bytes())));
        mesh.triangles.iter().flatten().for_each(|index| bytes.extend(index.to_le_bytes()));
        assert_eq!(mesh.hash(), xxhash_rust::xxh3::xxh3_64(&bytes));
    }
}
