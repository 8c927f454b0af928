//! Which choices a preset makes, and why. The device chooses only what keeps the counts (method,
//! accessor); the scene and the preset choose the rest, so that every machine renders the same numbers.

use super::builder::why_builder;
use super::choices::{
    Accessor, Accumulator, Intersector, MOST_STACK, Method, Offset, Passes, Preset, Preview, Sampler,
    Settings, Slabs, Wishes,
};
use super::geometry::Geometry;
use super::invocations::{SPLIT_FROM_SAMPLES, choose_lanes, cut_by_rays};
use super::plan::{accessor_of, kernels_of};
use crate::error::{Error, Result};
use crate::kernels::{Kernel, NodeLayout, find_kernel};
use crate::pack;
use crate::vk::{Adapter, DeviceKind};

/// A choice with its reason, for `plan`.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Reason {
    pub what: &'static str,
    pub choice: String,
    pub why: String,
}

/// The settings of a render and where they come from.
pub struct Decision {
    pub settings: Settings,
    pub accessor: Accessor,
    /// Most invocations that may share a pixel's samples.
    pub sample_lanes: u32,
    /// Whether loops have to prove that they came to their end.
    pub leaves_loops: bool,
    pub reasons: Vec<Reason>,
}

/// Up to this many triangles all of them are tested on any device; one by one, a tree wins from 8 on (measured on boxes of 8, 16 and more
/// triangles, on an H100 and on Mesa's software device).
const BRUTE_UP_TO: usize = 4;
/// Where no preview tells of the picture: up to so many edges of faces for each unit of SAH cost `brute`, which finds them once for many of a pixel's rays, is the fastest on a GPU
/// (measured on an H100 at 64 samples: 1.7 times the rate of `entry` on Cornell with 66 edges and a cost of 12.3; boxes on a floor 1.4 with 28
/// edges and 5.0, 1.4 with 52 and 5.5, 1.0 with 100 and 8.0, 0.8 with 148 and 5.6; a closed room from outside, which every ray leaves, 0.75
/// with 44 and 9.9).
const EDGES_FOR_COST: f64 = 9.5;
/// Where a preview tells of it: fewer edges than for a walk of no steps, and than so many more for each step that ambient rays take, since a face costs all rays the same and a tree
/// more for longer walks ...
const EDGES_AND_FOR_STEP: (f64, f64) = (50.0, 16.7);
/// ... and of fewer samples or camera rays than these, whose subgroups have fewer rays and start farther apart (measured on an H100 on 22 views of 11 scenes of 24 to 264 edges, 1 to 11 steps and 63,000 to
/// 655,000 camera rays: where this takes it `brute` has 1.03 to 1.56 times the best rate of `entry` at 64 samples, 1.10 to 1.35 at 16 and 0.93 to 1.19 at 8, elsewhere 0.30 to 0.87, 0.55 to 1.06 and 0.47 to 0.90).
const FEW_EDGES_AND_FOR_STEP: (f64, f64) = (-25.0, 12.0);
const FEW_SAMPLES: u32 = 32;
const FEW_CAMERA_RAYS: u64 = 100_000;
/// Samples of a camera ray from which that pays (there, 1.4, 1.2 and 1.1 times the rate of the next best at 8 on Cornell and the first two of
/// those, 0.85 times at 4; since `entry` tests triangles roughly and takes small sets cell by cell, and `brute` reads by address, 1.13 times at 8 and
/// 0.74 times at 4 on Cornell).
pub(super) const FACES_FROM_SAMPLES: u32 = 8;
/// From this many triangles on `wide`, with its small nodes, is the fastest on a GPU for few samples, if one kernel does all of a pixel
/// (measured on an H100 at 4 samples: 1.17 times the rate of `entry` on a terrain of 10 million triangles, 0.96 to 1.03 times on one of 2 million, 0.64 times
/// on the arcade of 260,000) and lanes do not take over each other's work.
const WIDE_FROM: usize = 3_000_000;
const WIDE_UP_TO_SAMPLES: u32 = 8;

