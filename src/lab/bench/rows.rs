//! What a benchmark measures, row by row: which there are, and what each one tells.

use clap::ValueEnum;
use serde::Serialize;

use crate::bvh::quality::Quality;
use crate::bvh::{Builder, Wanted};
use crate::error::Error;
use crate::render::builder::choose_builder;
use crate::render::choices::{Method, Passes, Preset, Wishes};
use crate::render::work::RayWork;

/// The choices of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spec {
    pub preset: Preset,
    pub method: Method,
    pub builder: Builder,
    pub passes: Passes,
}

/// Methods, builders and passes that were asked for.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    pub methods: Option<Vec<Method>>,
    pub builders: Option<Vec<Builder>>,
    pub passes: Option<Vec<Passes>>,
}

/// The methods of the report, ours last.
pub const REPORTED: [Method; 4] = [Method::Brute, Method::Stack(64), Method::Stack(16), Method::Threaded];

impl Spec {
    /// `builder`: the preset's, if there is none; `cheaper`: what that is where it depends on the scene. `brute` reads no tree, so
    /// every builder is the same to it.
    pub fn new(
        preset: Preset,
        method: Method,
        builder: Option<Builder>,
        passes: Passes,
        cheaper: Builder,
    ) -> Self {
        let wishes = Wishes { preset: Some(preset), method: Some(method), builder, ..Wishes::default() };
        let builder = match choose_builder(&wishes) {
            Wanted::Builder(builder) => builder,
            Wanted::Cheaper => cheaper,
        };
        Self { preset, method, builder, passes }
    }

    pub fn wishes(&self) -> Wishes {
        Wishes {
            preset: Some(self.preset),
            method: Some(self.method),
            builder: Some(self.builder),
            passes: Some(self.passes),
            ..Wishes::default()
        }
    }

    /// Whether two rows can read the same geometry.
    pub fn shares_geometry(&self, other: &Self) -> bool {
        let conditioned = |spec: &Self| !spec.preset.is_original();
        self.builder == other.builder && conditioned(self) == conditioned(other)
    }

    /// The method; with its preset where that is not `auto`.
    pub fn label(&self) -> String {
        method_label(self.preset.name(), &self.method.to_string())
    }
}

/// `original/stack64` for the original's, otherwise the method alone.
pub fn method_label(preset: &str, method: &str) -> String {
    if preset == Preset::Auto.name() { method.to_string() } else { format!("{preset}/{method}") }
}

/// Every method once, stacks with the sizes of the report.
fn all_methods() -> Vec<Method> {
    let mut methods = Method::all(64).to_vec();
    methods.insert(2, Method::Stack(16));
    methods
}

/// The rows of a scene: the full product of what was asked for; otherwise every method on the default builder, every
/// builder with two methods and every way of cutting passes with one. `cheaper`: the default builder.
pub fn specs(lists: &Lists, cheaper: Builder) -> Vec<Spec> {
    let mut specs: Vec<Spec> = Vec::new();
    let mut add = |method, builder, passes| {
        let spec = Spec::new(Preset::Auto, method, builder, passes, cheaper);
        if !specs.contains(&spec) {
            specs.push(spec);
        }
    };
    let asked = lists.methods.is_some() || lists.builders.is_some() || lists.passes.is_some();
    let methods = lists.methods.clone().unwrap_or_else(all_methods);
    let builders: Vec<Option<Builder>> =
        lists.builders.as_ref().map_or(vec![None], |list| list.iter().copied().map(Some).collect());
    for &passes in lists.passes.as_deref().unwrap_or(&[Passes::Single]) {
        for &builder in &builders {
            methods.iter().for_each(|&method| add(method, builder, passes));
        }
    }
    if !asked {
        for &builder in Builder::value_variants() {
            add(Method::Threaded, Some(builder), Passes::Single);
            add(Method::Ordered, Some(builder), Passes::Single);
        }
        add(Method::Ordered, None, Passes::Split);
        add(Method::Ordered, None, Passes::Staged);
    }
    specs
}

/// The rows with the original's own choices, of the methods that are measured at all.
pub fn original_specs(lists: &Lists) -> Vec<Spec> {
    let wanted = |method: &Method| lists.methods.as_ref().is_none_or(|list| list.contains(method));
    let spec = |method| Spec::new(Preset::Original, method, None, Passes::Single, Builder::Midpoint);
    REPORTED.into_iter().filter(wanted).map(spec).collect()
}

