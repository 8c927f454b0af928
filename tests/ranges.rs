//! Work cut into ranges: nothing is lost and nothing done twice, however it is cut.

mod common;

use common::{geometry, job, pinhole, plan, run, scene_named, scene_of, with_device};
use cousu::bvh::Builder;
use cousu::layout::Count;
use cousu::render::choices::{Accessor, Accumulator, Method, Passes, Preset, Sampler, Wishes};
use cousu::render::execute;
use cousu::render::geometry::Geometry;
use cousu::render::picture::Accumulated;
use cousu::render::plan::Job;
use cousu::render::seeds::hash;

fn counts(accumulated: &Accumulated) -> &[Count] {
    match accumulated {
        Accumulated::Counts(counts) => counts,
        Accumulated::Means(_) => panic!("counts were asked for"),
    }
}

fn traced(count: &Count) -> u32 {
    count.traced0 + count.traced1
}

/// 4,096 samples in one render, and in eight of 512: the same counts. A driver that leaves loops early
/// would show here: every pixel that hit must have traced all its rays.
#[test]
fn thousands_of_samples_in_one_command_or_in_many() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = geometry(&scene, Preset::Auto);
        let render = |samples: std::ops::Range<u32>| {
            run(device, &plan(device, &scene, &geometry, job(&scene, (48, 30), samples), Wishes::default()))
        };
        let once = render(0..4096);
        let whole = counts(&once.accumulated);
        assert!(whole.iter().all(|count| traced(count) == 0 || traced(count) == 4096));
        let mut sum = vec![Count::default(); whole.len()];
        for piece in 0..8 {
            let part = render(piece * 512..(piece + 1) * 512);
            for (sum, part) in sum.iter_mut().zip(counts(&part.accumulated)) {
                sum.escaped0 += part.escaped0;
                sum.traced0 += part.traced0;
                sum.escaped1 += part.escaped1;
                sum.traced1 += part.traced1;
            }
        }
        assert!(whole == sum);
    });
}

/// Dispatches with more work than the driver's loop limit allows: the kernels notice, and the pixels are
/// taken up again until no ray is missing.
#[test]
fn a_driver_that_leaves_loops_early_loses_no_ray() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = geometry(&scene, Preset::Auto);
        for (method, accessor) in [
            (Method::Brute, None),
            (Method::Stack(geometry.stack_bound), None),
            (Method::Threaded, None),
            (Method::SinglePush, None),
            (Method::Ordered, None),
            (Method::Entry, None),
            // Lanes take over each other's work.
            (Method::Entry, Some(Accessor::Address)),
            (Method::Packet, None),
            (Method::Postponed, None),
            (Method::Bundle, None),
        ] {
            // With kept hits an invocation of it takes too few samples to come near the limit.
            let passes = if method == Method::Bundle { Some(Passes::Single) } else { None };
            let wishes = Wishes { method: Some(method), passes, accessor, ..Wishes::default() };
            let samples = match method {
                Method::Brute => 64,
                // Four of them go together.
                Method::Bundle => 16384,
                _ => 2048,
            };
            // Bounded rays meet many triangles that lie too far.
            for max_distance in [None, Some(1.0)] {
                let render = |block| {
                    let job = Job { block, max_distance, ..job(&scene, (16, 10), 0..samples) };
                    run(device, &plan(device, &scene, &geometry, job, wishes))
                };
                let (cut, whole) = (render(None), render(Some(samples)));
                assert!(cut.accumulated == whole.accumulated, "{method} {max_distance:?}");
                assert_eq!(cut.ambient_rays, whole.ambient_rays, "{method} {max_distance:?}");
                assert_eq!(cut.repeats, 0, "{method} {max_distance:?}");
                if device.adapter().limits.loop_iterations.is_some() && max_distance.is_none() {
                    assert!(whole.repeats > 0, "{method}: this much work should meet the limit");
                }
            }
        }
    });
}

