//! What experiments share: plans, rays and times.

use super::Lab;
use crate::error::Result;
use crate::lab::interleave::{Variant, interleave};
use crate::lab::scenes::usual_job;
use crate::layout::{FRAME_SAMPLES, HitRecord, RayRecord};
use crate::render::builder::choose_builder;
use crate::render::choices::{Method, Preset, Wishes};
use crate::render::execute::{self, Outcome};
use crate::render::geometry::Geometry;
use crate::render::picture::Picture;
use crate::render::plan::{Job, Plan};
use crate::render::raylist::{Query, RayLists, reach_of};
use crate::render::{auto, preview};
use crate::scene::Scene;

/// The method, a stack as deep as this tree needs.
pub(super) fn fitted(method: Method, geometry: &Geometry) -> Method {
    match method {
        Method::Stack(_) => Method::Stack(geometry.stack_bound.max(1)),
        other => other,
    }
}

impl Lab<'_> {
    pub(super) fn observe(&self, what: &str, done: f64) {
        (self.observe)(what, done);
    }

    /// `long`, or `quick` for a first look.
    pub(super) fn pick<T>(&self, quick: T, long: T) -> T {
        if self.quick { quick } else { long }
    }

    /// Methods that take part beside `auto`, `stackN` as deep as the tree needs.
    pub(super) fn methods(&self, geometry: &Geometry) -> Vec<Method> {
        match self.methods.is_empty() {
            true => Method::all(geometry.stack_bound.max(1)).into(),
            false => self.methods.iter().map(|method| fitted(*method, geometry)).collect(),
        }
    }

    /// The scene as these choices want it.
    pub(super) fn geometry(&self, scene: &Scene, wishes: &Wishes) -> Result<Geometry> {
        let conditioned = !wishes.preset.is_some_and(Preset::is_original);
        Geometry::build(scene, conditioned, choose_builder(&wishes.on(self.device.adapter().kind)), &|_| {})
    }

    /// A job from the scene's usual view.
    pub(super) fn job(&self, scene: &Scene, size: (u32, u32), samples: u32) -> Job {
        usual_job(scene, size, samples, self.seed)
    }

    pub(super) fn plan<'g>(
        &self,
        job: Job,
        scene: &Scene,
        geometry: &'g Geometry,
        wishes: &Wishes,
    ) -> Result<Plan<'g>> {
        let adapter = self.device.adapter();
        let wishes = preview::wishes_for(&job, wishes, scene, geometry, adapter.kind);
        let decision = auto::decide(&wishes, geometry, adapter);
        Plan::new(job, scene, geometry, &decision, &adapter.limits)
    }

    pub(super) fn render(&self, plan: &Plan<'_>) -> Result<Outcome> {
        execute::run(self.device, plan, &mut |_| {})
    }

    pub(super) fn picture(&self, plan: &Plan<'_>) -> Result<Picture> {
        Ok(Picture::new(plan.tiles, &self.render(plan)?.accumulated))
    }

    /// What each ray meets.
    pub(super) fn trace(&self, plan: &Plan<'_>, query: Query, rays: &[RayRecord]) -> Result<Vec<HitRecord>> {
        let plan = plan.clone().with_reach(reach_of(rays), query == Query::Any);
        RayLists::new(self.device, &plan)?.sharing(&self.compiled).trace(query, rays)
    }

    /// Methods whose costs are measured: `brute` takes minutes on a CPU, and a first look has one.
    pub(super) fn timed(&self, methods: &[Method]) -> Vec<Method> {
        let trees = methods.iter().copied().filter(|method| *method != Method::Brute);
        trees.take(if self.quick { 1 } else { usize::MAX }).collect()
    }

    /// Kernel times of frames of four rays from the scene's usual view with these choices, each over that of the first:
    /// medians of frames that alternate.
    pub(super) fn costs(
        &self,
        scene: &Scene,
        geometry: &Geometry,
        choices: &[(&str, Wishes)],
    ) -> Result<Vec<f64>> {
        let variants = choices
            .iter()
            .map(|(label, wishes)| {
                let plan = self.plan(self.job(scene, self.size, FRAME_SAMPLES), scene, geometry, wishes)?;
                Ok(Variant::new(*label, plan))
            })
            .collect::<Result<Vec<_>>>()?;
        let series = interleave(self.device, self.quick, &scene.path, &variants)?;
        (0..variants.len()).map(|which| Ok(series.ratio(which, 0)?.ratio)).collect()
    }
}
