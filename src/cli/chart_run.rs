//! A run of `cousu chart`: its record, saved with every point, and what a person hears of it.

use std::path::Path;

use super::progress::{Meter, RowMeter};
use super::session;
use crate::error::{Error, Result};
use crate::lab::chart::curves::Choices;
use crate::lab::chart::results::{Curve, Point, TimeTo};
use crate::lab::chart::{SceneFacts, Watch};
use crate::render::choices::Wishes;
use crate::render::geometry::Geometry;
use crate::render::rounds::Goal;
use crate::render::tally::Progress;
use crate::report::atomic::Output;
use crate::report::chart::{Record, write_csv};
use crate::report::chart_resume::Earlier;
use crate::report::png::{self, Encoding};
use crate::report::{chart_plot, chart_table};
use crate::scene::Scene;

/// The clock may move by so much before a person is told.
const STEADY: f64 = 1.05;
const ANEW: &str = "and is written anew";
/// Formats of a scene's picture.
pub const ENDINGS: [&str; 2] = ["png", "svg"];

/// A run under way: its record, saved with every point.
pub struct Run<'a> {
    pub record: Record,
    folder: &'a Path,
    earlier: Earlier,
    /// The earlier record is safe in a file of its own.
    set_aside: bool,
    /// Points taken over from it.
    taken: usize,
    scene: String,
    /// What its pictures are called, without ending.
    picture: String,
    meter: RowMeter,
    /// The number of the reference that is made, and how far it is.
    reference: Option<(usize, Meter)>,
}

impl<'a> Run<'a> {
    /// `scenes`: all that will be measured.
    pub fn new(record: Record, folder: &'a Path, scenes: &[String], earlier: Earlier) -> Result<Self> {
        let mut run = Self {
            record,
            folder,
            earlier: Earlier::default(),
            set_aside: false,
            taken: 0,
            scene: String::new(),
            picture: String::new(),
            meter: RowMeter::new(),
            reference: None,
        };
        match earlier.differs(&run.record) {
            Some(difference) => {
                run.note(&format!("chart.json answers another question ({difference}), {ANEW}."));
                run.set_aside()?;
            }
            None => {
                for name in earlier.scenes().iter().filter(|name| !scenes.contains(name)) {
                    run.note(&format!("chart.json has {name} too, which this run does not measure, {ANEW}."));
                    run.set_aside()?;
                }
                earlier.keep_in(&mut run.record, scenes);
                run.earlier = earlier;
            }
        }
        Ok(run)
    }

    /// Copies chart.json, of which not everything will be kept, to a free name beside it; once a run.
    fn set_aside(&mut self) -> Result<()> {
        let from = self.folder.join("chart.json");
        if std::mem::replace(&mut self.set_aside, true) || !from.exists() {
            return Ok(());
        }
        let mut names = (1..).map(|number| format!("chart-before-{number}.json"));
        let Some(name) = names.find(|name| !self.folder.join(name).exists()) else { return Ok(()) };
        let content = std::fs::read(&from).map_err(|error| {
            Error::other(format!(
                "{} could not be read ({error}): choose another folder for -o.",
                from.display()
            ))
        })?;
        Output::claim(&self.folder.join(&name))?.write(|out| out.write_all(&content))?;
        self.note(&format!("What chart.json had is in {name}."));
        Ok(())
    }

    /// The next scene, and what its pictures are called, without ending.
    pub fn scene(&mut self, name: &str, picture: &str) {
        self.meter.scene(name);
        self.scene = name.to_string();
        self.picture = picture.to_string();
    }

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
    pub fn scene_done(&mut self) -> Result<()> {
        self.quiet();
        let Some(facts) = self.record.scenes.own.iter().find(|facts| facts.scene == self.scene).cloned()
        else {
            return Ok(());
        };
        let [png_path, svg_path] =
            ENDINGS.map(|ending| self.folder.join(format!("{}.{ending}", self.picture)));
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
            .write(|mut out| write_csv(&self.record.curves.own, &mut out))?;
        self.save()?;
        super::print(&format!("{}\n", chart_table::table(&self.record, &facts)))
    }

    pub fn finish(mut self, first_error: Option<Error>) -> Result<()> {
        self.quiet();
        // What was measured of a scene until the device was lost is in chart.json.
        if let Some(error) = first_error
            && (self.record.pictures.is_empty() || matches!(error, Error::Device(_)))
        {
            return Err(error);
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
            self.reference = Some((number, Meter::new(Goal::Samples)));
        }
        if let Some((_, meter)) = &mut self.reference {
            meter.observe(progress);
        }
    }

    fn begin(&mut self, facts: SceneFacts) -> Result<()> {
        self.quiet();
        self.taken = 0;
        if let Some(difference) = self.earlier.scene_differs(&facts) {
            self.note(&format!(
                "{}: chart.json answers another question ({difference}), {ANEW}.",
                facts.scene
            ));
            self.set_aside()?;
            self.earlier.forget(&facts.scene);
        }
        self.record.begin_scene(facts);
        Ok(())
    }

    fn known(&mut self, _label: &str, choices: &Choices) -> Vec<Point> {
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
        let choices: Vec<&Choices> = curves.iter().map(|curve| &curve.choices).collect();
        if self.earlier.has_others(&self.scene, &choices) {
            self.set_aside()?;
        }
        let scene = self.scene.clone();
        self.record.set_scene(&scene, curves, times);
        self.save()
    }
}