/// The same where each ray's weight or numbers follow from those before.
#[test]
fn states_that_step_survive_the_limit_of_loops() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        for (preset, sampler) in [(Preset::Original, None), (Preset::Auto, Some(Sampler::Lcg))] {
            let geometry = geometry(&scene, preset);
            let render = |accessor, block| {
                let wishes = Wishes {
                    preset: Some(preset),
                    sampler,
                    method: Some(Method::Entry),
                    passes: Some(Passes::Split),
                    accessor: Some(accessor),
                    accumulator: Some(Accumulator::Count),
                    ..Wishes::default()
                };
                let job = Job { block, ..job(&scene, (16, 10), 0..2048) };
                run(device, &plan(device, &scene, &geometry, job, wishes))
            };
            let cut = render(Accessor::StorageBuffer, None);
            let whole = render(Accessor::Address, Some(2048));
            assert!(cut.accumulated == whole.accumulated, "{preset} {sampler:?}");
            assert_eq!(cut.ambient_rays, whole.ambient_rays, "{preset} {sampler:?}");
            if device.adapter().limits.loop_iterations.is_some() {
                assert!(whole.repeats > 0, "{preset}: this much work should meet the limit");
            }
        }
    });
}

/// Thin triangles behind one another, in whose boxes a camera ray lies all the way to a wall that they leave uncovered.
fn stacked(triangles: u32) -> String {
    let mut text = String::from("v -2 -2 -1\nv 2 -2 -1\nv 0 4 -1\nf 1 2 3\n");
    for place in 1..=triangles {
        let z = f64::from(place) / f64::from(triangles);
        text += &format!("v -1 -1 {z:.9}\nv 1 1 {z:.9}\nv 1 0.9999 {z:.9}\nf -3 -2 -1\n");
    }
    text
}

/// One camera ray near the driver's loop limit, where none can be cut: its hit is found, or the render says that it is too long.
#[test]
fn a_camera_ray_too_long_for_the_driver_is_told_of() {
    with_device(|device| {
        let limited = device.adapter().limits.loop_iterations.is_some();
        for method in [Method::Ordered, Method::Entry] {
            let finds = |triangles: u32| {
                let scene = scene_of(&stacked(triangles));
                let geometry = Geometry::build(&scene, true, Builder::Midpoint, &|_| {}).expect("a tree");
                let wishes =
                    Wishes { method: Some(method), passes: Some(Passes::Split), ..Wishes::default() };
                let mut job = Job { max_distance: Some(0.001), ..job(&scene, (4, 4), 0..1) };
                job.camera = pinhole([0.2, -0.3, 6.0], [0.2, -0.3, 0.0], [0.0, 1.0, 0.0], 1.0);
                match execute::run(device, &plan(device, &scene, &geometry, job, wishes), &mut |_| {}) {
                    Ok(outcome) => {
                        assert_eq!(
                            (outcome.primary_rays, outcome.ambient_rays),
                            (16, 16),
                            "{method}, {triangles}"
                        );
                        true
                    }
                    Err(error) => {
                        assert!(error.to_string().contains("too long"), "{method}, {triangles}: {error}");
                        assert!(limited, "{method}, {triangles}: {error}");
                        false
                    }
                }
            };
            // The least number that is refused, where there is one, and its neighbours.
            let (mut least, mut most) = (1_000, 20_000);
            while limited && most - least > 1 {
                let middle = (least + most) / 2;
                if finds(middle) { least = middle } else { most = middle }
            }
            for triangles in [1_000, 20_000].into_iter().chain(most.saturating_sub(4)..most + 4) {
                assert_eq!(finds(triangles), !limited || triangles < most, "{method}, {triangles}");
            }
        }
    });
}

/// Brute force over more triangles than one invocation may test: parts with the state carried between
/// them find what the tree finds.
#[test]
fn brute_force_in_parts_of_the_triangles() {
    with_device(|device| {
        let scene = scene_named("terrain", Some(80_000));
        let geometry = geometry(&scene, Preset::Auto);
        let render = |method| {
            let wishes = Wishes { method: Some(method), ..Wishes::default() };
            run(device, &plan(device, &scene, &geometry, job(&scene, (16, 16), 0..3), wishes))
        };
        let (brute, tree) = (render(Method::Brute), render(Method::Threaded));
        assert!(brute.accumulated == tree.accumulated);
        assert_eq!((brute.primary_rays, brute.ambient_rays), (tree.primary_rays, tree.ambient_rays));
    });
}

