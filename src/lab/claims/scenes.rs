//! Scenes and plans of the experiments.

use super::Lab;
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::scenes::{scene_of, usual_job};
use crate::layout::{self, FRAME_SAMPLES};
use crate::render::auto;
use crate::render::choices::{Method, Passes, Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::render::plan::{Job, Plan};
use crate::scene::{Mesh, Scene};

/// The scene with another number of triangles: the largest of them, or the largest halved at their longest edge until
/// there are enough. Its picture changes only where triangles are left out.
pub fn with_triangles(scene: &Scene, count: usize) -> Scene {
    let mut mesh = scene.mesh.clone();
    let area = |mesh: &Mesh, triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
        (b - a).cross(c - a).length()
    };
    let order = |mesh: &mut Mesh| {
        let mut triangles = std::mem::take(&mut mesh.triangles);
        triangles.sort_by(|a, b| area(mesh, b).total_cmp(&area(mesh, a)));
        mesh.triangles = triangles;
    };
    order(&mut mesh);
    mesh.triangles.truncate(count);
    while mesh.triangles.len() < count && !mesh.triangles.is_empty() {
        let missing = (count - mesh.triangles.len()).min(mesh.triangles.len());
        for place in 0..missing {
            let triangle = mesh.triangles[place];
            let edge = |k: usize| {
                let ends = [triangle[k], triangle[(k + 1) % 3]].map(|corner| mesh.positions[corner as usize]);
                (ends[1] - ends[0]).length()
            };
            let longest = (0..3).max_by(|&a, &b| edge(a).total_cmp(&edge(b))).unwrap_or(0);
            let [a, b, c] = [0, 1, 2].map(|k| triangle[(longest + k) % 3]);
            let middle = (mesh.positions[a as usize] + mesh.positions[b as usize]) * 0.5;
            mesh.positions.push(middle);
            let m = (mesh.positions.len() - 1) as u32;
            mesh.triangles[place] = [a, m, c];
            mesh.triangles.push([m, b, c]);
        }
        order(&mut mesh);
    }
    scene_of(&scene.path, mesh)
}

impl Lab<'_> {
    /// The scene in the way of this preset, with this tree.
    pub(super) fn geometry(&self, scene: &Scene, preset: Preset, builder: Builder) -> Result<Geometry> {
        Geometry::build(scene, !preset.is_original(), builder, &|_| {})
    }

    /// A frame of four rays from the scene's usual view.
    pub(super) fn job(&self, scene: &Scene, size: (u32, u32)) -> Job {
        usual_job(scene, size, FRAME_SAMPLES, self.seed)
    }

    pub(super) fn plan_job<'g>(
        &self,
        job: Job,
        scene: &Scene,
        geometry: &'g Geometry,
        wishes: &Wishes,
    ) -> Result<Plan<'g>> {
        let decision = auto::decide(wishes, geometry, self.device.adapter());
        let plan = Plan::new(job, scene, geometry, &decision, &self.device.adapter().limits)?;
        // Every frame has all its camera rays.
        Ok(plan.with_constant(layout::SPEC_MARKS_MISSES, 0))
    }

    /// A frame of four rays with these choices.
    pub(super) fn plan<'g>(
        &self,
        scene: &Scene,
        geometry: &'g Geometry,
        wishes: &Wishes,
    ) -> Result<Plan<'g>> {
        self.plan_job(self.job(scene, self.size), scene, geometry, wishes)
    }
}

/// The preset with this method.
pub fn method(preset: Preset, method: Method) -> Wishes {
    Wishes {
        preset: Some(preset),
        method: Some(method),
        // What `auto` would choose by method and device would be compared as well.
        passes: Some(Passes::Single),
        ..Wishes::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scenes::procedural;

    #[test]
    fn triangles_are_left_out_or_halved() {
        let cornell = procedural("cornell", None, 0).unwrap();
        let area = |scene: &Scene| -> f64 {
            let corner = |i: u32| scene.mesh.positions[i as usize];
            let twice =
                |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length();
            scene.mesh.triangles.iter().map(twice).sum::<f64>() * 0.5
        };
        for count in [8, 16, 32, 64, 100, 128] {
            let scene = with_triangles(&cornell, count);
            assert_eq!(scene.mesh.triangles.len(), count);
            let (part, whole) = (area(&scene), area(&cornell));
            assert!(if count < 32 { part < whole } else { (part - whole).abs() < 1e-9 * whole });
        }
    }
}
