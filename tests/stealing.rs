//! Lanes that take over each other's rays (`entry` by address, `split`) count what each lane counts that walks its own: any set of samples, numbers and
//! intersector.

mod common;

use common::{INTERSECTORS, geometry, job, pinhole, plan, run, scene_named, scene_of, with_device};
use cousu::kernels::NodeLayout;
use cousu::layout::{SPEC_LEAVES_LOOPS, SPEC_SAMPLE_LANES};
use cousu::render::choices::{Accessor, Accumulator, Method, Offset, Passes, Preset, Sampler, Slabs, Wishes};
use cousu::render::execute::Outcome;
use cousu::render::plan::Job;
use cousu::scene::Scene;
use cousu::vk::Device;

const SIZE: (u32, u32) = (33, 21);

/// The same render by lanes that walk their own rays, and by those that take over others', with so many lanes for a pixel: with several, rays of more than one batch
/// are under way. `camera`: camera rays, too.
fn alone_and_together(
    device: &Device,
    scene: &Scene,
    job: &Job,
    wishes: Wishes,
    lanes: Option<u32>,
    camera: bool,
) -> [Outcome; 2] {
    let geometry = geometry(scene, wishes.preset.unwrap_or(Preset::Auto));
    [Accessor::StorageBuffer, Accessor::Address].map(|accessor| {
        let wishes = Wishes {
            method: Some(Method::Entry),
            passes: Some(Passes::Split),
            accessor: Some(accessor),
            ..wishes
        };
        let plan = plan(device, scene, &geometry, job.clone(), wishes);
        let plan = match lanes {
            Some(lanes) if accessor == Accessor::Address => plan.with_constant(SPEC_SAMPLE_LANES, lanes),
            _ => plan,
        };
        // Camera rays are taken over only where no driver leaves loops.
        let plan = if camera { plan.with_constant(SPEC_LEAVES_LOOPS, 0) } else { plan };
        let steals = plan.kernels.iter().any(|kernel| kernel.name == "ambient_list/entry/address");
        assert_eq!(steals, accessor == Accessor::Address);
        assert!(matches!(plan.node_layout(), NodeLayout::Centred | NodeLayout::Compact));
        run(device, &plan)
    })
}

fn agree(device: &Device, scene: &Scene, job: Job, wishes: Wishes) {
    // Sums of floats and states that step need a lane of their own for each pixel.
    let shares = wishes.accumulator.is_none_or(|sum| sum == Accumulator::Count)
        && wishes.sampler != Some(Sampler::Lcg)
        && !wishes.preset.is_some_and(Preset::is_original);
    for (lanes, camera) in [(None, false), (None, true), (Some(2), false), (Some(8), true)] {
        if lanes.is_some() && !shares {
            continue;
        }
        let [alone, together] = alone_and_together(device, scene, &job, wishes, lanes, camera);
        let what = format!("{}, {:?}, {wishes:?}, {lanes:?} lanes, {camera}", scene.path, job.samples);
        assert!(alone.accumulated == together.accumulated, "{what}");
        assert_eq!(alone.primary_rays, together.primary_rays, "{what}");
        assert_eq!(alone.ambient_rays, together.ambient_rays, "{what}");
        assert!(together.ambient_rays > 0, "{what}");
        assert_eq!((together.overflowed_rays, together.repeats), (0, 0), "{what}");
    }
}

/// One ray, more than a word's bits of them, and sets that begin anywhere.
#[test]
fn any_number_of_samples() {
    with_device(|device| {
        for (name, triangles) in [("hairball", Some(4000)), ("maison", None), ("arcade", Some(3000))] {
            let scene = scene_named(name, triangles);
            for samples in [0..1, 0..4, 3..8, 0..31, 0..33, 5..70, 0..256] {
                agree(device, &scene, job(&scene, SIZE, samples), Wishes::default());
            }
            let long = Job { block: Some(256), ..job(&scene, SIZE, 0..256) };
            agree(device, &scene, long, Wishes::default());
            let adaptive = Job { adaptive: true, ..job(&scene, SIZE, 0..32) };
            agree(device, &scene, adaptive, Wishes::default());
            let jittered = Job { jitters: 3, ..job(&scene, SIZE, 0..8) };
            agree(device, &scene, jittered, Wishes::default());
        }
    });
}

#[test]
fn any_choice() {
    with_device(|device| {
        let auto = Wishes::default();
        for (name, triangles) in [("hairball", Some(4000)), ("maison", None)] {
            let scene = scene_named(name, triangles);
            for intersector in INTERSECTORS {
                for max_distance in [None, Some(0.3)] {
                    let job = Job { max_distance, ..job(&scene, SIZE, 0..12) };
                    agree(device, &scene, job, Wishes { intersector: Some(intersector), ..auto });
                }
            }
            for sampler in [Sampler::Lcg, Sampler::Pcg, Sampler::Strata, Sampler::Philox] {
                for accumulator in [Accumulator::Count, Accumulator::Rgba32f, Accumulator::Rgba8] {
                    let wishes = Wishes { sampler: Some(sampler), accumulator: Some(accumulator), ..auto };
                    agree(device, &scene, job(&scene, SIZE, 0..40), wishes);
                }
            }
            for wishes in [
                Wishes { slabs: Some(Slabs::Plain), ..auto },
                Wishes { offset: Some(Offset::Fixed), ..auto },
                Wishes { preset: Some(Preset::Original), ..auto },
                Wishes { preset: Some(Preset::OriginalUnbiased), ..auto },
            ] {
                agree(device, &scene, job(&scene, SIZE, 0..40), wishes);
            }
        }
    });
}

