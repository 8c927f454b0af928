//! What a few rays on the host tell of a picture before it is rendered: how much of it the scene covers, and how far ambient rays walk from there. Where
//! that decides which kernels are the fastest.

use glam::{DVec3, Vec3};

use super::auto::FACES_FROM_SAMPLES;
use super::choices::{Accessor, Accumulator, Intersector, Method, Passes, Preset, Preview, Sampler, Wishes};
use super::geometry::Geometry;
use super::invocations::{LANES_FROM_SAMPLES, picture_decides};
use super::plan::Job;
use crate::bvh::walk_cost;
use crate::scene::Scene;
use crate::scene::camera::RayModel;
use crate::vk::DeviceKind;

/// Camera rays that are traced. They tell the part to within 0.01 of large shapes; of half-covered patterns that are finer than their distance they err by
/// 0.015 in the mean, as independent points do.
const RAYS: u32 = 1024;

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
        && !wishes.preset.is_some_and(Preset::is_original)
        && (decides_passes(&wishes) || decides_lanes(&wishes) || decides_faces(&wishes, geometry));
    Wishes { preview: decides.then(|| preview(job, scene, geometry)), ..wishes }
}

/// One kernel or two.
fn decides_passes(wishes: &Wishes) -> bool {
    let methods = [None, Some(Method::Entry), Some(Method::Ordered), Some(Method::Postponed)];
    wishes.passes.is_none()
        && methods.contains(&wishes.method)
        && wishes.samples.is_some()
        && picture_decides(wishes)
}

/// Several invocations may share a pixel.
fn shares_pixels(wishes: &Wishes) -> bool {
    matches!(wishes.passes, None | Some(Passes::Split))
        && matches!(wishes.accumulator, None | Some(Accumulator::Count))
        && wishes.sampler != Some(Sampler::Lcg)
}

/// How many do.
fn decides_lanes(wishes: &Wishes) -> bool {
    shares_pixels(wishes)
        && matches!(wishes.method, None | Some(Method::Entry))
        && matches!(wishes.accessor, None | Some(Accessor::Address))
        && wishes.samples.is_some_and(|samples| samples >= LANES_FROM_SAMPLES)
}

/// `brute` or a tree.
fn decides_faces(wishes: &Wishes, geometry: &Geometry) -> bool {
    shares_pixels(wishes)
        && wishes.method.is_none()
        && geometry.face_edges.is_some()
        && !wishes.bounded
        && matches!(wishes.intersector, None | Some(Intersector::Conservative))
        && wishes.accessor != Some(Accessor::TexelBuffer)
        && wishes.samples.is_some_and(|samples| samples >= FACES_FROM_SAMPLES)
}

