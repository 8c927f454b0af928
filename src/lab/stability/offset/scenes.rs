//! Scenes of every size at every place.

use glam::DVec3;
use rayon::prelude::*;

use super::super::Lab;
use super::ground::{Ground, Start, direction_from};
use crate::error::Result;
use crate::lab::scenes::{procedural, scene_of};
use crate::scene::camera::Camera;
use crate::scene::{Mesh, Scene};

/// A ray whose answer is known.
pub struct Known {
    /// Place in the list of starts.
    pub start: usize,
    pub direction: [f32; 3],
    pub meets: bool,
}

/// A scene as its file has it, and what its rays meet.
pub struct Subject {
    pub scene: Scene,
    pub starts: Vec<Start>,
    pub rays: Vec<Known>,
    pub size: (u32, u32),
    camera: Camera,
}

/// A mesh scaled after it was shifted along the diagonal by so many of its widths.
pub fn moved(mesh: &Mesh, scale: f64, shift: f64) -> Mesh {
    let bounds = mesh.bounds();
    let width = (bounds.max - bounds.min).max_element();
    let point = |p: &DVec3| (*p + shift * width) * scale;
    Mesh { positions: mesh.positions.iter().map(point).collect(), triangles: mesh.triangles.clone() }
}

impl Subject {
    /// The camera that looks at the scene wherever it was moved.
    pub fn camera(&self, scale: f64, shift: f64) -> Camera {
        let bounds = &self.scene.bounds;
        let width = (bounds.max - bounds.min).max_element();
        let point = |p: [f64; 3]| p.map(|x| (x + shift * width) * scale);
        match self.camera {
            Camera::Pinhole { eye, target, up, fov } => {
                Camera::Pinhole { eye: point(eye), target: point(target), up, fov }
            }
            orbit => orbit,
        }
    }

    /// A scene, and what rays from the points that its pixels see meet. `always`: what a form of the scene tells of them all.
    fn new(lab: &Lab<'_>, name: &str, mesh: Mesh, camera: Camera, always: Option<bool>) -> Self {
        let scene = scene_of(name, mesh);
        let ground = Ground::new(&scene.mesh);
        // More would take f64 longer than the device.
        let size = (lab.size.0.min(256), lab.size.1.min(160));
        let starts = ground.starts(&scene, &camera, size);
        let (each, seed) = (lab.pick(2, 4), lab.seed);
        let known = |ray: usize| {
            let start = &starts[ray / each];
            let direction = direction_from(start, seed, (ray % each) as u32);
            let meets = always.or_else(|| ground.meets(start, direction))?;
            Some(Known { start: ray / each, direction: direction.as_vec3().to_array(), meets })
        };
        let rays = (0..each * starts.len()).into_par_iter().filter_map(known).collect();
        Self { scene, starts, rays, size, camera }
    }
}

/// A rectangle of two triangles askew.
pub fn plane() -> Mesh {
    let normal = DVec3::new(0.3, 0.9, -0.2).normalize();
    let side = DVec3::new(0.7, 0.1, 0.6).cross(normal).normalize();
    let corner = |x: f64, y: f64| side * x + normal.cross(side) * y;
    Mesh {
        positions: vec![corner(-1.0, -0.7), corner(1.0, -0.7), corner(1.0, 0.7), corner(-1.0, 0.7)],
        triangles: vec![[0, 1, 2], [2, 3, 0]],
    }
}

/// A box askew, closed: neighbours share their corners.
pub fn closed_box() -> Mesh {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(0.5, 0.7, -0.3).normalize(), 0.8);
    let corner = |i: u32| {
        let sign = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        turn * DVec3::new(sign(0), 0.7 * sign(1), 0.8 * sign(2))
    };
    let sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [c, d, a]]).collect(),
    }
}

/// From within the box.
pub const INSIDE: Camera =
    Camera::Pinhole { eye: [0.1, -0.15, 0.2], target: [-0.4, 0.3, -0.5], up: [0.0, 1.0, 0.0], fov: 100.0 };

/// The scenes in their own units.
pub fn subjects(lab: &Lab<'_>) -> Result<Vec<Subject>> {
    let of = |name: &str| -> Result<Subject> {
        let mesh = procedural(name, None, 0)?.mesh;
        Ok(Subject::new(lab, name, mesh, Camera::default_for(name), None))
    };
    Ok(vec![
        Subject::new(lab, "plane", plane(), Camera::default_for("plane"), Some(false)),
        Subject::new(lab, "box", closed_box(), INSIDE, Some(true)),
        of("cornell")?,
        of("maison")?,
    ])
}
