//! Cameras where the original's pictures go wrong.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "camera",
    what: "Moves without a reset, near and far planes, scenes beyond the limit, an eye in a triangle's plane.",
    counts: "pixels",
    worst: "largest difference of light",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
