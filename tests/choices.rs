//! What `auto` chooses on a GPU, and which nodes kernels read, from scene, picture and rays: devices are asked as if they were GPUs.

mod common;

use common::{job, plan_decided, scene_named, with_device};
use cousu::bvh::Builder;
use cousu::kernels::NodeLayout;
use cousu::render::auto;
use cousu::render::choices::{
    Accessor, Accumulator, Intersector, Method, Passes, Preset, Preview, Sampler, Wishes,
};
use cousu::render::geometry::Geometry;
use cousu::vk::DeviceKind;

const SIZE: (u32, u32) = (40, 25);

/// Compact nodes are taken where whole ones would not stay in a GPU's caches, and where rays visit many nodes.
#[test]
fn large_scenes_have_compact_nodes() {
    with_device(|device| {
        let scenes = [("terrain", 2_000), ("terrain", 50_000), ("terrain", 800_000), ("hairball", 100_000)];
        let [tiny, small, large, dense] = scenes.map(|(name, triangles)| {
            let scene = scene_named(name, Some(triangles));
            let geometry = Geometry::build(&scene, true, Builder::Midpoint, &|_| {}).expect("a tree");
            (scene, geometry)
        });
        for ((scene, geometry), method, passes, expected) in [
            (&small, Method::Entry, Passes::Single, NodeLayout::Compact),
            (&small, Method::Entry, Passes::Split, NodeLayout::Compact),
            (&tiny, Method::Entry, Passes::Split, NodeLayout::Centred),
            (&tiny, Method::Postponed, Passes::Single, NodeLayout::Centred),
            (&small, Method::Ordered, Passes::Single, NodeLayout::Pair),
            (&large, Method::Entry, Passes::Split, NodeLayout::Compact),
            (&dense, Method::Postponed, Passes::Split, NodeLayout::Compact),
            (&small, Method::Postponed, Passes::Split, NodeLayout::Centred),
            (&large, Method::Postponed, Passes::Split, NodeLayout::Compact),
            (&dense, Method::Packet, Passes::Split, NodeLayout::Pair),
        ] {
            let wishes = Wishes { method: Some(method), passes: Some(passes), ..Wishes::default() };
            let plan = common::plan(device, scene, geometry, job(scene, SIZE, 0..4), wishes);
            assert_eq!(plan.node_layout(), expected, "{method} {passes}");
        }
    });
}

/// The same device as if it were a GPU, with and without the feature.
#[test]
fn a_gpu_reads_by_address_where_it_has_the_kernels() {
    with_device(|device| {
        let scene = scene_named("maison", None);
        let geometry = Geometry::build(&scene, true, Builder::Sah, &|_| {}).expect("a tree");
        let mut gpu = device.adapter().clone();
        gpu.kind = DeviceKind::Discrete;
        let mut older = gpu.clone();
        older.features.retain(|(name, _)| *name != "buffer device address");
        let auto = Wishes::default();
        let original = Wishes { preset: Some(Preset::Original), ..auto };
        let staged = Wishes { passes: Some(Passes::Staged), ..auto };
        let asked = Wishes { method: Some(Method::Threaded), accessor: Some(Accessor::Address), ..auto };
        let limits = device.adapter().limits.loop_iterations;
        for loop_iterations in [None, Some(65_535)] {
            gpu.limits.loop_iterations = loop_iterations;
            let decision = auto::decide(&auto, &geometry, &gpu);
            assert_eq!(decision.leaves_loops, loop_iterations.is_some());
        }
        gpu.limits.loop_iterations = limits;
        for (adapter, wishes, accessor) in [
            (&gpu, auto, Accessor::Address),
            (&older, auto, Accessor::StorageBuffer),
            (&gpu, original, Accessor::StorageBuffer),
            (&gpu, staged, Accessor::StorageBuffer),
            (&gpu, asked, Accessor::StorageBuffer),
        ] {
            let decision = auto::decide(&wishes, &geometry, adapter);
            assert_eq!(decision.accessor, accessor, "{:?}", decision.reasons);
            let told = decision.reasons.iter().find(|reason| reason.what == "accessor").expect("a reason");
            assert_eq!(told.choice, accessor.name());
        }
        if device.adapter().kind == DeviceKind::Cpu {
            assert_ne!(auto::decide(&auto, &geometry, device.adapter()).accessor, Accessor::Address);
        }
    });
}

