//! Cameras where the original's pictures go wrong.

use glam::DVec3;

use super::shapes::{ASKEW, Shapes, yard};
use super::sight::{SEEN, Sight, judge, sights};
use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::ghosts::without_reset;
use crate::lab::interleave::digits;
use crate::lab::scenes::scene_of;
use crate::layout::FRAME_SAMPLES;
use crate::render::choices::{Accumulator, Offset, Passes, Preset, Sampler, Wishes};
use crate::render::picture::Picture;
use crate::render::plan::Job;
use crate::scene::camera::Camera;
use crate::scene::{Mesh, Scene};
use crate::vk::DeviceKind;

pub const EXPERIMENT: Experiment = Experiment {
    name: "camera",
    what: "Moves without a reset, near and far planes, scenes beyond the limit, an eye in a triangle's plane.",
    counts: "pixels",
    worst: "largest difference of light",
    run,
};

/// The original's orbiter where it is not told otherwise.
const ORBIT: Camera = Camera::Orbit { rx: 20.0, ry: 140.0 };
/// How far the camera orbits between two pictures, degrees.
const TURN: f64 = 15.0;

/// What a view is to provoke.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Nothing: what the variants differ by anyhow.
    Plain,
    /// The original's near and far plane.
    Planes,
    /// The original's longest ambient ray.
    Limit,
    /// An eye on a surface, or in its plane.
    Plane,
    /// The angle of view.
    Angle,
}

/// A camera on a scene.
struct View {
    name: &'static str,
    kind: Kind,
    scene: Scene,
    camera: Camera,
}

/// Ways to render a view.
struct Variant {
    name: String,
    wishes: Wishes,
    /// Of all kinds of view, or of those with an eye in a plane.
    all: bool,
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let views = views(lab.quick);
    let variants = variants(lab);
    let rays = lab.pick(2048, 1024);
    let mut cases: Vec<Vec<Case>> = variants.iter().map(|_| Vec::new()).collect();
    let mut figures: Vec<Figure> = Vec::new();
    for (place, view) in views.iter().enumerate() {
        lab.observe(view.name, place as f64 / (views.len() + 1) as f64);
        let truth = sights(&view.scene, &view.camera, size(lab), rays);
        let mut survivor = None;
        for (variant, cases) in variants.iter().zip(&mut cases) {
            if !variant.all && view.kind != Kind::Plane {
                continue;
            }
            let job = Job { camera: view.camera, ..lab.job(&view.scene, size(lab), samples(lab)) };
            let picture = match picture(lab, &view.scene, job, &variant.wishes) {
                Ok(picture) => picture,
                Err(error) => {
                    cases.push(Case::of_error(view.name, &error));
                    continue;
                }
            };
            let (case, fails) = judge(view.name, &picture, &truth);
            let name = figure_of(view.kind);
            // The variant that differs from `auto` in nothing but the camera tells most.
            let telling = variant.wishes.preset == Some(Preset::OriginalUnbiased) && case.failures > 0;
            if let (Some(name), Some(survivor), true) = (name, &survivor, telling)
                && figures.iter().all(|figure| figure.name != name)
            {
                figures.push(Figure::of_failure(name, &picture, survivor, &fails));
            }
            cases.push(case);
            survivor.get_or_insert(picture);
        }
    }
    lab.observe("moves", views.len() as f64 / (views.len() + 1) as f64);
    let mut moves = moves(lab, rays)?;
    let mut rows = Vec::new();
    for (variant, mut cases) in variants.into_iter().zip(cases) {
        if variant.name == "auto" {
            cases.append(&mut moves.auto);
        }
        rows.push(Row::of(variant.name, cases));
    }
    rows[1..3].iter_mut().zip(NOTES).for_each(|(row, note)| row.note = Some(note.into()));
    rows.append(&mut moves.rows);
    figures.extend(moves.figure);
    Ok(Findings { rows, figures })
}

/// On the original's rows.
const NOTES: [&str; 2] = [
    "with auto's random numbers, counts and an offset of the scene's size; the plain view tells what rays through pixels' \
     corners and normals that do not turn cost by themselves",
    "the same with pixel centres and turned normals: its near and far plane and its limit of 1000 units alone",
];

/// Ambient rays of a pixel: the more pixels, the farther chance leads one of them astray.
fn samples(lab: &Lab<'_>) -> u32 {
    if lab.device.adapter().kind == DeviceKind::Cpu { lab.pick(128, 256) } else { 512 }
}

fn size(lab: &Lab<'_>) -> (u32, u32) {
    match lab.device.adapter().kind {
        DeviceKind::Cpu => lab.pick((24, 15), (64, 40)),
        _ => lab.pick((64, 40), (160, 100)),
    }
}

