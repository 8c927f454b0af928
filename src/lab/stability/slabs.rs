//! Boxes that a ray meets and the test misses.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "slabs",
    what: "Rays along axes and in faces of boxes, flat boxes, boxes far away: hits that are lost.",
    counts: "rays",
    worst: "hits lost in a million rays",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
