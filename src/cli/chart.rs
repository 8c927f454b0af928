//! `cousu chart`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::args::{CameraArguments, distance, size};
use super::bench::subject;
use super::progress::{Meter, RowMeter};
use super::session::{self, DeviceArguments};
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::lab::chart::curves::{self, Choices, Lists};
use crate::lab::chart::levels::{MOST_SPP, Rule};
use crate::lab::chart::results::{Curve, Point, TimeTo};
use crate::lab::chart::{Chart, Given, Options, SceneFacts, Watch};
use crate::render::choices::{Method, Passes, Preset, Sampler, Wishes};
use crate::render::geometry::Geometry;
use crate::render::tally::Progress;
use crate::report::atomic::{Output, folder, refuse_overwriting};
use crate::report::chart::{Record, write_csv};
use crate::report::chart_resume::Earlier;
use crate::report::exr_references::{References, usual_folder};
use crate::report::manifest::Manifest;
use crate::report::png::{self, Encoding};
use crate::report::{chart_plot, chart_table, exr_read};
use crate::scene::Scene;
use crate::vk::{Adapter, DeviceKind};

#[derive(Args)]
pub struct Arguments {
    /// OBJ files, or procedural scenes by name, such as hairball or hairball:100000 (so many triangles) [default: cornell
    /// and maison; with --quick cornell]
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Folder for chart.json, chart.csv and each scene's pictures; a run that was cut goes on with the same folder
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Width and height of the pictures in pixels [default: 1024x640; on a CPU device 256x160; with --quick 64x40]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Most samples of a pixel; curves have 4, 16, 64, 256 ... [default: until RMSE 0.0009 or the budget's end]
    #[arg(long, value_name = "MAX", value_parser = clap::value_parser!(u32).range(4..=i64::from(MOST_SPP)))]
    spp: Option<u32>,
    /// GPU time that a curve may take, seconds [default: 10; on a CPU device 60; with --quick 1]
    #[arg(long, value_name = "S", value_parser = seconds)]
    budget: Option<f64>,
    /// Methods, separated by commas; lists are multiplied with each other and stand beside the original made unbiased and
    /// the default choices [default: the curves listed below]
    #[arg(long, value_delimiter = ',', value_name = "METHODS")]
    methods: Option<Vec<Method>>,
    /// Builders, separated by commas
    #[arg(long, value_delimiter = ',', value_name = "BUILDERS")]
    builders: Option<Vec<Builder>>,
    /// Ways of cutting a render into kernels, separated by commas
    #[arg(long, value_delimiter = ',', value_name = "PASSES")]
    passes: Option<Vec<Passes>>,
    /// Samplers, separated by commas
    #[arg(long, value_delimiter = ',', value_name = "SAMPLERS")]
    samplers: Option<Vec<Sampler>>,
    /// Curves to keep, by label, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "LABELS")]
    only: Vec<String>,
    /// A picture to compare with instead of references that the command makes: EXR as render writes it. Twice: two that
    /// are independent of each other, whose own noise then drops out
    #[arg(long, value_name = "FILE")]
    reference: Vec<PathBuf>,
    /// Samples of each of the two references that the command makes [default: 65536; with --quick 8192]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SPP)))]
    reference_spp: Option<u32>,
    /// Folder where references are kept for later runs, on any device [default: cousu/references in the user's cache
    /// folder]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Bounded ambient occlusion: occluders farther away than this do not count, units of the file
    #[arg(long, value_name = "D", value_parser = distance)]
    max_distance: Option<f64>,
    /// A first look: small pictures, a small budget and coarser references
    #[arg(long)]
    quick: bool,
    /// Seed of the random numbers and of scenes with chance in them
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u32,
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    device: DeviceArguments,
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && f64::is_finite(seconds) => Ok(seconds),
        _ => Err("give a positive number of seconds, such as 30".to_string()),
    }
}

/// Samples of a reference: errors of 0.001 can be read with them.
const REFERENCE_SPP: u32 = 65_536;
const QUICK_REFERENCE_SPP: u32 = 8192;
/// Runs of a point are enough when they took this part of the budget together.
const ENOUGH: f64 = 0.03;
/// The clock may move by so much before a person is told.
const STEADY: f64 = 1.05;