fn variants(lab: &Lab<'_>) -> Vec<Variant> {
    let original = |preset| Wishes {
        preset: Some(preset),
        sampler: Some(Sampler::Sobol),
        accumulator: Some(Accumulator::Count),
        offset: Some(Offset::Scaled),
        ..Wishes::default()
    };
    let row = |name: &str, wishes| Variant { name: name.into(), wishes, all: true };
    let mut variants = vec![
        row("auto", Wishes::default()),
        row("original", original(Preset::Original)),
        row("original-unbiased", original(Preset::OriginalUnbiased)),
    ];
    // Each method is a kernel for each scene: too many for a first look.
    if !lab.quick {
        let scene = scene_of("yard", yard([0.0; 3], 1.0));
        if let Ok(geometry) = lab.geometry(&scene, &Wishes::default()) {
            variants.extend(lab.methods(&geometry).into_iter().map(|method| Variant {
                name: method.to_string(),
                wishes: Wishes { method: Some(method), passes: Some(Passes::Single), ..Wishes::default() },
                all: false,
            }));
        }
    }
    variants
}

fn picture(lab: &Lab<'_>, scene: &Scene, job: Job, wishes: &Wishes) -> Result<Picture> {
    let geometry = lab.geometry(scene, wishes)?;
    lab.picture(&lab.plan(job, scene, &geometry, wishes)?)
}

fn figure_of(kind: Kind) -> Option<&'static str> {
    match kind {
        Kind::Planes => Some("camera-planes"),
        Kind::Limit => Some("camera-limit"),
        Kind::Plain | Kind::Plane | Kind::Angle => None,
    }
}

/// A room without openings.
fn hall(size: [f64; 3]) -> Mesh {
    let mut shapes = Shapes::default();
    shapes.inner_box(size.map(|side| -0.5 * side), size.map(|side| 0.5 * side));
    shapes.mesh()
}

/// A floor of 5,000 units and walls along two of its sides.
fn court() -> Mesh {
    let mut shapes = Shapes::default();
    let half = 2500.0;
    shapes.quad([[-half, 0.0, half], [half, 0.0, half], [half, 0.0, -half], [-half, 0.0, -half]]);
    shapes.outer_box([-half, 0.0, -half - 100.0], [half, 1500.0, -half]);
    shapes.outer_box([half, 0.0, -half], [half + 100.0, 1500.0, half]);
    shapes.mesh()
}

fn views(quick: bool) -> Vec<View> {
    let diagonal = scene_of("yard", yard([0.0; 3], 1.0)).bounds.diagonal();
    let orbited = |name, kind, mesh| View { name, kind, scene: scene_of("yard", mesh), camera: ORBIT };
    // The yard's centre is (0, 1, 0): moved there by so many diagonals along x and z.
    let shifted =
        |name, x: f64, z: f64| orbited(name, Kind::Planes, yard([x * diagonal, -1.0, z * diagonal], 1.0));
    let seen = |name, kind, eye: [f64; 3], target: [f64; 3], fov: f64| View {
        name,
        kind,
        scene: scene_of("yard", yard([0.0; 3], 1.0)),
        camera: Camera::Pinhole { eye, target, up: [0.0, 1.0, 0.0], fov },
    };
    let inside = |name, mesh, target: [f64; 3]| View {
        name,
        kind: Kind::Limit,
        scene: scene_of("hall", mesh),
        camera: Camera::Pinhole { eye: [0.0; 3], target, up: [0.0, 1.0, 0.0], fov: 90.0 },
    };
    let usual = 45.0;
    let mut views = vec![
        orbited("plain view", Kind::Plain, yard([0.0; 3], 1.0)),
        shifted("1 diagonal along z: far cuts", 0.0, 1.0),
        shifted("1.5 diagonals along x: near cuts", 1.5, 0.0),
        View {
            name: "court of 5000 units",
            kind: Kind::Limit,
            scene: scene_of("court", court()),
            camera: Camera::Orbit { rx: 35.0, ry: 20.0 },
        },
        seen("in the plane of a top", Kind::Plane, [3.5, 1.0, 3.0], [-1.0, 0.875, -0.5], usual),
        seen("on a wall", Kind::Plane, [0.5, 1.25, 0.125], [-1.0, 0.5, 0.25], 75.0),
    ];
    if quick {
        return views;
    }
    let [a, b, c] = ASKEW.map(DVec3::from);
    let askew = |u: f64, v: f64| (a + (b - a) * u + (c - a) * v).to_array();
    views.extend([
        shifted("3 diagonals along x: all before near", 3.0, 0.0),
        shifted("1 diagonal against z", 0.0, -1.0),
        orbited("0.04 units wide: near is 0.1", Kind::Planes, yard([0.0; 3], 0.01)),
        inside("closed hall, 5000 x 3000 x 4000 units", hall([5000.0, 3000.0, 4000.0]), [1.0, -0.25, 0.75]),
        inside("closed hall, 5000 x 400 x 400 units", hall([5000.0, 400.0, 400.0]), [1.0, 0.0, 0.0625]),
        seen("in the plane of a wall", Kind::Plane, [0.5, 1.25, 4.0], [0.25, 0.75, 0.0], usual),
        seen("in the plane of the floor", Kind::Plane, [3.0, 0.0, 3.25], [0.0, 0.75, 0.0], usual),
        seen("in a plane askew", Kind::Plane, askew(2.0, 1.5), askew(0.25, 0.5), usual),
        seen("on a triangle askew", Kind::Plane, askew(0.25, 0.25), [1.0, 0.75, -0.5], 90.0),
        seen("on a vertex", Kind::Plane, [0.5, 2.0, 0.5], [-1.0, 0.5, 0.5], 90.0),
        seen("on an edge", Kind::Plane, [0.5, 2.0, 0.0], [-1.0, 0.0, 0.25], 90.0),
        seen("beside a block", Kind::Plain, [-0.25, 0.5, -0.125], [2.0, 0.25, 1.0], 75.0),
        seen("170 degrees", Kind::Angle, [-1.75, 0.5, 1.75], [0.0, 0.5, 0.0], 170.0),
        seen("0.02 degrees", Kind::Angle, [6.0, 3.0, 5.0], [-0.75, 0.75, 0.0], 0.02),
        seen("0.0001 degrees", Kind::Angle, [6.0, 3.0, 5.0], [-0.75, 0.75, 0.0], 0.0001),
    ]);
    views
}