/// Up to this SAH cost and so many triangles `bundle` is the fastest on a CPU device, where neighbouring rays stay together (measured
/// on Mesa's software device: 1.1 to 2.4 times the rate of `wide` on Cornell, maison, bunny and arcade, 0.8 to 1 on the terrain of two million
/// triangles and on the hairball, of cost 189).
const BUNDLE_UP_TO_COST: f64 = 100.0;
const BUNDLE_UP_TO: usize = 1_000_000;

/// From this SAH cost on `postponed` is the fastest on a GPU where no lanes take over work (measured on an H100 with Sobol points: 1.2 times the rate of `entry` at 64 samples and 1.06 to 1.12 times at
/// 4 and 8 on the hairball, of cost 189; 0.64 to 0.82 times at 64 on maison, bunny, arcade and terrain).
const POSTPONED_FROM: f64 = 100.0;

/// Makes every choice that `wishes` leaves open.
pub fn decide(wishes: &Wishes, geometry: &Geometry, adapter: &Adapter) -> Decision {
    let mut reasons = Vec::new();
    let preset = wishes.preset.unwrap_or(Preset::Auto);
    let mut note =
        |what, choice: String, why: &str| reasons.push(Reason { what, choice, why: why.to_string() });
    let asked = "asked for";
    let settings = match preset {
        Preset::Original | Preset::OriginalUnbiased => {
            let unbiased = preset == Preset::OriginalUnbiased;
            let (accumulator, offset, why) = match unbiased {
                false => (Accumulator::Rgba8, Offset::Fixed, "what the OpenGL original did, faults included"),
                true => (
                    Accumulator::Rgba32f,
                    Offset::Scaled,
                    "what the OpenGL original did, with floats, pixel centres, facing normals and a scaled offset",
                ),
            };
            note("preset", preset.name().into(), why);
            Settings {
                preset,
                method: wishes.method.unwrap_or(Method::Threaded),
                builder: geometry.builder,
                passes: wishes.passes.unwrap_or(Passes::Single),
                sampler: wishes.sampler.unwrap_or(Sampler::Lcg),
                accumulator: wishes.accumulator.unwrap_or(accumulator),
                offset: wishes.offset.unwrap_or(offset),
                intersector: wishes.intersector.unwrap_or(Intersector::Moller),
                slabs: wishes.slabs.unwrap_or(Slabs::Plain),
            }
        }
        Preset::Auto => {
            let (method, why) = match wishes.method {
                Some(method) => (method, asked.to_string()),
                None => choose_method(wishes, geometry, adapter),
            };
            note("method", method.to_string(), &why);
            let mut choose = |what, wish: Option<&'static str>, default: &'static str, why: &str| {
                note(what, wish.unwrap_or(default).into(), if wish.is_some() { asked } else { why });
            };
            choose(
                "sampler",
                wishes.sampler.map(Sampler::name),
                "sobol",
                "its error falls faster than that of independent numbers",
            );
            choose(
                "accumulator",
                wishes.accumulator.map(Accumulator::name),
                "count",
                "exact, and it adds up in any order",
            );
            let (passes, why) = choose_passes(wishes, method, geometry, adapter);
            choose("passes", wishes.passes.map(Passes::name), passes.name(), &why);
            choose(
                "offset",
                wishes.offset.map(Offset::name),
                "ulp",
                "no farther off the surface than the error of a hit point",
            );
            choose(
                "samples",
                None,
                "as many for each pixel",
                "--adaptive pays where large parts of the picture are open",
            );
            let (intersector, why) = choose_intersector(geometry);
            choose("intersector", wishes.intersector.map(Intersector::name), intersector.name(), why);
            choose("slabs", wishes.slabs.map(Slabs::name), "robust", "no box that a ray meets is missed");
            Settings {
                preset,
                method,
                builder: geometry.builder,
                passes: wishes.passes.unwrap_or(passes),
                sampler: wishes.sampler.unwrap_or(Sampler::Sobol),
                accumulator: wishes.accumulator.unwrap_or(Accumulator::Count),
                offset: wishes.offset.unwrap_or(Offset::Ulp),
                intersector: wishes.intersector.unwrap_or(intersector),
                slabs: wishes.slabs.unwrap_or(Slabs::Robust),
            }
        }
    };
    let (wanted, why) = match wishes.accessor {
        Some(accessor) => (accessor, asked),
        None => choose_accessor(&settings, geometry, adapter),
    };
    let accessor = kernels_of(&settings, wanted).map_or(wanted, |kernels| accessor_of(&kernels, wanted));
    let why = if accessor == wanted { why } else { "no kernel of these choices reads by device address" };
    note("accessor", accessor.name().into(), why);
    note("builder", settings.builder.name().into(), &why_builder(wishes, geometry));
    // Where a driver leaves loops early a block must be able to begin with the ray that was left.
    let leaves_loops = adapter.limits.loop_iterations.is_some();
    let narrow = adapter.kind == DeviceKind::Cpu || leaves_loops;
    let (sample_lanes, why) = if narrow { (1, None) } else { choose_lanes(&settings, accessor, wishes) };
    if let Some(why) = why {
        note("sample lanes", sample_lanes.to_string(), &why);
    }
    Decision { settings, accessor, sample_lanes, leaves_loops, reasons }
}

