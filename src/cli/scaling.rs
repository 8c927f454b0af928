//! `cousu bench --scaling`.

use std::path::PathBuf;

use serde::Serialize;

use super::bench::{Arguments, Places, places};
use super::progress::RowMeter;
use super::session;
use crate::error::{Error, Result};
use crate::lab::bench::schedule::Effort;
use crate::lab::scaling::{self, Fit, LeftOut, MOST_TRIANGLES, Options, Row, Study, Watch, fits};
use crate::report::atomic::{Output, refuse_overwriting};
use crate::report::manifest::Manifest;
use crate::report::{scaling as shown, scaling_plot};
use crate::scene::procedural::{self, SceneKind};
use crate::vk::Device;

/// What bench.json holds with --scaling.
#[derive(Serialize)]
struct Record {
    device: String,
    driver: String,
    /// Where it is not what grows.
    size: [u32; 2],
    spp: u32,
    seed: u32,
    scaling: Scaling,
    manifest: Manifest,
}

#[derive(Default, Serialize)]
struct Scaling {
    rows: Vec<Row>,
    fits: Vec<Fit>,
    left_out: Vec<LeftOut>,
}

const DEFAULT_SCENE: &str = "terrain";

pub fn run(arguments: &Arguments) -> Result<()> {
    let names = match &arguments.scenes[..] {
        [] => vec![DEFAULT_SCENE.to_string()],
        scenes => scenes.to_vec(),
    };
    let kinds: Vec<_> = names.iter().map(|name| kind(name)).collect::<Result<_>>()?;
    let passes = match arguments.passes.as_deref() {
        None => None,
        Some([passes]) => Some(*passes),
        Some(_) => {
            return Err(Error::usage("--scaling cuts all frames in one way: give --passes a single value."));
        }
    };
    let places = places(arguments, &[])?;
    let plots = plots(arguments, &names)?;
    let device = session::open(&arguments.device)?;
    let mut run = Run::new(arguments, &device, places);
    super::print(&format!("{} ({})\n", run.record.device, run.record.driver))?;
    for ((kind, most), plots) in kinds.into_iter().zip(plots) {
        let mut options = Options::new(kind, most, arguments.quick, device.adapter().kind);
        let effort = Effort { frames: arguments.frames, ..options.effort };
        options = Options {
            size: arguments.size.unwrap_or(options.size),
            spp: arguments.spp,
            methods: arguments.methods.clone().unwrap_or(options.methods),
            builders: arguments.builders.clone().unwrap_or(options.builders),
            passes,
            seed: arguments.seed,
            effort,
            ..options
        };
        run.record.size = [options.size.0, options.size.1];
        run.meter.scene(kind.name);
        let before = run.record.scaling.rows.len();
        scaling::run(&device, &options, &mut run)?;
        run.scene_done(kind, before, plots)?;
    }
    run.finish()
}

/// A procedural scene, `NAME` or `NAME:N`, and the most triangles that it is to have.
fn kind(name: &str) -> Result<(&'static SceneKind, Option<u64>)> {
    let (kind, most) = match name.split_once(':') {
        Some((kind, most)) => (kind, Some(most)),
        None => (name, None),
    };
    let growing = |kind: &&&str| **kind != "cornell";
    let Some(found) = procedural::find(kind).filter(|found| growing(&&found.name)) else {
        let known: Vec<&str> =
            procedural::KINDS.iter().map(|kind| kind.name).filter(|name| growing(&name)).collect();
        return Err(Error::usage(format!(
            "{name} does not come in every number of triangles: choose one of {} for --scaling.",
            known.join(", ")
        )));
    };
    match most.map(str::parse::<u64>) {
        None => Ok((found, None)),
        Some(Ok(most)) if most > MOST_TRIANGLES => Err(Error::usage(format!(
            "{name} asks for more than the {MOST_TRIANGLES} triangles that --scaling goes up to: name no more than these."
        ))),
        Some(Ok(most)) if most > 0 => Ok((found, Some(most))),
        Some(_) => Err(Error::usage(format!(
            "{name} has no number of triangles after the colon: write it as {kind}:1000000."
        ))),
    }
}

