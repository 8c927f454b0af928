//! The same seed on two devices.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "bits",
    what: "The same pictures on two devices: pixels that differ.",
    counts: "pixels",
    worst: "pixels apart in a million",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
