//! Stacks that are too small for a tree.

use super::{Experiment, Findings, Lab, Row};
use crate::error::Result;

pub const EXPERIMENT: Experiment = Experiment {
    name: "stack",
    what: "Trees that need 8 to 200 entries, and the house: rays that lose a subtree.",
    counts: "rays",
    worst: "entries needed over entries there are",
    run,
};

fn run(_lab: &Lab<'_>) -> Result<Findings> {
    Ok(Findings { rows: vec![Row::undecided("auto", "not written yet")], figures: Vec::new() })
}
