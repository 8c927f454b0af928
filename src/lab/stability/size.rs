//! Pictures and scenes of odd sizes.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "size",
    what: "Pictures of one pixel, odd sides, and beyond the limit; scenes of 0 to 3 triangles; ids above 2^24.",
    counts: "cases",
    worst: "wrong pixels",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
