//! `cousu render`.

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;

use super::args::{CameraArguments, ChoiceArguments, distance, error, seconds, size};
use super::progress::Meter;
use super::session::{self, DeviceArguments};
use crate::error::{Error, Result, joined};
use crate::layout::FRAME_SAMPLES;
use crate::render::execute;
use crate::render::picture::Picture;
use crate::render::plan::{Job, Plan};
use crate::render::rounds::{Goal, MOST_SAMPLES};
use crate::render::spans::{Span, Spans};
use crate::render::work::count_work;
use crate::render::{auto, preview};
use crate::report::atomic::{Output, refuse_overwriting};
use crate::report::manifest::Manifest;
use crate::report::png::Encoding;
use crate::report::record::RenderRecord;
use crate::report::trace::Timeline;
use crate::report::{exr, heatmap, png};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::vk::{Calibration, Device};

#[derive(Args)]
pub struct Arguments {
    /// The scene, a Wavefront OBJ file
    scene: PathBuf,
    /// Where the picture goes: .png (8 bits) or .exr (32-bit float, with coverage)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Where the record of the render goes; - is the standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1024x640")]
    size: (u32, u32),
    /// Ambient rays of each pixel whose camera ray hits [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SAMPLES)))]
    spp: Option<u32>,
    /// Instead of --spp: render until the estimated root mean square error of the covered pixels is E or less
    #[arg(long, value_name = "E", value_parser = error, conflicts_with = "spp")]
    target_rmse: Option<f64>,
    /// Instead of --spp: render for S seconds, loading and building not counted
    #[arg(long, value_name = "S", value_parser = seconds, conflicts_with_all = ["spp", "target_rmse"])]
    time: Option<Duration>,
    /// Share out the rays by the error: a few rays, which are thrown away, tell which pixels need more and which fewer; --spp
    /// is about the mean then. Pays where large parts are open
    #[arg(long)]
    adaptive: bool,
    /// Camera rays of a pixel, among which its ambient rays are dealt out: edges become smooth, to 1/K of a pixel
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=1024), default_value = "1")]
    antialias: u32,
    /// Seed of the random numbers: same seed, same picture
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u32,
    /// Bounded ambient occlusion: occluders farther away than this do not count, units of the file
    #[arg(long, value_name = "D", value_parser = distance)]
    max_distance: Option<f64>,
    /// Where a timeline of host and device goes, for Perfetto or chrome://tracing (Chrome trace format)
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Where a map of what each pixel's rays cost goes (PNG): node visits and triangle tests per ray, counted over up to
    /// 16 samples of a pixel
    #[arg(long, value_name = "FILE")]
    heatmap: Option<PathBuf>,
    /// Write linear bytes into a PNG instead of sRGB
    #[arg(long)]
    linear: bool,
    #[command(flatten)]
    choices: ChoiceArguments,
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    device: DeviceArguments,
}

/// Formats by the ending of the file's name.
#[derive(Clone, Copy)]
enum Format {
    Png,
    Exr,
}

fn format_of(path: &Path) -> Result<Format> {
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_lowercase);
    match ending.as_deref() {
        Some("png") => Ok(Format::Png),
        Some("exr") => Ok(Format::Exr),
        _ => Err(Error::usage(format!(
            "{} ends in neither .png nor .exr: choose one of them.",
            path.display()
        ))),
    }
}

/// Places for the results, claimed before the work.
struct Outputs {
    picture: Option<(Format, Output)>,
    json: Option<Output>,
    json_to_stdout: bool,
    trace: Option<Output>,
    heatmap: Option<Output>,
}

impl Outputs {
    fn claim(arguments: &Arguments) -> Result<Self> {
        let picture = match &arguments.output {
            Some(path) => Some((format_of(path)?, Output::claim(path)?)),
            None => None,
        };
        let json_to_stdout = arguments.json.as_deref() == Some(Path::new("-"));
        let json = match &arguments.json {
            Some(path) if !json_to_stdout => Some(Output::claim(path)?),
            _ => None,
        };
        let trace = arguments.trace.as_deref().map(Output::claim).transpose()?;
        if let Some(path) = &arguments.heatmap
            && !matches!(format_of(path), Ok(Format::Png))
        {
            return Err(Error::usage(format!("{} does not end in .png: the map is a PNG.", path.display())));
        }
        let heatmap = arguments.heatmap.as_deref().map(Output::claim).transpose()?;
        let claimed =
            [picture.as_ref().map(|(_, output)| output), json.as_ref(), trace.as_ref(), heatmap.as_ref()];
        let results: Vec<&Path> = claimed.into_iter().flatten().map(Output::path).collect();
        refuse_overwriting(&results, &[&arguments.scene])?;
        Ok(Self { picture, json, json_to_stdout, trace, heatmap })
    }

