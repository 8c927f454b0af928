//! `cousu compare`.

use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::{Table, presets};
use image::{Rgb, RgbImage};
use serde::Serialize;

use super::args::{CameraArguments, size};
use super::session::{self, DeviceArguments};
use crate::error::{Error, Result};
use crate::gl::{Context, Preference, TimerKind};
use crate::lab::compare::{Auto, Effort, Images, Renders, Row, measure};
use crate::render::choices::{Method, Preset, Wishes};
use crate::render::execute;
use crate::render::frames::fragment;
use crate::render::frames::opengl::OpenGlFrames;
use crate::render::frames::vulkan::Stage;
use crate::render::geometry::Geometry;
use crate::render::plan::{Job, Plan};
use crate::render::rounds::Goal;
use crate::render::{auto, preview};
use crate::report::atomic::{Output, folder};
use crate::report::manifest::Manifest;
use crate::report::png::{self, Encoding};
use crate::scene::Scene;
use crate::vk::{Device, DeviceKind};

#[derive(Args)]
pub struct Arguments {
    /// The scene, a Wavefront OBJ file
    scene: PathBuf,
    /// Folder for the table (compare.json, compare.csv) and the images
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Frames of four rays a pixel to measure on each API [default: 32]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    /// Methods, separated by commas; undersized stacks drop what does not fit, as the original's did
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "METHODS",
        default_value = "fragment,brute,stack64,stack16,threaded"
    )]
    methods: Vec<Form>,
    /// Width and height of the picture in pixels [default: 1024x640]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// A first look: by default 160x100 pixels and 16 frames
    #[arg(long)]
    quick: bool,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u32,
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    device: DeviceArguments,
}

/// A row of the comparison.
#[derive(Clone, Copy, Debug)]
enum Form {
    /// The original's first: primary hits by a fragment shader.
    Fragment,
    /// Its compute shader with this method.
    Compute(Method),
}

impl std::str::FromStr for Form {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            fragment::NAME => Ok(Self::Fragment),
            _ => text.parse().map(Self::Compute).map_err(|error| format!("{error}, or {}", fragment::NAME)),
        }
    }
}

impl std::fmt::Display for Form {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fragment => f.write_str(fragment::NAME),
            Self::Compute(method) => method.fmt(f),
        }
    }
}

/// What `compare.json` holds.
#[derive(Serialize)]
struct Record {
    device: String,
    driver: String,
    gl_renderer: String,
    gl_version: String,
    gl_platform: &'static str,
    scene: String,
    size: [u32; 2],
    rows: Vec<Row>,
    auto: Option<Auto>,
    manifest: Manifest,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let scene = Scene::load(&arguments.scene)?;
    folder(&arguments.output)?;
    let device = session::open(&arguments.device)?;
    let software = device.adapter().kind == DeviceKind::Cpu;
    let context = Context::open(if software { Preference::Software } else { Preference::Hardware })?;
    if context.is_software() != software {
        super::tell(&format!(
            "!!! OpenGL runs on {}, Vulkan on {}: not the same device.",
            context.renderer,
            device.adapter().name
        ));
    }
    let geometry =
        session::geometry(&scene, &Wishes { preset: Some(Preset::Original), ..Wishes::default() })?;
    let (width, height) = arguments.size.unwrap_or(if arguments.quick { (160, 100) } else { (1024, 640) });
    let mut record = Record {
        device: device.adapter().name.clone(),
        driver: device.adapter().driver.clone(),
        gl_renderer: context.renderer.clone(),
        gl_version: context.version.clone(),
        gl_platform: context.platform,
        scene: scene.path.clone(),
        size: [width, height],
        rows: Vec::new(),
        auto: None,
        manifest: Manifest::new(&scene, device.adapter(), arguments.seed),
    };
    for &method in &arguments.methods {
        super::tell(&format!("{method} ..."));
        match compare(arguments, &scene, &geometry, &device, &context, method, record.size) {
            Ok((row, images)) => {
                write_images(&arguments.output, &row.method, &images, record.size, &record.manifest)?;
                record.rows.push(row);
                write_tables(&arguments.output, &record)?;
            }
            // A row that fails does not lose the others.
            Err(error) => super::tell(&format!("{method} is left out: {error}")),
        }
    }
    if record.rows.is_empty() {
        return Err(Error::device("No method could be compared: see above."));
    }
    // The first form finds camera hits alone.
    let compute: Vec<&Row> = record.rows.iter().filter(|row| row.method != fragment::NAME).collect();
    if !compute.is_empty() {
        super::tell("auto ...");
        match render_auto(arguments, &scene, &device, record.size) {
            Ok(renders) => {
                record.auto = Auto::beside(&compute, renders);
                write_tables(&arguments.output, &record)?;
            }
            Err(error) => super::tell(&format!("auto is left out: {error}")),
        }
    }
    super::print(&table(&record))
}

