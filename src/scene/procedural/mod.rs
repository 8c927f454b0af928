//! Scenes that are computed instead of read.

mod arcade;
mod builder;
pub mod cornell;
mod hairball;
mod maison;
mod random;
mod stadium;
mod terrain;

use super::Mesh;
use crate::error::Error;
use std::io::{self, Write};
use std::ops::RangeInclusive;

/// What a procedural scene is asked for.
pub struct Request {
    /// The number of triangles wanted; the scene's own default if `None`.
    pub triangles: Option<u64>,
    /// Seed of the scenes with chance in them; the others ignore it.
    pub seed: u32,
}

/// A procedural scene.
pub struct SceneKind {
    /// The name that `find` knows it by.
    pub name: &'static str,
    /// What the scene shows, in one line.
    pub summary: &'static str,
    /// The number of triangles that it is made for.
    pub default_triangles: u64,
    /// Builds it. The count comes out within 5% of what was asked for; the terrain, a square grid,
    /// stays as close below it as a square can.
    pub generate: fn(&Request) -> Result<Mesh, Error>,
}

/// All procedural scenes.
pub const KINDS: &[SceneKind] = &[
    SceneKind {
        name: "maison",
        summary: "a creole house with a verandah all round",
        default_triangles: maison::DEFAULT_TRIANGLES,
        generate: maison::generate,
    },
    SceneKind {
        name: "arcade",
        summary: "a court between two-storey galleries of round arches",
        default_triangles: arcade::DEFAULT_TRIANGLES,
        generate: arcade::generate,
    },
    SceneKind {
        name: "terrain",
        summary: "an eroded mountain range on a regular grid",
        default_triangles: terrain::DEFAULT_TRIANGLES,
        generate: terrain::generate,
    },
    SceneKind {
        name: "hairball",
        summary: "a ball of long, thin, curly strands",
        default_triangles: hairball::DEFAULT_TRIANGLES,
        generate: hairball::generate,
    },
    SceneKind {
        name: "stadium",
        summary: "a small dense knot in the middle of a wide sparse stadium",
        default_triangles: stadium::DEFAULT_TRIANGLES,
        generate: stadium::generate,
    },
    SceneKind {
        name: "cornell",
        summary: "the Cornell box",
        default_triangles: 32,
        generate: cornell::generate,
    },
];

/// The scene called `name`.
pub fn find(name: &str) -> Option<&'static SceneKind> {
    KINDS.iter().find(|kind| kind.name == name)
}

/// Writes `mesh` as an OBJ file with the lines of `header` as comments on top. Coordinates are
/// written with the fewest digits that read back as the same numbers.
pub fn write_obj(mesh: &Mesh, header: &str, out: &mut dyn Write) -> io::Result<()> {
    let mut out = io::BufWriter::with_capacity(1 << 16, out);
    for line in header.lines() {
        writeln!(out, "# {line}")?;
    }
    for p in &mesh.positions {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in &mesh.triangles {
        // OBJ counts vertices from one.
        writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    out.flush()
}

/// The number of triangles to aim at: the request's, if the scene called `name` can have so many.
fn wanted(request: &Request, default: u64, name: &str, range: RangeInclusive<u64>) -> Result<u64, Error> {
    let triangles = request.triangles.unwrap_or(default);
    if range.contains(&triangles) {
        Ok(triangles)
    } else {
        Err(Error::usage(format!(
            "the scene {name} can have {} to {} triangles, not {triangles}",
            range.start(),
            range.end()
        )))
    }
}

#[cfg(test)]
mod tests;
