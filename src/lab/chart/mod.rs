//! Speed against accuracy: the error of pictures over the time they take, curve by curve.

pub mod accuracy;
pub mod curves;
pub mod front;
pub mod levels;
pub mod measure;
pub mod reference;
pub mod results;

use serde::Serialize;

use super::bench::Subject;
use super::bench::drift::Drift;
use super::bench::schedule::shuffled;
use crate::bvh::Wanted;
use crate::error::{Error, Result};
use crate::layout::SPEC_REPEAT;
use crate::render::auto;
use crate::render::builder::choose_builder;
use crate::render::choices::{Method, Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Picture;
use crate::render::plan::{Job, Plan};
use crate::render::rounds::Goal;
use crate::render::stage::Uploads;
use crate::render::tally::Progress;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::vk::Device;
use accuracy::Truth;
use curves::{Choices, Lists, Variant};
use levels::Rule;
use reference::{Recipe, Store};
use results::{Curve, Point, TimeTo, evaluate};

/// What is asked for.
pub struct Options {
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
    pub seed: u32,
    /// Bound of the ambient rays, units of the file.
    pub max_distance: Option<f64>,
    pub rule: Rule,
    /// A point's runs are enough when they took so long together, ms.
    pub enough_ms: f64,
    pub lists: Lists,
    /// Samples of each reference that is made.
    pub reference_spp: u32,
}

/// References from files instead of made ones: one, or two that are independent of each other.
pub struct Given {
    pub pictures: Vec<Picture>,
    /// Names their contents.
    pub keys: Vec<String>,
}

/// What a scene's curves have in common.
#[derive(Clone, Debug, Serialize)]
pub struct SceneFacts {
    pub scene: String,
    pub path: String,
    pub triangles: usize,
    /// Hexadecimal.
    pub hash: String,
    pub camera: Camera,
    pub max_distance: Option<f64>,
    /// What the references are, each in a line; of files, a hash of their content.
    pub references: Vec<String>,
    /// Samples of each; `None` of files.
    pub reference_spp: Option<u32>,
    /// Pixels that are compared: those that the references cover fully.
    pub pixels: usize,
    /// Their mean light.
    pub mean: f64,
    /// Root mean square errors far below this drown in the references' noise; `None` with one reference.
    pub resolution: Option<f64>,
}

/// Who hears of a chart. An error ends the run.
pub trait Watch {
    fn build(&mut self, scene: &Scene, wishes: &Wishes) -> Result<Geometry>;
    /// Something that a person should know, now and later.
    fn note(&mut self, text: &str);
    /// How far the first or second reference is.
    fn reference(&mut self, number: usize, progress: &Progress);
    /// The references are there, the curves begin.
    fn begin(&mut self, facts: SceneFacts) -> Result<()>;
    /// Points of this curve from an earlier run that asked the same.
    fn known(&mut self, label: &str, choices: &Choices) -> Vec<Point>;
    /// So many curves of all are through; this is at hand.
    fn progress(&mut self, what: &str, done: usize, all: usize);
    /// The scene's curves have another point.
    fn measured(&mut self, curves: &[Curve], times: &[TimeTo]) -> Result<()>;
}

/// What all scenes of a run share.
pub struct Chart<'a> {
    pub device: &'a Device,
    pub options: &'a Options,
    pub drift: Drift<'a>,
}

/// A tree, by what it follows from.
struct Tree {
    builder: Wanted,
    conditioned: bool,
    geometry: Geometry,
}

/// A curve that can be measured.
struct Planned<'a> {
    variant: &'a Variant,
    geometry: &'a Geometry,
    ended: bool,
}

/// A device is lost when so many curves fail one after the other.
const LOST_AFTER: u32 = 3;
/// Beyond so many triangles brute force would not end.
const MOST_BRUTE: usize = 10_000;

impl<'a> Chart<'a> {
    pub fn new(device: &'a Device, options: &'a Options) -> Result<Self> {
        Ok(Self { device, options, drift: Drift::new(device)? })
    }

