//! Methods, builders, passes, accessors, accumulators and samplers: all pairs of choices see the same scene, exactly.

mod common;

use std::collections::{BTreeMap, BTreeSet};

use common::{INTERSECTORS, job, plan_decided, run, scene_named, with_device};
use cousu::bvh::Builder;
use cousu::kernels::NodeLayout;
use cousu::layout::{SPEC_COMPACT, SPEC_LEAVES_LOOPS};
use cousu::render::auto::{self, Decision};
use cousu::render::choices::{Accessor, Accumulator, Intersector, Method, Passes, Sampler, Wishes};
use cousu::render::geometry::Geometry;
use cousu::render::picture::Accumulated;
use cousu::render::raylist::{Query, RayLists};
use cousu::scene::Scene;
use cousu::vk::{Device, DeviceKind};

const SIZE: (u32, u32) = (40, 25);
const BUILDERS: [Builder; 5] =
    [Builder::Midpoint, Builder::Sah, Builder::Reinsert, Builder::Ploc, Builder::Sbvh];
const PASSES: [Passes; 3] = [Passes::Single, Passes::Split, Passes::Staged];
const ACCESSORS: [Accessor; 3] = [Accessor::StorageBuffer, Accessor::TexelBuffer, Accessor::Address];
// Each accumulator and each sampler; `lcg` and the strata, whose numbers depend on more than pixel and sample, several times.
const SUMS: [(Accumulator, Sampler); 8] = [
    (Accumulator::Count, Sampler::Pcg),
    (Accumulator::Count, Sampler::Lcg),
    (Accumulator::Count, Sampler::Strata),
    (Accumulator::Count, Sampler::Philox),
    (Accumulator::Rgba32f, Sampler::Lcg),
    (Accumulator::Rgba32f, Sampler::Strata),
    (Accumulator::Rgba8, Sampler::Lcg),
    (Accumulator::Rgba8, Sampler::Sobol),
];
const METHODS: usize = 10;

/// Method, builder, passes, accessor, accumulator with sampler, intersector.
const FACTORS: usize = 6;

/// A choice of each factor.
type Combination = [usize; FACTORS];

const SIZES: Combination =
    [METHODS, BUILDERS.len(), PASSES.len(), ACCESSORS.len(), SUMS.len(), INTERSECTORS.len()];

/// Combinations in which every pair of choices of two factors stands at least once, greedily: each takes the first
/// pair that is missing and fills its other factors so as to cover as many more as it can.
fn all_pairs(sizes: Combination) -> Vec<Combination> {
    let mut missing = BTreeSet::new();
    for (a, b) in (0..FACTORS).flat_map(|a| (a + 1..FACTORS).map(move |b| (a, b))) {
        for (x, y) in (0..sizes[a]).flat_map(|x| (0..sizes[b]).map(move |y| (x, y))) {
            missing.insert((a, b, x, y));
        }
    }
    let mut combinations = Vec::new();
    while let Some(&(a, b, x, y)) = missing.first() {
        let mut chosen: [Option<usize>; FACTORS] = [None; FACTORS];
        chosen[a] = Some(x);
        chosen[b] = Some(y);
        for factor in 0..FACTORS {
            if chosen[factor].is_none() {
                let covers = |choice: usize| {
                    let new = |other: usize| {
                        chosen[other].is_some_and(|with| {
                            let pair = if other < factor {
                                (other, factor, with, choice)
                            } else {
                                (factor, other, choice, with)
                            };
                            missing.contains(&pair)
                        })
                    };
                    (0..FACTORS).filter(|&other| other != factor && new(other)).count()
                };
                // Of equals another one each time.
                let start = combinations.len();
                let turned = (0..sizes[factor]).map(|i| (i + start) % sizes[factor]);
                chosen[factor] = turned.max_by_key(|&choice| covers(choice));
            }
        }
        let combination = chosen.map(|choice| choice.unwrap_or(0));
        for (a, b) in (0..FACTORS).flat_map(|a| (a + 1..FACTORS).map(move |b| (a, b))) {
            missing.remove(&(a, b, combination[a], combination[b]));
        }
        combinations.push(combination);
    }
    combinations
}

#[test]
fn the_combinations_hold_all_pairs() {
    let combinations = all_pairs(SIZES);
    let mut seen = BTreeSet::new();
    for combination in &combinations {
        for (a, b) in (0..FACTORS).flat_map(|a| (a + 1..FACTORS).map(move |b| (a, b))) {
            seen.insert((a, b, combination[a], combination[b]));
        }
    }
    let pairs: usize = (0..FACTORS).flat_map(|a| (a + 1..FACTORS).map(move |b| SIZES[a] * SIZES[b])).sum();
    assert_eq!(seen.len(), pairs);
    assert!(combinations.len() < 100, "{}", combinations.len());
}

