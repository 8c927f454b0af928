//! The statements of the report that cousu grew from, each as an experiment with a verdict on one device.

mod accumulation;
mod measure;
mod order;
mod passes;
mod records;
mod scenes;
mod stacks;
mod triangles;

use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::interleave::Ratio;
use crate::lab::scenes::procedural;
use crate::scene::Scene;
use crate::vk::{Device, DeviceKind};

/// What an experiment says of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Holds,
    DoesNotHold,
    /// An interval includes the threshold, or something that is needed is not there.
    NotDecided,
}

impl Verdict {
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
            Self::NotDecided => "not decided",
        }
    }

    fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::DoesNotHold }
    }

    /// Of a statement with several parts: it holds if all of them do, and fails if one of them does.
    fn all(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut whole = None;
        for part in parts {
            whole = match (whole, part) {
                (Some(Self::DoesNotHold), _) | (_, Self::DoesNotHold) => Some(Self::DoesNotHold),
                (Some(Self::NotDecided), _) | (_, Self::NotDecided) => Some(Self::NotDecided),
                _ => Some(Self::Holds),
            };
        }
        whole.unwrap_or(Self::NotDecided)
    }
}

impl Serialize for Verdict {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// What an experiment found.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// In a sentence, with figures.
    pub measured: String,
    pub verdict: Verdict,
    pub ratios: Vec<Ratio>,
    /// Further figures, by name.
    pub numbers: Map<String, Value>,
    pub figures: Vec<Figure>,
}

impl Evidence {
    fn new(verdict: Verdict, measured: impl Into<String>) -> Self {
        Self {
            measured: measured.into(),
            verdict,
            ratios: Vec::new(),
            numbers: Map::new(),
            figures: Vec::new(),
        }
    }

    fn ratios(mut self, ratios: impl IntoIterator<Item = Ratio>) -> Self {
        self.ratios.extend(ratios);
        self
    }

    fn number(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.numbers.insert(name.to_string(), value.into());
        self
    }

    fn figure(mut self, figure: Figure) -> Self {
        self.figures.push(figure);
        self
    }
}

/// A statement and the experiment that tests it.
pub struct Experiment {
    pub name: &'static str,
    /// The statement of the report.
    pub statement: &'static str,
    run: fn(&Lab<'_>) -> Result<Evidence>,
}

/// Names of the pictures that experiments give.
pub const FIGURES: [&str; 2] = ["ghosts", "misaligned"];

/// Every statement, in the order of the report.
pub const EXPERIMENTS: &[Experiment] = &[
    Experiment {
        name: "tree",
        statement: "On the house the tree pays: brute force is not real-time there.",
        run: triangles::tree,
    },
    Experiment {
        name: "few-triangles",
        statement: "On 32 triangles brute force beats every tree.",
        run: triangles::few_triangles,
    },
    Experiment { name: "small-stack", statement: "A smaller stack is faster.", run: stacks::small_stack },
    Experiment {
        name: "stack-cost",
        statement: "A stack in every thread costs registers, and with them occupancy.",
        run: stacks::stack_cost,
    },
    Experiment {
        name: "threaded",
        statement: "The threaded tree needs no memory for a stack and is as fast as a small stack.",
        run: stacks::threaded,
    },
    Experiment {
        name: "single-push",
        statement: "Going to one child at once and pushing only the other halves the stack.",
        run: order::single_push,
    },
    Experiment {
        name: "both-children",
        statement: "Testing the boxes of both children at their parent is faster.",
        run: order::both_children,
    },
    Experiment {
        name: "divergence",
        statement: "Divergence leaves lanes idle, and postponing leaves keeps them busy.",
        run: order::divergence,
    },
    Experiment {
        name: "split",
        statement: "Splitting the shader in passes pays, with camera rays traced in every frame.",
        run: passes::split,
    },
    Experiment {
        name: "kept-hits",
        statement: "Keeping the camera rays' hits from frame to frame pays.",
        run: passes::kept_hits,
    },
    Experiment {
        name: "round-trips",
        statement: "Many kernels a frame cost round trips between host and device.",
        run: passes::round_trips,
    },
    Experiment {
        name: "no-sync",
        statement: "A thread for each pixel needs no synchronisation, where atomics would serialise.",
        run: passes::no_sync,
    },
    Experiment {
        name: "same-seeds",
        statement: "The same random numbers in every frame defeat accumulation.",
        run: accumulation::same_seeds,
    },
    Experiment {
        name: "ghosts",
        statement: "Without a reset the picture keeps ghosts when the camera moves.",
        run: accumulation::ghosts,
    },
    Experiment {
        name: "misaligned",
        statement: "Records packed without std430's padding shift all the data after them.",
        run: records::misaligned,
    },
];

/// What experiments work with.
pub struct Lab<'a> {
    pub device: &'a Device,
    /// Width and height of a picture, pixels.
    pub size: (u32, u32),
    /// Fewer frames, for a first look.
    pub quick: bool,
    pub seed: u32,
    pub maison: Scene,
    pub cornell: Scene,
}

impl<'a> Lab<'a> {
    pub fn new(device: &'a Device, size: (u32, u32), quick: bool, seed: u32) -> Result<Self> {
        Ok(Self {
            device,
            size,
            quick,
            seed,
            maison: procedural("maison", None, seed)?,
            cornell: procedural("cornell", None, seed)?,
        })
    }

    /// Runs an experiment. One that fails decides nothing and says why.
    pub fn run(&self, experiment: &Experiment) -> Evidence {
        (experiment.run)(self).unwrap_or_else(|error| {
            Evidence::new(Verdict::NotDecided, format!("it could not be run: {error}"))
        })
    }

    /// On a CPU device a fraction of the picture, for work that takes long there.
    fn smaller(&self, divisor: u32) -> (u32, u32) {
        let (width, height) = self.size;
        match self.device.adapter().kind {
            DeviceKind::Cpu => ((width / divisor).max(16), (height / divisor).max(16)),
            _ => self.size,
        }
    }
}

/// The usual size of a picture on this kind of device, pixels.
pub fn usual_size(kind: DeviceKind, quick: bool) -> (u32, u32) {
    match (kind, quick) {
        (DeviceKind::Cpu, false) => (320, 200),
        (DeviceKind::Cpu, true) => (96, 60),
        (_, false) => (1024, 640),
        (_, true) => (512, 320),
    }
}

/// "a", "a and b", "a, b and c".
fn listed(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [only] => only.clone(),
        [before @ .., last] => format!("{} and {last}", before.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_statement_in_parts_holds_if_all_parts_do() {
        use Verdict::*;
        assert_eq!(Verdict::all([Holds, Holds]), Holds);
        assert_eq!(Verdict::all([Holds, NotDecided]), NotDecided);
        assert_eq!(Verdict::all([NotDecided, DoesNotHold, Holds]), DoesNotHold);
        assert_eq!(Verdict::all([]), NotDecided);
    }

    #[test]
    fn names_are_unique() {
        let mut names: Vec<&str> = EXPERIMENTS.iter().map(|experiment| experiment.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), EXPERIMENTS.len());
    }
}