pub fn run(arguments: &Arguments) -> Result<()> {
    let scenes = match &arguments.scenes[..] {
        [] if arguments.quick => vec!["cornell".to_string()],
        [] => vec!["cornell".into(), "maison".into()],
        named => named.to_vec(),
    };
    check(arguments, &scenes)?;
    let (earlier, note) = Earlier::read(&arguments.output.join("chart.json"));
    let device = session::open(&arguments.device)?;
    let adapter = device.adapter();
    let options = options(arguments, adapter);
    let given = given(arguments, options.size)?;
    let manifest = Manifest::of_several(&[], adapter, options.seed);
    let mut run = Run {
        record: Record {
            device: adapter.name.clone(),
            driver: adapter.driver.clone(),
            size: [options.size.0, options.size.1],
            seed: options.seed,
            budget_s: options.rule.budget_ms * 1e-3,
            clock_spread: None,
            scenes: Vec::new(),
            curves: Vec::new(),
            time_to_rmse: Vec::new(),
            notes: Vec::new(),
            pictures: Vec::new(),
            manifest,
        },
        folder: &arguments.output,
        earlier,
        resumes: false,
        taken: 0,
        scene: String::new(),
        meter: RowMeter::new(),
        reference: None,
    };
    note.iter().for_each(|note| run.note(note));
    notes_on_references(arguments, &options, given.as_ref()).iter().for_each(|note| run.note(note));
    super::print(&format!("{} ({})\n", run.record.device, run.record.driver))?;
    let chart = Chart::new(&device, &options)?;
    let mut hashes = Vec::new();
    let mut first_error = None;
    for name in &scenes {
        let outcome = subject(name, arguments.seed).and_then(|subject| {
            hashes.push(subject.scene.hash);
            run.record.manifest = Manifest::of_several(&hashes, adapter, options.seed);
            let camera = arguments.camera.camera(&subject.scene, Preset::Auto)?;
            let mut store = store(arguments, &run.record.manifest, &mut run.record.notes)?;
            run.meter.scene(name);
            run.scene.clone_from(name);
            chart.scene(&subject, camera, given.as_ref(), &mut store, &mut run)?;
            store.note.iter().for_each(|note| run.note(note));
            run.record.clock_spread = chart.drift.spread();
            run.scene_done()
        });
        if let Err(error) = outcome {
            run.note(&format!("{name} is left out: {error}"));
            first_error.get_or_insert(error);
        }
    }
    run.finish(first_error)
}

/// What can be told before the work begins: places for results, references that do not fit.
fn check(arguments: &Arguments, scenes: &[String]) -> Result<()> {
    if arguments.reference.len() > 2 {
        return Err(Error::usage("--reference is given more than twice: choose one or two pictures."));
    }
    if !arguments.reference.is_empty() && scenes.len() != 1 {
        return Err(Error::usage(
            "--reference is a picture of one scene: name that scene alone, or leave --reference out.",
        ));
    }
    let asked = Lists { only: Vec::new(), ..lists(arguments) };
    let labels: Vec<String> = curves::variants(&asked).into_iter().map(|variant| variant.label).collect();
    if let Some(unknown) = arguments.only.iter().find(|label| !labels.contains(label)) {
        return Err(Error::usage(format!(
            "There is no curve {unknown:?} for --only: choose among {}.",
            labels.join(", ")
        )));
    }
    folder(&arguments.output)?;
    let mut results = vec![arguments.output.join("chart.json"), arguments.output.join("chart.csv")];
    results.extend(scenes.iter().flat_map(|scene| pictures(&arguments.output, scene)));
    let mut unlike = results.clone();
    unlike.sort();
    unlike.dedup();
    let results: Vec<&Path> = unlike.iter().map(PathBuf::as_path).collect();
    let inputs: Vec<&Path> = scenes.iter().map(Path::new).filter(|path| path.exists()).collect();
    let references = arguments.reference.iter().map(PathBuf::as_path);
    refuse_overwriting(&results, &inputs.into_iter().chain(references).collect::<Vec<_>>())?;
    results.iter().try_for_each(|path| Output::claim(path).map(drop))
}