fn choose_method(wishes: &Wishes, geometry: &Geometry, adapter: &Adapter) -> (Method, String) {
    let triangles = geometry.triangles.len();
    let on_cpu = adapter.kind == DeviceKind::Cpu;
    // It takes a while for millions of triangles, and on a CPU device their number decides.
    let cost = if on_cpu && triangles > BUNDLE_UP_TO { 0.0 } else { geometry.quality().sah_cost };
    let votes =
        find_kernel("ambient/postponed/count/ssbo").and_then(|kernel| check_subgroup(kernel, adapter));
    let together =
        find_kernel("ambient_list/bundle/texel").and_then(|kernel| check_subgroup(kernel, adapter));
    if triangles <= BRUTE_UP_TO {
        let why = format!("{triangles} triangles, at most {BRUTE_UP_TO}: a tree would not pay");
        (Method::Brute, why)
    } else if on_cpu && together.is_err() {
        (
            Method::Wide,
            "a CPU device whose subgroups have not eight lanes is fastest with few, large nodes".into(),
        )
    } else if on_cpu && triangles > BUNDLE_UP_TO {
        (Method::Wide, format!("{triangles} triangles, above {BUNDLE_UP_TO}: neighbouring rays part early"))
    } else if on_cpu && cost > BUNDLE_UP_TO_COST {
        (Method::Wide, format!("SAH cost {cost:.0}, above {BUNDLE_UP_TO_COST}: neighbouring rays part early"))
    } else if on_cpu {
        (Method::Bundle, "a CPU device is fastest where many rays share what a node costs".into())
    } else if takes_faces(wishes, geometry, adapter)
        && let Some(why) = why_faces(wishes, geometry.face_edges, cost)
    {
        (Method::Brute, why)
    } else if triangles >= WIDE_FROM
        && cost <= POSTPONED_FROM
        && wishes.fewer_samples(WIDE_UP_TO_SAMPLES)
        && matches!(wishes.passes, None | Some(Passes::Single))
        && (wishes.passes.is_some() || !can_take_over_work(wishes, adapter))
    {
        let why = format!(
            "{triangles} triangles, at least {WIDE_FROM}: for few rays small nodes are the fastest to read"
        );
        (Method::Wide, why)
    } else if cost > POSTPONED_FROM && votes.is_ok() && !takes_over_work(wishes, adapter) {
        let why = format!(
            "SAH cost {cost:.0}, above {POSTPONED_FROM}: where rays meet many leaves, they wait for one another"
        );
        (Method::Postponed, why)
    } else {
        (Method::Entry, "a GPU is fastest with two-child nodes, from where the rays start".into())
    }
}

