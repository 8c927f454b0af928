//! `cousu bench`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use serde::Serialize;

use super::args::{angles, size};
use super::progress::RowMeter;
use super::session::{self, DeviceArguments};
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::lab::bench::rows::{Failure, Lists, Row};
use crate::lab::bench::schedule::Effort;
use crate::lab::bench::table1::{self, TableRow, table1};
use crate::lab::bench::{Bench, Options, RayKind, Subject, View, Watch};
use crate::render::choices::{Method, Passes, Wishes};
use crate::render::geometry::Geometry;
use crate::report::atomic::{Output, folder, refuse_overwriting};
use crate::report::bench as shown;
use crate::report::manifest::Manifest;
use crate::scene::camera::Camera;
use crate::scene::procedural::{self, Request};
use crate::scene::{Scene, obj, rays};
use crate::vk::Device;

#[derive(Args)]
pub struct Arguments {
    /// OBJ files, or procedural scenes by name, such as hairball or hairball:100000 (so many triangles) [default: cornell,
    /// maison and every OBJ file in ./meshes; with --quick cornell; with --scaling terrain]
    #[arg(value_name = "SCENE")]
    pub(super) scenes: Vec<String>,
    /// How cost grows instead: procedural scenes with 1k, 10k, 100k, 1M and 10M triangles (at most N, if named as NAME:N),
    /// more and more samples, larger and larger pictures, each builder's time, loading, memory; fits and, with -o, plots.
    /// With --quick up to 100k triangles
    #[arg(long, conflicts_with_all = ["rays", "views"])]
    scaling: bool,
    /// Width and height of the picture in pixels [default: 1024x640; with --quick 160x100; with --scaling on a CPU device
    /// 256x160, with --quick 128x80]
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(super) size: Option<(u32, u32)>,
    /// Ambient rays of each pixel in a frame
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096), default_value = "4")]
    pub(super) spp: u32,
    /// Frames to measure of each row [default: 30, or as many as take 3 s, but at least 3]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(super) frames: Option<u32>,
    /// Methods, separated by commas; undersized stacks drop what does not fit and count the rays [default: all; with --scaling threaded, ordered, wide, bundle (on a GPU entry and postponed for it)]
    #[arg(long, value_delimiter = ',', value_name = "METHODS")]
    pub(super) methods: Option<Vec<Method>>,
    /// Builders, separated by commas; lists are multiplied with each other [default: what render chooses for 64 samples, and each with
    /// two methods]
    #[arg(long, value_delimiter = ',', value_name = "BUILDERS")]
    pub(super) builders: Option<Vec<Builder>>,
    /// Ways of cutting a frame into kernels, separated by commas [default: single, and each with one method]
    #[arg(long, value_delimiter = ',', value_name = "PASSES")]
    pub(super) passes: Option<Vec<Passes>>,
    /// Views, separated by semicolons: default, original (orbit 0,180) or an orbit RX,RY in degrees [default: default; for
    /// the original's choices the report's]
    #[arg(long, value_delimiter = ';', value_name = "VIEWS", allow_hyphen_values = true)]
    views: Vec<View>,
    /// Rays: ambient (whole frames), or lists for the hit kernels alone: primary (the view's camera rays), random (2^20 from
    /// anywhere in the scene's box), or a FILE of one's own in units of the scene: lines `ox oy oz dx dy dz [tmax]`, tmax in
    /// lengths of the direction; or, if its name ends in .bin, records of seven 32-bit floats, little-endian
    #[arg(long, value_name = "KIND|FILE", default_value = "ambient")]
    rays: PathBuf,
    /// Where the rows go as JSON
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Where the rows go as CSV
    #[arg(long, value_name = "FILE")]
    pub(super) csv: Option<PathBuf>,
    /// Folder for both, as bench.json and bench.csv, and for the plots of --scaling, as scaling-triangles.svg and so on
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: Option<PathBuf>,
    /// A first look: small pictures and few frames
    #[arg(long)]
    pub(super) quick: bool,
    /// Seed of the random numbers, of scenes with chance in them and of the order of frames
    #[arg(long, value_name = "N", default_value = "0")]
    pub(super) seed: u32,
    #[command(flatten)]
    pub(super) device: DeviceArguments,
}

impl FromStr for View {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "default" => Ok(Self::default_view()),
            "original" => Ok(Self::original()),
            _ => {
                let [rx, ry] =
                    angles(text).map_err(|_| "choose default, original or an orbit such as 20,140")?;
                Ok(Self { name: text.into(), camera: Some(Camera::Orbit { rx, ry }) })
            }
        }
    }
}

