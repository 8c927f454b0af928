//! How much of a picture a scene covers, told before it is rendered by a few camera rays on the host: where it decides which kernels are
//! the fastest.

use glam::{DVec3, Vec3};

use super::choices::{Covered, Preset, Wishes};
use super::geometry::Geometry;
use super::plan::Job;
use crate::bvh::walk_cost;
use crate::scene::Scene;
use crate::scene::camera::RayModel;
use crate::vk::DeviceKind;

/// Camera rays that are traced. Of a half-covered picture they tell the part to within 0.01 or so.
const RAYS: u32 = 1024;

/// Samples of a camera ray for which it decides.
pub const DECIDES_FOR: std::ops::Range<u32> = 8..16;

/// What a job tells of the rays to come, and what the scene does.
pub fn wishes_for(
    job: &Job,
    wishes: &Wishes,
    scene: &Scene,
    geometry: &Geometry,
    device: DeviceKind,
) -> Wishes {
    let wishes = job.wishes(wishes);
    let decides = device != DeviceKind::Cpu
        && wishes.passes.is_none()
        && !wishes.preset.is_some_and(Preset::is_original)
        && wishes.samples.is_some_and(|samples| DECIDES_FOR.contains(&samples));
    Wishes { covered: decides.then(|| covered(job, scene, geometry)), ..wishes }
}

/// The part of a job's camera rays that meet the scene.
fn covered(job: &Job, scene: &Scene, geometry: &Geometry) -> Covered {
    let fan = job.camera.rays(&scene.bounds, &geometry.placement, job.size, RayModel::Eye);
    let (width, height) = (f64::from(job.size.0), f64::from(job.size.1));
    let ray = |number: u32| {
        // Points of Hammersley's set.
        let x = (f64::from(number) + 0.5) / f64::from(RAYS) * width;
        let y = (f64::from(number.reverse_bits()) * 2f64.powi(-32) + 0.5 / f64::from(RAYS)) * height;
        let along = |[start, dx, dy]: [DVec3; 3]| -> Vec3 { (start + x * dx + y * dy).as_vec3() };
        (along(fan.origin), along(fan.direction))
    };
    let rays: Vec<_> = (0..RAYS).map(ray).collect();
    let part = walk_cost::part_that_meets(&geometry.tree, &geometry.triangles, &rays);
    let all = u64::from(job.size.0) * u64::from(job.size.1) * u64::from(job.jitters);
    Covered { camera_rays: (part * all as f64) as u64, percent: (part * 100.0) as u32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::render::choices::Passes;
    use crate::render::rounds::Goal;
    use crate::scene::Mesh;
    use crate::scene::camera::Camera;
    use crate::scene::obj::Report;

    /// A square of two triangles about the origin, seen from (0, 0, 10) through 90 degrees: a picture of 20 by 20 units in its plane.
    fn square(side: f64, samples: u32) -> (Scene, Geometry, Job) {
        let half = side / 2.0;
        let corner = |x: f64, y: f64| DVec3::new(x * half, y * half, 0.0);
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] };
        let scene = Scene {
            path: "square.obj".into(),
            bounds: mesh.bounds(),
            hash: 0,
            report: Report::default(),
            load_ms: 0.0,
            mesh,
        };
        let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).unwrap();
        let camera = Camera::Pinhole {
            eye: [0.0, 0.0, 10.0],
            target: [0.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            fov: 90.0,
        };
        let job = Job {
            camera,
            size: (400, 400),
            samples: 0..samples,
            seed: 0,
            max_distance: None,
            jitters: 2,
            adaptive: false,
            goal: Goal::Samples,
            block: None,
        };
        (scene, geometry, job)
    }

    #[test]
    fn a_square_covers_its_part_of_the_picture() {
        for side in [2.0, 8.0, 14.0, 19.0, 21.0] {
            let (scene, geometry, job) = square(side, 8);
            let found = covered(&job, &scene, &geometry);
            let part = f64::min(side / 20.0, 1.0).powi(2);
            assert!((found.camera_rays as f64 / 320_000.0 - part).abs() < 0.01, "{side}: {found:?}, {part}");
            assert!((f64::from(found.percent) - 100.0 * part).abs() < 2.0, "{side}: {found:?}, {part}");
        }
    }

    #[test]
    fn nothing_is_traced_where_it_does_not_decide() {
        let wishes = Wishes::default();
        let split = Wishes { passes: Some(Passes::Split), ..wishes };
        let original = Wishes { preset: Some(Preset::Original), ..wishes };
        for (samples, wishes, device, told) in [
            (8, wishes, DeviceKind::Discrete, true),
            (15, wishes, DeviceKind::Integrated, true),
            (7, wishes, DeviceKind::Discrete, false),
            (16, wishes, DeviceKind::Discrete, false),
            (8, split, DeviceKind::Discrete, false),
            (8, original, DeviceKind::Discrete, false),
            (8, wishes, DeviceKind::Cpu, false),
        ] {
            let (scene, geometry, job) = square(8.0, samples);
            let found = wishes_for(&job, &wishes, &scene, &geometry, device);
            assert_eq!(found.covered.is_some(), told, "{samples} {wishes:?} {device:?}");
            assert_eq!(found.samples, Some(samples));
        }
    }
}
