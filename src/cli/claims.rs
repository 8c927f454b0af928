//! `cousu claims`.

use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::{ColumnConstraint, ContentArrangement, Table, Width, presets};
use serde::Serialize;
use serde_json::{Map, Value};

use super::args::size;
use super::session::{self, DeviceArguments};
use crate::error::{Error, Result};
use crate::lab::claims::{EXPERIMENTS, Evidence, Experiment, FIGURES, Lab, Verdict, usual_size};
use crate::lab::interleave::Ratio;
use crate::report::atomic::{Output, folder, refuse_overwriting};
use crate::report::manifest::Manifest;
use crate::report::png;

#[derive(Args)]
#[command(after_help = names())]
pub struct Arguments {
    /// Folder for the table (claims.json) and the pictures
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Where the table goes as JSON; - is the standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Statements to test, by name, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = known)]
    only: Vec<String>,
    /// Width and height of the pictures in pixels [default: 1024x640; on a CPU device 320x200]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// A first look: fewer frames of smaller pictures
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
        .map(|experiment| format!("  {:14} {}", experiment.name, experiment.statement))
        .collect();
    format!("Statements:\n{}", lines.join("\n"))
}

fn known(name: &str) -> std::result::Result<String, String> {
    let names: Vec<&str> = EXPERIMENTS.iter().map(|experiment| experiment.name).collect();
    if names.contains(&name) {
        Ok(name.to_string())
    } else {
        Err(format!("choose among {}", names.join(", ")))
    }
}

#[derive(Serialize)]
struct SceneRecord {
    name: String,
    triangles: usize,
    hash: String,
}

#[derive(Serialize)]
struct Row {
    claim: &'static str,
    statement: &'static str,
    measured: String,
    verdict: Verdict,
    ratios: Vec<Ratio>,
    pictures: Vec<String>,
    #[serde(flatten)]
    numbers: Map<String, Value>,
}

/// What `claims.json` holds.
#[derive(Serialize)]
struct Record {
    device: String,
    driver: String,
    size: [u32; 2],
    quick: bool,
    scenes: Vec<SceneRecord>,
    rows: Vec<Row>,
    /// Its scene is the house.
    manifest: Manifest,
}

/// Where results go.
struct Outputs<'a> {
    folder: Option<&'a Path>,
    json: Option<&'a Path>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let to_stdout = arguments.json.as_deref() == Some(Path::new("-"));
    let outputs = Outputs {
        folder: arguments.output.as_deref(),
        json: arguments.json.as_deref().filter(|_| !to_stdout),
    };
    outputs.check()?;
    let device = session::open(&arguments.device)?;
    let adapter = device.adapter();
    let size = arguments.size.unwrap_or(usual_size(adapter.kind, arguments.quick));
    let lab = Lab::new(&device, size, arguments.quick, arguments.seed)?;
    let scenes = [&lab.maison, &lab.cornell].map(|scene| SceneRecord {
        name: scene.path.clone(),
        triangles: scene.mesh.triangles.len(),
        hash: format!("{:016x}", scene.hash),
    });
    let mut record = Record {
        device: adapter.name.clone(),
        driver: adapter.driver.clone(),
        size: [size.0, size.1],
        quick: arguments.quick,
        scenes: scenes.into(),
        rows: Vec::new(),
        manifest: Manifest::new(&lab.maison, adapter, arguments.seed),
    };
    let chosen = |experiment: &&Experiment| {
        arguments.only.is_empty() || arguments.only.iter().any(|name| name == experiment.name)
    };
    for experiment in EXPERIMENTS.iter().filter(chosen) {
        super::tell(&format!("{}: {}", experiment.name, experiment.statement));
        let evidence = lab.run(experiment);
        super::tell(&format!("  {}", evidence.verdict.name()));
        let pictures = outputs.write_figures(&evidence, &record.manifest)?;
        let Evidence { measured, verdict, ratios, numbers, .. } = evidence;
        let Experiment { name, statement, .. } = *experiment;
        record.rows.push(Row { claim: name, statement, measured, verdict, ratios, pictures, numbers });
        outputs.write(&record)?;
    }
    if to_stdout {
        let text = serde_json::to_string_pretty(&record)
            .map_err(|error| Error::other(format!("The table could not be written ({error}).")))?;
        return super::print(&text);
    }
    super::print(&table(&record))
}

impl Outputs<'_> {
    fn tables(&self) -> impl Iterator<Item = PathBuf> {
        let in_folder = self.folder.map(|folder| folder.join("claims.json"));
        in_folder.into_iter().chain(self.json.map(Path::to_path_buf))
    }

    /// Places that can't be written are told before the work begins.
    fn check(&self) -> Result<()> {
        if let Some(path) = self.folder {
            folder(path)?;
        }
        let tables: Vec<PathBuf> = self.tables().collect();
        let pictures: Vec<PathBuf> = match self.folder {
            Some(folder) => FIGURES.iter().map(|name| folder.join(format!("{name}.png"))).collect(),
            None => Vec::new(),
        };
        let all: Vec<&Path> = tables.iter().chain(&pictures).map(PathBuf::as_path).collect();
        refuse_overwriting(&all, &[])?;
        tables.iter().try_for_each(|path| Output::claim(path).map(drop))
    }

    fn write(&self, record: &Record) -> Result<()> {
        self.tables().try_for_each(|path| {
            Output::claim(&path)?.write(|out| {
                serde_json::to_writer_pretty(&mut *out, record)?;
                out.write_all(b"\n")
            })
        })
    }

    /// Names of the files written.
    fn write_figures(&self, evidence: &Evidence, manifest: &Manifest) -> Result<Vec<String>> {
        let Some(folder) = self.folder else { return Ok(Vec::new()) };
        let mut names = Vec::new();
        for figure in &evidence.figures {
            let name = format!("{}.png", figure.name);
            Output::claim(&folder.join(&name))?
                .write(|mut out| png::write_figure(figure, manifest, &mut out))?;
            names.push(name);
        }
        Ok(names)
    }
}

/// Columns of the claim and of its measurement in the table, letters.
const CLAIM_WIDTH: u16 = 30;
const MEASURED_WIDTH: u16 = 74;

fn table(record: &Record) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(CLAIM_WIDTH + MEASURED_WIDTH + 16);
    table.set_header(["claim", "measured", "verdict"]);
    for row in &record.rows {
        let claim = format!("{}: {}", row.claim, row.statement);
        table.add_row([claim.as_str(), row.measured.as_str(), row.verdict.name()]);
        table.add_row(["", "", ""]);
    }
    for (place, width) in [(0, CLAIM_WIDTH), (1, MEASURED_WIDTH)] {
        if let Some(column) = table.column_mut(place) {
            column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width)));
        }
    }
    format!(
        "{} ({}), {}x{}; ratios are medians [95% interval]\n\n{}",
        record.device,
        record.driver,
        record.size[0],
        record.size[1],
        table.trim_fmt()
    )
}