/// What bench.json holds.
#[derive(Serialize)]
struct Record {
    device: String,
    driver: String,
    size: [u32; 2],
    spp: u32,
    seed: u32,
    rays: String,
    /// The slowest moment's time of a fixed amount of work over the fastest one's.
    clock_spread: Option<f64>,
    rows: Vec<Row>,
    failed: Vec<Failure>,
    table1: Option<Vec<TableRow>>,
    manifest: Manifest,
}

/// The clock may move by so much before a person is told.
const STEADY: f64 = 1.05;

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.scaling {
        return super::scaling::run(arguments);
    }
    let options = options(arguments)?;
    let scenes = scenes(arguments)?;
    let places = places(arguments, &scenes)?;
    let device = session::open(&arguments.device)?;
    let bench = Bench::new(&device, &options)?;
    let mut run = Run {
        record: Record {
            device: device.adapter().name.clone(),
            driver: device.adapter().driver.clone(),
            size: [options.size.0, options.size.1],
            spp: options.spp,
            seed: options.seed,
            rays: arguments.rays.display().to_string(),
            clock_spread: None,
            rows: Vec::new(),
            failed: Vec::new(),
            table1: None,
            manifest: Manifest::of_several(&[], device.adapter(), options.seed),
        },
        places,
        meter: RowMeter::new(),
        shown: 0,
        first_error: None,
    };
    super::print(&format!("{} ({})\n", run.record.device, run.record.driver))?;
    let mut hashes = Vec::new();
    for name in &scenes {
        let subject = match subject(name, arguments.seed) {
            Ok(subject) => subject,
            Err(error) => {
                run.note(&format!("{name} is left out: {error}"));
                run.record.failed.push(Failure::of_scene(name, &error));
                run.first_error.get_or_insert(error);
                continue;
            }
        };
        hashes.push(subject.scene.hash);
        run.record.manifest = Manifest::of_several(&hashes, device.adapter(), options.seed);
        run.meter.scene(name);
        bench.scene(&subject, &mut run)?;
    }
    run.finish(&bench, &device)
}

fn options(arguments: &Arguments) -> Result<Options> {
    let quick = arguments.quick;
    let effort = if quick { Effort::QUICK } else { Effort::FULL };
    Ok(Options {
        size: arguments.size.unwrap_or(if quick { (160, 100) } else { (1024, 640) }),
        spp: arguments.spp,
        seed: arguments.seed,
        effort: Effort { frames: arguments.frames, ..effort },
        lists: Lists {
            methods: arguments.methods.clone(),
            builders: arguments.builders.clone(),
            passes: arguments.passes.clone(),
        },
        views: arguments.views.clone(),
        rays: match arguments.rays.to_str() {
            Some("ambient") => RayKind::Ambient,
            Some("primary") => RayKind::Primary,
            Some("random") => RayKind::Random,
            _ => RayKind::Listed(rays::load(&arguments.rays)?),
        },
    })
}

/// Folder of the meshes that `make bench-scenes` fetches.
const MESHES: &str = "meshes";

/// The scenes that were asked for, or the default ones.
fn scenes(arguments: &Arguments) -> Result<Vec<String>> {
    if !arguments.scenes.is_empty() {
        return Ok(arguments.scenes.clone());
    }
    let mut scenes = vec![table1::CORNELL.to_string()];
    if arguments.quick {
        return Ok(scenes);
    }
    scenes.push(table1::HOUSE.into());
    let is_obj = |path: &PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"));
    let mut meshes: Vec<String> = std::fs::read_dir(MESHES)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()).filter(is_obj))
        .map(|path| path.display().to_string())
        .collect();
    meshes.sort();
    if meshes.is_empty() {
        super::tell(&format!("There are no real meshes in ./{MESHES}: `make bench-scenes` fetches some."));
    }
    scenes.extend(meshes);
    Ok(scenes)
}

/// A procedural scene, `name` or `name:triangles`, or a file.
pub(super) fn subject(name: &str, seed: u32) -> Result<Subject> {
    let (kind, triangles) = match name.split_once(':') {
        Some((kind, triangles)) => (kind, Some(triangles)),
        None => (name, None),
    };
    let Some(kind) = procedural::find(kind) else {
        return Ok(Subject { name: name.into(), scene: Scene::load(Path::new(name))? });
    };
    let triangles = match triangles.map(str::parse::<u64>) {
        None => None,
        Some(Ok(triangles)) => Some(triangles),
        Some(Err(_)) => {
            return Err(Error::usage(format!(
                "{name} has no number of triangles after the colon: write it as {}:{}.",
                kind.name, kind.default_triangles
            )));
        }
    };
    let start = std::time::Instant::now();
    let mesh = (kind.generate)(&Request { triangles, seed })?;
    let (bounds, hash) = (mesh.bounds(), mesh.hash());
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    let report = obj::Report::default();
    let scene = Scene { path: kind.name.into(), mesh, bounds, hash, report, load_ms };
    Ok(Subject { name: name.into(), scene })
}

