//! Triangles without area, needles, copies, and scales.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "degenerate",
    what: "Zero-area, needle, duplicated, coplanar, overlapping and tiny triangles: wrong hits, NaNs, loops without end.",
    counts: "rays",
    worst: "failures in a million rays",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