    /// Measures a scene's curves from a camera. Curves that fail are told; only what it returns is an error.
    pub fn scene(
        &self,
        subject: &Subject,
        camera: Camera,
        given: Option<&Given>,
        store: &mut dyn Store,
        watch: &mut dyn Watch,
    ) -> Result<()> {
        let scene = &subject.scene;
        let mut variants = curves::variants(&self.options.lists);
        for variant in &mut variants {
            variant.wishes = variant.wishes.on(self.device.adapter().kind);
        }
        let trees = self.trees(scene, &variants, given.is_none(), watch)?;
        let (truth, facts) = self.truth(subject, camera, &trees, given, store, watch)?;
        watch.begin(facts)?;
        let (mut planned, mut curves) = (Vec::new(), Vec::new());
        for variant in &variants {
            let Some(geometry) = find(&trees, &variant.wishes) else { continue };
            if let Err(error) = self.check(scene, camera, variant, geometry) {
                watch.note(&format!("{}: {} is left out: {error}", subject.name, variant.label_on(geometry)));
                continue;
            }
            let curve = self.curve(subject, variant, geometry, &curves, watch);
            planned.push(Planned { variant, geometry, ended: curve.same_as.is_some() });
            curves.push(curve);
        }
        if curves.is_empty() {
            return Err(Error::device(format!("No curve of {} could be measured: see above.", subject.name)));
        }
        let times = evaluate(&mut curves);
        watch.measured(&curves, &times)?;
        self.measure(subject, camera, &truth, &mut planned, &mut curves, watch)
    }

    fn trees(
        &self,
        scene: &Scene,
        variants: &[Variant],
        with_reference: bool,
        watch: &mut dyn Watch,
    ) -> Result<Vec<Tree>> {
        let mut trees = Vec::new();
        let reference = with_reference.then(reference::wishes);
        for wishes in reference.into_iter().chain(variants.iter().map(|variant| variant.wishes)) {
            if find(&trees, &wishes).is_none() {
                let (builder, conditioned) = tree_of(&wishes);
                trees.push(Tree { builder, conditioned, geometry: watch.build(scene, &wishes)? });
            }
        }
        Ok(trees)
    }

    /// What the curves are compared with.
    fn truth(
        &self,
        subject: &Subject,
        camera: Camera,
        trees: &[Tree],
        given: Option<&Given>,
        store: &mut dyn Store,
        watch: &mut dyn Watch,
    ) -> Result<(Truth, SceneFacts)> {
        let Options { size, max_distance, reference_spp: spp, .. } = *self.options;
        let scene = &subject.scene;
        let (mut made, mut references) = (Vec::new(), Vec::new());
        if let (None, Some(geometry)) = (given, find(trees, &reference::wishes())) {
            for (number, seed) in reference::seeds(self.options.seed).into_iter().enumerate() {
                let recipe = Recipe { scene, camera, size, max_distance, spp, seed };
                let mut observe = |progress: &Progress| watch.reference(number, progress);
                let sums = reference::make(self.device, &recipe, geometry, store, &mut observe)?;
                made.push(sums.picture(size));
                references.push(recipe.text());
            }
        }
        let pictures = given.map_or(&made, |given| &given.pictures);
        let truth = pictures.first().and_then(|first| Truth::new(first, pictures.get(1))).ok_or_else(|| {
            Error::input(format!(
                "No pixel of {} is covered fully: choose a camera that sees it (--orbit, or --eye with --target).",
                subject.name
            ))
        })?;
        let facts = SceneFacts {
            scene: subject.name.clone(),
            path: scene.path.clone(),
            triangles: scene.mesh.triangles.len(),
            hash: format!("{:016x}", scene.hash),
            camera,
            max_distance,
            references: given.map_or(references, |given| given.keys.clone()),
            reference_spp: given.is_none().then_some(spp),
            pixels: truth.pixels(),
            mean: truth.mean(),
            resolution: truth.resolution(),
        };
        Ok((truth, facts))
    }

