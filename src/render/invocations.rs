//! How many invocations a GPU gives to a pixel: one kernel for all of its rays, or a second one whose invocations share its samples. That follows from how many rays
//! there are and how long they take, of which the preview tells.

use super::choices::{Accessor, Accumulator, Method, Passes, Preview, Sampler, Settings, Wishes};

/// Samples of a camera ray from which a second kernel may pay on a GPU, and from which it does whatever the picture where several invocations share a pixel.
pub const SPLIT_FROM_SAMPLES: u32 = 4;
const SPLIT_ALWAYS_FROM: u32 = 32;
/// Running means leave a pixel to one invocation, so that a second kernel only costs: from so many camera rays on one is the fastest whatever the samples (measured on an H100 on bunny, a closed room, stadium,
/// trees and terrain, 118,000 to 655,000 camera rays, rate of `single` over `split`: 1.3 to 1.75 at 64 and 256 samples, 1.1 to 1.66 at 8; maison 2.2; hairball by `postponed` 1.1 times that of `entry` by `split` at 64, but 0.84 at 8; of
/// 9,000 to 41,000 camera rays 0.5 to 0.72 at 64).
const MEANS_ALONE_FROM: u64 = 80_000;
/// One kernel, which need not wait for the last camera ray, is the fastest between them where rays take fewer steps than this, ...
const SHORT_WALK: u32 = 20;
/// ... and for each sample so many camera rays meet the scene, so that a GPU is busy with a ray at a time from each of them.
///
/// Measured on an H100 with `entry`, rate of `single` over `split` with stealing (docs/measurements.md). 1024x640, 4 samples: rays of 6 to 15 steps (boxes, Cornell, a closed room, arcade, a
/// city, maison) 1.12 to 1.48; 23 to 37 (stadium, bunny, terrain) 0.87 to 0.99, but 1.17 on trees of leaves (0.90 since lanes take over camera rays, too); 54 (a hairball) 0.70. At 8 samples 1.00 to 1.31, 0.77 to 0.95, 0.58.
/// Short rays at 4 samples: 0.88 of 44,000 camera rays, 1.09 to 1.48 from 62,000 on; at 8 0.79 and 0.91 up to 62,000, 0.95 to 1.31 from 155,000 on; at 16 0.65 to 1.0 up to
/// 176,000, but 1.08 to 1.22 from 250,000 on (a room of 655,000 1.15).
const CAMERA_RAYS_FOR_SAMPLE: u64 = 12_500;
/// Of rays of fewer steps than these fewer will do, and of next to none, or up to so many samples, any number (there, with stealing, rays of 1 to 10 steps in boxes, rooms and Cornell, 4,000 to 390,000 camera rays: `single` has
/// 1.2 to 2.2 times the rate of `split` at 4 samples, 1.0 to 2.1 at 8; at 16 0.75 to 0.96 of 4,000 to 38,000 with 5 and more steps, 0.93 to 1.35 from 38,000 on, and 1.4 to 1.6 of 9,000 to 146,000 with 1 step; 2 were not measured. A city
/// of 19,000 triangles and 11 steps has 0.95, 0.77 and 0.51 of 9,000, 0.98, 0.84 and 0.73 of 38,000).
const SHORTEST_WALK: u32 = 11;
const NO_WALK: u32 = 3;
const ANY_UP_TO_SAMPLES: u32 = 8;
const CAMERA_RAYS_FOR_SAMPLE_OF_SHORTEST: u64 = 2_500;
/// The limit of steps for fewer samples than these where no lanes steal (there, at 4 samples and 1024x640 `single` has 1.03 to 1.3 times the rate of `split` on stadium, terrain, bunny and trees, 0.75
/// on a hairball of 5,000 triangles; at 8 0.86 to 0.93 on the first three, 1.17 on the trees).
const SHORT_WALK_ALONE: u32 = 50;
const ALONE_BELOW_SAMPLES: u32 = 8;
/// Invocations of a GPU that share a pixel's samples where there are enough (measured on an H100 at 64 samples with `ordered`, against
/// 1: 4 are 1.01 times as fast on Cornell, 1.3 on maison; 8 are 1.3 on the bunny, 1.4 on the arcade and the terrain; 16 are no faster).
const SAMPLE_LANES: u32 = 8;
/// Fewer where `entry`, whose lanes take over each other's work, has rays of fewer steps than these, so that finding a pixel's surface and entries counts (there, at 64 samples: 4 have 1.02 to
/// 1.09 times the rate of 8 on a closed room, Cornell, boxes, a city, maison and arcade, of 6 to 15 steps, 0.94 to 1.00 times on ten scenes of more; 2 have 1.12 and 1.16 times on Cornell and the room,
/// of 8 and 9 steps, and at 32 samples 0.92 times the rate of 4 on maison, 0.94 on the arcade, 1.01 on boxes and the city) ...
const FEWER_LANES: [(u32, u32); 2] = [(2, 10), (4, SHORT_WALK)];
/// ... and where that leaves so many invocations, which keep a GPU busy until the end (of 62,000 camera rays and fewer 4 have 0.88 to 0.94 times the rate of 8; of 98,000 1.02, from 153,000 on 1.02 to
/// 1.09; 2 have 0.98 and 1.0 times of 164,000 and 98,000, 1.12 to 1.16 from 391,000 on).
const BUSY_WITH: u64 = 600_000;
/// From this many samples on (with 32 2 have 1.06 and 1.07 times the rate of 4 on Cornell and the room, from 256 on they are the same; of fewer there are so few lanes anyway).
pub const LANES_FROM_SAMPLES: u32 = 32;

