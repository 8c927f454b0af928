//! More work than a dispatch may do.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "work",
    what: "Samples and triangles beyond the iterations of a loop, and submits of 100 ms: rays that are lost.",
    counts: "rays",
    worst: "rays lost in a million",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
