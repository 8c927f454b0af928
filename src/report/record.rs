//! The record of a render: what `--json` writes and the summary prints. Its keys are stable.

use serde::Serialize;

use super::manifest::Manifest;
use crate::bvh::quality::Quality;
use crate::render::execute::Outcome;
use crate::render::plan::Plan;
use crate::render::rounds::Goal;
use crate::render::tally::KernelTime;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::vk::Adapter;

#[derive(Clone, Debug, Serialize)]
pub struct SceneRecord {
    pub path: String,
    pub triangles: usize,
    /// Hexadecimal.
    pub hash: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct RenderRecord {
    pub device: String,
    pub driver: String,
    pub scene: SceneRecord,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Ambient rays of a pixel; the mean of those that hit, where each has its own number.
    pub spp: u32,
    pub adaptive: bool,
    /// Camera rays of a pixel.
    pub antialias: u32,
    pub preset: &'static str,
    pub method: String,
    pub builder: &'static str,
    pub tree: Quality,
    pub passes: &'static str,
    pub sampler: &'static str,
    pub accumulator: &'static str,
    pub offset: &'static str,
    pub intersector: &'static str,
    pub slabs: &'static str,
    pub camera: Camera,
    pub seed: u32,
    /// Bound of the ambient rays, units of the file.
    pub max_distance: Option<f64>,
    pub kernels: Vec<KernelTime>,
    pub primary_rays: u64,
    pub ambient_rays: u64,
    /// Ambient rays over summed kernel time.
    pub ambient_mrays_per_s: f64,
    /// All rays over summed kernel time.
    pub mrays_per_s: f64,
    /// Stack entries that the tree can ask of a ray; 0 without a stack.
    pub max_stack: u32,
    pub overflowed_rays: u64,
    /// How often pixels were taken up again because the driver had left a loop early.
    pub repeats: u32,
    pub rmse_estimate: Option<f64>,
    /// The error that was asked for.
    pub target_rmse: Option<f64>,
    pub build_ms: f64,
    pub load_ms: f64,
    pub wall_s: f64,
    pub manifest: Manifest,
}

impl RenderRecord {
    pub fn new(
        scene: &Scene,
        plan: &Plan<'_>,
        adapter: &Adapter,
        outcome: &Outcome,
        manifest: Manifest,
        wall_s: f64,
    ) -> Self {
        let settings = &plan.settings;
        let gpu_ms: f64 = outcome.kernels.iter().map(|kernel| kernel.gpu_ms).sum();
        let rate = |rays: u64| if gpu_ms > 0.0 { rays as f64 / gpu_ms * 1e-3 } else { 0.0 };
        Self {
            device: adapter.name.clone(),
            driver: adapter.driver.clone(),
            scene: SceneRecord {
                path: scene.path.clone(),
                triangles: scene.mesh.triangles.len(),
                hash: format!("{:016x}", scene.hash),
            },
            size: [plan.job.size.0, plan.job.size.1],
            spp: outcome.samples.saturating_mul(plan.job.jitters),
            adaptive: plan.job.adaptive,
            antialias: plan.job.jitters,
            preset: settings.preset.name(),
            method: settings.method.to_string(),
            builder: settings.builder.name(),
            tree: *plan.geometry.quality(),
            passes: settings.passes.name(),
            sampler: settings.sampler.name(),
            accumulator: settings.accumulator.name(),
            offset: settings.offset.name(),
            intersector: settings.intersector.name(),
            slabs: settings.slabs.name(),
            camera: plan.job.camera,
            seed: plan.job.seed,
            max_distance: plan.job.max_distance,
            kernels: outcome.kernels.clone(),
            primary_rays: outcome.primary_rays,
            ambient_rays: outcome.ambient_rays,
            ambient_mrays_per_s: rate(outcome.ambient_rays),
            mrays_per_s: rate(outcome.primary_rays + outcome.ambient_rays),
            max_stack: plan.stack_bound(),
            overflowed_rays: outcome.overflowed_rays,
            repeats: outcome.repeats,
            rmse_estimate: outcome.error.map(|error| error.rmse),
            target_rmse: match plan.job.goal {
                Goal::Rmse(goal) => Some(goal),
                _ => None,
            },
            build_ms: plan.geometry.build_ms,
            load_ms: scene.load_ms,
            wall_s,
            manifest,
        }
    }

    /// For a person: device, method, time per kernel, rays per second.
    pub fn summary(&self) -> String {
        let mut text = format!("device   {} ({})\n", self.device, self.driver);
        text += &format!(
            "scene    {}: {} triangles, loaded in {:.0} ms, tree built in {:.0} ms\n",
            self.scene.path, self.scene.triangles, self.load_ms, self.build_ms
        );
        text += &format!(
            "method   {} ({} tree, {} pass), {} {} {}, {} offset, {} slabs\n",
            self.method,
            self.builder,
            self.passes,
            self.sampler,
            self.accumulator,
            self.intersector,
            self.offset,
            self.slabs
        );
        for kernel in &self.kernels {
            text += &format!(
                "kernel   {}: {:.2} ms in {} dispatches\n",
                kernel.name, kernel.gpu_ms, kernel.dispatches
            );
        }
        text += &format!(
            "rays     {} camera + {} ambient: {:.1} Mrays/s\n",
            self.primary_rays, self.ambient_rays, self.mrays_per_s
        );
        if self.overflowed_rays > 0 {
            text += &format!(
                "overflow {} rays lost a part of the tree: {} is too small (this tree can need {})\n",
                self.overflowed_rays, self.method, self.max_stack
            );
        }
        if self.repeats > 0 {
            text += &format!("repeats  {} (the driver left loops early; no ray is missing)\n", self.repeats);
        }
        if let Some(rmse) = self.rmse_estimate {
            text += &format!("error    {rmse:.5} (estimated root mean square)\n");
        }
        text + &format!("wall     {:.2} s", self.wall_s)
    }
}