/// A floor under crossing slivers, whose boxes all overlap: a ray visits nearly every leaf, so that a block of samples
/// runs into the driver's loop limit in some pixels and not in others. A pixel that lags behind after one block must not
/// be taken for one that keeps up in the next.
#[test]
fn a_pixel_that_lags_behind_misses_no_sample_of_a_later_block() {
    let number =
        |i: u32, low: f64, high: f64| low + (high - low) * f64::from(hash(i, 1)) / f64::from(u32::MAX);
    let mut text = String::from("v -20 0 -20\nv 20 0 -20\nv 0 0 30\nf 1 2 3\n");
    for i in 0..3000 {
        let at = |k: u32, low, high| number(6 * i + k, low, high);
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        let (ax, ay, az) = (at(0, -10.0, -9.0), at(1, 1.0, 2.0), side * at(2, -10.0, -9.0));
        let (bx, by, bz) = (at(3, 9.0, 10.0), at(4, 9.0, 10.0), side * at(5, 9.0, 10.0));
        text += &format!("v {ax} {ay} {az}\nv {bx} {by} {bz}\nv {} {by} {bz}\nf -3 -2 -1\n", bx + 0.003);
    }
    let scene = scene_of(&text);
    let geometry = geometry(&scene, Preset::Auto);
    let camera = cousu::scene::camera::Camera::Pinhole {
        eye: [0.0, 3.0, 14.0],
        target: [0.0, 2.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov: 45.0,
    };
    with_device(|device| {
        let mut first = None;
        for passes in [Passes::Staged, Passes::Split, Passes::Single] {
            for (method, accessor) in
                [(Method::Wide, None), (Method::Ordered, None), (Method::Entry, Some(Accessor::Address))]
            {
                let wishes =
                    Wishes { method: Some(method), passes: Some(passes), accessor, ..Wishes::default() };
                let job = Job { camera, block: Some(73), ..job(&scene, (8, 8), 0..219) };
                let outcome = run(device, &plan(device, &scene, &geometry, job, wishes));
                if device.adapter().limits.loop_iterations.is_some() && passes != Passes::Staged {
                    assert!(
                        outcome.repeats > 0,
                        "{method} {passes}: the limit was not met, this proves nothing"
                    );
                }
                match &first {
                    None => first = Some(outcome.accumulated),
                    Some(first) => assert!(*first == outcome.accumulated, "{method} {passes}"),
                }
            }
        }
    });
}

/// Pictures of any size: each pixel is that of the same ray in a larger padded grid.
#[test]
fn odd_sizes_are_whole() {
    with_device(|device| {
        // A plane that fills the view: every pixel hits, every ray escapes.
        let scene = scene_of("v -100 -100 0\nv 100 -100 0\nv 100 100 0\nv -100 100 0\nf 1 2 3 4\n");
        let geometry = geometry(&scene, Preset::Auto);
        for size in [(1, 1), (7, 13), (8, 8), (1, 300), (333, 2)] {
            let camera = cousu::scene::camera::Camera::Pinhole {
                eye: [1.0, 2.0, 30.0],
                target: [1.0, 2.0, 0.0],
                up: [0.0, 1.0, 0.0],
                fov: 20.0,
            };
            let wide = size == (333, 2);
            let job = Job { camera, ..job(&scene, size, 0..5) };
            let plan = plan(device, &scene, &geometry, job, Wishes::default());
            let outcome = run(device, &plan);
            let pixels = u64::from(size.0 * size.1);
            assert_eq!(outcome.primary_rays, pixels);
            if !wide {
                assert_eq!(outcome.ambient_rays, 5 * pixels, "{size:?}");
            }
            for (pixel, count) in counts(&outcome.accumulated).iter().enumerate() {
                let (x, y) = plan.tiles.position(pixel as u32);
                let inside = x < size.0 && y < size.1;
                assert!(
                    inside || *count == Count::default(),
                    "{size:?}: a pixel beyond the image was touched"
                );
                assert_eq!(count.escaped0 + count.escaped1, traced(count), "a lone plane hides nothing");
            }
        }
    });
}