/// A measured row. `None` (null) where a figure does not exist or was not found out.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The place in the plan of the whole run.
    #[serde(skip)]
    pub order: usize,
    pub scene: String,
    /// Hexadecimal, of the triangles.
    pub scene_hash: String,
    pub triangles: usize,
    /// As on the command line; `-` where rays do not depend on a view.
    pub view: String,
    pub preset: &'static str,
    pub method: String,
    pub builder: &'static str,
    /// With lists of rays `trace`: the kernel that answers them.
    pub passes: &'static str,
    /// With lists of rays, what was asked of them: `closest` or `any` hit.
    pub query: Option<&'static str>,
    pub api: &'static str,
    pub accessor: &'static str,
    /// Ambient rays of a pixel in a frame; 0 with lists of rays.
    pub spp: u32,
    /// Measured frames.
    pub frames: usize,
    /// Rays of one frame, of the whole picture or list.
    pub rays_per_frame: u64,
    /// The share of the rays that ran, where the whole would have taken too long; times are scaled to the whole.
    pub subset: Option<f64>,
    /// Summed kernel time of a frame: the median and its 95% interval.
    pub gpu_ms_median: f64,
    pub gpu_ms_ci95: [f64; 2],
    /// Time of a frame that also traces the camera rays, where a frame otherwise keeps their hits.
    pub first_frame_ms: Option<f64>,
    /// Of the hit kernels alone, for a frame's camera rays and ambient rays, from a run of the same method in stages.
    pub traversal_ms: Option<f64>,
    pub mrays_per_s: f64,
    /// Stack entries that a ray can need; 0 without a stack.
    pub max_stack: u32,
    /// Rays of the first frame that lost a part of the tree to a full stack.
    pub overflowed_rays: u64,
    /// Pixels whose counts differ from the reference row's after the first frame; with lists of rays, rays whose
    /// answers differ. `None` for running means, which have no counts, and with the original's choices, whose rays
    /// are others.
    pub mismatched_pixels: Option<u64>,
    pub build_ms: f64,
    pub tree: Quality,
    /// Bytes of the nodes on the device.
    pub bvh_bytes: u64,
    /// Of the kernel that traces ambient rays (or the list); `None` where the driver does not tell.
    pub registers: Option<u32>,
    pub stack_bytes: Option<u32>,
    /// Of camera rays and ambient rays, from a run of a kernel that counts (`render/work.rs`); of a smaller picture
    /// where the row ran on a part.
    pub closest: Option<RayWork>,
    pub any: Option<RayWork>,
}

/// A row that could not be measured.
#[derive(Debug, Serialize)]
pub struct Failure {
    pub scene: String,
    pub view: String,
    pub preset: &'static str,
    pub method: String,
    pub builder: &'static str,
    pub passes: &'static str,
    pub reason: String,
}

impl Failure {
    /// A scene that could not be had at all: no view and no choices are named.
    pub fn of_scene(scene: &str, error: &Error) -> Self {
        let (view, method) = (String::new(), String::new());
        let reason = error.to_string();
        Self { scene: scene.into(), view, preset: "", method, builder: "", passes: "", reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_run_has_every_method_builder_and_cut_once() {
        let specs = specs(&Lists::default(), Builder::Reinsert);
        for (place, spec) in specs.iter().enumerate() {
            assert!(!specs[..place].contains(spec), "{spec:?}");
        }
        let has = |test: &dyn Fn(&Spec) -> bool| specs.iter().any(test);
        for method in all_methods() {
            assert!(has(&|spec| spec.method == method), "{method}");
        }
        for &builder in Builder::value_variants() {
            assert!(has(&|spec| spec.builder == builder && spec.method == Method::Ordered));
        }
        assert!(has(&|spec| spec.passes == Passes::Staged) && has(&|spec| spec.passes == Passes::Split));
    }

    #[test]
    fn lists_are_multiplied_and_brute_has_no_builder() {
        let lists = Lists {
            methods: Some(vec![Method::Brute, Method::Threaded]),
            builders: Some(vec![Builder::Midpoint, Builder::Sah]),
            passes: Some(vec![Passes::Single, Passes::Split]),
        };
        assert_eq!(specs(&lists, Builder::Sah).len(), 6);
        assert_eq!(original_specs(&lists).len(), 2);
        assert_eq!(original_specs(&Lists::default()).len(), REPORTED.len());
    }
}
