//! Running means that freeze, and counts that do not.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "accumulation",
    what: "1 to 65,536 frames added up: bias, error, and the frame at which a mean freezes.",
    counts: "frames",
    worst: "bias after the last frame",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