/// A scene's PNG and SVG.
fn pictures(folder: &Path, scene: &str) -> [PathBuf; 2] {
    let stem = Path::new(scene).file_stem().map_or(scene.into(), |stem| stem.to_string_lossy());
    let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '-' };
    let name: String = stem.chars().map(plain).collect();
    ["png", "svg"].map(|ending| folder.join(format!("chart-{name}.{ending}")))
}

fn lists(arguments: &Arguments) -> Lists {
    Lists {
        methods: arguments.methods.clone(),
        builders: arguments.builders.clone(),
        passes: arguments.passes.clone(),
        samplers: arguments.samplers.clone(),
        only: arguments.only.clone(),
    }
}

fn options(arguments: &Arguments, adapter: &Adapter) -> Options {
    let on_cpu = adapter.kind == DeviceKind::Cpu;
    let size = match (arguments.quick, on_cpu) {
        (true, _) => (64, 40),
        (false, true) => (256, 160),
        (false, false) => (1024, 640),
    };
    let budget_s = match (arguments.quick, on_cpu) {
        (true, _) => 1.0,
        (false, true) => 60.0,
        (false, false) => 10.0,
    };
    let budget_ms = arguments.budget.unwrap_or(budget_s) * 1e3;
    let reference_spp = if arguments.quick { QUICK_REFERENCE_SPP } else { REFERENCE_SPP };
    Options {
        size: arguments.size.unwrap_or(size),
        seed: arguments.seed,
        max_distance: arguments.max_distance,
        rule: Rule { budget_ms, most_spp: arguments.spp.unwrap_or(MOST_SPP) },
        enough_ms: budget_ms * ENOUGH,
        lists: lists(arguments),
        reference_spp: arguments.reference_spp.unwrap_or(reference_spp),
    }
}

/// References from files.
fn given(arguments: &Arguments, size: (u32, u32)) -> Result<Option<Given>> {
    if arguments.reference.is_empty() {
        return Ok(None);
    }
    let mut given = Given { pictures: Vec::new(), keys: Vec::new() };
    for path in &arguments.reference {
        let picture = exr_read::read(path, size)?.picture;
        let hash = |values: &[f32]| xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(values));
        let key = format!("{:016x}{:016x}", hash(&picture.light), hash(&picture.coverage));
        if given.keys.contains(&key) {
            return Err(Error::usage(format!(
                "{} is the same picture as the reference before it: give two of different seeds, or one.",
                path.display()
            )));
        }
        given.pictures.push(picture);
        given.keys.push(key);
    }
    Ok(Some(given))
}

fn notes_on_references(arguments: &Arguments, options: &Options, given: Option<&Given>) -> Vec<String> {
    let mut notes = Vec::new();
    match given {
        Some(given) if given.pictures.len() == 1 => notes.push(
            "There is one reference: what it differs from the truth by is in every RMSE and bias. Give two that are \
             independent of each other to have its noise drop out."
                .into(),
        ),
        Some(_) => {}
        None if options.reference_spp < REFERENCE_SPP => notes.push(format!(
            "The references have {} samples a pixel, {}: small errors are resolved less well than with {REFERENCE_SPP}.",
            options.reference_spp,
            if arguments.quick { "a quick look" } else { "as asked for" }
        )),
        None => {}
    }
    notes
}

/// Where references are kept: as asked for, or in the user's cache folder if it can be written.
fn store(arguments: &Arguments, manifest: &Manifest, notes: &mut Vec<String>) -> Result<References> {
    if let Some(place) = &arguments.cache {
        return References::new(Some(place), manifest.text());
    }
    let place = usual_folder();
    References::new(place.as_deref(), manifest.text()).or_else(|error| {
        let note = format!("References are not kept for later runs: {error}");
        super::tell(&note);
        notes.push(note);
        References::new(None, manifest.text())
    })
}

/// A run under way: its record, saved with every point.
struct Run<'a> {
    record: Record,
    folder: &'a Path,
    earlier: Earlier,
    /// The earlier run asked the same of this scene.
    resumes: bool,
    /// Points taken over from it.
    taken: usize,
    scene: String,
    meter: RowMeter,
    /// The number of the reference that is made, and how far it is.
    reference: Option<(usize, Meter)>,
}

