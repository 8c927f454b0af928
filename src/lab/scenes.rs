//! Scenes of experiments.

use crate::error::{Error, Result};
use crate::render::plan::Job;
use crate::render::rounds::Goal;
use crate::scene::camera::Camera;
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

/// The first `samples` of a scene's usual view, and nothing special.
pub fn usual_job(scene: &Scene, size: (u32, u32), samples: u32, seed: u32) -> Job {
    Job {
        camera: Camera::default_for(&scene.path),
        size,
        samples: 0..samples,
        seed,
        max_distance: None,
        jitters: 1,
        adaptive: false,
        goal: Goal::Samples,
        block: None,
    }
}