    fn plan<'p>(
        &self,
        scene: &Scene,
        camera: Camera,
        variant: &Variant,
        geometry: &'p Geometry,
        spp: u32,
    ) -> Result<Plan<'p>> {
        let (decision, choices) = variant.decide(geometry, self.device.adapter());
        let job = Job {
            camera,
            size: self.options.size,
            samples: 0..spp,
            seed: self.options.seed,
            max_distance: self.options.max_distance,
            jitters: 1,
            adaptive: choices.adaptive,
            goal: Goal::Samples,
            block: None,
        };
        let plan = Plan::new(job, scene, geometry, &decision, &self.device.adapter().limits)?;
        Ok(match choices.repeat {
            Some(samples) => plan.with_constant(SPEC_REPEAT, samples),
            None => plan,
        })
    }

    /// Whether the device can do it in a time that a person would wait.
    fn check(&self, scene: &Scene, camera: Camera, variant: &Variant, geometry: &Geometry) -> Result<()> {
        let plan = self.plan(scene, camera, variant, geometry, 4)?;
        let triangles = geometry.triangles.len();
        if plan.settings.method == Method::Brute && triangles > MOST_BRUTE {
            return Err(Error::usage(format!(
                "brute would test {triangles} triangles for each ray; a chart takes it up to {MOST_BRUTE}."
            )));
        }
        plan.kernels.iter().try_for_each(|kernel| auto::check_subgroup(kernel, self.device.adapter()))
    }

    /// A curve with the points that are known, or with those of an equal one.
    fn curve(
        &self,
        subject: &Subject,
        variant: &Variant,
        geometry: &Geometry,
        before: &[Curve],
        watch: &mut dyn Watch,
    ) -> Curve {
        let (_, choices) = variant.decide(geometry, self.device.adapter());
        let label = variant.label_on(geometry);
        let same = before.iter().find(|curve| curve.choices == choices);
        let points = match same {
            Some(curve) => curve.points.clone(),
            None => watch.known(&label, &choices),
        };
        Curve {
            scene: subject.name.clone(),
            label,
            varies: variant.varies,
            same_as: same.map(|curve| curve.label.clone()),
            choices,
            points,
            slope: None,
            efficiency: None,
        }
    }

    /// Level by level, so that all curves meet the same moods of the device's clock.
    fn measure(
        &self,
        subject: &Subject,
        camera: Camera,
        truth: &Truth,
        planned: &mut [Planned<'_>],
        curves: &mut [Curve],
        watch: &mut dyn Watch,
    ) -> Result<()> {
        let mut uploads = Uploads::default();
        let (mut round, mut failed_in_a_row) = (0, 0);
        while planned.iter().any(|curve| !curve.ended) {
            self.drift.measure()?;
            for place in shuffled(planned.len(), self.options.seed, round) {
                let Planned { variant, geometry, ended } = &mut planned[place];
                if *ended {
                    continue;
                }
                let Some(spp) = levels::next(&curves[place].points, &self.options.rule) else {
                    *ended = true;
                    continue;
                };
                let (variant, geometry) = (*variant, *geometry);
                let done = planned.iter().filter(|curve| curve.ended).count();
                watch.progress(&format!("{}, {spp} spp", curves[place].label), done, planned.len());
                let shot = self.plan(&subject.scene, camera, variant, geometry, spp).and_then(|plan| {
                    measure::shoot(self.device, &plan, &mut uploads, &self.drift, self.options.enough_ms)
                });
                match shot {
                    Ok(shot) => {
                        failed_in_a_row = 0;
                        let errors = truth.errors(&shot.light);
                        add(curves, place, Point::new(spp, &shot.times, &errors, shot.overflowed));
                        let times = evaluate(curves);
                        watch.measured(curves, &times)?;
                    }
                    Err(error) => {
                        planned[place].ended = true;
                        watch.note(&format!(
                            "{}: {} ends before {spp} samples: {error}",
                            subject.name, curves[place].label
                        ));
                        failed_in_a_row += 1;
                        if failed_in_a_row >= LOST_AFTER {
                            return Err(error);
                        }
                    }
                }
            }
            round += 1;
        }
        if curves.iter().all(|curve| curve.points.is_empty()) {
            return Err(Error::device(format!("No curve of {} could be measured: see above.", subject.name)));
        }
        Ok(())
    }
}

/// Adds a point to a curve and to those that share its points.
fn add(curves: &mut [Curve], place: usize, point: Point) {
    let label = curves[place].label.clone();
    for curve in curves.iter_mut() {
        if curve.label == label || curve.same_as.as_ref() == Some(&label) {
            curve.points.push(point.clone());
            curve.points.sort_by_key(|point| point.spp);
        }
    }
}

fn tree_of(wishes: &Wishes) -> (Wanted, bool) {
    (choose_builder(wishes), !wishes.preset.is_some_and(Preset::is_original))
}

fn find<'t>(trees: &'t [Tree], wishes: &Wishes) -> Option<&'t Geometry> {
    let (builder, conditioned) = tree_of(wishes);
    // A tree that the rule came to serves for its builder's name too.
    let serves = |tree: &&Tree| match builder {
        Wanted::Builder(named) => tree.geometry.builder == named && tree.conditioned == conditioned,
        Wanted::Cheaper => tree.builder == builder && tree.conditioned == conditioned,
    };
    trees.iter().find(serves).map(|tree| &tree.geometry)
}