/// Samples of the render by the default choices, and how often it is done and measured.
const AUTO_SAMPLES: u32 = 64;
const AUTO_RENDERS: usize = 5;

/// The same picture by the default choices.
fn render_auto(arguments: &Arguments, scene: &Scene, device: &Device, size: [u32; 2]) -> Result<Renders> {
    let job = job(arguments, scene, size, AUTO_SAMPLES)?;
    let wishes = job.wishes(&Wishes::default().on(device.adapter().kind));
    let geometry = session::geometry(scene, &wishes)?;
    let wishes = preview::wishes_for(&job, &wishes, scene, &geometry, device.adapter().kind);
    let decision = auto::decide(&wishes, &geometry, device.adapter());
    let plan = Plan::new(job, scene, &geometry, &decision, &device.adapter().limits)?;
    // A driver may compile kernels when they first run.
    let first = execute::run(device, &plan, &mut |_| {})?;
    let mut renders = Renders {
        method: plan.settings.method.to_string(),
        passes: plan.settings.passes.to_string(),
        samples: AUTO_SAMPLES,
        rays: first.primary_rays + first.ambient_rays,
        gpu_ms: Vec::new(),
    };
    for _ in 0..AUTO_RENDERS {
        let outcome = execute::run(device, &plan, &mut |_| {})?;
        renders.gpu_ms.push(outcome.kernels.iter().map(|kernel| kernel.gpu_ms).sum());
    }
    Ok(renders)
}

fn job(arguments: &Arguments, scene: &Scene, [width, height]: [u32; 2], samples: u32) -> Result<Job> {
    Ok(Job {
        camera: arguments.camera.camera(scene, Preset::Original)?,
        size: (width, height),
        samples: 0..samples,
        seed: arguments.seed,
        max_distance: None,
        jitters: 1,
        adaptive: false,
        goal: Goal::Samples,
        block: None,
    })
}

/// One method's row and images.
fn compare(
    arguments: &Arguments,
    scene: &Scene,
    geometry: &Geometry,
    device: &Device,
    context: &Context,
    form: Form,
    size: [u32; 2],
) -> Result<(Row, Images)> {
    let frames = arguments.frames.unwrap_or(if arguments.quick { 16 } else { 32 });
    let job = job(arguments, scene, size, 4 * frames)?;
    let method = match form {
        Form::Fragment => Method::Brute,
        Form::Compute(method) => method,
    };
    let wishes = Wishes { preset: Some(Preset::Original), method: Some(method), ..Wishes::default() };
    let decision = auto::decide(&wishes, geometry, device.adapter());
    let plan = Plan::new(job, scene, geometry, &decision, &device.adapter().limits)?;
    // Who asks for a number of frames gets them, however long they take.
    let patience_s = match (arguments.frames, arguments.quick) {
        (Some(_), _) => f64::INFINITY,
        (None, true) => 8.0,
        (None, false) => 120.0,
    };
    let effort = Effort { frames, warm_up: 4, patience_s };
    if let Form::Fragment = form {
        let inputs = fragment::Inputs::new(scene, geometry, &plan)?;
        // Its own device: once lavapipe has drawn, its timestamps of compute work are wrong.
        let device = Device::open(device.instance(), device.adapter())?;
        let stage = fragment::VulkanStage::new(&device, &inputs, &plan)?;
        let mut gl = fragment::OpenGlFragment::new(context, &inputs, &plan)?;
        let (row, images) = measure(&form.to_string(), &mut gl, &mut stage.bind()?, &effort)?;
        return Ok((Row { gl_timer: gl.timer(), ..row }, images));
    }
    let mut gl = OpenGlFrames::new(context, &plan)?;
    let stage = Stage::new(device, &plan)?;
    let (row, images) = measure(&form.to_string(), &mut gl, &mut stage.bind()?, &effort)?;
    Ok((Row { gl_timer: gl.timer(), ..row }, images))
}