/// Whether lanes of `entry` could take over each other's work, if passes are `split`. (Where a pixel is left to one invocation each batch of rays ends before the next: on a hairball `entry` still has 1.35 times the
/// rate of `postponed` with `lcg` at 64 samples, 1.6 to 1.7 times with running means.)
fn can_take_over_work(wishes: &Wishes, adapter: &Adapter) -> bool {
    let kernel = find_kernel("ambient_list/entry/address");
    adapter.kind != DeviceKind::Cpu
        && kernel.and_then(|kernel| check_subgroup(kernel, adapter)).is_ok()
        && matches!(wishes.accessor, None | Some(Accessor::Address))
        && !wishes.fewer_samples(SPLIT_FROM_SAMPLES)
}

/// Whether they would.
fn takes_over_work(wishes: &Wishes, adapter: &Adapter) -> bool {
    can_take_over_work(wishes, adapter)
        && wishes.passes.unwrap_or_else(|| cut_by_rays(wishes, true).0) == Passes::Split
}

/// Whether `brute` would find each face's edges for many rays at once.
fn takes_faces(wishes: &Wishes, geometry: &Geometry, adapter: &Adapter) -> bool {
    let kernels = ["primary/brute/ssbo", "ambient_list/brute/ssbo"];
    let runs = |name| find_kernel(name).and_then(|kernel| check_subgroup(kernel, adapter)).is_ok();
    let intersector = wishes.intersector.unwrap_or(choose_intersector(geometry).0);
    kernels.into_iter().all(runs)
        && intersector == Intersector::Conservative
        && wishes.slabs != Some(Slabs::Plain)
        && matches!(wishes.passes, None | Some(Passes::Split))
        && matches!(wishes.accumulator, None | Some(Accumulator::Count))
        && wishes.sampler != Some(Sampler::Lcg)
        && wishes.accessor != Some(Accessor::TexelBuffer)
        && geometry.triangles.len() <= pack::MOST_FACES
        && !wishes.fewer_samples(FACES_FROM_SAMPLES)
        && !wishes.bounded
}

/// Why that pays, if it does.
fn why_faces(wishes: &Wishes, edges: Option<u32>, cost: f64) -> Option<String> {
    let edges = edges?;
    let (few, than) = match wishes.preview {
        None => (f64::from(edges) <= EDGES_FOR_COST * cost, format!("an SAH cost of {cost:.1}")),
        Some(Preview { camera_rays, steps }) => {
            let few_rays = wishes.fewer_samples(FEW_SAMPLES) || camera_rays < FEW_CAMERA_RAYS;
            let (some, for_step) = if few_rays { FEW_EDGES_AND_FOR_STEP } else { EDGES_AND_FOR_STEP };
            let rays = format!(
                "about {camera_rays} camera rays that meet the scene and ambient rays of about {steps} steps"
            );
            (f64::from(edges) < some + for_step * f64::from(steps), rays)
        }
    };
    few.then(|| format!("{edges} edges of faces, few for {than}, are found once for many of a pixel's rays"))
}

/// All see the same triangles but for rays within some roundings of an edge.
fn choose_intersector(geometry: &Geometry) -> (Intersector, &'static str) {
    if geometry.shares_edges {
        (Intersector::Conservative, "triangles may share edges, and no ray may pass between them")
    } else {
        (Intersector::Moller, "no two triangles share an edge that rays could pass through")
    }
}

/// Camera rays' hits are found again with each dispatch of a single pass; a second kernel costs little where dispatches
/// are many, as on a CPU, or where lanes do not take their next ray by themselves.
fn choose_passes(
    wishes: &Wishes,
    method: Method,
    geometry: &Geometry,
    adapter: &Adapter,
) -> (Passes, String) {
    let on_cpu = adapter.kind == DeviceKind::Cpu;
    match method {
        Method::Brute if !on_cpu && takes_faces(wishes, geometry, adapter) => {
            (Passes::Split, "many of a pixel's rays share what a face costs".into())
        }
        Method::Brute => (Passes::Single, "one kernel does all of a pixel".into()),
        _ if on_cpu => (
            Passes::Split,
            "a CPU device does the work in many dispatches, and camera rays' hits are kept".into(),
        ),
        Method::Ordered | Method::Entry | Method::Postponed => {
            cut_by_rays(wishes, method == Method::Entry && can_take_over_work(wishes, adapter))
        }
        _ => (Passes::Single, "one kernel does all of a pixel".into()),
    }
}

