//! `cousu stability`.

use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::Instant;

use clap::Args;

use super::args::size;
use super::progress::RowMeter;
use super::session::{self, DeviceArguments};
use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::lab::scenes::procedural;
use crate::lab::stability::{EXPERIMENTS, Earlier, Experiment, Findings, Lab, usual_size};
use crate::render::choices::Method;
use crate::report::atomic::{Output, folder, refuse_overwriting};
use crate::report::manifest::Manifest;
use crate::report::png;
use crate::report::stability::{Line, Record, Told, table, write_csv};
use crate::scene::Scene;

#[derive(Args)]
#[command(after_help = names())]
pub struct Arguments {
    /// Further closed meshes for `watertight`, Wavefront OBJ files
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Folder for the matrix (stability.json, stability.csv) and the pictures
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Where the matrix goes as JSON beside that; - is the standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Experiments to run, by name, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = known)]
    only: Vec<String>,
    /// Methods that take part beside auto, separated by commas [default: all; a stack is as deep as its tree needs]
    #[arg(long, value_delimiter = ',', value_name = "METHODS")]
    methods: Vec<Method>,
    /// Width and height of the pictures in pixels [default: 1024x640; on a CPU device 160x100]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// A stability.json of another device, with whose pictures `bits` compares this one's
    #[arg(long, value_name = "FILE")]
    with: Option<PathBuf>,
    /// A first look: fewer trials
    #[arg(long)]
    quick: bool,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u32,
    #[command(flatten)]
    device: DeviceArguments,
}

fn names() -> String {
    let lines: Vec<String> = EXPERIMENTS
        .iter()
        .map(|experiment| format!("  {:13} {}", experiment.name, experiment.what))
        .collect();
    format!("Experiments:\n{}", lines.join("\n"))
}

fn known(name: &str) -> std::result::Result<String, String> {
    let names: Vec<&str> = EXPERIMENTS.iter().map(|experiment| experiment.name).collect();
    if names.contains(&name) {
        Ok(name.to_string())
    } else {
        Err(format!("choose among {}", names.join(", ")))
    }
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let to_stdout = arguments.json.as_deref() == Some(Path::new("-"));
    let outputs =
        Outputs { folder: &arguments.output, json: arguments.json.as_deref().filter(|_| !to_stdout) };
    let inputs: Vec<&Path> = arguments.scenes.iter().chain(&arguments.with).map(PathBuf::as_path).collect();
    outputs.check(&inputs)?;
    let scenes = arguments.scenes.iter().map(|path| Scene::load(path)).collect::<Result<Vec<_>>>()?;
    let with = arguments.with.as_deref().map(Earlier::read).transpose()?;
    if let Some(earlier) = &with {
        earlier.check(arguments.quick, arguments.seed)?;
    }
    let device = session::open(&arguments.device)?;
    let adapter = device.adapter();
    let size = arguments.size.unwrap_or(usual_size(adapter.kind, arguments.quick));
    let mut record = Record {
        device: adapter.name.clone(),
        driver: adapter.driver.clone(),
        size: [size.0, size.1],
        quick: arguments.quick,
        experiments: Vec::new(),
        rows: Vec::new(),
        manifest: Manifest::new(&procedural("cornell", None, arguments.seed)?, adapter, arguments.seed),
    };
    let chosen = |experiment: &&Experiment| {
        arguments.only.is_empty() || arguments.only.iter().any(|name| name == experiment.name)
    };
    let experiments: Vec<&Experiment> = EXPERIMENTS.iter().filter(chosen).collect();
    let meter = std::cell::RefCell::new(RowMeter::new());
    for (place, experiment) in experiments.iter().enumerate() {
        meter.borrow_mut().scene(experiment.name);
        let observe = |what: &str, done: f64| {
            let steps = ((place as f64 + done.clamp(0.0, 1.0)) * 100.0) as usize;
            meter.borrow_mut().observe(what, steps, experiments.len() * 100);
        };
        let lab = Lab {
            device: &device,
            quick: arguments.quick,
            seed: arguments.seed,
            size,
            scenes: &scenes,
            compiled: Rc::default(),
            methods: arguments.methods.clone(),
            with: with.as_ref(),
            observe: &observe,
        };
        let start = Instant::now();
        let Findings { rows, figures } = experiment.run(&lab)?;
        meter.borrow_mut().clear();
        if !to_stdout {
            super::print(&table(experiment, &rows))?;
        }
        record.experiments.push(Told {
            experiment: experiment.name,
            what: experiment.what,
            counts: experiment.counts,
            worst: experiment.worst,
            pictures: outputs.write_figures(&figures, &record.manifest)?,
            seconds: start.elapsed().as_secs_f64(),
        });
        record.rows.extend(rows.into_iter().map(|row| Line { experiment: experiment.name, row }));
        outputs.write(&record)?;
    }
    if to_stdout {
        let text = serde_json::to_string_pretty(&record)
            .map_err(|error| Error::other(format!("The matrix could not be written ({error}).")))?;
        super::print(&text)?;
    }
    Ok(())
}

/// Where results go.
struct Outputs<'a> {
    folder: &'a Path,
    json: Option<&'a Path>,
}

impl Outputs<'_> {
    fn tables(&self) -> impl Iterator<Item = PathBuf> {
        [self.folder.join("stability.json")].into_iter().chain(self.json.map(Path::to_path_buf))
    }

    fn csv(&self) -> PathBuf {
        self.folder.join("stability.csv")
    }

    /// Places that can't be written are told before the work begins.
    fn check(&self, inputs: &[&Path]) -> Result<()> {
        folder(self.folder)?;
        let all: Vec<PathBuf> = self.tables().chain([self.csv()]).collect();
        let all: Vec<&Path> = all.iter().map(PathBuf::as_path).collect();
        refuse_overwriting(&all, inputs)?;
        all.iter().try_for_each(|path| Output::claim(path).map(drop))
    }

    fn write(&self, record: &Record) -> Result<()> {
        self.tables().try_for_each(|path| {
            Output::claim(&path)?.write(|out| {
                serde_json::to_writer_pretty(&mut *out, record)?;
                out.write_all(b"\n")
            })
        })?;
        Output::claim(&self.csv())?.write(|mut out| write_csv(record, &mut out))
    }

    /// Names of the files written.
    fn write_figures(&self, figures: &[Figure], manifest: &Manifest) -> Result<Vec<String>> {
        let mut names = Vec::new();
        for figure in figures {
            let name = format!("{}.png", figure.name);
            Output::claim(&self.folder.join(&name))?
                .write(|mut out| png::write_figure(figure, manifest, &mut out))?;
            names.push(name);
        }
        Ok(names)
    }
}
