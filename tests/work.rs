//! What the counting kernels count.

mod common;

use common::{every_traversal, geometry, job, plan, plan_decided, run, scene_named, with_device};
use cousu::layout::Work;
use cousu::render::auto::Decision;
use cousu::render::choices::{Accessor, Accumulator, Method, Passes, Preset, Wishes};
use cousu::render::work::{RayWork, WorkCount, count_work};

/// The counts of every method that reads by this accessor.
fn count_all(
    device: &cousu::vk::Device,
    scene: &cousu::scene::Scene,
    accessor: Accessor,
) -> Vec<(Method, WorkCount)> {
    let geometry = geometry(scene, Preset::Auto);
    let decisions = every_traversal(Wishes::default(), &geometry, device);
    let with = |decision: &Decision| {
        let plan = plan_decided(device, scene, &geometry, job(scene, (72, 45), 0..8), decision);
        let work = count_work(device, &plan).unwrap().expect("a device with subgroup operations");
        assert_eq!(work.repeats, 0, "{}", plan.kernel().name);
        (decision.settings.method, work)
    };
    decisions.iter().filter(|decision| decision.accessor == accessor).map(with).collect()
}

fn of_method<'a>(all: &'a [(Method, WorkCount)], family: &str) -> &'a WorkCount {
    &all.iter().find(|(method, _)| method.family() == family).expect("the method").1
}

fn visits_and_tests(work: &WorkCount) -> Vec<[u32; 4]> {
    let of = |pixel: &Work| [pixel.closest_visits, pixel.closest_tests, pixel.any_visits, pixel.any_tests];
    work.pixels.iter().map(of).collect()
}

/// Methods that visit the same nodes in the same order, whatever they keep on their stacks, do the same work for each
/// pixel, and so do both accessors.
#[test]
fn equal_walks_do_equal_work() {
    with_device(|device| {
        for (name, triangles) in common::SCENES {
            let scene = scene_named(name, triangles);
            let by_accessor = [Accessor::StorageBuffer, Accessor::TexelBuffer]
                .map(|accessor| count_all(device, &scene, accessor));
            let all = &by_accessor[0];
            let stack = visits_and_tests(of_method(all, "stack"));
            for other in ["threaded", "single-push"] {
                assert!(visits_and_tests(of_method(all, other)) == stack, "{name}: {other}");
            }
            // An any hit takes the left child first, whoever walks beside it; a leaf that waits may be found to
            // occlude late, but no other one is tested before it.
            let any = |family, work: fn(&Work) -> u32| -> Vec<u32> {
                of_method(all, family).pixels.iter().map(work).collect()
            };
            assert!(any("packet", |p| p.any_visits) == any("ordered", |p| p.any_visits), "{name}");
            assert!(any("packet", |p| p.any_tests) == any("ordered", |p| p.any_tests), "{name}");
            // The boxes of `postponed` are grown a little more, so that now and then a leaf more is met.
            let (late, early) = (of_method(all, "postponed").any, of_method(all, "ordered").any);
            assert!(late.visits >= early.visits, "{name}");
            assert!((early.tests..=1.001 * early.tests).contains(&late.tests), "{name}");
            for ((method, by_buffer), (_, by_texel)) in by_accessor[0].iter().zip(&by_accessor[1]) {
                assert!(visits_and_tests(by_buffer) == visits_and_tests(by_texel), "{name}: {method}");
            }
        }
    });
}

#[test]
fn work_is_what_the_methods_must_and_need_not_do() {
    with_device(|device| {
        let scene = scene_named("maison", Some(1000));
        let triangles = geometry(&scene, Preset::Auto).triangles.len() as f64;
        let all = count_all(device, &scene, Accessor::StorageBuffer);
        let brute = of_method(&all, "brute");
        assert_eq!((brute.closest.tests, brute.closest.visits), (triangles, 0.0));
        assert!(brute.any.tests < triangles && brute.any.tests > 1.0);
        for (method, work) in &all {
            for RayWork { visits, tests, lanes } in [work.closest, work.any] {
                assert!(lanes > 0.0 && lanes <= 1.0, "{method}: {lanes}");
                assert!(*method == Method::Brute || (visits >= 1.0 && tests < triangles / 10.0), "{method}");
            }
            let group = work.pixels.iter().map(|pixel| pixel.subgroup_size).max();
            assert_eq!(group, Some(device.adapter().subgroup.size), "{method}");
        }
        // A near child first, and leaves whose boxes are tested: less work than the order of the array.
        let (ordered, stack) = (of_method(&all, "ordered"), of_method(&all, "stack"));
        assert!(ordered.closest.tests < stack.closest.tests);
        assert!(ordered.closest.visits < stack.closest.visits);
    });
}

/// The rays are the plan's, whatever its way of adding up and its passes.
#[test]
fn counting_follows_the_plan_s_rays() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let with = |accumulator, passes| {
            let wishes = Wishes { accumulator: Some(accumulator), passes: Some(passes), ..Wishes::default() };
            plan(device, &scene, &geometry, job(&scene, (40, 25), 0..4), wishes)
        };
        let counted = with(Accumulator::Count, Passes::Single);
        let outcome = run(device, &counted);
        let work = count_work(device, &counted).unwrap().unwrap();
        let tests: u64 = work.pixels.iter().map(|pixel| u64::from(pixel.any_tests)).sum();
        assert_eq!((tests as f64 / outcome.ambient_rays as f64).to_bits(), work.any.tests.to_bits());
        let other = count_work(device, &with(Accumulator::Rgba32f, Passes::Staged)).unwrap().unwrap();
        assert!(work == other, "another plan's rays");
    });
}