/// Where the rows are saved, tried before the work begins.
pub(super) struct Places {
    pub json: Vec<PathBuf>,
    pub csv: Vec<PathBuf>,
}

pub(super) fn places(arguments: &Arguments, scenes: &[String]) -> Result<Places> {
    let mut places = Places {
        json: arguments.json.iter().cloned().collect(),
        csv: arguments.csv.iter().cloned().collect(),
    };
    if let Some(path) = &arguments.output {
        folder(path)?;
        places.json.push(path.join("bench.json"));
        places.csv.push(path.join("bench.csv"));
    }
    let results: Vec<&Path> = places.json.iter().chain(&places.csv).map(PathBuf::as_path).collect();
    if results.contains(&Path::new("-")) {
        return Err(Error::usage(
            "bench saves each row into its files as soon as it is measured: name a file instead of -.",
        ));
    }
    let inputs: Vec<&Path> =
        scenes.iter().map(Path::new).chain([arguments.rays.as_path()]).filter(|path| path.exists()).collect();
    refuse_overwriting(&results, &inputs)?;
    for path in results {
        Output::claim(path)?;
    }
    Ok(places)
}

/// A run under way: its record, saved with every row.
struct Run {
    record: Record,
    places: Places,
    meter: RowMeter,
    /// Rows whose table is printed.
    shown: usize,
    first_error: Option<Error>,
}

impl Run {
    fn save(&self) -> Result<()> {
        for path in &self.places.json {
            Output::claim(path)?.write(|out| {
                serde_json::to_writer_pretty(&mut *out, &self.record)?;
                out.write_all(b"\n")
            })?;
        }
        for path in &self.places.csv {
            Output::claim(path)?.write(|mut out| shown::write_csv(&self.record.rows, &mut out))?;
        }
        Ok(())
    }

    fn finish(mut self, bench: &Bench<'_>, device: &Device) -> Result<()> {
        self.meter.clear();
        if self.record.rows.is_empty() {
            let nothing = || Error::device("No row could be measured: see above.");
            return Err(self.first_error.unwrap_or_else(nothing));
        }
        self.record.clock_spread = bench.drift.spread();
        self.record.table1 = table1(&self.record.rows);
        self.save()?;
        if let Some(spread) = self.record.clock_spread.filter(|spread| *spread > STEADY) {
            super::tell(&format!(
                "!!! {} ran up to {:.0}% slower at times (its clock fell, or others were at work on it): read the 95% \
                 intervals.",
                device.adapter().name,
                (spread - 1.0) * 100.0
            ));
        }
        super::print(shown::LEGEND)?;
        match &self.record.table1 {
            Some(rows) => super::print(&format!("\n{}", shown::table1(rows, self.record.size))),
            None => Ok(()),
        }
    }
}

impl Watch for Run {
    fn build(&mut self, scene: &Scene, wishes: &Wishes) -> Result<Geometry> {
        self.meter.clear();
        session::geometry(scene, wishes)
    }

    fn progress(&mut self, what: &str, done: usize, all: usize) {
        self.meter.observe(what, done, all);
    }

    fn note(&mut self, text: &str) {
        self.meter.clear();
        super::tell(text);
    }

    fn row(&mut self, row: Row) -> Result<()> {
        self.record.rows.push(row);
        self.record.rows.sort_by_key(|row| row.order);
        self.save()
    }

    fn failed(&mut self, failure: Failure, error: Error) -> Result<()> {
        let Failure { scene, view, preset, method, builder, passes, .. } = &failure;
        let method = crate::lab::bench::rows::method_label(preset, method);
        self.note(&format!("{scene} ({view}): {method} {builder} {passes} is left out: {error}"));
        self.record.failed.push(failure);
        self.first_error.get_or_insert(error);
        self.save()
    }

    fn view_done(&mut self) -> Result<()> {
        self.meter.clear();
        // Rows are in the order of the plan, whose views come one after the other.
        let rows: Vec<&Row> = self.record.rows[self.shown..].iter().collect();
        self.shown = self.record.rows.len();
        if rows.is_empty() { Ok(()) } else { super::print(&format!("{}\n", shown::table(&rows))) }
    }
}
