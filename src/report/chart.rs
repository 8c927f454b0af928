//! A chart's record, and its points as CSV.

use std::io::{self, Write};

use serde::ser::SerializeSeq;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::bench::{quoted, shown};
use super::manifest::Manifest;
use crate::lab::chart::SceneFacts;
use crate::lab::chart::results::{Curve, TimeTo};

/// What chart.json holds. Its keys are stable.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    pub device: String,
    pub driver: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    pub seed: u32,
    /// GPU time that a curve may take.
    pub budget_s: f64,
    /// The slowest moment's time of a fixed amount of work over the fastest one's.
    pub clock_spread: Option<f64>,
    pub scenes: Listed<SceneFacts>,
    pub curves: Listed<Curve>,
    pub time_to_rmse: Listed<TimeTo>,
    /// What a reader should know: what was left out, and why.
    pub notes: Vec<String>,
    /// Files with the pictures, beside this one.
    pub pictures: Vec<String>,
    pub manifest: Manifest,
}

/// What this run found, and what an earlier one found of scenes whose turn has not come.
#[derive(Clone, Debug)]
pub struct Listed<T> {
    pub own: Vec<T>,
    pub kept: Vec<Value>,
}

impl<T> Default for Listed<T> {
    fn default() -> Self {
        Self { own: Vec::new(), kept: Vec::new() }
    }
}

impl<T: Serialize> Serialize for Listed<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(self.own.len() + self.kept.len()))?;
        self.own.iter().try_for_each(|one| list.serialize_element(one))?;
        self.kept.iter().try_for_each(|one| list.serialize_element(one))?;
        list.end()
    }
}

impl Record {
    /// The scene's turn has come: what was kept of it is no longer.
    pub fn begin_scene(&mut self, facts: SceneFacts) {
        for kept in [&mut self.scenes.kept, &mut self.curves.kept, &mut self.time_to_rmse.kept] {
            kept.retain(|one| one["scene"] != facts.scene);
        }
        self.scenes.own.push(facts);
    }

    /// Puts a scene's curves in the place of those that it has.
    pub fn set_scene(&mut self, scene: &str, curves: &[Curve], times: &[TimeTo]) {
        self.curves.own.retain(|curve| curve.scene != scene);
        self.time_to_rmse.own.retain(|time| time.scene != scene);
        self.curves.own.extend_from_slice(curves);
        self.time_to_rmse.own.extend_from_slice(times);
    }

    pub fn curves_of<'a>(&'a self, scene: &'a str) -> impl Iterator<Item = &'a Curve> {
        self.curves.own.iter().filter(move |curve| curve.scene == scene)
    }

    /// The times of a curve, in the order of the errors.
    pub fn times_of<'a>(&'a self, curve: &'a Curve) -> impl Iterator<Item = &'a TimeTo> {
        self.time_to_rmse
            .own
            .iter()
            .filter(move |time| time.scene == curve.scene && time.label == curve.label)
    }
}

/// Columns of the CSV, in the order of the values of [`write_csv`].
const COLUMNS: &str = "scene,label,same_as,preset,method,builder,passes,sampler,accumulator,offset,intersector,slabs,accessor,\
                       adaptive,repeat,spp,gpu_ms,gpu_ms_low,gpu_ms_high,runs,rmse,rmse_below,mse,mse_error,bias,\
                       bias_error,overflowed_rays,pareto";

/// Writes a line of names and a line a point; what a point does not have is empty.
pub fn write_csv(curves: &[Curve], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "{COLUMNS}")?;
    for curve in curves {
        let choices = &curve.choices;
        let [scene, label, same_as] =
            [&curve.scene, &curve.label, curve.same_as.as_ref().unwrap_or(&String::new())].map(|x| quoted(x));
        for point in &curve.points {
            let values = [
                scene.clone(),
                label.clone(),
                same_as.clone(),
                choices.preset.into(),
                choices.method.clone(),
                choices.builder.into(),
                choices.passes.into(),
                choices.sampler.into(),
                choices.accumulator.into(),
                choices.offset.into(),
                choices.intersector.into(),
                choices.slabs.into(),
                choices.accessor.into(),
                choices.adaptive.to_string(),
                shown(choices.repeat),
                point.spp.to_string(),
                point.gpu_ms.to_string(),
                point.gpu_ms_ci95[0].to_string(),
                point.gpu_ms_ci95[1].to_string(),
                point.runs.to_string(),
                shown(point.rmse),
                shown(point.rmse_below),
                point.mse.to_string(),
                point.mse_error.to_string(),
                point.bias.to_string(),
                point.bias_error.to_string(),
                point.overflowed_rays.to_string(),
                point.pareto.to_string(),
            ];
            writeln!(out, "{}", values.join(","))?;
        }
    }
    Ok(())
}
