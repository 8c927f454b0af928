//! Hits do not depend on how the tree was built, bit for bit.

use super::*;
use crate::bvh::quality::Quality;
use crate::bvh::{Builder, build};
use crate::layout::{NO_HIT, Triangle};
use crate::reference::ray::no_hit;
use crate::reference::testing::{
    KINDS, Random, Scene, aimed_ray, by_corners, grazing_ray, procedural, triangle, triangles_of,
};

const BUILDERS: [Builder; 5] =
    [Builder::Midpoint, Builder::Sah, Builder::Reinsert, Builder::Ploc, Builder::Sbvh];

/// Bits of a hit but for its place in the array.
fn bits(hit: Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.id]
}

/// A few long walls, floors and roofs, whole and tilted, across many small things: what spatial splits are for.
fn hall(seed: u64, count: usize) -> Vec<Triangle> {
    let mut random = Random::new(seed);
    (0..count as u32)
        .map(|id| {
            let (along, across) = match random.below(3) {
                0 => (random.axis(), random.direction()),
                1 => (random.axis(), random.axis()),
                _ => (random.direction(), random.direction()),
            };
            let (length, width) = match random.below(16) {
                0 => (1.5, 0.2),
                1 => (1.0, 1.0),
                _ => (0.1, 0.1),
            };
            triangle(id, random.point(), along * length * random.unit(), across * width * random.unit())
        })
        .collect()
}

/// The scene over a builder's tree, for either intersector.
fn built(builder: Builder, triangles: &[Triangle], watertight: bool) -> Scene {
    if watertight {
        let (corners, triangles) = by_corners(triangles);
        return Scene::watertight_with(&build(builder, &triangles, &|_| ()), &corners, &triangles);
    }
    Scene::with(&build(builder, triangles, &|_| ()), triangles)
}

/// Rays that a traversal of the tree answers otherwise than a test of every triangle, of `count` of each kind.
fn differences(
    tree_scene: &Scene,
    plain: &Scene,
    triangles: &[Triangle],
    seed: u64,
    count: usize,
) -> Vec<String> {
    let mut random = Random::new(seed);
    let stack = Traversal::Stack { size: tree_scene.stack_bound };
    let mut found = Vec::new();
    for i in 0..2 * count {
        let target = &triangles[random.below(triangles.len() as u32) as usize];
        let ray = if i < count { aimed_ray(&mut random, target) } else { grazing_ray(&mut random, target) };
        let brute = plain.by(Traversal::Brute);
        let (hit, _) = closest_hit(&brute, &ray, no_hit(ray.t_max));
        for traversal in [stack, Traversal::Threaded] {
            let inputs = tree_scene.by(traversal);
            let (other, overflowed) = closest_hit(&inputs, &ray, no_hit(ray.t_max));
            assert!(!overflowed);
            let any = any_hit(&inputs, &ray).0;
            if bits(other) != bits(hit) || any != (hit.index != NO_HIT) {
                found.push(format!("{traversal:?} {ray:?}: {other:?} any {any}, not {hit:?}"));
            }
        }
    }
    found
}

#[test]
fn every_builder_gives_the_same_bits() {
    for kind in KINDS {
        for count in [2, 30, 600] {
            let triangles = triangles_of(kind, 60 + count as u64, count);
            for watertight in [false, true] {
                let plain = built(Builder::Midpoint, &triangles, watertight);
                for builder in BUILDERS {
                    let scene = built(builder, &triangles, watertight);
                    let wrong = differences(&scene, &plain, &triangles, 61, 400);
                    assert!(
                        wrong.is_empty(),
                        "{builder} {count} of {kind:?}, watertight {watertight}: {} such as {}",
                        wrong.len(),
                        wrong[0]
                    );
                }
            }
        }
    }
}

/// Scenes whose triangles are cut, and rays that lie on the edge of being lost.
#[test]
fn spatial_splits_lose_no_hit() {
    let mut duplicates = 0;
    for seed in 0..12 {
        let triangles = hall(70 + seed, 100 + 100 * seed as usize);
        duplicates += Quality::of(&build(Builder::Sbvh, &triangles, &|_| ())).duplicates;
        for watertight in [false, true] {
            let plain = built(Builder::Midpoint, &triangles, watertight);
            let scene = built(Builder::Sbvh, &triangles, watertight);
            let wrong = differences(&scene, &plain, &triangles, 71 + seed, 4000);
            assert!(wrong.is_empty(), "watertight {watertight}: {} such as {}", wrong.len(), wrong[0]);
        }
    }
    println!("{duplicates} duplicates");
    assert!(duplicates > 800, "{duplicates}: too few cuts to prove anything");
}

#[test]
fn a_house_is_the_same_from_every_tree() {
    let triangles = procedural("maison", None);
    for watertight in [false, true] {
        let plain = built(Builder::Midpoint, &triangles, watertight);
        for builder in BUILDERS {
            let scene = built(builder, &triangles, watertight);
            let wrong = differences(&scene, &plain, &triangles, 90, 600);
            assert!(
                wrong.is_empty(),
                "{builder}, watertight {watertight}: {} such as {}",
                wrong.len(),
                wrong[0]
            );
        }
    }
}
