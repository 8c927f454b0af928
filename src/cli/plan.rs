//! `cousu plan`.

use std::path::PathBuf;

use clap::Args;
use comfy_table::{Table, presets};

use super::args::{CameraArguments, ChoiceArguments, distance, size};
use super::render::{default_spp, samples_of_camera_ray};
use super::session::{self, DeviceArguments};
use crate::error::Result;
use crate::render::plan::{Job, Plan};
use crate::render::rounds::{Goal, MOST_SAMPLES};
use crate::render::{auto, preview};
use crate::scene::Scene;

#[derive(Args)]
pub struct Arguments {
    /// The scene, a Wavefront OBJ file
    scene: PathBuf,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1024x640")]
    size: (u32, u32),
    /// Ambient rays of each pixel whose camera ray hits, as for render [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SAMPLES)))]
    spp: Option<u32>,
    /// Camera rays of a pixel, as for render
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=1024), default_value = "1")]
    antialias: u32,
    /// Bounded ambient occlusion, as for render
    #[arg(long, value_name = "D", value_parser = distance)]
    max_distance: Option<f64>,
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    choices: ChoiceArguments,
    #[command(flatten)]
    device: DeviceArguments,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let scene = Scene::load(&arguments.scene)?;
    let (_instance, adapter) = session::adapter(&arguments.device)?;
    let spp = arguments.spp.unwrap_or_else(|| default_spp(arguments.antialias));
    let job = Job {
        camera: arguments.camera.camera(&scene, arguments.choices.preset)?,
        size: arguments.size,
        samples: 0..samples_of_camera_ray(spp, arguments.antialias)?,
        seed: 0,
        max_distance: arguments.max_distance,
        jitters: arguments.antialias,
        adaptive: false,
        goal: Goal::Samples,
        block: None,
    };
    let wishes = job.wishes(&arguments.choices.wishes().on(adapter.kind));
    let geometry = session::geometry(&scene, &wishes)?;
    let wishes = preview::wishes_for(&job, &wishes, &scene, &geometry, adapter.kind);
    let decision = auto::decide(&wishes, &geometry, &adapter);
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["choice", "", "why"]);
    for reason in &decision.reasons {
        table.add_row([reason.what, &reason.choice, &reason.why]);
    }
    let tree = geometry.quality();
    super::print(&format!(
        "{} on {}: {} triangles\ntree {}: {} nodes, {} leaves of up to {} triangles, {} references beyond one a triangle; depth \
         {}, a stack of up to {} entries, SAH cost {:.1}; built in {:.0} ms\n\n{}",
        scene.path,
        adapter.name,
        tree.references - tree.duplicates,
        geometry.builder,
        tree.nodes,
        tree.leaves,
        tree.largest_leaf,
        tree.duplicates,
        tree.depth,
        tree.stack_bound,
        tree.sah_cost,
        geometry.build_ms,
        table.trim_fmt()
    ))?;
    auto::check_stack(decision.settings.method, &geometry, arguments.choices.allow_overflow)?;
    let plan = Plan::new(job, &scene, &geometry, &decision, &adapter.limits)?;
    plan.kernels.iter().try_for_each(|kernel| auto::check_subgroup(kernel, &adapter))
}