/// Whether the device takes the method at all: `bundle` is for CPU devices alone (`auto::check_subgroup`).
fn takes(device: &Device, method: usize) -> bool {
    device.adapter().kind == DeviceKind::Cpu || Method::all(1)[method] != Method::Bundle
}

/// The scene with each builder's tree.
fn geometries(scene: &Scene) -> Vec<Geometry> {
    BUILDERS.map(|builder| Geometry::build(scene, true, builder, &|_| {}).expect("a tree")).into()
}

fn decide(
    device: &Device,
    geometry: &Geometry,
    method: usize,
    wishes: Wishes,
    accessor: Accessor,
) -> Decision {
    let method = Method::all(geometry.stack_bound.max(1))[method];
    let decision = auto::decide(&Wishes { method: Some(method), ..wishes }, geometry, device.adapter());
    Decision { accessor, ..decision }
}

fn counts_agree(device: &Device, scene: &Scene) {
    let geometries = geometries(scene);
    let mut first: BTreeMap<(usize, usize), (Combination, Accumulated)> = BTreeMap::new();
    for combination in all_pairs(SIZES) {
        let [method, builder, passes, accessor, sum, intersector] = combination;
        if !takes(device, method) {
            continue;
        }
        let (accumulator, sampler) = SUMS[sum];
        let wishes = Wishes {
            passes: Some(PASSES[passes]),
            accumulator: Some(accumulator),
            sampler: Some(sampler),
            intersector: Some(INTERSECTORS[intersector]),
            ..Wishes::default()
        };
        let decision = decide(device, &geometries[builder], method, wishes, ACCESSORS[accessor]);
        let plan = plan_decided(device, scene, &geometries[builder], job(scene, SIZE, 0..8), &decision);
        let outcome = run(device, &plan);
        let what = || format!("{}: {:?} on {}", scene.path, decision.settings, BUILDERS[builder]);
        assert_eq!((outcome.overflowed_rays, outcome.repeats), (0, 0), "{}", what());
        assert!(outcome.ambient_rays > 500, "{}: the camera sees too little", what());
        match first.get(&(sum, intersector)) {
            None => {
                first.insert((sum, intersector), (combination, outcome.accumulated));
            }
            Some((other, accumulated)) => {
                assert!(*accumulated == outcome.accumulated, "{} differs from {other:?}", what());
            }
        }
    }
    assert_eq!(first.len(), SUMS.len() * INTERSECTORS.len());
}

/// Distance, barycentric coordinates and triangle of each camera ray's closest hit, whatever tree and method.
fn camera_hits_agree(device: &Device, scene: &Scene) {
    let geometries = geometries(scene);
    for intersector in INTERSECTORS {
        camera_hits_agree_with(device, scene, &geometries, intersector);
    }
}

fn camera_hits_agree_with(device: &Device, scene: &Scene, geometries: &[Geometry], intersector: Intersector) {
    let mut first: Option<Vec<[u32; 4]>> = None;
    for (place, geometry) in geometries.iter().enumerate() {
        for method in 0..METHODS {
            // The others with each method and each builder once or twice.
            if intersector != Intersector::Moller && method % geometries.len() != place
                || !takes(device, method)
            {
                continue;
            }
            let accessor = ACCESSORS[(place + method) % ACCESSORS.len()];
            let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
            let decision = decide(device, geometry, method, wishes, accessor);
            let plan = plan_decided(device, scene, geometry, job(scene, SIZE, 0..1), &decision);
            let lists = RayLists::new(device, &plan).unwrap();
            let hits = lists.trace(Query::Closest, &lists.camera_rays().unwrap()).unwrap();
            let named = hits.iter().map(|hit| {
                let id = geometry.triangles.get(hit.index as usize).map_or(u32::MAX, |triangle| triangle.id);
                [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), id]
            });
            let named: Vec<_> = named.collect();
            match &first {
                None => first = Some(named),
                Some(expected) => {
                    let apart = expected.iter().zip(&named).filter(|(a, b)| a != b).count();
                    let method = plan.settings.method;
                    let what = format!("{}: {method} on {} with {intersector}", scene.path, geometry.builder);
                    assert_eq!(apart, 0, "{what}: so many of {} hits differ", named.len());
                }
            }
        }
    }
    let met = first.iter().flatten().filter(|hit| hit[3] != u32::MAX).count();
    assert!(met > 50, "{}: {met} rays met something", scene.path);
}

/// Every scene in assets/ (cornell and maison are procedural ones as well) and every procedural one.
#[test]
fn all_pairs_of_choices_count_the_same_rays() {
    with_device(|device| {
        for (name, triangles) in common::SCENES {
            counts_agree(device, &scene_named(name, triangles));
        }
    });
}