fn write_tables(folder: &Path, record: &Record) -> Result<()> {
    Output::claim(&folder.join("compare.json"))?.write(|out| {
        serde_json::to_writer_pretty(&mut *out, record)?;
        out.write_all(b"\n")
    })?;
    Output::claim(&folder.join("compare.csv"))?.write(|out| {
        writeln!(
            out,
            "method,frames,gl_ms_median,gl_ms_low,gl_ms_high,gl_timer,vk_ms_median,vk_ms_low,vk_ms_high,ratio,ratio_low,\
             ratio_high,pixels_different,max_difference"
        )?;
        for row in &record.rows {
            let timer = if row.gl_timer == TimerKind::Wall { "wall" } else { "device" };
            let numbers = |median: f64, [low, high]: [f64; 2]| format!("{median},{low},{high}");
            writeln!(
                out,
                "{},{},{},{timer},{},{},{},{}",
                row.method,
                row.frames,
                numbers(row.gl_ms_median, row.gl_ms_ci95),
                numbers(row.vk_ms_median, row.vk_ms_ci95),
                numbers(row.ratio, row.ratio_ci95),
                row.difference.pixels_different,
                row.difference.max_difference
            )?;
        }
        Ok(())
    })
}

fn table(record: &Record) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["method", "frames", "OpenGL ms", "Vulkan ms", "Vulkan/OpenGL", "pixels apart", "most"]);
    for row in &record.rows {
        let wall = if row.gl_timer == TimerKind::Wall { " (wall)" } else { "" };
        table.add_row([
            row.method.clone(),
            row.frames.to_string(),
            format!("{:.3} [{:.3}, {:.3}]{wall}", row.gl_ms_median, row.gl_ms_ci95[0], row.gl_ms_ci95[1]),
            format!("{:.3} [{:.3}, {:.3}]", row.vk_ms_median, row.vk_ms_ci95[0], row.vk_ms_ci95[1]),
            format!("{:.3} [{:.3}, {:.3}]", row.ratio, row.ratio_ci95[0], row.ratio_ci95[1]),
            row.difference.pixels_different.to_string(),
            format!("{:.4}", row.difference.max_difference),
        ]);
    }
    let auto = record.auto.as_ref().map_or_else(String::new, said_of_auto);
    format!(
        "{} {}x{}\nVulkan   {} ({})\nOpenGL   {} ({}, {})\n\n{}{auto}",
        record.scene,
        record.size[0],
        record.size[1],
        record.device,
        record.driver,
        record.gl_renderer,
        record.gl_version,
        record.gl_platform,
        table.trim_fmt()
    )
}

fn said_of_auto(auto: &Auto) -> String {
    format!(
        "\n\nauto ({} by {}, {} samples) takes {:.3} ms a sample [{:.3}, {:.3}], {:.1} Mrays/s: {:.1} [{:.1}, {:.1}] times as fast as {} on OpenGL with \
         {:.3} ms.",
        auto.method,
        auto.passes,
        auto.samples,
        auto.ms_per_sample,
        auto.ms_per_sample_ci95[0],
        auto.ms_per_sample_ci95[1],
        auto.mrays_per_s,
        auto.times_as_fast,
        auto.times_as_fast_ci95[0],
        auto.times_as_fast_ci95[1],
        auto.original,
        auto.original_ms_per_sample,
    )
}

/// The two images, the two side by side, and where they differ: black for equal, red for a step of a byte,
/// white for a tenth of the range and more.
fn write_images(
    folder: &Path,
    method: &str,
    images: &Images,
    size: [u32; 2],
    manifest: &Manifest,
) -> Result<()> {
    let [width, height] = size;
    let shown = |pixels: &[[f32; 4]], x: u32, y: u32| {
        let pixel = pixels[(y * width + x) as usize];
        Rgb([0, 1, 2].map(|channel| Encoding::Srgb.byte(pixel[channel])))
    };
    let heat = |x: u32, y: u32| {
        let place = (y * width + x) as usize;
        let apart = (images.gl[place][0] - images.vk[place][0]).abs();
        let channel = |from: f32, to: f32| (((apart - from) / (to - from)).clamp(0.0, 1.0) * 255.0) as u8;
        Rgb([channel(0.0, 1.0 / 255.0), channel(1.0 / 255.0, 0.03), channel(0.03, 0.1)])
    };
    let pictures = [
        ("gl", RgbImage::from_fn(width, height, |x, y| shown(&images.gl, x, y))),
        ("vk", RgbImage::from_fn(width, height, |x, y| shown(&images.vk, x, y))),
        (
            "both",
            RgbImage::from_fn(2 * width, height, |x, y| {
                if x < width { shown(&images.gl, x, y) } else { shown(&images.vk, x - width, y) }
            }),
        ),
        ("difference", RgbImage::from_fn(width, height, heat)),
    ];
    for (name, picture) in pictures {
        let path = folder.join(format!("{method}-{name}.png"));
        Output::claim(&path)?
            .write(|mut out| png::write_rgb(&picture, Encoding::Srgb, manifest, &mut out))?;
    }
    Ok(())
}