/// Faces with few edges are for `brute`, where many rays of any length leave a pixel, and passes follow from their number.
#[test]
fn a_gpu_s_method_and_passes_follow_from_the_rays() {
    with_device(|device| {
        let mut gpu = device.adapter().clone();
        gpu.kind = DeviceKind::Discrete;
        let few = Wishes { samples: Some(4), ..Wishes::default() };
        let fewer = Wishes { samples: Some(3), ..Wishes::default() };
        let with = |samples, camera_rays, steps| Wishes {
            samples: Some(samples),
            preview: Some(Preview { camera_rays, steps }),
            ..Wishes::default()
        };
        let bounded = Wishes { bounded: true, ..Wishes::default() };
        let moller = Wishes { intersector: Some(Intersector::Moller), ..Wishes::default() };
        let lcg = Wishes { sampler: Some(Sampler::Lcg), ..Wishes::default() };
        let brute = Wishes { method: Some(Method::Brute), ..Wishes::default() };
        let brute_moller = Wishes { method: Some(Method::Brute), ..moller };
        let single = Wishes { passes: Some(Passes::Single), ..Wishes::default() };
        let floats = Wishes { accumulator: Some(Accumulator::Rgba32f), ..Wishes::default() };
        let by_buffers = Wishes { accessor: Some(Accessor::StorageBuffer), ..Wishes::default() };
        let few_split = Wishes { passes: Some(Passes::Split), ..few };
        let scenes = [
            ("large", "terrain", Some(3_200_000), Builder::Midpoint),
            ("terrain", "terrain", Some(800_000), Builder::Midpoint),
            ("cornell", "cornell", None, Builder::Midpoint),
            ("maison", "maison", None, Builder::Midpoint),
            ("hairball", "hairball", Some(20_000), Builder::Midpoint),
            ("tidy hairball", "hairball", Some(20_000), Builder::Sah),
        ];
        let scenes = scenes.map(|(label, name, triangles, builder)| {
            let scene = scene_named(name, triangles);
            let geometry = Geometry::build(&scene, true, builder, &|_| {}).expect("a tree");
            (label, geometry)
        });
        for (name, least, most) in
            [("hairball", 100.0, 200.0), ("tidy hairball", 75.0, 100.0), ("maison", 0.0, 75.0)]
        {
            let (_, geometry) = scenes.iter().find(|(known, _)| *known == name).expect("one of them");
            let cost = geometry.quality().sah_cost;
            assert!((least..most).contains(&cost), "{name} has another SAH cost, {cost}");
        }
        for (name, wishes, method, passes) in [
            ("large", fewer, Method::Wide, Passes::Single),
            ("large", few, Method::Entry, Passes::Split),
            ("large", with(4, 400_000, 10), Method::Entry, Passes::Single),
            ("large", with(4, 400_000, 37), Method::Entry, Passes::Split),
            ("large", Wishes { passes: Some(Passes::Single), ..few }, Method::Wide, Passes::Single),
            ("large", few_split, Method::Entry, Passes::Split),
            ("large", Wishes::default(), Method::Entry, Passes::Split),
            ("terrain", few, Method::Entry, Passes::Split),
            ("cornell", Wishes::default(), Method::Brute, Passes::Split),
            ("cornell", few, Method::Entry, Passes::Split),
            ("cornell", with(4, 400_000, 8), Method::Entry, Passes::Single),
            // 66 edges.
            ("cornell", with(64, 400_000, 1), Method::Brute, Passes::Split),
            ("cornell", with(64, 400_000, 0), Method::Entry, Passes::Split),
            ("cornell", with(64, 100_000, 1), Method::Brute, Passes::Split),
            ("cornell", with(64, 99_999, 7), Method::Entry, Passes::Split),
            ("cornell", with(64, 99_999, 8), Method::Brute, Passes::Split),
            ("cornell", with(32, 400_000, 7), Method::Brute, Passes::Split),
            ("cornell", with(31, 400_000, 7), Method::Entry, Passes::Single),
            ("cornell", with(31, 400_000, 8), Method::Brute, Passes::Split),
            ("cornell", with(8, 400_000, 8), Method::Brute, Passes::Split),
            ("cornell", with(7, 400_000, 11), Method::Entry, Passes::Single),
            ("cornell", bounded, Method::Entry, Passes::Split),
            ("cornell", moller, Method::Entry, Passes::Split),
            ("cornell", lcg, Method::Entry, Passes::Split),
            (
                "maison",
                Wishes { sampler: Some(Sampler::Lcg), ..with(64, 160_000, 10) },
                Method::Entry,
                Passes::Single,
            ),
            (
                "maison",
                Wishes { sampler: Some(Sampler::Lcg), ..with(64, 159_999, 10) },
                Method::Entry,
                Passes::Split,
            ),
            (
                "maison",
                Wishes { sampler: Some(Sampler::Lcg), ..with(64, 700_000, 11) },
                Method::Entry,
                Passes::Split,
            ),
            ("hairball", lcg, Method::Entry, Passes::Split),
            ("maison", floats, Method::Entry, Passes::Single),
            (
                "maison",
                Wishes { accumulator: floats.accumulator, ..with(64, 80_000, 90) },
                Method::Entry,
                Passes::Single,
            ),
            (
                "maison",
                Wishes { accumulator: floats.accumulator, ..with(64, 79_999, 9) },
                Method::Entry,
                Passes::Split,
            ),
            (
                "hairball",
                Wishes { accumulator: floats.accumulator, ..with(64, 79_999, 90) },
                Method::Entry,
                Passes::Split,
            ),
            ("maison", Wishes::default(), Method::Entry, Passes::Split),
            ("maison", fewer, Method::Entry, Passes::Single),
            ("maison", with(3, 10, 90), Method::Entry, Passes::Single),
            ("maison", with(4, 50_000, 19), Method::Entry, Passes::Single),
            ("maison", with(4, 49_999, 19), Method::Entry, Passes::Split),
            ("maison", with(4, 50_000, 20), Method::Entry, Passes::Split),
            ("maison", with(8, 1, 10), Method::Entry, Passes::Single),
            ("maison", with(8, 99_999, 11), Method::Entry, Passes::Split),
            ("maison", with(9, 22_500, 10), Method::Entry, Passes::Single),
            ("maison", with(9, 22_499, 10), Method::Entry, Passes::Split),
            ("maison", with(9, 22_500, 11), Method::Entry, Passes::Split),
            ("maison", with(31, 1, 2), Method::Entry, Passes::Single),
            ("maison", with(31, 77_499, 3), Method::Entry, Passes::Split),
            ("maison", with(31, 387_500, 19), Method::Entry, Passes::Single),
            ("maison", with(31, 387_499, 19), Method::Entry, Passes::Split),
            ("maison", with(32, 1_000_000, 5), Method::Entry, Passes::Split),
            ("hairball", Wishes::default(), Method::Entry, Passes::Split),
            ("hairball", few, Method::Entry, Passes::Split),
            ("hairball", fewer, Method::Postponed, Passes::Single),
            ("hairball", single, Method::Postponed, Passes::Single),
            ("hairball", by_buffers, Method::Postponed, Passes::Split),
            ("hairball", with(8, 400_000, 10), Method::Postponed, Passes::Single),
            ("hairball", with(8, 400_000, 90), Method::Entry, Passes::Split),
            ("hairball", floats, Method::Postponed, Passes::Single),
            ("cornell", brute_moller, Method::Brute, Passes::Single),
            ("cornell", brute, Method::Brute, Passes::Split),
        ] {
            let (_, geometry) = scenes.iter().find(|(known, _)| *known == name).expect("one of them");
            let settings = auto::decide(&wishes, geometry, &gpu).settings;
            assert_eq!((settings.method, settings.passes), (method, passes), "{name} {wishes:?}");
        }
        let (_, maison) = scenes.iter().find(|(known, _)| *known == "maison").expect("one of them");
        for (wishes, told) in [
            (with(4, 123_456, 21), "about 21 steps, at least 20,"),
            (with(4, 34_567, 17), "about 34567 camera rays meet the scene, fewer than 50000:"),
            (with(8, 123_456, 17), "about 123456 camera rays meet the scene, at least 100000,"),
            (with(8, 56, 7), "8 rays of about 7 steps, fewer than 11,"),
        ] {
            let reasons = auto::decide(&wishes, maison, &gpu).reasons;
            let reason = reasons.iter().find(|reason| reason.what == "passes").expect("a reason");
            assert!(reason.why.contains(told), "{}", reason.why);
        }
        // Where lanes cannot take over each other's work.
        gpu.features.retain(|(name, _)| *name != "buffer device address");
        for (name, wishes, method, passes) in [
            ("hairball", Wishes::default(), Method::Postponed, Passes::Split),
            ("hairball", few, Method::Postponed, Passes::Split),
            ("large", few, Method::Wide, Passes::Single),
            ("maison", with(4, 50_000, 49), Method::Entry, Passes::Single),
            ("maison", with(4, 50_000, 50), Method::Entry, Passes::Split),
            ("maison", with(8, 100_000, 19), Method::Entry, Passes::Single),
            ("maison", with(8, 100_000, 20), Method::Entry, Passes::Split),
            ("maison", few, Method::Entry, Passes::Split),
        ] {
            let (_, geometry) = scenes.iter().find(|(known, _)| *known == name).expect("one of them");
            let settings = auto::decide(&wishes, geometry, &gpu).settings;
            assert_eq!((settings.method, settings.passes), (method, passes), "{name} {wishes:?}");
        }
    });
}