/// Each kernel that reads by device address, against the one that reads storage buffers.
#[test]
fn kernels_by_address_count_the_same_rays() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).expect("a tree");
        for method in [Method::Ordered, Method::Entry, Method::Postponed, Method::Wide] {
            for passes in [Passes::Single, Passes::Split] {
                let [by_buffer, by_address] = [Accessor::StorageBuffer, Accessor::Address].map(|accessor| {
                    let wishes = Wishes {
                        method: Some(method),
                        passes: Some(passes),
                        accessor: Some(accessor),
                        ..Wishes::default()
                    };
                    let plan = common::plan(device, &scene, &geometry, job(&scene, (72, 45), 0..16), wishes);
                    let traversing = plan.kernels.iter().filter(|kernel| kernel.nodes != NodeLayout::None);
                    let by_address: Vec<bool> = traversing.map(|kernel| kernel.by_address).collect();
                    let expected = if passes == Passes::Single { 1 } else { 2 };
                    assert_eq!(
                        by_address,
                        vec![accessor == Accessor::Address; expected],
                        "{method} {passes}"
                    );
                    run(device, &plan)
                });
                assert!(by_buffer.accumulated == by_address.accumulated, "{method} {passes}");
                assert_eq!(by_buffer.ambient_rays, by_address.ambient_rays, "{method} {passes}");
                assert_eq!((by_address.overflowed_rays, by_address.repeats), (0, 0), "{method} {passes}");
            }
        }
    });
}

/// Nodes in less room, by every accessor and intersector, against whole ones.
#[test]
fn compact_nodes_count_the_same_rays() {
    with_device(|device| {
        for (name, triangles) in common::SCENES {
            let scene = scene_named(name, triangles);
            let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).expect("a tree");
            // Any two of them together on maison, each of them on the others.
            let places = (0..9).map(|place| [place / 3, place % 3, (place / 3 + place) % 3]);
            for [a, b, c] in places.filter(|[a, b, _]| name == "maison" || a == b) {
                for method in [Method::Entry, Method::Postponed] {
                    let (passes, accessor, intersector) = (PASSES[a], ACCESSORS[b], INTERSECTORS[c]);
                    let wishes = Wishes {
                        method: Some(method),
                        passes: Some(passes),
                        accessor: Some(accessor),
                        intersector: Some(intersector),
                        ..Wishes::default()
                    };
                    let plan = common::plan(device, &scene, &geometry, job(&scene, SIZE, 0..16), wishes);
                    let [whole, compact] =
                        [(0, NodeLayout::Centred), (1, NodeLayout::Compact)].map(|(compact, layout)| {
                            let plan = plan.clone().with_constant(SPEC_COMPACT, compact);
                            assert_eq!(plan.node_layout(), layout);
                            run(device, &plan)
                        });
                    let what = format!("{name}, {method}, {passes}, {accessor}, {intersector}");
                    assert!(whole.accumulated == compact.accumulated, "{what}");
                    assert_eq!((compact.overflowed_rays, compact.repeats), (0, 0), "{what}");
                }
            }
        }
    });
}

/// Loops that do not ask whether the driver left them early, with little enough work that none does, against those that do.
#[test]
fn loops_that_need_no_proof_count_the_same_rays() {
    with_device(|device| {
        for (name, triangles) in [("cornell", None), ("maison", None), ("hairball", Some(2_000))] {
            let scene = scene_named(name, triangles);
            let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).expect("a tree");
            for (method, passes, accessor) in [
                (Method::Entry, Passes::Single, Accessor::StorageBuffer),
                (Method::Entry, Passes::Split, Accessor::StorageBuffer),
                (Method::Entry, Passes::Split, Accessor::Address),
                (Method::Brute, Passes::Split, Accessor::StorageBuffer),
                (Method::Brute, Passes::Split, Accessor::Address),
            ] {
                let wishes = Wishes {
                    method: Some(method),
                    passes: Some(passes),
                    accessor: Some(accessor),
                    ..Wishes::default()
                };
                let plan = common::plan(device, &scene, &geometry, job(&scene, SIZE, 0..4), wishes);
                let [with, without] =
                    [1, 0].map(|asks| run(device, &plan.clone().with_constant(SPEC_LEAVES_LOOPS, asks)));
                assert!(with.accumulated == without.accumulated, "{name}, {wishes:?}");
                assert_eq!((without.overflowed_rays, without.repeats), (0, 0), "{name}, {wishes:?}");
            }
        }
    });
}

#[test]
fn all_methods_and_builders_find_the_same_camera_hits() {
    with_device(|device| {
        for (name, triangles) in common::SCENES {
            camera_hits_agree(device, &scene_named(name, triangles));
        }
        for file in ["cornell.obj", "maison.obj"] {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(file);
            camera_hits_agree(device, &Scene::load(&path).unwrap());
        }
    });
}