/// A scene's plots, each with its place.
type Plots = Vec<(Study, PathBuf)>;

/// Where each scene's plots go: named after the scene where there are several.
fn plots(arguments: &Arguments, names: &[String]) -> Result<Vec<Plots>> {
    let Some(folder) = &arguments.output else { return Ok(names.iter().map(|_| Vec::new()).collect()) };
    let several = names.len() > 1;
    let of = |name: &String| -> Plots {
        let scene = name.replace(':', "-");
        let file = |plot: &str| if several { format!("{plot}-{scene}.svg") } else { format!("{plot}.svg") };
        scaling_plot::PLOTS.map(|(study, plot)| (study, folder.join(file(plot)))).into()
    };
    let plots: Vec<Plots> = names.iter().map(of).collect();
    let all: Vec<_> = plots.iter().flatten().map(|(_, path)| path.as_path()).collect();
    refuse_overwriting(&all, &[])?;
    all.iter().try_for_each(|path| Output::claim(path).map(drop))?;
    Ok(plots)
}

/// A run under way: its record, saved with every study.
struct Run {
    record: Record,
    places: Places,
    meter: RowMeter,
    first_error: Option<Error>,
}

impl Run {
    fn new(arguments: &Arguments, device: &Device, places: Places) -> Self {
        let adapter = device.adapter();
        let record = Record {
            device: adapter.name.clone(),
            driver: adapter.driver.clone(),
            size: [0; 2],
            spp: arguments.spp,
            seed: arguments.seed,
            scaling: Scaling::default(),
            manifest: Manifest::of_several(&[], adapter, arguments.seed),
        };
        Self { record, places, meter: RowMeter::new(), first_error: None }
    }

    fn save(&self) -> Result<()> {
        for path in &self.places.json {
            Output::claim(path)?.write(|out| {
                serde_json::to_writer_pretty(&mut *out, &self.record)?;
                out.write_all(b"\n")
            })?;
        }
        for path in &self.places.csv {
            Output::claim(path)?.write(|mut out| shown::write_csv(&self.record.scaling.rows, &mut out))?;
        }
        Ok(())
    }

    /// Fits and plots of the scene whose rows begin there.
    fn scene_done(&mut self, kind: &SceneKind, begin: usize, plots: Plots) -> Result<()> {
        self.meter.clear();
        let rows = &self.record.scaling.rows[begin..];
        let found = fits(rows);
        let title = format!("{} on {}", kind.name, self.record.device);
        for (study, path) in plots {
            let drawn = scaling_plot::svg(study, rows, &found, &title).map_err(|error| {
                Error::other(format!(
                    "{} could not be drawn ({error}): report this as a bug.",
                    path.display()
                ))
            })?;
            if let Some(text) = drawn {
                Output::claim(&path)?.write(|out| out.write_all(text.as_bytes()))?;
            }
        }
        if !found.is_empty() {
            super::print(&format!("{}\n", shown::fits(&found)))?;
        }
        self.record.scaling.fits.extend(found);
        self.save()
    }

    fn finish(self) -> Result<()> {
        if self.record.scaling.rows.is_empty() {
            let nothing = || Error::device("No row could be measured: see above.");
            return Err(self.first_error.unwrap_or_else(nothing));
        }
        super::print(shown::LEGEND)
    }
}

impl Watch for Run {
    fn begin(&mut self, what: &str) {
        let rows = self.record.scaling.rows.len();
        self.meter.observe(what, rows, rows + 1);
    }

    fn rows(&mut self, rows: Vec<Row>) -> Result<()> {
        self.meter.clear();
        if rows.is_empty() {
            return Ok(());
        }
        super::print(&format!("{}\n", shown::table(&rows)))?;
        self.record.scaling.rows.extend(rows);
        self.save()
    }

    fn left_out(&mut self, left_out: LeftOut, error: Error) -> Result<()> {
        self.meter.clear();
        let LeftOut { study, scene, what, .. } = &left_out;
        let what = if what.is_empty() { String::new() } else { format!(" {what}") };
        super::tell(&format!("{scene} ({}){what} is left out: {error}", study.name()));
        self.record.scaling.left_out.push(left_out);
        self.first_error.get_or_insert(error);
        self.save()
    }
}
