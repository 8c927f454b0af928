use glam::Vec3;

use super::*;
use crate::layout::Triangle;
use crate::reference::exact::Truth;
use crate::reference::ray::no_hit;
use crate::reference::testing::{KINDS, Kind, Random, Scene, aimed_ray, by_corners, triangle, triangles_of};
use crate::reference::{Choices, trace_any, trace_closest};

fn rays_at(triangles: &[Triangle], seed: u64, count: usize) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let mut one = || {
        let target = &triangles[random.below(triangles.len() as u32) as usize];
        aimed_ray(&mut random, target)
    };
    (0..count).map(|_| one()).collect()
}

/// Bits of a hit but for its place in the array.
fn bits(hit: Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.id]
}

/// With either intersector.
fn all_scenes(mut check: impl FnMut(Kind, &[Triangle], &Scene)) {
    for kind in KINDS {
        for count in [1, 2, 10, 1000] {
            let triangles = triangles_of(kind, 20 + count as u64, count);
            check(kind, &triangles, &Scene::of(triangles.clone()));
            check(kind, &triangles, &Scene::watertight(&triangles));
        }
    }
}

#[test]
fn every_method_and_order_finds_the_same_bits() {
    all_scenes(|kind, triangles, scene| {
        let stack = Traversal::Stack { size: scene.stack_bound };
        let mut met = 0;
        for ray in rays_at(triangles, 21, 500) {
            let (hit, _) = closest_hit(&scene.by(Traversal::Brute), &ray, no_hit(ray.t_max));
            let (any, _) = any_hit(&scene.by(Traversal::Brute), &ray);
            assert_eq!(any, hit.index != crate::layout::NO_HIT);
            met += u32::from(any);
            for other in [
                stack,
                Traversal::Threaded,
                Traversal::SinglePush,
                Traversal::Ordered,
                Traversal::Entry,
                Traversal::Packet,
                Traversal::Postponed,
                Traversal::Wide,
                Traversal::Bundle,
            ] {
                let inputs = scene.by(other);
                let (found, overflowed) = closest_hit(&inputs, &ray, no_hit(ray.t_max));
                assert_eq!(found.index, hit.index, "{kind:?} {other:?} {ray:?}");
                assert_eq!(bits(found), bits(hit), "{kind:?} {other:?} {ray:?}");
                assert_eq!(any_hit(&inputs, &ray).0, any, "{kind:?} {other:?} {ray:?}");
                assert!(!overflowed);
            }
            // The triangles as they came, and backwards.
            let watertight = scene.choices(false).watertight;
            for backwards in [false, true] {
                let (mut corners, edges) = by_corners(triangles);
                let mut order = if watertight { edges } else { triangles.to_vec() };
                if backwards {
                    order.reverse();
                    corners.reverse();
                }
                let inputs = Inputs { triangles: &order, corners: &corners, ..scene.by(Traversal::Brute) };
                let (found, _) = closest_hit(&inputs, &ray, no_hit(ray.t_max));
                assert_eq!(bits(found), bits(hit), "{kind:?} {ray:?}");
            }
        }
        assert!(met > 50, "{kind:?}: {met} rays met something");
    });
}

/// Rays of any direction that go together, in packets and in groups whose leaves wait, fare as each by itself.
#[test]
fn rays_together_find_the_bits_of_each_alone() {
    all_scenes(|kind, triangles, scene| {
        let (alone, together) = (scene.by(Traversal::Brute), scene.by(Traversal::Packet));
        for lanes in [1, 3, 8, 32] {
            for seed in 0..4 {
                let rays = rays_at(triangles, 30 + seed, lanes);
                let start = || rays.iter().map(|ray| no_hit(ray.t_max)).collect::<Vec<_>>();
                let closest = [
                    packet::closest_hits(&together, &rays, start()),
                    postponed::closest_hits(&together, &rays, start()),
                ];
                let any = [packet::any_hits(&together, &rays), postponed::any_hits(&together, &rays)];
                for (lane, ray) in rays.iter().enumerate() {
                    let hit = closest_hit(&alone, ray, no_hit(ray.t_max)).0;
                    let met = any_hit(&alone, ray).0;
                    for found in &closest {
                        assert_eq!(bits(found[lane]), bits(hit), "{kind:?}, {lanes} lanes, {ray:?}");
                    }
                    assert!(any.iter().all(|found| found[lane] == met), "{kind:?}, {lanes} lanes, {ray:?}");
                }
            }
        }
    });
}

