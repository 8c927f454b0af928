//! The choices that a render makes, by the names they have on the command line and in results.

use std::fmt;
use std::str::FromStr;

use crate::bvh::Builder;
use crate::names::choices;
use crate::vk::DeviceKind;

choices! {
    /// A bundle of choices.
    Preset {
        /// The least that scene and device need.
        Auto = "auto",
        /// What the OpenGL original did.
        Original = "original",
        /// The same, made unbiased: floats, pixel centres, normals that face the camera, an offset that follows the
        /// scene's size.
        OriginalUnbiased = "original-unbiased",
    }
    /// Where random numbers come from.
    Sampler {
        /// The original's generator, from a buffer of seeds; its state is carried along.
        Lcg = "lcg",
        /// A hash of pixel, sample, dimension and seed.
        Pcg = "pcg",
        /// Owen-scrambled Sobol points for each pixel.
        Sobol = "sobol",
        /// Jittered strata, in an order that is the same for all pixels.
        Strata = "strata",
        /// Independent numbers of a quality beyond doubt, for references.
        Philox = "philox",
    }
    /// How a pixel's rays are added up.
    Accumulator {
        /// The original's running mean in 8 bits.
        Rgba8 = "rgba8",
        /// The running mean in 32-bit floats.
        Rgba32f = "rgba32f",
        /// Escaped and traced rays, exactly.
        Count = "count",
    }
    /// How an ambient ray leaves its surface.
    Offset {
        /// 0.01 units of the file along the normal, the original's.
        Fixed = "fixed",
        /// 10^-4 of the diagonal of the scene's box.
        Scaled = "scaled",
        /// Some ulps of the start's coordinates (Wächter and Binder 2019).
        Ulp = "ulp",
    }
    /// How the work is cut into kernels.
    Passes {
        /// One kernel does all of a pixel.
        Single = "single",
        /// Camera rays' hits are found once, kept and listed; ambient rays start from the list.
        Split = "split",
        /// A kernel a step: camera rays, closest hit, ambient rays, any hit, accumulation.
        Staged = "staged",
    }
    /// The test of a ray against a triangle.
    Intersector {
        /// Möller and Trumbore 1997, the original's.
        Moller = "moller",
        /// The same, but no triangle is missed that the exact ray meets.
        Conservative = "conservative",
        /// Woop, Benthin and Wald 2013: no ray passes between neighbours.
        Watertight = "watertight",
    }
    /// How kernels read geometry.
    Accessor {
        /// From storage buffers.
        StorageBuffer = "ssbo",
        /// From texel buffers.
        TexelBuffer = "texel",
        /// From storage buffers by their device addresses.
        Address = "address",
    }
    /// The test of a ray against a box.
    Slabs {
        Plain = "plain",
        /// No box that the exact ray meets is missed.
        Robust = "robust",
    }
}

/// How a ray finds triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Every triangle.
    Brute,
    /// A stack of this many nodes for each ray.
    Stack(u32),
    /// A sewn tree, no stack.
    Threaded,
    /// Takes one child at once and puts only the other on the stack.
    SinglePush,
    /// Nodes with both children's boxes, the near child first.
    Ordered,
    /// Rays share the way from the root to where they start.
    Entry,
    /// A subgroup's rays share one stack.
    Packet,
    /// Leaves wait until enough of the subgroup have one.
    Postponed,
    /// A compressed tree of eight children a node.
    Wide,
    /// A subgroup's rays share one stack, several rays a lane.
    Bundle,
}

impl Preset {
    /// Whether the kernels do what the original's did.
    pub fn is_original(self) -> bool {
        self != Self::Auto
    }
}

/// Deepest stack that a kernel is made with.
pub const MOST_STACK: u32 = 1024;

