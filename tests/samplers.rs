//! Samplers on a device against the shaders' twin.

mod common;

use std::ops::Range;

use common::{geometry, job, plan, run, scene_named, with_device};
use cousu::layout::{NO_HIT, RayRecord};
use cousu::reference;
use cousu::render::choices::{Offset, Passes, Preset, Sampler, Wishes};
use cousu::render::picture::Accumulated;
use cousu::render::plan::Job;
use cousu::render::raylist::{Query, RayLists};
use cousu::render::twin::Twin;

const SAMPLERS: [Sampler; 4] = [Sampler::Pcg, Sampler::Sobol, Sampler::Strata, Sampler::Philox];

/// Rays as lists, bit by bit: of the first samples, of sets of many sizes, of sample numbers up to the last.
#[test]
fn the_device_draws_the_numbers_of_the_twin() {
    let far = 1 << 30;
    let sets: [(Range<u32>, &[u32]); 12] = [
        (0..1, &[0]),
        (0..2, &[0, 1]),
        (4..8, &[4, 5, 6, 7]),
        (0..8, &[0, 3, 6, 7]),
        (48..64, &[48, 51, 63]),
        (0..32, &[0, 15, 16, 31]),
        (0..100, &[0, 63, 64, 97, 98, 99]),
        (3..12, &[3, 4, 10, 11]),
        (0..64, &[0, 1, 31, 62, 63]),
        (7..4106, &[7, 8, 1000, 4105]),
        (far + 5..far + 70_000, &[far + 5, far + 6, far + 66_666]),
        (0..u32::MAX, &[0, 1 << 17, (1 << 25) + 1, u32::MAX - 1]),
    ];
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        for sampler in SAMPLERS {
            for (set, samples) in &sets {
                let wishes = Wishes { sampler: Some(sampler), ..Wishes::default() };
                let plan = plan(device, &scene, &geometry, job(&scene, (40, 25), set.clone()), wishes);
                let lists = RayLists::new(device, &plan).unwrap();
                let hits = lists.trace(Query::Closest, &lists.camera_rays().unwrap()).unwrap();
                let twin = Twin::new(&plan);
                for &sample in *samples {
                    let rays = lists.ambient_rays(&hits, sample).unwrap();
                    let expected = reference::ambient_rays(&twin.inputs(&plan), &hits, sample, set);
                    for (pixel, (ray, twin)) in rays.iter().zip(&expected).enumerate() {
                        let what = || format!("{sampler}: pixel {pixel}, sample {sample} of {set:?}");
                        assert_eq!((bits(ray), ray.t_max), (bits(twin), twin.t_max), "{}", what());
                    }
                }
            }
        }
    });
}

/// A plan that is given other samples takes them in their own order.
#[test]
fn a_plan_with_other_samples_draws_as_one_made_for_them() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let [many, few] = [0..64, 0..16].map(|set| job(&scene, (40, 25), set));
        let wishes = Wishes { sampler: Some(Sampler::Sobol), ..Wishes::default() };
        let made = plan(device, &scene, &geometry, few.clone(), wishes);
        let given = plan(device, &scene, &geometry, many, wishes).with_job(few);
        let [made, given] = [made, given].map(|plan| {
            let lists = RayLists::new(device, &plan).unwrap();
            let hits = lists.trace(Query::Closest, &lists.camera_rays().unwrap()).unwrap();
            lists.ambient_rays(&hits, 5).unwrap().iter().map(bits).collect::<Vec<_>>()
        });
        assert_eq!(made, given);
    });
}

/// Rays that start some ulps off their surface, bit by bit.
#[test]
fn the_device_starts_rays_where_the_twin_does() {
    with_device(|device| {
        for (name, triangles) in common::SCENES {
            let scene = scene_named(name, triangles);
            for preset in [Preset::Auto, Preset::OriginalUnbiased] {
                let geometry = geometry(&scene, preset);
                let wishes = Wishes { preset: Some(preset), offset: Some(Offset::Ulp), ..Wishes::default() };
                let plan = plan(device, &scene, &geometry, job(&scene, (101, 67), 0..4), wishes);
                let lists = RayLists::new(device, &plan).unwrap();
                let hits = lists.trace(Query::Closest, &lists.camera_rays().unwrap()).unwrap();
                let rays = lists.ambient_rays(&hits, 1).unwrap();
                let twin = Twin::new(&plan);
                let expected = reference::ambient_rays(&twin.inputs(&plan), &hits, 1, &(0..4));
                assert!(hits.iter().filter(|hit| hit.index != NO_HIT).count() > 500, "{name}");
                for (pixel, (ray, twin)) in rays.iter().zip(&expected).enumerate() {
                    assert_eq!(bits(ray), bits(twin), "{name} {preset}, pixel {pixel}");
                }
            }
        }
    });
}

fn bits(ray: &RayRecord) -> [[u32; 3]; 2] {
    [ray.origin.map(f32::to_bits), ray.direction.map(f32::to_bits)]
}

/// Counts in blocks of samples, which know of the whole set, from a sample number that is far and odd.
#[test]
fn blocks_and_passes_keep_to_one_set() {
    let far = (1 << 30) + 1;
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        for sampler in SAMPLERS {
            for passes in [Passes::Single, Passes::Split, Passes::Staged] {
                let wishes = Wishes { sampler: Some(sampler), passes: Some(passes), ..Wishes::default() };
                let job = Job { block: Some(3), ..job(&scene, (40, 25), far..far + 11) };
                let plan = plan(device, &scene, &geometry, job, wishes);
                let Accumulated::Counts(counts) = run(device, &plan).accumulated else { panic!("counts") };
                let expected = reference::render_counts(&Twin::new(&plan).inputs(&plan), far..far + 11, None);
                assert!(counts == expected.counts, "{sampler} {passes}");
            }
        }
    });
}