#[test]
fn answers_are_those_of_exact_arithmetic() {
    all_scenes(|kind, triangles, scene| {
        let inputs = scene.inputs();
        let truth = Truth::of(&inputs);
        let rays: Vec<_> = rays_at(triangles, 22, 400).iter().map(Ray::record).collect();
        let (closest, any) = (trace_closest(&inputs, &rays), trace_any(&inputs, &rays));
        let mut certain = 0;
        for (i, ray) in rays.iter().enumerate() {
            let exact = truth.closest(ray);
            exact.accepts(&closest[i]).unwrap_or_else(|e| panic!("{kind:?} {ray:?}: {e}"));
            truth.any(ray).accepts(&any[i]).unwrap_or_else(|e| panic!("{kind:?} {ray:?}: {e}"));
            certain += u32::from(exact.edge_margin > 1.0);
        }
        println!(
            "{kind:?} {} watertight {}: {certain} of {} rays are certain",
            triangles.len(),
            inputs.choices.watertight,
            rays.len()
        );
        assert!(certain > 60, "{kind:?}: only {certain} rays prove anything");
    });
}

#[test]
fn of_equal_hits_the_smaller_id_wins_and_in_the_original_the_last() {
    let one = |id| triangle(id, Vec3::ZERO, Vec3::X, Vec3::Y);
    let scene = Scene::of(vec![one(2), one(0), one(1)]);
    let ray = Ray { origin: Vec3::new(0.2, 0.2, 1.0), direction: Vec3::NEG_Z, t_max: 9.0 };
    let stack = Traversal::Stack { size: 8 };
    for traversal in [Traversal::Brute, stack, Traversal::Threaded] {
        let mut inputs = scene.by(traversal);
        assert_eq!(closest_hit(&inputs, &ray, no_hit(9.0)).0.id, 0);
        inputs.choices = Choices { original: true, robust_slabs: false, facing: false, ..inputs.choices };
        let last = if traversal == Traversal::Brute { 2 } else { 0 };
        assert_eq!(closest_hit(&inputs, &ray, no_hit(9.0)).0.index, last, "{traversal:?}");
    }
}

#[test]
fn a_small_stack_counts_what_it_drops() {
    let triangles = triangles_of(Kind::Soup, 23, 1000);
    let scene = Scene::of(triangles.clone());
    let rays = rays_at(&triangles, 24, 300);
    let truth = scene.by(Traversal::Brute);
    let mut lost = 0;
    for (size, some_overflow) in [(0, true), (1, true), (2, true), (4, true), (scene.stack_bound, false)] {
        let inputs = scene.by(Traversal::Stack { size });
        let mut overflows = 0;
        for ray in &rays {
            let (hit, dropped) = closest_hit(&inputs, ray, no_hit(ray.t_max));
            let (any, dropped_any) = any_hit(&inputs, ray);
            overflows += u32::from(dropped || dropped_any);
            let (right, _) = closest_hit(&truth, ray, no_hit(ray.t_max));
            assert!(dropped || bits(hit) == bits(right), "a wrong answer that is not counted");
            assert!(dropped_any || any == any_hit(&truth, ray).0);
            lost += u32::from(bits(hit) != bits(right));
        }
        assert_eq!(overflows > 0, some_overflow, "{size} entries: {overflows} rays");
    }
    assert!(lost > 0, "a stack too small changed no answer: the test proves nothing");
}
