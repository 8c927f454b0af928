//! `brute` finds the edges of whole faces once for many rays (shaders/traverse/edges.glsl); what it says of each ray is
//! what the exact test says.

mod common;

use std::fmt::Write as _;

use common::{geometry, job, pinhole, plan_decided, run, scene_of, with_device};
use cousu::layout::SPEC_SAMPLE_LANES;
use cousu::pack;
use cousu::render::auto::{self, Decision};
use cousu::render::choices::{Accessor, Accumulator, Intersector, Method, Passes, Preset, Sampler, Wishes};
use cousu::render::picture::Picture;
use cousu::render::plan::Job;
use cousu::render::rounds::Goal;
use cousu::scene::Scene;
use cousu::vk::Device;
use glam::{DMat3, DQuat, DVec3};

/// Numbers from 0 to 1, the same each time.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }

    fn turn(&mut self) -> DMat3 {
        let axis = self.point().normalize_or(DVec3::X);
        DMat3::from_quat(DQuat::from_axis_angle(axis, 6.0 * self.next()))
    }
}

#[derive(Default)]
struct Text {
    corners: usize,
    text: String,
}

impl Text {
    fn polygon(&mut self, corners: &[DVec3]) {
        for corner in corners {
            writeln!(self.text, "v {} {} {}", corner.x, corner.y, corner.z).expect("text grows");
        }
        let numbers: Vec<_> = (1..=corners.len()).map(|i| (self.corners + i).to_string()).collect();
        writeln!(self.text, "f {}", numbers.join(" ")).expect("text grows");
        self.corners += corners.len();
    }

    fn cuboid(&mut self, centre: DVec3, half: DVec3, turn: DMat3) {
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let corner = |u: f64, v: f64| {
                    let mut at = DVec3::ZERO;
                    at[axis] = side * half[axis];
                    at[(axis + 1) % 3] = u * half[(axis + 1) % 3];
                    at[(axis + 2) % 3] = v * half[(axis + 2) % 3];
                    centre + turn * at
                };
                self.polygon(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
            }
        }
    }
}

/// Bars and slabs up to a thousand times as long as thick, through one another, in a room.
fn bars(seed: u64) -> Scene {
    let mut chance = Chance(seed);
    let mut text = Text::default();
    text.cuboid(DVec3::ZERO, DVec3::splat(1.5), DMat3::IDENTITY);
    for i in 0..8 {
        let thin = [0.3, 0.05, 0.001][i % 3];
        let half = DVec3::new(1.0, thin, if i % 2 == 0 { thin } else { 0.4 });
        let (centre, turn) = (chance.point(), chance.turn());
        text.cuboid(centre, half, turn);
    }
    scene_of(&text.text)
}

/// Trapezoids, kites, pyramids and long slivers, of all sizes.
fn odd_faces(seed: u64) -> Scene {
    let mut chance = Chance(seed);
    let mut text = Text::default();
    for i in 0..40 {
        let (centre, turn) = (chance.point(), chance.turn());
        let size = 10f64.powf(-2.0 * chance.next());
        let at = |u: f64, v: f64| centre + turn * DVec3::new(u * size, v * size, 0.0);
        let (p, q) = (chance.next(), chance.next());
        match i % 4 {
            0 => text.polygon(&[at(-1.0, 0.0), at(1.0, 0.0), at(p, 1.0), at(p - q, 1.0)]),
            1 => text.polygon(&[at(-1.0, 0.0), at(0.0, -p), at(1.0 + q, 0.0), at(0.0, p)]),
            2 => text.polygon(&[at(-1.0, 0.0), at(1.0, 0.0), at(p, 1e-3)]),
            _ => {
                let apex = centre + turn * DVec3::new(0.0, 0.0, size);
                for corner in 0..4 {
                    let angle = |corner: i32| std::f64::consts::FRAC_PI_2 * f64::from(corner);
                    let foot = |corner: i32| at(angle(corner).cos(), angle(corner).sin());
                    text.polygon(&[foot(corner), foot(corner + 1), apex]);
                }
            }
        }
    }
    scene_of(&text.text)
}

/// A floor of tiles in one plane, walls upright on their edges, and tiles that lie on tiles.
fn tiles() -> Scene {
    let mut text = Text::default();
    let at = |x: i32, y: f64, z: i32| DVec3::new(f64::from(x) / 3.0, y, f64::from(z) / 3.0);
    for (x, z) in (-3..3).flat_map(|x| (-3..3).map(move |z| (x, z))) {
        text.polygon(&[at(x, 0.0, z), at(x, 0.0, z + 1), at(x + 1, 0.0, z + 1), at(x + 1, 0.0, z)]);
        if (x + z) % 3 == 0 {
            text.polygon(&[at(x, 0.0, z), at(x + 1, 0.0, z), at(x + 1, 0.4, z), at(x, 0.4, z)]);
        }
        if (x - z) % 4 == 0 {
            text.polygon(&[at(x, 0.0, z), at(x + 1, 0.0, z), at(x + 1, 0.0, z + 1)]);
        }
    }
    scene_of(&text.text)
}

fn decision(
    device: &Device,
    scene_geometry: &cousu::render::geometry::Geometry,
    method: Method,
    passes: Passes,
    sampler: Sampler,
) -> Decision {
    let wishes = Wishes {
        method: Some(method),
        passes: Some(passes),
        sampler: Some(sampler),
        intersector: Some(Intersector::Conservative),
        ..Wishes::default()
    };
    let decision = auto::decide(&wishes, scene_geometry, device.adapter());
    Decision { accessor: Accessor::StorageBuffer, ..decision }
}

