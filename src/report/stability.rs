//! The matrix of failures as a table for a person and as CSV.

use std::io::{self, Write};

use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;

use super::bench::{quoted, shown};
use super::manifest::Manifest;
use crate::lab::interleave::digits;
use crate::lab::stability::{Experiment, Row};

/// A row of the matrix.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    pub experiment: &'static str,
    #[serde(flatten)]
    pub row: Row,
}

/// What trials, failures and worst of an experiment's rows are.
#[derive(Clone, Debug, Serialize)]
pub struct Told {
    pub experiment: &'static str,
    pub what: &'static str,
    pub counts: &'static str,
    pub worst: &'static str,
    pub pictures: Vec<String>,
    pub seconds: f64,
}

/// What `stability.json` holds.
#[derive(Serialize)]
pub struct Record {
    pub device: String,
    pub driver: String,
    pub size: [u32; 2],
    pub quick: bool,
    pub experiments: Vec<Told>,
    pub rows: Vec<Line>,
    /// Its scene is the Cornell box.
    pub manifest: Manifest,
}

/// Columns of the CSV, in the order of the values of [`write_csv`].
const COLUMNS: &str =
    "experiment,variant,case,trials,failures,counts,worst,worst_measures,gpu_ms_ratio,verdict,note";

/// Writes a line of names, a line a row, whose case is empty, and a line for each of its cases.
pub fn write_csv(record: &Record, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "{COLUMNS}")?;
    for Line { experiment, row } in &record.rows {
        let told = record.experiments.iter().find(|told| told.experiment == *experiment);
        let [counts, worst] = told.map_or([""; 2], |told| [told.counts, told.worst]).map(quoted);
        let mut line = |case: &str, trials: u64, failures: u64, most: Option<f64>, last: [String; 3]| {
            let [ratio, verdict, note] = last;
            let (variant, case, most) = (quoted(&row.variant), quoted(case), shown(most));
            writeln!(
                out,
                "{experiment},{variant},{case},{trials},{failures},{counts},{most},{worst},{ratio},{verdict},{note}"
            )
        };
        let note = |note: &Option<String>| quoted(note.as_deref().unwrap_or(""));
        let whole = [shown(row.gpu_ms_ratio), row.verdict.name().into(), note(&row.note)];
        line("", row.trials, row.failures, row.worst, whole)?;
        for case in &row.cases {
            let last = [String::new(), String::new(), note(&case.note)];
            line(&case.case, case.trials, case.failures, case.worst, last)?;
        }
    }
    Ok(())
}

/// The rows of an experiment.
pub fn table(experiment: &Experiment, rows: &[Row]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["variant", experiment.counts, "failures", "worst", "at", "cost", "verdict"]);
    for place in [1, 2, 3, 5] {
        if let Some(column) = table.column_mut(place) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for row in rows {
        table.add_row([
            row.variant.clone(),
            row.trials.to_string(),
            row.failures.to_string(),
            row.worst.map(digits).unwrap_or_default(),
            row.worst_case.clone().unwrap_or_default(),
            row.gpu_ms_ratio.map(|ratio| format!("{ratio:.2}x")).unwrap_or_default(),
            row.verdict.name().into(),
        ]);
    }
    let notes = rows.iter().filter_map(|row| Some(format!("  {}: {}", row.variant, row.note.as_ref()?)));
    let lines: Vec<String> = notes.collect();
    let notes = if lines.is_empty() { String::new() } else { format!("\n{}", lines.join("\n")) };
    format!("{}: {}\nworst: {}\n{table}{notes}\n", experiment.name, experiment.what, experiment.worst)
}
