//! Which curves there are: the one table of them. A variant is a row.

use serde::Serialize;

use crate::bvh::Builder;
use crate::layout::FRAME_SAMPLES;
use crate::render::auto::{self, Decision};
use crate::render::choices::{
    Accumulator, Intersector, Method, Offset, Passes, Preset, Sampler, Settings, Slabs, Wishes,
};
use crate::render::geometry::Geometry;
use crate::vk::Adapter;

/// The curve that factors are told over.
pub const BASE: &str = "original-unbiased";
/// The default choices.
pub const AUTO: &str = "auto";

/// A curve as it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    pub label: String,
    pub varies: Varies,
    pub wishes: Wishes,
    pub tweak: Tweak,
}

/// What a curve changes, for its place in the legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Varies {
    /// The original, or one of its faults alone.
    Original,
    Base,
    Nothing,
    Sampler,
    Method,
    Passes,
    Surface,
    /// What was asked for on the command line.
    Asked,
}

/// What a curve changes beside the choices of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tweak {
    None,
    Adaptive,
    /// The numbers of a frame come again in each frame: more of them tell nothing new.
    FixedSeed,
}

/// Lists on the command line.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    pub methods: Option<Vec<Method>>,
    pub builders: Option<Vec<Builder>>,
    pub passes: Option<Vec<Passes>>,
    pub samplers: Option<Vec<Sampler>>,
    /// Labels of the curves to keep; all, if empty.
    pub only: Vec<String>,
}

/// Stands for a stack as deep as the tree needs.
const FITTED: Method = Method::Stack(0);

/// The curves of a scene: the table's, or the product of the lists on the command line beside the base and the default
/// choices.
pub fn variants(lists: &Lists) -> Vec<Variant> {
    let asked = lists.methods.is_some()
        || lists.builders.is_some()
        || lists.passes.is_some()
        || lists.samplers.is_some();
    let mut variants = table();
    if asked {
        variants.retain(|variant| [BASE, AUTO].contains(&variant.label.as_str()));
        variants.extend(product(lists));
    }
    let kept = |variant: &Variant| lists.only.is_empty() || lists.only.contains(&variant.label);
    variants.retain(kept);
    variants
}

fn table() -> Vec<Variant> {
    use Varies::{Method as ByMethod, Nothing, Passes as ByPasses, Sampler as BySampler, Surface};
    let auto = Wishes::default();
    let preset = |preset| Wishes { preset: Some(preset), ..auto };
    let eight_bit = Wishes { accumulator: Some(Accumulator::Rgba8), ..preset(Preset::OriginalUnbiased) };
    let sampler = |sampler| Wishes { sampler: Some(sampler), ..auto };
    let method = |method| Wishes { method: Some(method), ..auto };
    let passes = |passes| Wishes { passes: Some(passes), ..auto };
    let offset = |offset| Wishes { offset: Some(offset), ..auto };
    let intersector = |intersector| Wishes { intersector: Some(intersector), ..auto };
    let slabs = |slabs| Wishes { slabs: Some(slabs), ..auto };
    [
        ("original", Varies::Original, preset(Preset::Original), Tweak::None),
        ("8-bit", Varies::Original, eight_bit, Tweak::None),
        (BASE, Varies::Base, preset(Preset::OriginalUnbiased), Tweak::None),
        (AUTO, Nothing, auto, Tweak::None),
        ("lcg", BySampler, sampler(Sampler::Lcg), Tweak::None),
        ("pcg", BySampler, sampler(Sampler::Pcg), Tweak::None),
        ("sobol", BySampler, sampler(Sampler::Sobol), Tweak::None),
        ("strata", BySampler, sampler(Sampler::Strata), Tweak::None),
        ("adaptive", BySampler, auto, Tweak::Adaptive),
        ("fixed-seed", BySampler, sampler(Sampler::Pcg), Tweak::FixedSeed),
        ("threaded", ByMethod, method(Method::Threaded), Tweak::None),
        ("stack", ByMethod, method(FITTED), Tweak::None),
        ("ordered", ByMethod, method(Method::Ordered), Tweak::None),
        ("entry", ByMethod, method(Method::Entry), Tweak::None),
        ("wide", ByMethod, method(Method::Wide), Tweak::None),
        ("postponed", ByMethod, method(Method::Postponed), Tweak::None),
        ("packet", ByMethod, method(Method::Packet), Tweak::None),
        ("bundle", ByMethod, method(Method::Bundle), Tweak::None),
        ("single", ByPasses, passes(Passes::Single), Tweak::None),
        ("split", ByPasses, passes(Passes::Split), Tweak::None),
        ("staged", ByPasses, passes(Passes::Staged), Tweak::None),
        ("offset-fixed", Surface, offset(Offset::Fixed), Tweak::None),
        ("offset-scaled", Surface, offset(Offset::Scaled), Tweak::None),
        ("offset-ulp", Surface, offset(Offset::Ulp), Tweak::None),
        ("moller", Surface, intersector(Intersector::Moller), Tweak::None),
        ("conservative", Surface, intersector(Intersector::Conservative), Tweak::None),
        ("watertight", Surface, intersector(Intersector::Watertight), Tweak::None),
        ("plain-slabs", Surface, slabs(Slabs::Plain), Tweak::None),
    ]
    .map(|(label, varies, wishes, tweak)| Variant { label: label.into(), varies, wishes, tweak })
    .into()
}