/// The feature of a device whose kernels may read by address.
const ADDRESSES: (&str, bool) = ("buffer device address", true);

/// Mesa's software device reads texel buffers three times faster than storage buffers: the fetch is
/// inlined, a storage buffer's load under control flow is a loop over lanes. An H100 has 1.03 to 1.08 times the rate
/// of storage buffers if it reads them by their device addresses. The original had storage buffers.
fn choose_accessor(settings: &Settings, geometry: &Geometry, adapter: &Adapter) -> (Accessor, &'static str) {
    let words = geometry.tree.nodes.len().max(geometry.triangles.len() * 3 / 2) as u64 * 2;
    if settings.preset.is_original() {
        (Accessor::StorageBuffer, "as the original")
    } else if adapter.kind != DeviceKind::Cpu && adapter.features.contains(&ADDRESSES) {
        let runs = |kernel: &&Kernel| check_subgroup(kernel, adapter).is_ok();
        match kernels_of(settings, Accessor::Address) {
            Ok(kernels) if !kernels.iter().all(runs) => (
                Accessor::StorageBuffer,
                "the kernels that read by device addresses need subgroup operations that the device has not",
            ),
            _ => (Accessor::Address, "a GPU reads fastest by device addresses"),
        }
    } else if adapter.kind != DeviceKind::Cpu {
        (Accessor::StorageBuffer, "a GPU without device addresses reads storage buffers")
    } else if words > adapter.limits.texel_elements {
        (Accessor::StorageBuffer, "the scene has more words than a texel buffer")
    } else {
        (Accessor::TexelBuffer, "a CPU device reads texel buffers faster than storage buffers")
    }
}

/// Refuses a stack that a ray could overflow, unless that is allowed.
pub fn check_stack(method: Method, geometry: &Geometry, allow_overflow: bool) -> Result<()> {
    match method {
        Method::Stack(entries) if entries < geometry.stack_bound && !allow_overflow => {
            let needed = geometry.stack_bound;
            let deep_enough = if needed > MOST_STACK { String::new() } else { format!("stack{needed} or ") };
            Err(Error::usage(format!(
                "{method} can overflow: this tree needs up to {needed} entries; choose --method {deep_enough}threaded, \
                 or pass --allow-overflow to drop pushes and count the rays that it touches."
            )))
        }
        _ => Ok(()),
    }
}

/// Refuses a kernel whose subgroup operations or device addresses the device does not have.
pub fn check_subgroup(kernel: &Kernel, adapter: &Adapter) -> Result<()> {
    // Its votes went wrong on an H100 (docs/measurements.md).
    if kernel.nodes == NodeLayout::Quad && adapter.kind != DeviceKind::Cpu {
        return Err(Error::device(format!(
            "bundle is made for CPU devices, and lost rays on a GPU: choose --method ordered for {}.",
            adapter.name
        )));
    }
    check_addresses(kernel, &adapter.name, adapter.features.contains(&ADDRESSES))?;
    check_operations(kernel, &adapter.name, adapter.subgroup.size, &adapter.subgroup.operations())
}

fn check_addresses(kernel: &Kernel, device: &str, has_addresses: bool) -> Result<()> {
    if !kernel.by_address || has_addresses {
        return Ok(());
    }
    Err(Error::device(format!(
        "{device} has no device addresses of buffers, which the kernel {} needs: choose --accessor ssbo.",
        kernel.name
    )))
}

/// Lanes that `packet` shares a node's words among, where they are texels.
const FEWEST_LANES: u32 = 4;
/// Lanes of `bundle`, where nodes are texels.
const BUNDLE_LANES: u32 = 8;

