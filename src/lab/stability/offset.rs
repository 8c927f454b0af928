//! Where ambient rays start: self-hits and leaks of light.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "offset",
    what: "Scenes scaled and shifted: ambient rays that meet their own surface or start behind it.",
    counts: "rays",
    worst: "failures in a million rays",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
