//! `cousu chart`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;

use super::args::{CameraArguments, distance, seconds, size};
use super::bench::subject;
use super::chart_run::{ENDINGS, Run};
use super::session::{self, DeviceArguments};
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::lab::chart::curves::{self, Lists};
use crate::lab::chart::levels::{MOST_SPP, Rule};
use crate::lab::chart::{Chart, Given, Options, Watch};
use crate::render::choices::{Method, Passes, Preset, Sampler};
use crate::report::atomic::{Output, folder, refuse_overwriting};
use crate::report::chart::{Listed, Record};
use crate::report::chart_resume::Earlier;
use crate::report::exr_read;
use crate::report::exr_references::{References, try_folder, usual_folder};
use crate::report::manifest::Manifest;
use crate::vk::{Adapter, DeviceKind};

#[derive(Args)]
#[command(after_help = labels())]
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
    budget: Option<Duration>,
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

fn labels() -> String {
    format!(
        "Curves:\n  {}\n(8-bit is the original made unbiased but for its running mean in bytes; stack has as many entries as the \
         tree needs; fixed-seed draws the same four numbers again and again.)",
        curves::labels().join(", ")
    )
}

/// Samples of a reference: errors of 0.001 can be read with them.
const REFERENCE_SPP: u32 = 65_536;
const QUICK_REFERENCE_SPP: u32 = 8192;
/// Runs of a point are enough when they took this part of the budget together.
const ENOUGH: f64 = 0.03;

pub fn run(arguments: &Arguments) -> Result<()> {
    let mut scenes = match &arguments.scenes[..] {
        [] if arguments.quick => vec!["cornell".to_string()],
        [] => vec!["cornell".into(), "maison".into()],
        named => named.to_vec(),
    };
    let mut named = Vec::new();
    scenes.retain(|scene| {
        !named.contains(scene) && {
            named.push(scene.clone());
            true
        }
    });
    check(arguments, &scenes)?;
    let (place, unkept) = place_of_references(arguments)?;
    let (earlier, note) = Earlier::read(&arguments.output.join("chart.json"));
    let device = session::open(&arguments.device)?;
    let adapter = device.adapter();
    let options = options(arguments, adapter);
    let given = given(arguments, options.size)?;
    let record = Record {
        device: adapter.name.clone(),
        driver: adapter.driver.clone(),
        size: [options.size.0, options.size.1],
        seed: options.seed,
        budget_s: options.rule.budget_ms * 1e-3,
        clock_spread: None,
        scenes: Listed::default(),
        curves: Listed::default(),
        time_to_rmse: Listed::default(),
        notes: Vec::new(),
        pictures: Vec::new(),
        manifest: Manifest::of_several(&[], adapter, options.seed),
    };
    let mut run = Run::new(record, &arguments.output, &scenes, earlier)?;
    note.iter().chain(&unkept).for_each(|note| run.note(note));
    notes_on_references(arguments, &options, given.as_ref()).iter().for_each(|note| run.note(note));
    super::print(&format!("{} ({})\n", run.record.device, run.record.driver))?;
    let chart = Chart::new(&device, &options)?;
    let mut hashes = Vec::new();
    let mut first_error = None;
    for (number, name) in scenes.iter().enumerate() {
        let outcome = subject(name, arguments.seed).and_then(|subject| {
            hashes.push(subject.scene.hash);
            run.record.manifest = Manifest::of_several(&hashes, adapter, options.seed);
            let camera = arguments.camera.camera(&subject.scene, Preset::Auto)?;
            let mut store = References::new(place.clone(), run.record.manifest.text());
            run.scene(name, &picture_name(&scenes, number));
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
    for place in 0..scenes.len() {
        let name = picture_name(scenes, place);
        results.extend(ENDINGS.map(|ending| arguments.output.join(format!("{name}.{ending}"))));
    }
    let results: Vec<&Path> = results.iter().map(PathBuf::as_path).collect();
    let inputs: Vec<&Path> = scenes.iter().map(Path::new).filter(|path| path.exists()).collect();
    let references = arguments.reference.iter().map(PathBuf::as_path);
    refuse_overwriting(&results, &inputs.into_iter().chain(references).collect::<Vec<_>>())?;
    results.iter().try_for_each(|path| Output::claim(path).map(drop))
}

/// What a scene's pictures are called, without ending: after its file, and numbered where that is another's name.
fn picture_name(scenes: &[String], place: usize) -> String {
    let stem = |scene: &String| -> String {
        let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '-' };
        let stem = Path::new(scene).file_stem().map_or(scene.into(), |stem| stem.to_string_lossy());
        stem.chars().map(plain).collect()
    };
    let mut names: Vec<String> = Vec::new();
    for scene in &scenes[..=place] {
        let own = format!("chart-{}", stem(scene));
        let numbered = (2..).map(|number| format!("{own}-{number}"));
        let free = std::iter::once(own.clone()).chain(numbered).find(|name| !names.contains(name));
        names.push(free.unwrap_or(own));
    }
    names.pop().unwrap_or_default()
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
    let budget_ms = arguments.budget.map_or(budget_s, |budget| budget.as_secs_f64()) * 1e3;
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

/// Where references are kept: as asked for, or in the user's cache folder if it can be written; otherwise nowhere, and the
/// text says why.
fn place_of_references(arguments: &Arguments) -> Result<(Option<PathBuf>, Option<String>)> {
    if let Some(place) = &arguments.cache {
        try_folder(place)?;
        return Ok((Some(place.clone()), None));
    }
    let reason = match usual_folder() {
        Some(place) => match try_folder(&place) {
            Ok(()) => return Ok((Some(place), None)),
            Err(error) => error.to_string(),
        },
        None => "COUSU_CACHE is off, or neither XDG_CACHE_HOME nor HOME names a folder.".into(),
    };
    Ok((None, Some(format!("References are not kept for later runs (--cache DIR keeps them): {reason}"))))
}
