//! What the tests on a device share. A device that is not found fails them.

#![allow(dead_code)] // Each test binary uses its part.

use std::io::Cursor;

use cousu::render::auto::{self, Decision};
use cousu::render::builder;
use cousu::render::choices::{Accessor, Intersector, Method, Preset, Wishes};
use cousu::render::execute::{self, Outcome};
use cousu::render::geometry::Geometry;
use cousu::render::plan::{Job, Plan};
use cousu::render::rounds::Goal;
use cousu::scene::camera::Camera;
use cousu::scene::procedural::{self, Request};
use cousu::scene::{Mesh, Scene, obj};
use cousu::vk::{Adapter, Device, Instance};

/// Runs a test on the best device under the validation layer; afterwards nothing may be allocated and
/// the layer must have been silent.
pub fn with_device(test: impl FnOnce(&Device)) {
    let instance = Instance::new(true).expect("Vulkan with the validation layer");
    let adapters = instance.adapters().expect("a list of devices");
    let adapter = Adapter::choose(&adapters, None).expect("a usable device");
    let device = Device::open(&instance, adapter).expect("the device opens");
    test(&device);
    assert_eq!(device.allocations(), Vec::<String>::new(), "allocations leaked");
    drop(device);
    assert_eq!(instance.messages(), Vec::<String>::new(), "the validation layer spoke");
}

/// A scene from OBJ text.
pub fn scene_of(text: &str) -> Scene {
    let obj::Loaded { mesh, report } = obj::read(Cursor::new(text.to_string()), "test.obj").expect("a scene");
    scene_from(mesh, report)
}

/// Every procedural scene at test size.
pub const SCENES: [(&str, Option<u64>); 6] = [
    ("cornell", None),
    ("maison", None),
    ("arcade", Some(3000)),
    ("terrain", Some(5000)),
    ("hairball", Some(4000)),
    ("stadium", Some(3000)),
];

/// A procedural scene.
pub fn scene_named(name: &str, triangles: Option<u64>) -> Scene {
    let kind = procedural::find(name).expect("a scene of this name");
    let mesh = (kind.generate)(&Request { triangles, seed: 1 }).expect("the scene");
    let mut scene = scene_from(mesh, obj::Report::default());
    scene.path = format!("{name}.obj");
    scene
}

pub fn scene_from(mesh: Mesh, report: obj::Report) -> Scene {
    let (bounds, hash) = (mesh.bounds(), mesh.hash());
    Scene { path: "test.obj".into(), mesh, bounds, hash, report, load_ms: 0.0 }
}

/// A camera by its place.
pub fn pinhole(eye: [f64; 3], target: [f64; 3], up: [f64; 3], fov: f64) -> Camera {
    Camera::Pinhole { eye, target, up, fov }
}

/// A job of this size and these samples with the scene's default camera.
pub fn job(scene: &Scene, size: (u32, u32), samples: std::ops::Range<u32>) -> Job {
    Job {
        camera: Camera::default_for(&scene.path),
        size,
        samples,
        seed: 7,
        max_distance: None,
        jitters: 1,
        adaptive: false,
        goal: Goal::Samples,
        block: None,
    }
}

pub fn geometry(scene: &Scene, preset: Preset) -> Geometry {
    let builder = builder::choose_builder(&Wishes { preset: Some(preset), ..Wishes::default() });
    Geometry::build(scene, !preset.is_original(), builder, &|_| {}).expect("a tree")
}

pub fn plan<'a>(
    device: &Device,
    scene: &Scene,
    geometry: &'a Geometry,
    job: Job,
    wishes: Wishes,
) -> Plan<'a> {
    let decision = auto::decide(&wishes, geometry, device.adapter());
    plan_decided(device, scene, geometry, job, &decision)
}

pub fn plan_decided<'a>(
    device: &Device,
    scene: &Scene,
    geometry: &'a Geometry,
    job: Job,
    decision: &Decision,
) -> Plan<'a> {
    Plan::new(job, scene, geometry, decision, &device.adapter().limits).expect("a plan")
}

/// The tests against triangles, none of whose hits depend on method or tree.
pub const INTERSECTORS: [Intersector; 3] =
    [Intersector::Moller, Intersector::Watertight, Intersector::Conservative];

/// The same wishes with each method and accessor.
pub fn every_traversal(wishes: Wishes, geometry: &Geometry, device: &Device) -> Vec<Decision> {
    let mut decisions = Vec::new();
    for method in [
        Method::Brute,
        Method::Stack(geometry.stack_bound.max(1)),
        Method::Threaded,
        Method::SinglePush,
        Method::Ordered,
        Method::Entry,
        Method::Packet,
        Method::Postponed,
        Method::Wide,
        Method::Bundle,
    ] {
        for accessor in [Accessor::StorageBuffer, Accessor::TexelBuffer] {
            let decision =
                auto::decide(&Wishes { method: Some(method), ..wishes }, geometry, device.adapter());
            decisions.push(Decision { accessor, ..decision });
        }
    }
    decisions
}

pub fn run(device: &Device, plan: &Plan<'_>) -> Outcome {
    execute::run(device, plan, &mut |_| {}).expect("the render")
}