/// What came of the camera's moves.
struct Moves {
    auto: Vec<Case>,
    rows: Vec<Row>,
    figure: Option<Figure>,
}

/// Running means that go on after a move, and means and counts that start anew.
fn moves(lab: &Lab<'_>, rays: u32) -> Result<Moves> {
    let scene = scene_of("yard", yard([0.0; 3], 1.0));
    let geometry = lab.geometry(&scene, &Wishes::default())?;
    let turns: &[f64] = lab.pick(&[TURN], &[2.0, TURN, 90.0]);
    let orbit = |turn: f64| Camera::Orbit { rx: 20.0, ry: 140.0 + turn };
    let mean = |accumulator| Wishes { accumulator: Some(accumulator), ..Wishes::default() };
    let plan = |turn, first: u32, accumulator| {
        let job = Job {
            camera: orbit(turn),
            samples: first..first + FRAME_SAMPLES,
            ..lab.job(&scene, size(lab), FRAME_SAMPLES)
        };
        lab.plan(job, &scene, &geometry, &mean(accumulator))
    };
    // Before the move and after it, as many rays in all as of the other pictures.
    let frames = samples(lab) / FRAME_SAMPLES / 2;
    let next = frames * FRAME_SAMPLES;
    let mut cases: [Vec<Case>; 4] = Default::default();
    let mut figure = None;
    for &turn in turns {
        let name = format!("a move by {} degrees", digits(turn));
        let truth = sights(&scene, &orbit(turn), size(lab), rays);
        // What the program does: each picture is a render of its own.
        let job = Job { camera: orbit(turn), ..lab.job(&scene, size(lab), samples(lab)) };
        let auto = picture(lab, &scene, job, &Wishes::default())?;
        cases[0].push(judge(&name, &auto, &truth).0);
        let ways = [
            (Accumulator::Rgba8, 0.0),
            (Accumulator::Rgba32f, 0.0),
            // From the same side all along, as after a reset.
            (Accumulator::Rgba32f, turn),
        ];
        for ((accumulator, before), cases) in ways.into_iter().zip(&mut cases[1..]) {
            let [first, second] = [plan(before, 0, accumulator)?, plan(turn, next, accumulator)?];
            let picture = without_reset(lab.device, &first, &second, frames)?;
            let (case, fails) = judge(&name, &picture, &truth);
            let empty = |(place, sight): (usize, &Sight)| {
                *sight == Sight::Nothing && f64::from(picture.light[place]) > SEEN
            };
            let lit = truth.iter().enumerate().filter(|pixel| empty(*pixel)).count();
            let note = (lit > 0).then(|| format!("{lit} pixels that see nothing show a surface"));
            cases.push(Case { note: note.or(case.note), ..case });
            if figure.is_none() && turn == TURN && fails.contains(&true) {
                figure = Some(Figure::of_failure("camera-moves", &picture, &auto, &fails));
            }
        }
    }
    let [auto, rgba8, rgba32f, reset] = cases;
    let rows = vec![
        Row::of("rgba8, no reset", rgba8),
        Row::of("rgba32f, no reset", rgba32f),
        Row::of("rgba32f, reset", reset),
    ];
    Ok(Moves { auto, rows, figure })
}