fn check_operations(kernel: &Kernel, device: &str, size: u32, operations: &[&str]) -> Result<()> {
    let lacking: Vec<&str> =
        kernel.subgroup.iter().filter(|needed| !operations.contains(needed)).copied().collect();
    let shares_words = kernel.subgroup.contains(&"shuffle") && kernel.name.ends_with("/texel");
    let of_eight = kernel.nodes == NodeLayout::Quad && kernel.name.ends_with("/texel");
    let lack = match lacking.len() {
        0 if of_eight && size != BUNDLE_LANES => format!("subgroups of {BUNDLE_LANES} lanes"),
        0 if kernel.nodes == NodeLayout::Pair && shares_words && size < FEWEST_LANES => {
            format!("subgroups of at least {FEWEST_LANES} lanes")
        }
        0 => return Ok(()),
        _ => format!("the subgroup operations {}", lacking.join(", ")),
    };
    let by_buffers = kernel.name.strip_suffix("/address").map(|stem| find_kernel(&format!("{stem}/ssbo")));
    let instead = match by_buffers {
        Some(Ok(kernel)) if kernel.subgroup.is_empty() => "--accessor ssbo",
        _ => "--method ordered",
    };
    Err(Error::device(format!(
        "{device} has not {lack}, which the kernel {} needs: choose {instead}, which needs none.",
        kernel.name
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{KERNELS, find_kernel};

    #[test]
    fn a_device_without_the_subgroup_operations_is_refused_by_name() {
        let packet = find_kernel("ambient/packet/count/texel").unwrap();
        let all = ["basic", "vote", "arithmetic", "ballot", "shuffle", "quad"];
        check_operations(packet, "A", 4, &all).unwrap();
        let few = check_operations(packet, "A", 2, &all).unwrap_err().to_string();
        assert!(few.contains("at least 4 lanes"), "{few}");
        let none = check_operations(packet, "A", 32, &["basic", "vote"]).unwrap_err().to_string();
        assert!(none.contains("arithmetic") && none.contains("--method ordered"), "{none}");
        let bundle = find_kernel("ambient/bundle/count/texel").unwrap();
        check_operations(bundle, "A", 8, &all).unwrap();
        let other = check_operations(bundle, "A", 16, &all).unwrap_err().to_string();
        assert!(other.contains("subgroups of 8 lanes"), "{other}");
        for name in ["ambient_list/entry/address", "primary/entry/address"] {
            let stealing = find_kernel(name).unwrap();
            check_operations(stealing, "A", 8, &all).unwrap();
            let votes = check_operations(stealing, "A", 8, &["basic", "vote"]).unwrap_err().to_string();
            assert!(votes.contains("ballot") && votes.contains("choose --accessor ssbo"), "{votes}");
        }
        let ordered = find_kernel("ambient/ordered/count/ssbo").unwrap();
        check_operations(ordered, "A", 0, &[]).unwrap();
    }

    #[test]
    fn a_device_without_addresses_is_refused_by_name() {
        let entry = find_kernel("ambient_list/entry/address").unwrap();
        check_addresses(entry, "A", true).unwrap();
        let refusal = check_addresses(entry, "A", false).unwrap_err();
        assert_eq!(
            refusal.to_string(),
            "A has no device addresses of buffers, which the kernel ambient_list/entry/address needs: choose --accessor ssbo."
        );
        assert_eq!(refusal.exit_code(), 4);
        check_addresses(find_kernel("ambient_list/entry/ssbo").unwrap(), "A", false).unwrap();
    }

    /// Only the methods that vote, and the kernels that count, need more than a lone invocation.
    #[test]
    fn timed_kernels_have_no_subgroup_operations_but_their_method_s() {
        for kernel in KERNELS {
            let votes =
                ["/packet/", "/postponed/", "/bundle/"].iter().any(|method| kernel.name.contains(method))
                    || kernel.nodes == NodeLayout::Faces
                    || ["primary/entry/address", "ambient_list/entry/address"].contains(&kernel.name);
            let counts = kernel.name.starts_with("work/");
            assert_eq!(
                !kernel.subgroup.is_empty(),
                votes || counts,
                "{}: {:?}",
                kernel.name,
                kernel.subgroup
            );
            assert_eq!(kernel.glsl.is_empty(), votes || counts || kernel.by_address, "{}", kernel.name);
        }
    }
}