#[test]
fn faces_occlude_the_rays_that_their_triangles_do() {
    with_device(|device| {
        let scenes = [bars(1), bars(2), odd_faces(3), odd_faces(4), tiles()];
        for (number, scene) in scenes.iter().enumerate() {
            let geometry = geometry(scene, Preset::Auto);
            let pairs = pack::pairs(geometry.corners(&scene.mesh));
            assert!(
                pack::edges_of(&pairs) > 3 * pairs.len() as u32,
                "scene {number} has no face with four edges"
            );
            for (sampler, max_distance, samples) in
                [(Sampler::Sobol, None, 64), (Sampler::Pcg, None, 21), (Sampler::Pcg, Some(0.7), 16)]
            {
                let mut job = Job { max_distance, ..job(scene, (72, 45), 0..samples) };
                // Within the room of bars.
                job.camera = pinhole([1.3, 1.1, 1.2], [0.0; 3], [0.0, 1.0, 0.0], 80.0);
                let exact = decision(device, &geometry, Method::Threaded, Passes::Single, sampler);
                let exact = run(device, &plan_decided(device, scene, &geometry, job.clone(), &exact));
                assert!(exact.ambient_rays > 1_000, "scene {number}: the camera sees too little");
                let ways = [
                    (1, Accessor::StorageBuffer),
                    (1, Accessor::Address),
                    (2, Accessor::StorageBuffer),
                    (8, Accessor::Address),
                ];
                for (lanes, accessor) in ways {
                    let brute = decision(device, &geometry, Method::Brute, Passes::Split, sampler);
                    let brute = Decision { accessor, ..brute };
                    let plan = plan_decided(device, scene, &geometry, job.clone(), &brute);
                    let names = [0, 2].map(|step| plan.kernels[step].name);
                    assert_eq!(
                        names,
                        ["primary", "ambient_list"].map(|step| format!("{step}/brute/{accessor}"))
                    );
                    assert!(plan.faces.is_some(), "faces are not packed");
                    let plan = plan.with_constant(SPEC_SAMPLE_LANES, lanes);
                    let outcome = run(device, &plan);
                    let what =
                        format!("scene {number}, {sampler:?}, {max_distance:?}, {lanes} lanes, {accessor}");
                    assert_eq!(
                        (outcome.ambient_rays, outcome.overflowed_rays),
                        (exact.ambient_rays, 0),
                        "{what}"
                    );
                    assert!(outcome.accumulated == exact.accumulated, "{what}");
                }
            }
        }
    });
}

/// Sums of floats and bytes weigh each escaped ray as counts do.
#[test]
fn running_means_are_those_of_the_triangles() {
    with_device(|device| {
        let scene = odd_faces(3);
        let geometry = geometry(&scene, Preset::Auto);
        let mut job = job(&scene, (72, 45), 0..12);
        job.camera = pinhole([1.3, 1.1, 1.2], [0.0; 3], [0.0, 1.0, 0.0], 80.0);
        for accumulator in [Accumulator::Rgba32f, Accumulator::Rgba8] {
            let [exact, faces] = [(Method::Threaded, Passes::Single), (Method::Brute, Passes::Split)].map(
                |(method, passes)| {
                    let mut decision = decision(device, &geometry, method, passes, Sampler::Pcg);
                    decision.settings.accumulator = accumulator;
                    let plan = plan_decided(device, &scene, &geometry, job.clone(), &decision);
                    assert_eq!(plan.finds_edges(), passes == Passes::Split);
                    run(device, &plan)
                },
            );
            let light: f32 = Picture::new(job.tiles(), &faces.accumulated).light.iter().sum();
            assert!(light > 100.0, "{accumulator}: {light}");
            assert!(faces.accumulated == exact.accumulated, "{accumulator}");
        }
    });
}

/// Pixels get other numbers of samples, so that neighbours begin and end at others, in blocks of few.
#[test]
fn pixels_that_differ_in_their_samples_get_theirs() {
    with_device(|device| {
        let scene = odd_faces(3);
        let geometry = geometry(&scene, Preset::Auto);
        for sampler in [Sampler::Sobol, Sampler::Pcg] {
            let render = |method, passes| {
                // An error that is reached in some rounds: from the second on pixels differ.
                let goal = Goal::Rmse(0.004);
                let mut job = Job { adaptive: true, goal, ..job(&scene, (72, 45), 0..1 << 12) };
                job.camera = pinhole([1.3, 1.1, 1.2], [0.0; 3], [0.0, 1.0, 0.0], 80.0);
                let decision = decision(device, &geometry, method, passes, sampler);
                let mut plan = plan_decided(device, &scene, &geometry, job, &decision);
                assert_eq!(plan.finds_edges(), passes == Passes::Split);
                plan.tuning.block = (passes == Passes::Split).then_some(8);
                run(device, &plan)
            };
            let exact = render(Method::Threaded, Passes::Single);
            let outcome = render(Method::Brute, Passes::Split);
            assert!(outcome.rounds > 2, "{sampler:?}: {} rounds", outcome.rounds);
            assert!(outcome.accumulated == exact.accumulated, "{sampler:?}");
            assert_eq!((outcome.repeats, outcome.ambient_rays), (0, exact.ambient_rays), "{sampler:?}");
        }
    });
}
