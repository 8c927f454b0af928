//! Where methods fail: each known failure provoked, counted, and put beside what survives it.

mod accumulation;
mod bits;
mod camera;
mod closed;
mod degenerate;
mod matrix;
mod measure;
mod offset;
mod random;
mod shapes;
mod sight;
mod size;
mod slabs;
mod stack;
mod watertight;
mod work;

use std::rc::Rc;

use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::render::choices::Method;
use crate::render::raylist::Compiled;
use crate::scene::Scene;
use crate::vk::{Device, DeviceKind};

pub use bits::Earlier;
pub use matrix::{Case, Row, Verdict};

/// A failure that is provoked, and what it takes to count it.
pub struct Experiment {
    pub name: &'static str,
    /// What is provoked, in a sentence.
    pub what: &'static str,
    /// What `trials` and `failures` count.
    pub counts: &'static str,
    /// What `worst` measures.
    pub worst: &'static str,
    run: fn(&Lab<'_>) -> Result<Findings>,
}

/// What an experiment found: a row a variant, `auto` among them.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    pub rows: Vec<Row>,
    /// Failures beside survivors; each name begins with the experiment's.
    pub figures: Vec<Figure>,
}

/// Every experiment, in the order in which they are told.
pub const EXPERIMENTS: &[Experiment] = &[
    stack::EXPERIMENT,
    accumulation::EXPERIMENT,
    offset::EXPERIMENT,
    watertight::EXPERIMENT,
    slabs::EXPERIMENT,
    degenerate::EXPERIMENT,
    random::EXPERIMENT,
    camera::EXPERIMENT,
    size::EXPERIMENT,
    work::EXPERIMENT,
    bits::EXPERIMENT,
];

/// What experiments work with.
pub struct Lab<'a> {
    pub device: &'a Device,
    /// Fewer trials, for a first look: all experiments together take less than a minute on Mesa's software device.
    pub quick: bool,
    pub seed: u32,
    /// Width and height of a picture, pixels.
    pub size: (u32, u32),
    /// Methods that take part beside `auto`; none: all of them.
    pub methods: Vec<Method>,
    /// Further scenes, for the experiments that take any.
    pub scenes: &'a [Scene],
    /// What another device made of the pictures of `bits`.
    pub with: Option<&'a Earlier>,
    /// Kernels that were compiled for lists of rays.
    pub compiled: Rc<Compiled>,
    /// Hears what is at hand and how much of the experiment is done, in [0, 1].
    pub observe: &'a dyn Fn(&str, f64),
}

impl Experiment {
    /// Runs it. One that fails decides nothing and says why; only a device that fails ends it all.
    pub fn run(&self, lab: &Lab<'_>) -> Result<Findings> {
        match (self.run)(lab) {
            Err(error) if matches!(error, Error::Device(_)) => Err(error),
            Err(error) => Ok(Findings {
                rows: vec![Row::undecided("auto", format!("it could not be run: {error}"))],
                figures: Vec::new(),
            }),
            findings => findings,
        }
    }
}

/// The usual size of a picture on this kind of device, pixels.
pub fn usual_size(kind: DeviceKind, quick: bool) -> (u32, u32) {
    match (kind, quick) {
        (DeviceKind::Cpu, false) => (160, 100),
        (DeviceKind::Cpu, true) => (64, 40),
        (_, false) => (1024, 640),
        (_, true) => (256, 160),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        let mut names: Vec<&str> = EXPERIMENTS.iter().map(|experiment| experiment.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), EXPERIMENTS.len());
    }
}