fn preview(job: &Job, scene: &Scene, geometry: &Geometry) -> Preview {
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
    let longest = job.max_distance.map_or(f32::INFINITY, |longest| geometry.placement.length(longest) as f32);
    let seen = walk_cost::look(&geometry.tree, &geometry.triangles, &rays, longest);
    Preview {
        camera_rays: (seen.part * width * height * f64::from(job.jitters)) as u64,
        steps: seen.steps as u32,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::bvh::Builder;
    use crate::render::rounds::Goal;
    use crate::scene::Mesh;
    use crate::scene::camera::Camera;
    use crate::scene::obj::Report;

    /// The rectangle from `low` to `high` in the plane z = 0, of 10 by 10 squares, seen from (0, 0, 10) along -z: the picture shows 40 by 20 units of that
    /// plane.
    fn rectangle(low: DVec2, high: DVec2, samples: u32) -> (Scene, Geometry, Job) {
        let corner = |i: u32| low + (high - low) * DVec2::new(f64::from(i % 11), f64::from(i / 11)) / 10.0;
        let positions = (0..121).map(|i| corner(i).extend(0.0)).collect();
        let square = |k: u32| {
            // In an order that no tree has.
            let place = k * 37 % 100;
            let first = place / 10 * 11 + place % 10;
            [[first, first + 1, first + 12], [first, first + 12, first + 11]]
        };
        let mesh = Mesh { positions, triangles: (0..100).flat_map(square).collect() };
        let scene = Scene {
            path: "rectangle.obj".into(),
            bounds: mesh.bounds(),
            hash: 0,
            report: Report::default(),
            load_ms: 0.0,
            mesh,
        };
        let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).unwrap();
        let camera =
            Camera::Pinhole { eye: [0.0, 0.0, 10.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov: 90.0 };
        let job = Job {
            camera,
            size: (800, 400),
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
    fn a_rectangle_covers_its_part_of_the_picture() {
        for (low, high) in [
            ((-18.0, 1.0), (18.0, 5.0)),
            ((-3.0, -9.0), (-1.0, 9.0)),
            ((15.0, 2.0), (60.0, 60.0)),
            ((-25.0, -60.0), (-14.0, -3.0)),
            ((-30.0, -20.0), (30.0, 20.0)),
            ((21.0, -5.0), (30.0, 5.0)),
        ] {
            let (low, high) = (DVec2::from(low), DVec2::from(high));
            let (scene, geometry, job) = rectangle(low, high, 8);
            let found = preview(&job, &scene, &geometry);
            let half = DVec2::new(20.0, 10.0);
            let seen = (high.min(half) - low.max(-half)).max(DVec2::ZERO);
            let part = seen.x * seen.y / 800.0;
            assert!(
                (found.camera_rays as f64 / 640_000.0 - part).abs() < 0.01,
                "{low} {high}: {found:?}, {part}"
            );
        }
    }

    #[test]
    fn pictures_of_any_size_have_a_number_of_camera_rays() {
        let (scene, geometry, job) = rectangle(DVec2::splat(-60.0), DVec2::splat(60.0), 8);
        let job = Job { size: (u32::MAX, u32::MAX), jitters: u32::MAX, ..job };
        assert_eq!(preview(&job, &scene, &geometry).camera_rays, u64::MAX);
        let nowhere =
            Camera::Pinhole { eye: [f64::MAX; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov: 90.0 };
        let job = Job { camera: nowhere, size: (1, 1), ..job };
        assert_eq!(preview(&job, &scene, &geometry), Preview { camera_rays: 0, steps: 0 });
    }

    #[test]
    fn nothing_is_traced_where_it_does_not_decide() {
        let wishes = Wishes::default();
        let split = Wishes { passes: Some(Passes::Split), ..wishes };
        let single = Wishes { passes: Some(Passes::Single), ..wishes };
        let wide = Wishes { method: Some(Method::Wide), ..wishes };
        let ordered = Wishes { method: Some(Method::Ordered), ..wishes };
        let entry = Wishes { method: Some(Method::Entry), ..wishes };
        let entry_split = Wishes { passes: Some(Passes::Split), ..entry };
        let by_buffers = Wishes { accessor: Some(Accessor::StorageBuffer), ..wishes };
        let entry_by_buffers = Wishes { accessor: Some(Accessor::StorageBuffer), ..entry };
        let lcg = Wishes { sampler: Some(Sampler::Lcg), ..wishes };
        let split_watertight = Wishes { intersector: Some(Intersector::Watertight), ..split };
        let floats_split =
            Wishes { accumulator: Some(Accumulator::Rgba32f), passes: Some(Passes::Split), ..wishes };
        let floats = Wishes { accumulator: Some(Accumulator::Rgba32f), ..wishes };
        let original = Wishes { preset: Some(Preset::Original), ..wishes };
        for (samples, wishes, device, told) in [
            (3, wishes, DeviceKind::Discrete, false),
            (4, wishes, DeviceKind::Discrete, true),
            (31, wishes, DeviceKind::Integrated, true),
            (64, wishes, DeviceKind::Discrete, true),
            // Faces could be taken.
            (7, split, DeviceKind::Discrete, false),
            (8, split, DeviceKind::Discrete, true),
            (64, by_buffers, DeviceKind::Discrete, true),
            (8, split_watertight, DeviceKind::Discrete, false),
            (8, entry_split, DeviceKind::Discrete, false),
            (31, entry_split, DeviceKind::Discrete, false),
            (32, entry_split, DeviceKind::Discrete, true),
            (32, ordered, DeviceKind::Discrete, false),
            (31, ordered, DeviceKind::Discrete, true),
            (64, entry_by_buffers, DeviceKind::Discrete, false),
            (31, lcg, DeviceKind::Discrete, true),
            (3, lcg, DeviceKind::Discrete, false),
            (32, lcg, DeviceKind::Discrete, true),
            (3, floats, DeviceKind::Discrete, false),
            (32, floats, DeviceKind::Discrete, true),
            (32, floats_split, DeviceKind::Discrete, false),
            (31, single, DeviceKind::Discrete, false),
            (64, single, DeviceKind::Discrete, false),
            (8, wide, DeviceKind::Discrete, false),
            (64, wide, DeviceKind::Discrete, false),
            (64, original, DeviceKind::Discrete, false),
            (8, wishes, DeviceKind::Cpu, false),
            (64, wishes, DeviceKind::Cpu, false),
        ] {
            let (scene, geometry, job) = rectangle(DVec2::NEG_ONE, DVec2::ONE, samples);
            let found = wishes_for(&job, &wishes, &scene, &geometry, device);
            assert_eq!(found.preview.is_some(), told, "{samples} {wishes:?} {device:?}");
            assert_eq!(found.samples, Some(samples));
        }
    }
}