    fn write(self, picture: &Picture, record: &RenderRecord, encoding: Encoding) -> Result<()> {
        if let Some((format, output)) = self.picture {
            output.write(|mut out| match format {
                Format::Png => png::write(picture, encoding, &record.manifest, &mut out),
                Format::Exr => exr::write(picture, &record.manifest, out),
            })?;
        }
        if let Some(output) = self.json {
            output.write(|out| {
                serde_json::to_writer_pretty(&mut *out, record)?;
                out.write_all(b"\n")
            })?;
        }
        if self.json_to_stdout {
            let text = serde_json::to_string_pretty(record)
                .map_err(|error| Error::other(format!("The record could not be written ({error}).")))?;
            return super::print(&text);
        }
        super::print(&record.summary())
    }
}

/// Ambient rays of a pixel, if nothing else is asked for.
const DEFAULT_SPP: u32 = 64;

/// The same, so that each of a pixel's camera rays has two rays at least, of which the error can be told, and whole frames of the original.
pub(super) fn default_spp(jitters: u32) -> u32 {
    DEFAULT_SPP.max(2 * jitters).next_multiple_of(jitters * FRAME_SAMPLES)
}

/// Ambient rays of each of a pixel's camera rays.
pub(super) fn samples_of_camera_ray(spp: u32, jitters: u32) -> Result<u32> {
    if !spp.is_multiple_of(jitters) {
        return Err(Error::usage(format!(
            "--spp {spp} does not deal out evenly among the {jitters} camera rays of --antialias: choose a multiple \
             of {jitters}."
        )));
    }
    Ok(spp / jitters)
}

