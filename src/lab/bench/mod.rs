//! Every method on a scene, frame by frame in turn: what `cousu bench` measures.

pub mod drift;
mod frames;
mod lists;
mod reference;
pub mod rows;
pub mod schedule;
pub mod table1;
mod target;

use std::cell::Cell;

use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::render::choices::{Method, Passes, Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::rays::FileRay;
use crate::vk::Device;
use drift::Drift;
use rows::{Failure, Lists, Row, Spec};
use schedule::{Effort, Width};

/// A view of a scene by its name on the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    pub name: String,
    /// `None`: the scene's own.
    pub camera: Option<Camera>,
}

impl View {
    /// The scene's own view.
    pub fn default_view() -> Self {
        Self { name: "default".into(), camera: None }
    }

    /// The original's first view.
    pub fn original() -> Self {
        Self { name: "original".into(), camera: Some(Camera::Orbit { rx: 0.0, ry: 180.0 }) }
    }

    /// The view in which the report's scene of this name is compared with its table.
    fn of_report(name: &str) -> Self {
        if name == table1::CORNELL { Self::default_view() } else { Self::original() }
    }

    fn camera_for(&self, scene: &Scene) -> Camera {
        self.camera.unwrap_or_else(|| Camera::default_for(&scene.path))
    }
}

/// Which rays are traced.
#[derive(Clone, Debug)]
pub enum RayKind {
    /// A picture's camera and ambient rays, in whole frames.
    Ambient,
    /// The closest hits of a view's camera rays.
    Primary,
    /// The closest hits of rays from anywhere in the scene's box to anywhere.
    Random,
    /// One's own rays: their closest hits, and whether they hit at all.
    Listed(Vec<FileRay>),
}

/// What is asked for.
pub struct Options {
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
    /// Ambient rays of a pixel in a frame.
    pub spp: u32,
    pub seed: u32,
    pub effort: Effort,
    pub lists: Lists,
    /// The scene's own and, for the original's choices, the report's, if empty.
    pub views: Vec<View>,
    pub rays: RayKind,
}

/// A scene under its name on the command line.
pub struct Subject {
    pub name: String,
    pub scene: Scene,
}

/// Who hears of rows. An error ends the run.
pub trait Watch {
    /// Builds the tree of these choices.
    fn build(&mut self, scene: &Scene, wishes: &Wishes) -> Result<Geometry>;
    /// So many rows of a view are done, of so many.
    fn progress(&mut self, what: &str, done: usize, all: usize);
    fn row(&mut self, row: Row) -> Result<()>;
    /// Something that a person should know.
    fn note(&mut self, text: &str);
    /// A row was left out; the error says why.
    fn failed(&mut self, failure: Failure, error: Error) -> Result<()>;
    /// The rows of a view are through.
    fn view_done(&mut self) -> Result<()>;
}

/// What all scenes of a run share.
pub struct Bench<'a> {
    pub device: &'a Device,
    pub options: &'a Options,
    pub drift: Drift<'a>,
    /// Rows that were planned so far.
    planned: Cell<usize>,
}

/// Trees, each with a row that reads it.
type Trees = Vec<(Spec, Geometry)>;

/// The rows of one view of one scene.
struct Case<'a> {
    subject: &'a Subject,
    view: &'a View,
    /// Each with its tree and its place in the run's plan.
    rows: Vec<(&'a Spec, &'a Geometry, usize)>,
}

impl<'a> Bench<'a> {
    pub fn new(device: &'a Device, options: &'a Options) -> Result<Self> {
        Ok(Self { device, options, drift: Drift::new(device)?, planned: Cell::new(0) })
    }

    fn width(&self) -> Width {
        Width::of(self.device.adapter().kind)
    }

