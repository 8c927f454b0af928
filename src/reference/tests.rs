use glam::Vec3;

use super::testing::{Kind, Random, Scene, triangle, triangles_of};
use super::*;
use crate::layout::SAMPLER_LCG;

/// Two triangles over four corners in a row around.
fn quad(id: u32, [a, b, c, d]: [Vec3; 4]) -> [Triangle; 2] {
    [triangle(id, a, b - a, c - a), triangle(id + 1, a, c - a, d - a)]
}

fn plane() -> Scene {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    let mut scene = Scene::of(quad(0, corners).to_vec());
    scene.frame.offset = 1e-4;
    // Wide enough that the plane leaves a rim.
    scene.look(Vec3::Y * 1.5, Vec3::NEG_Y, Vec3::Z, [40, 24])
}

fn closed_box() -> Scene {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let corner = |u: f32, v: f32| {
                let mut point = [side; 3];
                point[(axis + 1) % 3] = u;
                point[(axis + 2) % 3] = v;
                Vec3::from(point)
            };
            let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
            triangles.extend(quad(triangles.len() as u32, corners));
        }
    }
    let mut scene = Scene::of(triangles);
    scene.frame.offset = 1e-4;
    scene.look(Vec3::new(0.1, -0.2, 0.3), Vec3::NEG_Z, Vec3::Y, [40, 24])
}

fn soup() -> Scene {
    let mut scene = Scene::of(triangles_of(Kind::Soup, 40, 200));
    scene.frame.offset = 1e-4;
    scene.look(Vec3::Z * 2.5, Vec3::NEG_Z, Vec3::Y, [21, 13])
}

fn totals(counts: &[Count]) -> (u32, u32) {
    counts.iter().fold((0, 0), |(escaped, traced), count| {
        (escaped + count.escaped0 + count.escaped1, traced + count.traced0 + count.traced1)
    })
}

#[test]
fn a_lone_plane_sees_all_of_the_sky() {
    for eye in [1.5, -1.5] {
        let mut scene = plane();
        scene.frame.origin[1] = eye;
        scene.frame.direction[1] *= eye.signum();
        let outcome = render_counts(&scene.inputs(), 0..16, None);
        let (escaped, traced) = totals(&outcome.counts);
        assert_eq!((escaped, u64::from(traced)), (traced, outcome.ambient_rays), "from {eye}");
        assert_eq!(outcome.ambient_rays, 16 * outcome.primary_hits);
        assert_eq!(outcome.primary_rays, 40 * 24);
        // A side of 2 at a distance of 1.5 in a view 3 wide: 40 * 2/3 columns, all 24 rows.
        assert!((24 * 26..=24 * 27).contains(&outcome.primary_hits), "{}", outcome.primary_hits);
    }
}

#[test]
fn a_closed_box_sees_nothing() {
    let scene = closed_box();
    let stack = Traversal::Stack { size: scene.stack_bound };
    for traversal in [Traversal::Brute, stack, Traversal::Threaded] {
        let outcome = render_counts(&scene.by(traversal), 0..16, None);
        assert_eq!(outcome.primary_hits, 40 * 24);
        assert_eq!(totals(&outcome.counts), (0, 40 * 24 * 16), "{traversal:?}");
        assert_eq!(outcome.overflowed, 0);
    }
}

#[test]
fn methods_samples_and_threads_do_not_matter() {
    let scene = soup();
    let whole = render_counts(&scene.by(Traversal::Brute), 0..8, None);
    let (escaped, traced) = totals(&whole.counts);
    assert!(escaped > 0 && escaped < traced);
    assert_eq!(whole.counts.len(), 3 * 2 * 64);
    let stack = Traversal::Stack { size: scene.stack_bound };
    assert_eq!(render_counts(&scene.by(stack), 0..8, None), whole);
    let inputs = scene.inputs();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| render_counts(&inputs, 0..8, None)), whole);
    }
    let parts = [0..3, 3..4, 4..8].map(|samples| render_counts(&inputs, samples, None).counts);
    for (pixel, &count) in whole.counts.iter().enumerate() {
        let sum = parts.iter().fold(Count::default(), |sum, part| {
            let part = part[pixel];
            accumulate::add_samples(sum, [part.escaped0, part.escaped1], [part.traced0, part.traced1])
        });
        assert_eq!(sum, count);
    }
}

