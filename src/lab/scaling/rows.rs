//! What a study of scaling tells.

use serde::Serialize;

use crate::error::Error;
use crate::scene::Scene;

/// What grows, or what is made of the scene that grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Study {
    /// Frames of a scene with more and more triangles.
    Triangles,
    /// Pictures with more and more samples.
    Samples,
    /// Larger and larger pictures.
    Size,
    /// Trees of the scene as it grows.
    Build,
    /// Its file.
    Load,
}

impl Study {
    pub const ALL: [Self; 5] = [Self::Triangles, Self::Samples, Self::Size, Self::Build, Self::Load];

    pub fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Samples => "samples",
            Self::Size => "size",
            Self::Build => "build",
            Self::Load => "load",
        }
    }
}

/// A measured place of a study; what it does not have is `None`.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub study: Study,
    pub scene: String,
    pub triangles: usize,
    pub log2_triangles: f64,
    pub method: Option<String>,
    pub builder: Option<&'static str>,
    pub passes: Option<&'static str>,
    pub accessor: Option<&'static str>,
    pub size: Option<[u32; 2]>,
    pub spp: Option<u32>,
    pub frames: Option<usize>,
    /// Of a frame.
    pub dispatches: Option<u64>,
    /// Of a frame, camera rays included.
    pub rays: Option<u64>,
    /// Kernel time of a frame.
    pub gpu_ms_median: Option<f64>,
    pub gpu_ms_ci95: Option<[f64; 2]>,
    /// Of the fastest frame: others at work on the machine only ever add to a time.
    pub gpu_ms_min: Option<f64>,
    /// Likewise.
    pub ms_per_ray: Option<f64>,
    /// Pixels whose counts are not those of the first method.
    pub mismatched_pixels: Option<u64>,
    /// Of the tree alone.
    pub build_ms: Option<f64>,
    /// With placing the triangles and leaving out copies.
    pub geometry_ms: Option<f64>,
    pub sah_cost: Option<f64>,
    pub load_ms: Option<f64>,
    pub file_bytes: Option<u64>,
    /// The most memory of the process while the row was measured, that of all scenes so far included.
    pub peak_host_bytes: Option<u64>,
    /// Memory of the device, this row's alone: scene, tree and what is kept for pixels.
    pub device_bytes: Option<u64>,
}

impl Row {
    pub fn new(study: Study, name: &str, scene: &Scene) -> Self {
        let triangles = scene.mesh.triangles.len();
        Self {
            study,
            scene: name.into(),
            triangles,
            log2_triangles: (triangles.max(1) as f64).log2(),
            method: None,
            builder: None,
            passes: None,
            accessor: None,
            size: None,
            spp: None,
            frames: None,
            dispatches: None,
            rays: None,
            gpu_ms_median: None,
            gpu_ms_ci95: None,
            gpu_ms_min: None,
            ms_per_ray: None,
            mismatched_pixels: None,
            build_ms: None,
            geometry_ms: None,
            sah_cost: None,
            load_ms: None,
            file_bytes: None,
            peak_host_bytes: None,
            device_bytes: None,
        }
    }

    /// What tells curves of a study apart.
    pub fn label(&self) -> &str {
        match (&self.method, self.builder) {
            (Some(method), _) => method,
            (None, Some(builder)) => builder,
            (None, None) => "OBJ file",
        }
    }
}

/// What could not be measured, and why.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    pub study: Study,
    pub scene: String,
    /// Method or builder; empty where all of them.
    pub what: String,
    pub reason: String,
}

impl LeftOut {
    pub fn new(study: Study, scene: &str, what: &str, error: &Error) -> Self {
        Self { study, scene: scene.into(), what: what.into(), reason: error.to_string() }
    }
}