    /// Measures the rows of a scene. Rows that fail are told to `watch`; only what it returns is an error.
    pub fn scene(&self, subject: &Subject, watch: &mut dyn Watch) -> Result<()> {
        let mut trees = Trees::from_iter(self.default_tree(subject, watch));
        let plan = self.plan(subject, trees.first().map_or(Builder::Sah, |(spec, _)| spec.builder));
        for (view, specs) in &plan {
            let mut case = Vec::new();
            for spec in specs {
                if trees.iter().all(|(built, _)| !built.shares_geometry(spec)) {
                    watch.progress("building trees", 0, specs.len());
                    match watch.build(&subject.scene, &spec.wishes()) {
                        Ok(geometry) => trees.push((*spec, geometry)),
                        Err(error) => {
                            let none = Case { subject, view, rows: Vec::new() };
                            left_out(watch, &none, spec, error)?;
                            continue;
                        }
                    }
                }
                case.push(spec);
            }
            let place = self.planned.replace(self.planned.get() + case.len());
            let rows = case.into_iter().enumerate().filter_map(|(offset, spec)| {
                let (_, geometry) = trees.iter().find(|(built, _)| built.shares_geometry(spec))?;
                Some((spec, geometry, place + offset))
            });
            let case = Case { subject, view, rows: rows.collect() };
            match &self.options.rays {
                RayKind::Ambient => frames::measure(self, &case, watch)?,
                _ => lists::measure(self, &case, watch)?,
            }
            watch.view_done()?;
        }
        Ok(())
    }

    /// The tree that a render of many samples takes, where rows leave the builder open; for lists of rays, that of few. If it
    /// cannot be built, the rows that read it will tell.
    fn default_tree(&self, subject: &Subject, watch: &mut dyn Watch) -> Option<(Spec, Geometry)> {
        let Options { lists, rays, .. } = self.options;
        let reads_trees = |methods: &Vec<Method>| methods.iter().any(|method| *method != Method::Brute);
        if lists.builders.is_some() || !lists.methods.as_ref().is_none_or(reads_trees) {
            return None;
        }
        watch.progress("building trees", 0, 1);
        // Two trees are tried by ambient rays.
        let samples = (!matches!(rays, RayKind::Ambient)).then_some(1);
        let wishes = Wishes { samples, ..Wishes::default() }.on(self.device.adapter().kind);
        let geometry = watch.build(&subject.scene, &wishes).ok()?;
        let builder = geometry.builder;
        Some((Spec::new(Preset::Auto, Method::Ordered, Some(builder), Passes::Single, builder), geometry))
    }

    /// The views of a scene and the rows of each. `cheaper`: the builder of rows that name none.
    fn plan(&self, subject: &Subject, cheaper: Builder) -> Vec<(View, Vec<Spec>)> {
        let Options { lists, views, rays, .. } = self.options;
        let specs = rows::specs(lists, cheaper);
        let mut plan: Vec<(View, Vec<Spec>)> = Vec::new();
        match rays {
            RayKind::Ambient | RayKind::Primary => {
                let own = [View::default_view()];
                let views = if views.is_empty() { &own[..] } else { views };
                plan.extend(views.iter().map(|view| (view.clone(), specs.clone())));
            }
            // They do not depend on the view.
            RayKind::Random | RayKind::Listed(_) => {
                plan.push((View { name: "-".into(), camera: None }, specs));
            }
        }
        if let (RayKind::Ambient, true) = (rays, table1::is_reported(&subject.name)) {
            let originals = rows::original_specs(lists);
            let report_view = View::of_report(&subject.name);
            let shown = if views.is_empty() { vec![report_view] } else { views.clone() };
            for view in shown.into_iter().filter(|_| !originals.is_empty()) {
                match plan.iter_mut().find(|(known, _)| *known == view) {
                    Some((_, specs)) => specs.extend(&originals),
                    None => plan.push((view, originals.clone())),
                }
            }
        }
        plan
    }
}

/// Tells that a row was left out.
fn left_out(watch: &mut dyn Watch, case: &Case<'_>, spec: &Spec, error: Error) -> Result<()> {
    let failure = Failure {
        scene: case.subject.name.clone(),
        view: case.view.name.clone(),
        preset: spec.preset.name(),
        method: spec.method.to_string(),
        builder: spec.builder.name(),
        passes: spec.passes.name(),
        reason: error.to_string(),
    };
    watch.failed(failure, error)
}

/// Whether a row's rays are the reference row's.
fn has_reference(spec: &Spec) -> bool {
    spec.preset == Preset::Auto
}
