//! Methods with the choices that do not change what is hit, seeds, ways of adding up, undersized stacks.

mod common;

use common::{every_traversal, geometry, job, plan, plan_decided, run, scene_named, with_device};
use cousu::bvh::Builder;
use cousu::render::auto;
use cousu::render::choices::{Accumulator, Method, Offset, Preset, Sampler, Wishes};
use cousu::render::geometry::Geometry;
use cousu::render::picture::{Accumulated, Picture};
use cousu::vk::Device;

const SIZE: (u32, u32) = (72, 45);

/// Renders with every method and accessor and expects the same bits.
fn all_agree(device: &Device, name: &str, triangles: Option<u64>, wishes: Wishes) {
    let scene = scene_named(name, triangles);
    let geometry = geometry(&scene, wishes.preset.unwrap_or(Preset::Auto));
    let mut first: Option<(&str, Accumulated, u64)> = None;
    for decision in every_traversal(wishes, &geometry, device) {
        let plan = plan_decided(device, &scene, &geometry, job(&scene, SIZE, 0..8), &decision);
        let outcome = run(device, &plan);
        assert_eq!(outcome.overflowed_rays, 0, "{}", plan.kernel().name);
        assert_eq!(outcome.repeats, 0, "{}", plan.kernel().name);
        let rays = outcome.ambient_rays;
        match &first {
            None => first = Some((plan.kernel().name, outcome.accumulated, rays)),
            Some((kernel, accumulated, expected)) => {
                assert!(
                    *accumulated == outcome.accumulated,
                    "{name}: {kernel} and {} differ",
                    plan.kernel().name
                );
                assert_eq!(*expected, rays);
            }
        }
    }
    assert!(first.is_some_and(|(_, _, rays)| rays > 1000), "{name}: the camera sees too little");
}

#[test]
fn methods_agree_with_every_other_choice() {
    with_device(|device| {
        for accumulator in [Accumulator::Count, Accumulator::Rgba8, Accumulator::Rgba32f] {
            for sampler in [Sampler::Pcg, Sampler::Lcg] {
                let wishes =
                    Wishes { accumulator: Some(accumulator), sampler: Some(sampler), ..Wishes::default() };
                all_agree(device, "cornell", None, wishes);
            }
        }
        let fixed = Wishes { offset: Some(Offset::Fixed), ..Wishes::default() };
        all_agree(device, "maison", Some(1000), fixed);
    });
}

/// The same seed gives the same bits in every run, another one others.
#[test]
fn a_seed_is_a_picture() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        for preset in [Preset::Auto, Preset::Original] {
            let geometry = geometry(&scene, preset);
            let wishes = Wishes { preset: Some(preset), ..Wishes::default() };
            let render = |seed| {
                let job = cousu::render::plan::Job { seed, ..job(&scene, SIZE, 0..16) };
                run(device, &plan(device, &scene, &geometry, job, wishes)).accumulated
            };
            let first = render(1);
            assert!(first == render(1), "{preset}: the same seed");
            assert!(first != render(2), "{preset}: another seed");
        }
    });
}

/// Counts, floats and bytes add up the same rays: the running means differ by their rounding alone.
#[test]
fn accumulators_agree_within_their_rounding() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let picture = |accumulator| {
            let wishes = Wishes { accumulator: Some(accumulator), ..Wishes::default() };
            let plan = plan(device, &scene, &geometry, job(&scene, SIZE, 0..32), wishes);
            Picture::new(plan.tiles, &run(device, &plan).accumulated)
        };
        let counts = picture(Accumulator::Count);
        for (accumulator, bound) in [(Accumulator::Rgba32f, 1e-6), (Accumulator::Rgba8, 8.0 / 255.0)] {
            let means = picture(accumulator);
            assert_eq!(counts.coverage, means.coverage);
            let worst = counts.light.iter().zip(&means.light).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= bound, "{accumulator}: {worst}");
            assert!(worst > 0.0 || accumulator == Accumulator::Rgba32f, "8 bits must round");
        }
    });
}

/// maison's midpoint tree needs more than 16 entries: stack16 is refused with the figure, or counts the rays it loses,
/// and the others' counts stay whole.
#[test]
fn an_undersized_stack_is_refused_or_reported() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = Geometry::build(&scene, true, Builder::Midpoint, &|_| {}).expect("a tree");
        let stack16 = Method::Stack(16);
        let refusal = auto::check_stack(stack16, &geometry, false).expect_err("16 entries are too few");
        assert!(
            refusal.to_string().contains(&format!("needs up to {} entries", geometry.stack_bound)),
            "{refusal}"
        );
        assert_eq!(refusal.exit_code(), 2);
        auto::check_stack(stack16, &geometry, true).unwrap();
        auto::check_stack(Method::Stack(geometry.stack_bound), &geometry, false).unwrap();
        let render = |method| {
            let wishes = Wishes { method: Some(method), ..Wishes::default() };
            run(device, &plan(device, &scene, &geometry, job(&scene, (128, 80), 0..16), wishes))
        };
        let (whole, cut) = (render(Method::Stack(geometry.stack_bound)), render(stack16));
        assert_eq!(whole.overflowed_rays, 0);
        assert!(cut.overflowed_rays > 0, "some real rays need more than 16 entries");
        assert!(cut.overflowed_rays < cut.ambient_rays / 5);
        let tiny = render(Method::Stack(1));
        assert!(tiny.overflowed_rays > 0, "a stack of one entry drops nearly all, and stays in its array");
    });
}