/// Stacks of crossing needles: walks of very different lengths, that graze edges.
fn needles() -> Scene {
    let mut text = String::from("v -4 -1 -4\nv 4 -1 -4\nv 0 -1 8\nf 1 2 3\n");
    for i in 0..400 {
        let (x, z) = (f64::from(i % 20) / 10.0 - 1.0, f64::from(i / 20) / 10.0 - 1.0);
        text += &format!("v {x} -1 {z}\nv {x} 1 {z}\nv {} 1 {z}\nf -3 -2 -1\n", x + 1e-6);
        text += &format!("v {x} -1 {z}\nv {x} 1 {z}\nv {x} 1 {}\nf -3 -2 -1\n", z + 0.1);
    }
    scene_of(&text)
}

/// Many a ray is not sure until the exact test at the end.
#[test]
fn rays_along_edges() {
    let scene = needles();
    with_device(|device| {
        let geometry = geometry(&scene, Preset::Auto);
        for intersector in INTERSECTORS {
            let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
            let job = job(&scene, (64, 40), 0..32);
            agree(device, &scene, job.clone(), wishes);
            // Another method, whose every test is exact.
            let exact = Wishes { method: Some(Method::Ordered), passes: Some(Passes::Single), ..wishes };
            let exact = run(device, &plan(device, &scene, &geometry, job.clone(), exact));
            let [_, together] = alone_and_together(device, &scene, &job, wishes, Some(4), false);
            assert!(exact.accumulated == together.accumulated, "{intersector}");
        }
    });
}

/// Triangles of all slopes whose first corner is the origin: the ray that comes down on it meets all of them there, at one distance.
fn fan(stride: u32) -> Scene {
    let mut text = String::from("v 0 0 0\n");
    for i in 0..1500 {
        let angle = f64::from(i * stride % 1500) / 1500.0 * std::f64::consts::TAU;
        let (x, y, rise) = (angle.cos(), angle.sin(), f64::from(i * 11 % 13) / 8.0 - 1.0);
        text += &format!("v {x} {y} {rise}\nv {} {} {}\nf 1 -2 -1\n", x - 0.1 * y, y + 0.1 * x, rise / 2.0);
    }
    scene_of(&text)
}

/// Of many hits at one distance that of the smallest number counts, whoever found it.
#[test]
fn equal_distances() {
    with_device(|device| {
        for stride in [7, 11, 13, 17, 19, 23] {
            let scene = fan(stride);
            let camera = pinhole([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.001);
            let job = Job { camera, ..job(&scene, (9, 9), 0..64) };
            for intersector in INTERSECTORS {
                let wishes = Wishes { intersector: Some(intersector), ..Wishes::default() };
                let [alone, together] = alone_and_together(device, &scene, &job, wishes, None, true);
                assert!(alone.accumulated == together.accumulated, "{stride}, {intersector}");
            }
        }
    });
}

/// Camera rays, which lanes take over from each other where no driver leaves loops: they are asked for here as on such a device. Other methods meet the same points, from which
/// the same ambient rays go.
#[test]
fn closest_hits() {
    let mut sheets = String::new();
    for i in 0..200 {
        let (x, y, z) = (f64::from(i % 20) - 10.0, f64::from(i / 20) - 5.0, f64::from(i * 7 % 11));
        sheets += &format!(
            "v {x} {y} {z}\nv {} {y} {z}\nv {x} {} {}\nf -3 -2 -1\nf -2 -1 -3\n",
            x + 3.0,
            y + 3.0,
            z + 1.0
        );
    }
    let scenes = [
        scene_named("cornell", None),
        scene_named("maison", None),
        scene_named("hairball", Some(4000)),
        scene_named("terrain", Some(20_000)),
        needles(),
        scene_of(&sheets),
    ];
    with_device(|device| {
        for scene in &scenes {
            let geometry = geometry(scene, Preset::Auto);
            for intersector in INTERSECTORS {
                for jitters in [1, 3] {
                    let job = Job { jitters, ..job(scene, (131, 77), 0..6) };
                    let wishes = Wishes {
                        method: Some(Method::Entry),
                        passes: Some(Passes::Split),
                        accessor: Some(Accessor::Address),
                        intersector: Some(intersector),
                        ..Wishes::default()
                    };
                    let together = plan(device, scene, &geometry, job.clone(), wishes);
                    assert!(together.kernels.iter().any(|kernel| kernel.name == "primary/entry/address"));
                    let together = run(device, &together.with_constant(SPEC_LEAVES_LOOPS, 0));
                    let alone = Wishes {
                        method: Some(Method::Threaded),
                        passes: Some(Passes::Single),
                        accessor: None,
                        ..wishes
                    };
                    let alone = run(device, &plan(device, scene, &geometry, job, alone));
                    let what = format!("{}, {intersector}, {jitters} jitters", scene.path);
                    assert!(alone.accumulated == together.accumulated, "{what}");
                    assert_eq!(alone.ambient_rays, together.ambient_rays, "{what}");
                    assert!(together.ambient_rays > 0, "{what}");
                    assert_eq!((together.overflowed_rays, together.repeats), (0, 0), "{what}");
                }
            }
        }
    });
}
