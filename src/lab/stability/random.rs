//! Random numbers: how errors fall, and what is correlated.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "random",
    what: "Error slopes, correlations of neighbours and frames, periods, and the error of blocks of pixels.",
    counts: "checks",
    worst: "largest correlation",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