/// Labels that `--only` takes.
pub fn labels() -> Vec<String> {
    table().into_iter().map(|variant| variant.label).collect()
}

fn product(lists: &Lists) -> Vec<Variant> {
    fn each<T: Copy>(list: &Option<Vec<T>>) -> Vec<Option<T>> {
        list.as_ref().map_or(vec![None], |list| list.iter().copied().map(Some).collect())
    }
    let mut variants: Vec<Variant> = Vec::new();
    for method in each(&lists.methods) {
        for builder in each(&lists.builders) {
            for passes in each(&lists.passes) {
                for sampler in each(&lists.samplers) {
                    let wishes = Wishes { method, builder, passes, sampler, ..Wishes::default() };
                    let names = [
                        method.map(|method| method.to_string()),
                        builder.map(|builder| builder.name().to_string()),
                        passes.map(|passes| passes.name().to_string()),
                        sampler.map(|sampler| sampler.name().to_string()),
                    ];
                    let label = names.into_iter().flatten().collect::<Vec<_>>().join("+");
                    if variants.iter().all(|known| known.label != label) {
                        variants.push(Variant { label, varies: Varies::Asked, wishes, tweak: Tweak::None });
                    }
                }
            }
        }
    }
    variants
}

/// Everything that a curve chose. Equal choices give the same picture in the same time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Choices {
    pub preset: &'static str,
    pub method: String,
    pub builder: &'static str,
    pub passes: &'static str,
    pub sampler: &'static str,
    pub accumulator: &'static str,
    pub offset: &'static str,
    pub intersector: &'static str,
    pub slabs: &'static str,
    pub accessor: &'static str,
    pub adaptive: bool,
    /// Random numbers begin again after so many samples.
    pub repeat: Option<u32>,
}

impl Variant {
    /// The choices asked for, a stack as deep as this tree needs among them.
    pub fn wishes_on(&self, geometry: &Geometry) -> Wishes {
        let method = self.wishes.method.map(|method| match method {
            FITTED => Method::Stack(geometry.stack_bound.max(1)),
            other => other,
        });
        Wishes { method, ..self.wishes }
    }

    /// What this curve does on a scene and a device.
    pub fn decide(&self, geometry: &Geometry, adapter: &Adapter) -> (Decision, Choices) {
        let decision = auto::decide(&self.wishes_on(geometry), geometry, adapter);
        let Settings { preset, method, builder, passes, sampler, accumulator, offset, intersector, slabs } =
            decision.settings;
        let choices = Choices {
            preset: preset.name(),
            method: method.to_string(),
            builder: builder.name(),
            passes: passes.name(),
            sampler: sampler.name(),
            accumulator: accumulator.name(),
            offset: offset.name(),
            intersector: intersector.name(),
            slabs: slabs.name(),
            accessor: decision.accessor.name(),
            adaptive: self.tweak == Tweak::Adaptive,
            repeat: (self.tweak == Tweak::FixedSeed).then_some(FRAME_SAMPLES),
        };
        (decision, choices)
    }

    /// The label, with the size of a stack that was fitted.
    pub fn label_on(&self, geometry: &Geometry) -> String {
        match (self.wishes.method, self.wishes_on(geometry).method) {
            (Some(FITTED), Some(fitted)) => fitted.to_string(),
            _ => self.label.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_is_there_once() {
        let labels = labels();
        for (place, label) in labels.iter().enumerate() {
            assert!(!labels[..place].contains(label), "{label}");
        }
        for label in [BASE, AUTO, "original", "sobol", "adaptive", "fixed-seed", "wide", "staged"] {
            assert!(labels.iter().any(|known| known == label), "{label}");
        }
        assert_eq!(variants(&Lists::default()).len(), labels.len());
    }

    #[test]
    fn lists_are_multiplied_and_stand_beside_base_and_default() {
        let lists = Lists {
            methods: Some(vec![Method::Threaded, Method::Wide]),
            samplers: Some(vec![Sampler::Pcg, Sampler::Sobol, Sampler::Pcg]),
            ..Lists::default()
        };
        let labels = |lists: &Lists| -> Vec<String> {
            variants(lists).into_iter().map(|variant| variant.label).collect()
        };
        let all = [BASE, AUTO, "threaded+pcg", "threaded+sobol", "wide+pcg", "wide+sobol"];
        assert_eq!(labels(&lists), all);
        let only = Lists { only: vec![AUTO.into(), "wide+pcg".into()], ..lists };
        assert_eq!(labels(&only), [AUTO, "wide+pcg"]);
    }
}