impl Run<'_> {
    fn save(&self) -> Result<()> {
        Output::claim(&self.folder.join("chart.json"))?.write(|out| {
            serde_json::to_writer_pretty(&mut *out, &self.record)?;
            out.write_all(b"\n")
        })
    }

    fn quiet(&mut self) {
        self.meter.clear();
        if let Some((_, meter)) = self.reference.take() {
            meter.finish();
        }
    }

    /// The scene's table and pictures.
    fn scene_done(&mut self) -> Result<()> {
        self.quiet();
        let Some(facts) = self.record.scenes.iter().find(|facts| facts.scene == self.scene).cloned() else {
            return Ok(());
        };
        let [png_path, svg_path] = pictures(self.folder, &self.scene);
        let fail = |error: std::io::Error| Error::other(format!("The chart could not be drawn ({error})."));
        let pixels = chart_plot::pixels(&self.record, &facts).map_err(fail)?;
        let svg = chart_plot::svg(&self.record, &facts).map_err(fail)?;
        Output::claim(&png_path)?
            .write(|mut out| png::write_rgb(&pixels, Encoding::Srgb, &self.record.manifest, &mut out))?;
        Output::claim(&svg_path)?.write(|out| out.write_all(svg.as_bytes()))?;
        let names = [png_path, svg_path];
        let names = names.iter().filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
        self.record.pictures.extend(names);
        Output::claim(&self.folder.join("chart.csv"))?
            .write(|mut out| write_csv(&self.record.curves, &mut out))?;
        self.save()?;
        super::print(&format!("{}\n", chart_table::table(&self.record, &facts)))
    }

    fn finish(mut self, first_error: Option<Error>) -> Result<()> {
        self.quiet();
        if self.record.curves.is_empty() {
            let nothing = || Error::device("No curve could be measured: see above.");
            return Err(first_error.unwrap_or_else(nothing));
        }
        if let Some(spread) = self.record.clock_spread.filter(|spread| *spread > STEADY) {
            self.note(&format!(
                "!!! {} ran up to {:.0}% slower at times (its clock fell, or others were at work on it): times differ by as \
                 much for no other reason.",
                self.record.device,
                (spread - 1.0) * 100.0
            ));
        }
        self.save()?;
        super::print(chart_table::LEGEND)
    }
}

impl Watch for Run<'_> {
    fn build(&mut self, scene: &Scene, wishes: &Wishes) -> Result<Geometry> {
        self.quiet();
        session::geometry(scene, wishes)
    }

    fn note(&mut self, text: &str) {
        self.quiet();
        super::tell(text);
        self.record.notes.push(text.to_string());
    }

    fn reference(&mut self, number: usize, progress: &Progress) {
        if self.reference.as_ref().is_none_or(|(known, _)| *known != number) {
            self.quiet();
            super::tell(&format!("{}: reference {} of 2", self.scene, number + 1));
            self.reference = Some((number, Meter::new()));
        }
        if let Some((_, meter)) = &mut self.reference {
            meter.observe(progress);
        }
    }

    fn begin(&mut self, facts: SceneFacts) -> Result<()> {
        self.quiet();
        self.taken = 0;
        self.resumes = true;
        if let Some(difference) = self.earlier.differs(&self.record, &facts) {
            self.resumes = false;
            self.note(&format!(
                "{}: chart.json answers another question ({difference}) and is written anew.",
                facts.scene
            ));
        }
        self.record.scenes.retain(|known| known.scene != facts.scene);
        self.record.scenes.push(facts);
        Ok(())
    }

    fn known(&mut self, _label: &str, choices: &Choices) -> Vec<Point> {
        if !self.resumes {
            return Vec::new();
        }
        let points = self.earlier.points(&self.scene, choices);
        self.taken += points.len();
        points
    }

    fn progress(&mut self, what: &str, done: usize, all: usize) {
        self.meter.observe(what, done, all);
    }

    fn measured(&mut self, curves: &[Curve], times: &[TimeTo]) -> Result<()> {
        if self.taken > 0 {
            let taken = std::mem::take(&mut self.taken);
            self.quiet();
            super::tell(&format!("{}: {taken} points are taken over from chart.json.", self.scene));
        }
        let scene = self.scene.clone();
        self.record.set_scene(&scene, curves, times);
        self.save()
    }
}
