//! Bounded ambient occlusion (`--max-distance`) against its closed form.

mod common;

use common::{every_traversal, geometry, job, plan_decided, run, scene_of, with_device};
use cousu::layout::Count;
use cousu::render::choices::{Intersector, Offset, Passes, Preset, Wishes};
use cousu::render::picture::Accumulated;
use cousu::render::plan::Job;
use cousu::scene::camera::Camera;

/// A floor and, `HEIGHT` above it, a ceiling, both far wider than the bound.
const HEIGHT: f64 = 1.0;

fn counts(accumulated: Accumulated) -> Vec<Count> {
    match accumulated {
        Accumulated::Counts(counts) => counts,
        Accumulated::Means(_) => panic!("counts were asked for"),
    }
}

/// A ray at an angle with cosine c meets the ceiling at height / c. With density c / pi, c^2 is uniform in
/// [0, 1], so the share of rays that find nothing within D is (height / D)^2, and all do where D is below the height.
#[test]
fn a_ceiling_within_reach_occludes_by_its_closed_form() {
    let scene = scene_of(&format!(
        "v -40 0 -40\nv 40 0 -40\nv 40 0 40\nv -40 0 40\nf 4 3 2 1\n\
         v -40 {HEIGHT} -40\nv 40 {HEIGHT} -40\nv 40 {HEIGHT} 40\nv -40 {HEIGHT} 40\nf 5 6 7 8\n"
    ));
    let geometry = geometry(&scene, Preset::Auto);
    let camera = Camera::Pinhole { eye: [0.0, 0.9, 0.0], target: [0.0; 3], up: [0.0, 0.0, 1.0], fov: 60.0 };
    let offset = 1e-4 * scene.bounds.diagonal();
    with_device(|device| {
        for distance in [0.9 * (HEIGHT - offset), 1.25, 2.0, 8.0] {
            let expected = ((HEIGHT - offset) / distance).powi(2).min(1.0);
            let mut first: Option<Vec<Count>> = None;
            // Rays that pass no edge see the same with all intersectors.
            for (passes, intersector) in [
                (Passes::Single, Intersector::Moller),
                (Passes::Split, Intersector::Moller),
                (Passes::Staged, Intersector::Moller),
                (Passes::Split, Intersector::Watertight),
                (Passes::Split, Intersector::Conservative),
            ] {
                if intersector != Intersector::Moller && distance != 2.0 {
                    continue;
                }
                let wishes = Wishes {
                    passes: Some(passes),
                    offset: Some(Offset::Scaled),
                    intersector: Some(intersector),
                    ..Wishes::default()
                };
                for decision in every_traversal(wishes, &geometry, device) {
                    let job = Job { camera, max_distance: Some(distance), ..job(&scene, (32, 20), 0..64) };
                    let plan = plan_decided(device, &scene, &geometry, job, &decision);
                    let found = counts(run(device, &plan).accumulated);
                    match &first {
                        None => first = Some(found),
                        Some(first) => assert!(*first == found, "{:?} differs", decision.settings),
                    }
                }
            }
            let found = first.expect("a picture");
            let sum = |of: fn(&Count) -> u32| found.iter().map(|count| f64::from(of(count))).sum::<f64>();
            let (escaped, traced) = (sum(|c| c.escaped0 + c.escaped1), sum(|c| c.traced0 + c.traced1));
            assert_eq!(traced, 32.0 * 20.0 * 64.0);
            let standard_error = (expected * (1.0 - expected) / traced).sqrt();
            let mean = escaped / traced;
            assert!(
                (mean - expected).abs() <= 4.0 * standard_error,
                "{distance}: {mean}, exactly {expected}"
            );
        }
    });
}
