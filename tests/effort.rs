//! As many rays as are needed: an error or a time as the goal, samples where the error is, several camera rays a pixel.

mod common;

use std::time::Duration;

use common::{SCENES, geometry, job, plan, run, scene_named, scene_of, with_device};
use cousu::layout::Count;
use cousu::render::choices::{Accumulator, Method, Passes, Preset, Sampler, Wishes};
use cousu::render::execute::Outcome;
use cousu::render::picture::{Accumulated, Picture};
use cousu::render::plan::{Job, Plan};
use cousu::render::rounds::Goal;
use cousu::vk::Device;

fn counts(outcome: &Outcome) -> &[Count] {
    match &outcome.accumulated {
        Accumulated::Counts(counts) => counts,
        Accumulated::Means(_) => panic!("counts were asked for"),
    }
}

fn traced(count: &Count) -> u32 {
    count.traced0 + count.traced1
}

fn of_sampler(sampler: Sampler) -> Wishes {
    Wishes { sampler: Some(sampler), ..Wishes::default() }
}

/// Light of the covered pixels from `spp` independent samples; two of them with different seeds make a reference whose own
/// noise drops out.
fn reference(device: &Device, plan: &Plan<'_>, spp: u32, seed: u32) -> Vec<f32> {
    let mut plan = plan.clone();
    plan.job = Job { samples: 0..spp, adaptive: false, goal: Goal::Samples, seed, ..plan.job };
    plan.frame.seed = seed;
    plan.settings.sampler = Sampler::Philox;
    let plan = plan
        .with_constant(cousu::layout::SPEC_SAMPLER, cousu::layout::SAMPLER_PHILOX)
        .with_constant(cousu::layout::SPEC_BUDGETS, 0);
    Picture::new(plan.tiles, &run(device, &plan).accumulated).light
}

/// Mean of (x - r1)(x - r2) over the covered pixels, its root; and the mean error.
fn error_against(picture: &Picture, references: &[Vec<f32>; 2]) -> (f64, f64) {
    let (mut square, mut sum, mut pixels) = (0.0, 0.0, 0.0);
    for (place, &light) in picture.light.iter().enumerate() {
        if picture.coverage[place] == 1.0 {
            let [a, b] = [0, 1].map(|r: usize| f64::from(light) - f64::from(references[r][place]));
            square += a * b;
            sum += 0.5 * (a + b);
            pixels += 1.0;
        }
    }
    ((square / pixels).sqrt(), sum / pixels)
}

/// The estimate from the two halves against the error that there is, from 16 samples on.
#[test]
fn the_estimated_error_is_the_true_one_for_every_sampler_and_scene() {
    with_device(|device| {
        for (name, triangles) in SCENES {
            let scene = scene_named(name, triangles);
            let geometry = geometry(&scene, Preset::Auto);
            let render = |wishes, spp| plan(device, &scene, &geometry, job(&scene, (96, 60), 0..spp), wishes);
            let base = render(Wishes::default(), 1);
            let references = [1001, 2002].map(|seed| reference(device, &base, 2048, seed));
            for sampler in [Sampler::Lcg, Sampler::Pcg, Sampler::Sobol, Sampler::Strata, Sampler::Philox] {
                for spp in [16, 24, 64] {
                    let plan = render(of_sampler(sampler), spp);
                    let outcome = run(device, &plan);
                    let (rmse, _) =
                        error_against(&Picture::new(plan.tiles, &outcome.accumulated), &references);
                    let Some(estimate) = outcome.error else { panic!("{name}: no estimate") };
                    let ratio = estimate.rmse / rmse;
                    println!(
                        "{name} {sampler} {spp}: {rmse:.5}, estimated {:.5}, ratio {ratio:.3}",
                        estimate.rmse
                    );
                    assert!((ratio - 1.0).abs() < 0.2, "{name} {sampler} {spp}: {ratio}");
                }
            }
        }
    });
}

#[test]
fn a_render_ends_when_its_error_is_small_enough() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        for (sampler, adaptive) in
            [(Sampler::Pcg, false), (Sampler::Sobol, false), (Sampler::Sobol, true), (Sampler::Strata, true)]
        {
            let goal = 0.015;
            let job = Job { goal: Goal::Rmse(goal), adaptive, ..job(&scene, (96, 60), 0..1 << 16) };
            let plan = plan(device, &scene, &geometry, job, of_sampler(sampler));
            let outcome = run(device, &plan);
            let references = [1001, 2002].map(|seed| reference(device, &plan, 4096, seed));
            let (rmse, bias) = error_against(&Picture::new(plan.tiles, &outcome.accumulated), &references);
            let label = format!("{sampler} adaptive {adaptive}: {rmse:.5}, {} samples", outcome.samples);
            println!("{label}, {} rounds", outcome.rounds);
            assert!(outcome.error.is_some_and(|error| error.rmse <= goal), "{label}: {:?}", outcome.error);
            assert!(rmse < 1.1 * goal && rmse > 0.6 * goal, "{label}");
            assert!(bias.abs() < 4.0 * goal / 3000f64.sqrt(), "{label}: bias {bias}");
            assert!(outcome.rounds <= 8, "{label}: {} rounds", outcome.rounds);
        }
    });
}