fn job(arguments: &Arguments, camera: Camera) -> Result<Job> {
    let jitters = arguments.antialias;
    let goal = match (arguments.target_rmse, arguments.time) {
        (Some(rmse), _) => Goal::Rmse(rmse),
        (None, Some(time)) => Goal::Time(time),
        (None, None) => Goal::Samples,
    };
    let spp = match (goal, arguments.spp) {
        (Goal::Samples, Some(spp)) => spp,
        (Goal::Samples, None) => default_spp(jitters),
        _ => MOST_SAMPLES / (jitters * FRAME_SAMPLES) * jitters * FRAME_SAMPLES,
    };
    Ok(Job {
        camera,
        size: arguments.size,
        samples: 0..samples_of_camera_ray(spp, jitters)?,
        seed: arguments.seed,
        max_distance: arguments.max_distance,
        jitters,
        adaptive: arguments.adaptive,
        goal,
        block: None,
    })
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let start = Instant::now();
    let mut spans = Spans::new(start);
    let mut outputs = Outputs::claim(arguments)?;
    let (trace, heatmap) = (outputs.trace.take(), outputs.heatmap.take());
    // A missing scene is told before a missing device.
    let (scene, device) = thread::scope(|scope| {
        let opening = scope.spawn(|| {
            let begin = Instant::now();
            session::open_silently(&arguments.device)
                .map(|device| (device, Span::beside("open device", begin)))
        });
        let begin = Instant::now();
        let scene = Scene::load(&arguments.scene)?;
        spans.phase("load scene", begin);
        let begin = Instant::now();
        let (device, span) = joined(opening)?;
        spans.phase("wait for the device", begin);
        spans.phases.push(span);
        Ok::<_, Error>((scene, device))
    })?;
    session::announce(&device);
    if !scene.report.dropped.is_empty() {
        super::tell(&format!("{}: {} (see `cousu inspect`)", scene.path, scene.report.dropped));
    }
    let camera = arguments.camera.camera(&scene, arguments.choices.preset)?;
    let adapter = device.adapter();
    let begin = Instant::now();
    let job = job(arguments, camera)?;
    let wishes = job.wishes(&arguments.choices.wishes().on(adapter.kind));
    let geometry = session::geometry(&scene, &wishes)?;
    spans.phase("build tree", begin);
    if geometry.without_area > 0 {
        super::tell(&format!(
            "{}: {} triangles left out, whose area 32-bit floats do not see",
            scene.path, geometry.without_area
        ));
    }
    if geometry.copies > 0 {
        super::tell(&format!(
            "{}: {} triangles left out, which have the corners of another",
            scene.path, geometry.copies
        ));
    }
    let begin = Instant::now();
    let wishes = preview::wishes_for(&job, &wishes, &scene, &geometry, adapter.kind);
    let decision = auto::decide(&wishes, &geometry, adapter);
    auto::check_stack(decision.settings.method, &geometry, arguments.choices.allow_overflow)?;
    let plan = Plan::new(job, &scene, &geometry, &decision, &adapter.limits)?;
    spans.phase("plan", begin);
    let mut meter = Meter::new(plan.job.goal);
    let mut calibration = if trace.is_some() { Calibration::new(&device)? } else { None };
    let begin = Instant::now();
    let wanted = trace.is_some().then_some(&mut spans);
    let outcome = thread::scope(|scope| {
        // For the record; no kernel waits for it.
        scope.spawn(|| geometry.quality());
        execute::run_traced(&device, &plan, &mut |progress| meter.observe(progress), wanted)
    })?;
    meter.finish();
    if let (Goal::Rmse(goal), Some(error)) = (plan.job.goal, outcome.error)
        && error.rmse > goal
    {
        super::tell(&format!(
            "!!! The error is {:.2e} after {MOST_SAMPLES} rays a pixel, more than the {goal:.2e} asked for.",
            error.rmse
        ));
    }
    spans.phase("render", begin);
    let begin = Instant::now();
    let picture = Picture::new(plan.tiles, &outcome.accumulated);
    spans.phase("resolve picture", begin);
    let manifest = Manifest::new(&scene, adapter, arguments.seed);
    let wall_s = start.elapsed().as_secs_f64();
    let record = RenderRecord::new(&scene, &plan, adapter, &outcome, manifest, wall_s);
    let encoding = if arguments.linear { Encoding::Linear } else { Encoding::Srgb };
    let begin = Instant::now();
    outputs.write(&picture, &record, encoding)?;
    spans.phase("write results", begin);
    if let Some(output) = trace {
        if let Some(calibration) = &mut calibration {
            calibration.again(&device)?;
        }
        let timeline = Timeline::new(&spans, calibration.as_ref(), &record.manifest);
        if let Some(note) = timeline.note() {
            super::tell(note);
        }
        output.write(|out| timeline.write(out))?;
    }
    match heatmap {
        Some(output) => write_heatmap(output, &device, &plan, &record.manifest),
        None => Ok(()),
    }
}

/// Samples of a pixel over which costs are counted, at most.
const HEATMAP_SAMPLES: u32 = 16;

fn write_heatmap(output: Output, device: &Device, plan: &Plan<'_>, manifest: &Manifest) -> Result<()> {
    let begin = plan.job.samples.start;
    let samples = (plan.job.samples.len() as u32).min(HEATMAP_SAMPLES);
    // One camera ray a pixel, and the same number of samples for all.
    let job = Job {
        samples: begin..begin + samples,
        jitters: 1,
        adaptive: false,
        goal: Goal::Samples,
        ..plan.job.clone()
    };
    let plan = plan.clone().with_job(job);
    let Some(work) = count_work(device, &plan)? else {
        return Err(Error::device(format!(
            "{} lacks the subgroup operations that counting needs: leave --heatmap out or choose another --device.",
            device.adapter().name
        )));
    };
    if work.repeats > 0 {
        super::tell(
            "The map counts some rays twice: the driver left loops early, and they were traced again from their start.",
        );
    }
    let map = heatmap::draw(&work, plan.tiles, samples);
    output.write(|mut out| png::write_rgb(&map, Encoding::Srgb, manifest, &mut out))
}