fn sums_means(wishes: &Wishes) -> bool {
    !matches!(wishes.accumulator, None | Some(Accumulator::Count))
}

/// Whether one kernel or two follows from the picture. (The states of `lcg` leave a pixel to one invocation, too: measured on an H100 at 64 samples, `single` over `split`, a closed room of 9 steps 1.35, bunny, stadium, trees and
/// terrain 0.68 to 0.76.)
pub fn picture_decides(wishes: &Wishes) -> bool {
    let always_split = wishes.samples.is_none_or(|samples| samples >= SPLIT_ALWAYS_FROM);
    !wishes.fewer_samples(SPLIT_FROM_SAMPLES)
        && (!always_split || sums_means(wishes) || wishes.sampler == Some(Sampler::Lcg))
}

/// Whether a second kernel pays on a GPU follows from how many rays a pixel has, how long they take and how many pixels have any.
pub fn cut_by_rays(wishes: &Wishes, steals: bool) -> (Passes, String) {
    if wishes.fewer_samples(SPLIT_FROM_SAMPLES) {
        return (Passes::Single, "few rays of a pixel are done soonest where the camera ray was".into());
    }
    if sums_means(wishes) {
        return match wishes.preview {
            Some(Preview { camera_rays, .. }) if camera_rays < MEANS_ALONE_FROM => {
                let why = format!(
                    "about {camera_rays} camera rays meet the scene, fewer than {MEANS_ALONE_FROM}: a list of them keeps a GPU busy"
                );
                (Passes::Split, why)
            }
            _ => (
                Passes::Single,
                "running means leave a pixel to one invocation, which goes on where the camera ray was"
                    .into(),
            ),
        };
    }
    let samples = wishes.samples.filter(|_| picture_decides(wishes));
    let (Some(samples), Some(Preview { camera_rays, steps })) = (samples, wishes.preview) else {
        return (Passes::Split, "many rays of a pixel are done soonest by several invocations".into());
    };
    let alone = !steals && samples < ALONE_BELOW_SAMPLES;
    let short = if alone { SHORT_WALK_ALONE } else { SHORT_WALK };
    let for_sample = if steps < NO_WALK || steps < SHORTEST_WALK && samples <= ANY_UP_TO_SAMPLES {
        0
    } else if steps < SHORTEST_WALK {
        CAMERA_RAYS_FOR_SAMPLE_OF_SHORTEST
    } else {
        CAMERA_RAYS_FOR_SAMPLE
    };
    let enough = u64::from(samples) * for_sample;
    if steps >= short {
        let why = format!(
            "rays of about {steps} steps, at least {short}, are done soonest by several invocations for a pixel"
        );
        (Passes::Split, why)
    } else if camera_rays < enough {
        let why = format!(
            "about {camera_rays} camera rays meet the scene, fewer than {enough}: several invocations for each keep a GPU busy"
        );
        (Passes::Split, why)
    } else if enough == 0 {
        let few = if steps < NO_WALK { NO_WALK } else { SHORTEST_WALK };
        let why = format!(
            "{samples} rays of about {steps} steps, fewer than {few}, are done soonest where the camera ray was"
        );
        (Passes::Single, why)
    } else {
        let why = format!(
            "about {camera_rays} camera rays meet the scene, at least {enough}, and keep a GPU busy with rays of about {steps} steps; \
             no kernel waits for the last of them"
        );
        (Passes::Single, why)
    }
}

/// Invocations that share a pixel's samples: the greatest power of two up to the root of their number (with rounds, of the most that may come), so that
/// either has a part in keeping rays together, what starts at one place and what goes one way (measured on an H100: 2 were the fastest at 4 and 8 samples, 4 on four of five
/// scenes at 16 and on three at 32, 8 at 64), but `most`. Sums of floats and states that step need one, and `packet` lost
/// rays on an H100 with more (docs/measurements.md).
pub fn lanes_of(settings: &Settings, samples: u32, most: u32) -> u32 {
    let any_order = settings.passes == Passes::Split
        && settings.accumulator == Accumulator::Count
        && settings.sampler != Sampler::Lcg
        && !matches!(settings.method, Method::Packet | Method::Bundle)
        && !settings.preset.is_original();
    if any_order { most.min(1 << (samples.max(1).ilog2() / 2)) } else { 1 }
}

/// How many invocations share a pixel's samples at most, and why not as many as usual.
pub fn choose_lanes(settings: &Settings, accessor: Accessor, wishes: &Wishes) -> (u32, Option<String>) {
    let usual = (SAMPLE_LANES, None);
    let Some(Preview { camera_rays, steps }) = wishes.preview else { return usual };
    let steals = settings.method == Method::Entry && accessor == Accessor::Address;
    if !steals || settings.passes != Passes::Split || wishes.fewer_samples(LANES_FROM_SAMPLES) {
        return usual;
    }
    let enough = |lanes: u32| camera_rays.saturating_mul(u64::from(lanes)) >= BUSY_WITH;
    let fewer = FEWER_LANES.into_iter().find(|&(lanes, short)| steps < short && enough(lanes));
    let Some((lanes, _)) = fewer else { return usual };
    let [before, with] =
        [SAMPLE_LANES, lanes].map(|most| lanes_of(settings, wishes.samples.unwrap_or(u32::MAX), most));
    if with == before {
        return usual;
    }
    let why = format!(
        "rays of about {steps} steps are done soonest by few invocations for a pixel, \
         and about {camera_rays} camera rays that meet the scene keep a GPU busy all the same"
    );
    (lanes, Some(why))
}