impl Method {
    /// The family's name: what kernels are called by.
    pub fn family(self) -> &'static str {
        match self {
            Self::Brute => "brute",
            Self::Stack(_) => "stack",
            Self::Threaded => "threaded",
            Self::SinglePush => "single-push",
            Self::Ordered => "ordered",
            Self::Entry => "entry",
            Self::Packet => "packet",
            Self::Postponed => "postponed",
            Self::Wide => "wide",
            Self::Bundle => "bundle",
        }
    }

    /// Rays of an invocation that share their way through the tree.
    pub fn rays_together(self) -> u32 {
        if self == Self::Bundle { 4 } else { 1 }
    }

    /// Whether it tests any-hit rays against boxes by fused products ([`crate::pack::grown_pad`]).
    pub fn fuses_boxes(self) -> bool {
        matches!(self, Self::Entry | Self::Postponed)
    }

    /// Every method, `stackN` with so many entries.
    pub fn all(stack: u32) -> [Self; 10] {
        use Method::*;
        [Brute, Stack(stack), Threaded, SinglePush, Ordered, Entry, Packet, Postponed, Wide, Bundle]
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stack(entries) => write!(f, "stack{entries}"),
            other => f.write_str(other.family()),
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "cousu" => Ok(Self::Threaded),
            _ => {
                let unsized_method = |method: &Self| method.family() == text && *method != Self::Stack(1);
                if let Some(method) = Self::all(1).into_iter().find(unsized_method) {
                    return Ok(method);
                }
                let entries = text.strip_prefix("stack").and_then(|digits| digits.parse().ok());
                match entries {
                    Some(entries) if (1..=MOST_STACK).contains(&entries) => Ok(Self::Stack(entries)),
                    Some(_) => Err(format!("a stack has 1 to {MOST_STACK} entries")),
                    None => {
                        Err("choose brute, stackN (such as stack16 or stack64), threaded (or cousu), single-push, \
                             ordered, entry, packet, postponed, wide or bundle"
                            .into())
                    }
                }
            }
        }
    }
}

/// Every choice made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    pub preset: Preset,
    pub method: Method,
    pub builder: Builder,
    pub passes: Passes,
    pub sampler: Sampler,
    pub accumulator: Accumulator,
    pub offset: Offset,
    pub intersector: Intersector,
    pub slabs: Slabs,
}

/// What a few rays told of a picture before it is rendered, about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preview {
    /// Camera rays that meet the scene.
    pub camera_rays: u64,
    /// Nodes that an ambient ray from there opens, each two boxes, and triangles that it tests, from the root on: the mean.
    pub steps: u32,
}

/// Choices made on the command line; the rest is the preset's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wishes {
    pub preset: Option<Preset>,
    pub method: Option<Method>,
    pub builder: Option<Builder>,
    pub passes: Option<Passes>,
    pub sampler: Option<Sampler>,
    pub accumulator: Option<Accumulator>,
    pub offset: Option<Offset>,
    pub intersector: Option<Intersector>,
    pub slabs: Option<Slabs>,
    /// Ambient rays of a camera ray, if it is known how many there will be.
    pub samples: Option<u32>,
    /// Where the picture was looked at.
    pub preview: Option<Preview>,
    /// Ambient rays have an end.
    pub bounded: bool,
    pub accessor: Option<Accessor>,
    /// The device is a CPU, as far as is known before there is a tree.
    pub on_cpu: bool,
}

impl Wishes {
    /// For a device of this kind.
    pub fn on(self, kind: DeviceKind) -> Self {
        Self { on_cpu: kind == DeviceKind::Cpu, ..self }
    }

    /// Where their number is not known there may be many.
    pub fn fewer_samples(&self, than: u32) -> bool {
        self.samples.is_some_and(|samples| samples < than)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_have_names_both_ways() {
        for name in [
            "brute",
            "stack16",
            "stack64",
            "threaded",
            "single-push",
            "ordered",
            "entry",
            "packet",
            "postponed",
            "wide",
            "bundle",
        ] {
            assert_eq!(name.parse::<Method>().unwrap().to_string(), name);
        }
        assert_eq!("cousu".parse(), Ok(Method::Threaded));
        for wrong in ["stack", "stack0", "stack-1", "stack4096", "Brute", ""] {
            assert!(wrong.parse::<Method>().is_err(), "{wrong}");
        }
    }
}