#[test]
fn a_render_ends_when_its_time_is_up_with_whole_pixels() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let goal = Goal::Time(Duration::from_millis(3000));
        let job = Job { goal, ..job(&scene, (64, 40), 0..1 << 20) };
        let outcome = run(device, &plan(device, &scene, &geometry, job, Wishes::default()));
        assert!(outcome.samples > 16 && outcome.rounds > 1, "{} samples", outcome.samples);
        assert!(counts(&outcome).iter().all(|count| [0, outcome.samples].contains(&traced(count))));
    });
}

/// Rounds take up the sequence where the last one left it: for keyed samplers the sum is what one go gives.
#[test]
fn rounds_add_up_to_one_go() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = geometry(&scene, Preset::Auto);
        for sampler in [Sampler::Lcg, Sampler::Pcg, Sampler::Sobol] {
            let whole = job(&scene, (64, 40), 0..1 << 16);
            let in_rounds = Job { goal: Goal::Rmse(0.02), ..whole.clone() };
            let in_rounds = run(device, &plan(device, &scene, &geometry, in_rounds, of_sampler(sampler)));
            assert!(in_rounds.rounds > 1);
            let at_once = Job { samples: 0..in_rounds.samples, ..whole };
            let at_once = run(device, &plan(device, &scene, &geometry, at_once, of_sampler(sampler)));
            assert!(counts(&in_rounds) == counts(&at_once), "{sampler}");
        }
    });
}

/// Each pixel's count is that of a plain render with as many samples, so no pixel of the pilot is in it; a corner gets
/// more than an open floor; all passes agree.
#[test]
fn an_adaptive_render_is_a_plain_one_with_other_numbers_of_samples() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = geometry(&scene, Preset::Auto);
        for sampler in [Sampler::Lcg, Sampler::Pcg, Sampler::Sobol, Sampler::Strata] {
            let render = |passes, adaptive, spp| {
                let job = Job { adaptive, ..job(&scene, (64, 40), 0..spp) };
                let wishes = Wishes { passes: Some(passes), ..of_sampler(sampler) };
                run(device, &plan(device, &scene, &geometry, job, wishes))
            };
            let adaptive = render(Passes::Split, true, 32);
            let mut given: Vec<u32> = counts(&adaptive).iter().map(traced).filter(|&n| n > 0).collect();
            let mean = given.iter().map(|&n| f64::from(n)).sum::<f64>() / given.len() as f64;
            assert!((mean - 32.0).abs() < 1.0, "{sampler}: {mean}");
            given.sort_unstable();
            assert!(given[given.len() - 1] >= 2 * given[0], "{sampler}: {given:?}");
            given.dedup();
            for &spp in [given[0], given[given.len() / 2], given[given.len() - 1]].iter() {
                let plain = render(Passes::Split, false, spp);
                let same = counts(&adaptive).iter().zip(counts(&plain)).filter(|(a, _)| traced(a) == spp);
                assert!(same.clone().count() > 0 && same.clone().all(|(a, b)| a == b), "{sampler} {spp}");
            }
            for passes in [Passes::Single, Passes::Staged] {
                assert!(counts(&render(passes, true, 32)) == counts(&adaptive), "{sampler} {passes}");
            }
        }
    });
}

#[test]
fn an_adaptive_render_has_no_bias_and_a_smaller_error() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = geometry(&scene, Preset::Auto);
        let render = |adaptive, seed| {
            let job = Job { adaptive, seed, ..job(&scene, (96, 60), 0..64) };
            let plan = plan(device, &scene, &geometry, job, of_sampler(Sampler::Pcg));
            Picture::new(plan.tiles, &run(device, &plan).accumulated)
        };
        let base = plan(device, &scene, &geometry, job(&scene, (96, 60), 0..1), Wishes::default());
        let references = [1001, 2002].map(|seed| reference(device, &base, 4096, seed));
        let (mut squares, mut biases) = ([0.0; 2], [0.0; 2]);
        for seed in 0..8 {
            for adaptive in [false, true] {
                let (rmse, bias) = error_against(&render(adaptive, seed), &references);
                squares[usize::from(adaptive)] += rmse * rmse / 8.0;
                biases[usize::from(adaptive)] += bias / 8.0;
            }
        }
        println!("mean square errors {squares:?}, biases {biases:?}");
        assert!(squares[1] < 0.95 * squares[0], "{squares:?}");
        // Eight pictures of some 1,500 covered pixels.
        let deviation = (squares[0] / 8.0 / 1500.0).sqrt();
        assert!(biases.iter().all(|bias| bias.abs() < 4.0 * deviation), "{biases:?}");
    });
}

