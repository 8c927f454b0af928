//! Scenes of experiments.

use crate::error::{Error, Result};
use crate::scene::obj::Report;
use crate::scene::procedural::{self, Request};
use crate::scene::{Mesh, Scene};

/// A procedural scene, of its own size or of about so many triangles.
pub fn procedural(name: &str, triangles: Option<u64>, seed: u32) -> Result<Scene> {
    let kind = procedural::find(name)
        .ok_or_else(|| Error::other(format!("There is no scene {name}: report this as a bug.")))?;
    Ok(scene_of(name, (kind.generate)(&Request { triangles, seed })?))
}

/// A mesh as a scene.
pub fn scene_of(name: &str, mesh: Mesh) -> Scene {
    let (bounds, hash) = (mesh.bounds(), mesh.hash());
    Scene { path: name.into(), mesh, bounds, hash, report: Report::default(), load_ms: 0.0 }
}