/// Short walks of many pixels share a surface among fewer invocations, where lanes take over each other's work.
#[test]
fn a_gpu_s_lanes_follow_from_the_rays() {
    with_device(|device| {
        let mut gpu = device.adapter().clone();
        gpu.kind = DeviceKind::Discrete;
        gpu.limits.loop_iterations = None;
        let scene = scene_named("maison", None);
        let geometry = Geometry::build(&scene, true, Builder::Midpoint, &|_| {}).expect("a tree");
        let auto = Wishes::default();
        let (entry, split) = (Some(Method::Entry), Some(Passes::Split));
        for (wishes, samples, camera_rays, steps, lanes, told) in [
            (auto, 64, 300_000, 9, 2, true),
            (auto, 64, 299_999, 9, 4, true),
            (auto, 64, 300_000, 10, 4, true),
            (auto, 64, 149_999, 9, 8, false),
            (auto, 64, 150_000, 19, 4, true),
            (auto, 64, u64::MAX, 19, 4, true),
            (auto, 64, u64::MAX, 20, 8, false),
            (auto, 32, 300_000, 9, 2, true),
            (auto, 31, 300_000, 9, 1, false),
            // They are no more anyway.
            (auto, 63, u64::MAX, 19, 4, false),
            (auto, 64, 0, 0, 8, false),
            (
                Wishes { sampler: Some(Sampler::Lcg), method: entry, passes: split, ..auto },
                64,
                300_000,
                9,
                1,
                false,
            ),
            (
                Wishes { accumulator: Some(Accumulator::Rgba32f), method: entry, passes: split, ..auto },
                64,
                300_000,
                9,
                1,
                false,
            ),
            (Wishes { accessor: Some(Accessor::StorageBuffer), ..auto }, 64, 300_000, 9, 8, false),
            (Wishes { method: Some(Method::Ordered), ..auto }, 64, 300_000, 9, 8, false),
            (Wishes { passes: Some(Passes::Single), ..auto }, 64, 300_000, 9, 1, false),
        ] {
            let preview = Some(Preview { camera_rays, steps });
            let decision =
                auto::decide(&Wishes { samples: Some(samples), preview, ..wishes }, &geometry, &gpu);
            let what = format!("{wishes:?}, {samples} samples, {camera_rays} camera rays, {steps} steps");
            let plan = plan_decided(device, &scene, &geometry, job(&scene, SIZE, 0..samples), &decision);
            assert_eq!(plan.sample_lanes(), lanes, "{what}");
            let reason = decision.reasons.iter().find(|reason| reason.what == "sample lanes");
            assert_eq!(reason.map(|reason| reason.choice.clone()), told.then(|| lanes.to_string()), "{what}");
        }
        let unknown = auto::decide(&auto, &geometry, &gpu);
        assert_eq!(unknown.sample_lanes, 8);
        gpu.limits.loop_iterations = Some(65_535);
        let preview = Some(Preview { camera_rays: 300_000, steps: 9 });
        let narrow = auto::decide(&Wishes { samples: Some(64), preview, ..auto }, &geometry, &gpu);
        assert_eq!(narrow.sample_lanes, 1);
        assert!(narrow.reasons.iter().all(|reason| reason.what != "sample lanes"));
    });
}