/// With one kernel for all, a pixel whose camera ray hits nothing traces it once, however many dispatches there are.
#[test]
fn a_pixel_without_a_hit_costs_one_camera_ray() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let job = Job { block: Some(4), ..job(&scene, (101, 67), 0..32) };
        let wishes = Wishes { passes: Some(Passes::Single), ..Wishes::default() };
        let outcome = run(device, &plan(device, &scene, &geometry, job, wishes));
        let hits = counts(&outcome).iter().filter(|count| traced(count) > 0).count() as u64;
        assert!(hits > 1000 && hits < 101 * 67);
        assert_eq!(outcome.primary_rays, 101 * 67 + 7 * hits);
        assert_eq!(outcome.ambient_rays, 32 * hits);
    });
}

/// A triangle that covers half of each pixel on its diagonal, and one that covers a strip whose share is known.
#[test]
fn several_camera_rays_tell_how_much_of_a_pixel_is_covered() {
    with_device(|device| {
        // A wall that ends at x = 0.1 with the view's middle at x = 0: nothing lies before it.
        let scene = scene_of("v -9 -9 0\nv 0.1 -9 0\nv 0.1 9 0\nv -9 9 0\nf 1 2 3 4\n");
        let geometry = geometry(&scene, Preset::Auto);
        let camera = common::pinhole([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 90.0);
        for (jitters, within) in [(4, 0.25), (16, 1.0 / 16.0 + 1e-6), (64, 1.0 / 64.0 + 1e-6)] {
            let job = Job { camera, jitters, ..job(&scene, (20, 20), 0..2) };
            let plan = plan(device, &scene, &geometry, job, Wishes::default());
            let picture = Picture::new(plan.tiles, &run(device, &plan).accumulated);
            for (place, &coverage) in picture.coverage.iter().enumerate() {
                // A pixel is 0.4 wide there: the edge lies a quarter into column 10.
                let expected = match place % 20 {
                    column if column < 10 => 1.0,
                    10 => 0.25,
                    _ => 0.0,
                };
                assert!((coverage - expected).abs() <= within, "{jitters} at {place}: {coverage} {expected}");
                assert_eq!((coverage * jitters as f32).fract(), 0.0);
                assert_eq!(picture.light[place], coverage, "nothing is in the way");
            }
        }
    });
}

#[test]
fn several_camera_rays_agree_whatever_the_passes() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let render = |passes, adaptive| {
            let job = Job { jitters: 3, adaptive, ..job(&scene, (61, 37), 0..8) };
            let wishes = Wishes { passes: Some(passes), ..Wishes::default() };
            run(device, &plan(device, &scene, &geometry, job, wishes))
        };
        for adaptive in [false, true] {
            let split = render(Passes::Split, adaptive);
            for passes in [Passes::Single, Passes::Staged] {
                assert!(counts(&render(passes, adaptive)) == counts(&split), "{passes} {adaptive}");
            }
        }
    });
}

#[test]
fn running_means_are_refused_where_counts_are_needed() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let whole = job(&scene, (8, 8), 0..4);
        for (job, option) in [
            (Job { goal: Goal::Rmse(0.1), ..whole.clone() }, "--target-rmse"),
            (Job { goal: Goal::Time(Duration::from_secs(1)), ..whole.clone() }, "--time"),
            (Job { adaptive: true, ..whole.clone() }, "--adaptive"),
            (Job { jitters: 2, ..whole.clone() }, "--antialias"),
        ] {
            let wishes = Wishes { accumulator: Some(Accumulator::Rgba32f), ..Wishes::default() };
            let decision = cousu::render::auto::decide(&wishes, &geometry, device.adapter());
            match Plan::new(job, &scene, &geometry, &decision, &device.adapter().limits) {
                Ok(_) => panic!("{option} was taken"),
                Err(error) => assert!(error.to_string().starts_with(option), "{error}"),
            }
        }
    });
}

/// Pixels that a driver's loop limit holds up lag behind the others in a round; the next one must not take their list for
/// everybody's.
#[test]
fn a_round_in_which_pixels_lagged_is_followed_by_a_whole_one() {
    let mut text = String::from("v -1 -1 -1\nv 1 -1 -1\nv 1 -1 1\nv -1 -1 1\nf 1 4 3 2\n");
    text += "v 0.3 0 -1\nv 1 1 -1\nv 0.3 1 1\nf 5 6 7\nv -1 -1 -1\nv 1 1 1\nv 1 1 0.999\n";
    text += &"f 8 9 10\n".repeat(9000);
    let scene = scene_of(&text);
    with_device(|device| {
        let geometry = geometry(&scene, Preset::Auto);
        let entries = geometry.stack_bound.max(64);
        for seed in 1..4 {
            let job = Job { goal: Goal::Rmse(0.032), seed, ..job(&scene, (8, 8), 0..1 << 12) };
            let wishes = Wishes {
                method: Some(Method::Stack(entries)),
                passes: Some(Passes::Split),
                ..Wishes::default()
            };
            let outcome = run(device, &plan(device, &scene, &geometry, job, wishes));
            assert!(counts(&outcome).iter().all(|count| [0, outcome.samples].contains(&traced(count))));
        }
    });
}