#[test]
fn staged_kernels_give_the_counts_of_the_single_one() {
    let scene = soup();
    let inputs = scene.inputs();
    let camera = camera_rays(&inputs);
    let hits = trace_closest(&inputs, &camera);
    let mut counts = vec![Count::default(); camera.len()];
    for sample in 0..4 {
        let rays = ambient_rays(&inputs, &hits, sample, &(0..16));
        for (pixel, answer) in trace_any(&inputs, &rays).iter().enumerate() {
            if hits[pixel].index == NO_HIT {
                assert_eq!((rays[pixel].t_max, answer.index), (-1.0, NO_HIT));
                continue;
            }
            let (mut escaped, mut traced) = ([0; 2], [0; 2]);
            traced[sample as usize % 2] = 1;
            escaped[sample as usize % 2] = u32::from(answer.index == NO_HIT);
            counts[pixel] = accumulate::add_samples(counts[pixel], escaped, traced);
        }
    }
    assert_eq!(render_counts(&inputs, 0..4, None).counts, counts);
}

#[test]
fn means_are_the_share_of_escaped_rays() {
    let scene = soup();
    let inputs = scene.inputs();
    let blank = [0.25, 0.0, 0.0, 0.0];
    let mut image = vec![blank; 21 * 13];
    render_means(&inputs, &mut image, 0..4, None, false);
    render_means(&inputs, &mut image, 4..8, None, false);
    let mut eight_bit = vec![blank; 21 * 13];
    render_means(&inputs, &mut eight_bit, 0..8, None, true);
    let counts = render_counts(&inputs, 0..8, None).counts;
    for (pixel, count) in counts.iter().enumerate() {
        let [x, y] = camera::pixel_position(inputs.frame, pixel as u32);
        if x >= 21 || y >= 13 {
            assert_eq!(*count, Count::default());
            continue;
        }
        let texel = image[(y * 21 + x) as usize];
        let rough = eight_bit[(y * 21 + x) as usize];
        if count.traced0 == 0 {
            assert_eq!((texel, rough), (blank, blank), "left alone");
        } else {
            let mean = (count.escaped0 + count.escaped1) as f32 / 8.0;
            assert_eq!(texel, [mean, mean, mean, 1.0]);
            assert!((rough[0] - mean).abs() < 0.501 / 255.0 && rough[3] == 1.0);
        }
    }
}

#[test]
fn the_original_steps_every_seed_and_weighs_its_rays() {
    let mut scene = plane();
    // Its camera spans near to far at t 0 to 1.
    scene.frame.camera_t_max = 1.0;
    for part in [&mut scene.frame.direction, &mut scene.frame.direction_dx, &mut scene.frame.direction_dy] {
        *part = part.map(|x| x * 3.0);
    }
    scene.frame.ambient_t_max = 1000.0;
    let choices = Choices { sampler: SAMPLER_LCG, ..scene.choices(true) };
    let inputs = Inputs { choices, ..scene.inputs() };
    let mut random = Random::new(41);
    let start: Vec<u32> = (0..40 * 24).map(|_| random.bits() & 0x7fff_ffff).collect();
    let mut seeds = start.clone();
    let mut image = vec![[0.5; 4]; 40 * 24];
    let outcome = render_means(&inputs, &mut image, 0..4, Some(&mut seeds), false);
    for (before, after) in start.iter().zip(&seeds) {
        assert_eq!((0..8).fold(*before, |state, _| rng::lcg_step(state)), *after);
    }
    let hits = image.iter().filter(|texel| texel[3] == 1.0).count();
    assert_eq!(hits as u64, outcome.primary_hits);
    assert!(hits > 0 && hits < image.len());
    for texel in image {
        let expected = if texel[3] == 1.0 { 1.0 } else { 0.0 };
        assert!((texel[0] - expected).abs() < 1e-3, "{texel:?}");
    }
}

#[test]
fn lcg_states_go_on_where_they_stopped() {
    let scene = soup();
    let mut inputs = scene.inputs();
    inputs.choices.sampler = SAMPLER_LCG;
    let start: Vec<u32> = (0..3 * 2 * 64).map(|pixel| pixel * 7919).collect();
    let (mut once, mut twice) = (start.clone(), start.clone());
    let whole = render_counts(&inputs, 0..8, Some(&mut once));
    let first = render_counts(&inputs, 0..4, Some(&mut twice));
    let second = render_counts(&inputs, 4..8, Some(&mut twice));
    assert_eq!(once, twice);
    let sum = |outcome: &Outcome| totals(&outcome.counts);
    assert_eq!(sum(&whole).0, sum(&first).0 + sum(&second).0);
    // Where a pixel hits nothing no number is taken.
    for (pixel, count) in whole.counts.iter().enumerate() {
        assert_eq!(once[pixel] == start[pixel], count.traced0 == 0);
    }
}

#[test]
fn a_stack_too_small_is_counted() {
    let scene = soup();
    assert_eq!(
        render_counts(&scene.by(Traversal::Stack { size: scene.stack_bound }), 0..4, None).overflowed,
        0
    );
    let outcome = render_counts(&scene.by(Traversal::Stack { size: 2 }), 0..4, None);
    assert!(outcome.overflowed > 0);
    assert_eq!(outcome.primary_rays, 21 * 13);
}
