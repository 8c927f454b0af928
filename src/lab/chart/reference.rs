//! Pictures that others are compared with: many samples, of other random numbers than any curve has, with the most
//! robust choices. Made in parts, so that a run that was cut goes on where it was.

use xxhash_rust::xxh3::xxh3_128;

use crate::error::Result;
use crate::layout::Count;
use crate::render::auto;
use crate::render::choices::{Accumulator, Intersector, Offset, Sampler, Slabs, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::Picture;
use crate::render::plan::{Job, Plan};
use crate::render::repeat::Repeated;
use crate::render::rounds::Goal;
use crate::render::stage::Stage;
use crate::render::tally::Progress;
use crate::render::tiles::Tiles;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::vk::{Device, DeviceKind};

/// Names the code that a reference's counts follow from: camera rays, sampler, offset, intersector, slabs. Whoever
/// changes one of them so that counts change raises it, and kept references are made again; a test tells.
pub const VERSION: u32 = 1;

const SAMPLER: Sampler = Sampler::Philox;
const OFFSET: Offset = Offset::Ulp;
const INTERSECTOR: Intersector = Intersector::Watertight;
const SLABS: Slabs = Slabs::Robust;

/// Digits of e. Curves have other seeds: a chart takes two that its own seed is not.
const SEEDS: [u32; 3] = [2_718_281_828, 459_045_235, 3_602_874_713];

/// What a reference follows from. Devices do not matter: all of them give the same counts.
#[derive(Clone, Copy)]
pub struct Recipe<'a> {
    pub scene: &'a Scene,
    pub camera: Camera,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Bound of the ambient rays, units of the file.
    pub max_distance: Option<f64>,
    pub spp: u32,
    pub seed: u32,
}

/// The seeds of a chart's two references.
pub fn seeds(of_curves: u32) -> [u32; 2] {
    let [first, second, third] = SEEDS;
    match of_curves {
        seed if seed == first => [second, third],
        seed if seed == second => [first, third],
        _ => [first, second],
    }
}

/// The choices of a reference's plan, for its tree.
pub fn wishes() -> Wishes {
    Wishes {
        sampler: Some(SAMPLER),
        offset: Some(OFFSET),
        intersector: Some(INTERSECTOR),
        slabs: Some(SLABS),
        accumulator: Some(Accumulator::Count),
        ..Wishes::default()
    }
}

impl Recipe<'_> {
    /// Everything that the counts follow from, in one line.
    pub fn text(&self) -> String {
        let Self { scene, camera, size, max_distance, spp, seed } = self;
        let camera = serde_json::to_string(camera).unwrap_or_default();
        let distance = max_distance.map_or("none".into(), |distance| distance.to_string());
        format!(
            "version {VERSION}, scene {:016x}, camera {camera}, size {}x{}, max distance {distance}, {spp} samples, seed \
             {seed}, sampler {SAMPLER}, offset {OFFSET}, intersector {INTERSECTOR}, slabs {SLABS}",
            scene.hash, size.0, size.1
        )
    }

    /// The same, short: a name for a file.
    pub fn key(&self) -> String {
        format!("{:032x}", xxh3_128(self.text().as_bytes()))
    }
}

/// Rays of each pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    /// Samples that were asked for so far.
    pub samples: u32,
    pub escaped: Vec<u32>,
    pub traced: Vec<u32>,
}

impl Sums {
    fn new(size: (u32, u32)) -> Self {
        let zero = vec![0; size.0 as usize * size.1 as usize];
        Self { samples: 0, escaped: zero.clone(), traced: zero }
    }

    fn add(&mut self, tiles: Tiles, counts: &[Count]) {
        for (place, (escaped, traced)) in self.escaped.iter_mut().zip(&mut self.traced).enumerate() {
            let (x, y) = (place as u32 % tiles.width, place as u32 / tiles.width);
            let count = counts[tiles.number(x, y) as usize];
            *escaped += count.escaped0 + count.escaped1;
            *traced += count.traced0 + count.traced1;
        }
    }

    /// Exact in 32-bit floats up to 2^24 samples if they are a power of two; otherwise [`Self::of`] finds the counts
    /// by rounding, up to 2^22 samples.
    pub fn picture(&self, size: (u32, u32)) -> Picture {
        let share = |counts: &[u32]| {
            counts.iter().map(|&count| (f64::from(count) / f64::from(self.samples.max(1))) as f32).collect()
        };
        Picture { width: size.0, height: size.1, light: share(&self.escaped), coverage: share(&self.traced) }
    }

    /// The counts of a picture of so many samples.
    pub fn of(picture: &Picture, samples: u32) -> Self {
        let counts = |shares: &[f32]| {
            shares.iter().map(|&share| (f64::from(share) * f64::from(samples)).round() as u32).collect()
        };
        Self { samples, escaped: counts(&picture.light), traced: counts(&picture.coverage) }
    }
}

/// Where references are kept from run to run.
pub trait Store {
    /// What is there of a reference, whole or a part.
    fn load(&mut self, recipe: &Recipe<'_>) -> Option<Sums>;
    /// Keeps the samples so far.
    fn save(&mut self, recipe: &Recipe<'_>, sums: &Sums) -> Result<()>;
}

/// After so many seconds of work what was done is kept.
const SAVE_EVERY_S: f64 = 5.0;

/// The reference, taken from the store as far as it is there. `observe` hears of each part.
pub fn make(
    device: &Device,
    recipe: &Recipe<'_>,
    geometry: &Geometry,
    store: &mut dyn Store,
    observe: &mut dyn FnMut(&Progress),
) -> Result<Sums> {
    let mut sums = store.load(recipe).unwrap_or_else(|| Sums::new(recipe.size));
    let part = if device.adapter().kind == DeviceKind::Cpu { 512 } else { 4096 };
    let mut progress = Progress { done: 0.0, rays: 0, gpu_ms: 0.0, rmse: None };
    let mut saved = std::time::Instant::now();
    while sums.samples < recipe.spp {
        let left = recipe.spp - sums.samples;
        let each = part.min(left);
        let plan = plan(device, recipe, geometry, sums.samples..sums.samples + each)?;
        let stage = Stage::new(device, &plan)?;
        let before = sums.clone();
        let mut frames = Repeated::new(&stage)?;
        for frame in 1..=left / each {
            let cost = frames.frame()?;
            progress.rays += cost.totals.primary_finished + cost.totals.ambient_finished;
            progress.gpu_ms += cost.gpu_ms();
            progress.done = f64::from(before.samples + frame * each) / f64::from(recipe.spp);
            observe(&progress);
            let whole = frame == left / each;
            if whole || saved.elapsed().as_secs_f64() >= SAVE_EVERY_S {
                sums = before.clone();
                sums.samples += frame * each;
                sums.add(plan.tiles, &frames.counts()?);
                store.save(recipe, &sums)?;
                saved = std::time::Instant::now();
            }
        }
    }
    Ok(sums)
}

fn plan<'a>(
    device: &Device,
    recipe: &Recipe<'_>,
    geometry: &'a Geometry,
    samples: std::ops::Range<u32>,
) -> Result<Plan<'a>> {
    let decision = auto::decide(&wishes(), geometry, device.adapter());
    let job = Job {
        camera: recipe.camera,
        size: recipe.size,
        samples,
        seed: recipe.seed,
        max_distance: recipe.max_distance,
        jitters: 1,
        adaptive: false,
        goal: Goal::Samples,
        block: None,
    };
    Plan::new(job, recipe.scene, geometry, &decision, &device.adapter().limits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::obj::Report;
    use crate::scene::procedural::{self, Request};

    fn scene() -> Scene {
        let kind = procedural::find("cornell").unwrap();
        let mesh = (kind.generate)(&Request { triangles: None, seed: 0 }).unwrap();
        let (bounds, hash) = (mesh.bounds(), mesh.hash());
        Scene { path: "cornell".into(), mesh, bounds, hash, report: Report::default(), load_ms: 0.0 }
    }

    #[test]
    fn the_key_follows_from_every_part() {
        let one = scene();
        let mut other = scene();
        other.hash ^= 1;
        let recipe = Recipe {
            scene: &one,
            camera: Camera::Orbit { rx: 0.0, ry: 0.0 },
            size: (8, 8),
            max_distance: None,
            spp: 64,
            seed: SEEDS[0],
        };
        let others = [
            Recipe { scene: &other, ..recipe },
            Recipe { camera: Camera::Orbit { rx: 0.0, ry: 1.0 }, ..recipe },
            Recipe { size: (8, 9), ..recipe },
            Recipe { max_distance: Some(1.0), ..recipe },
            Recipe { spp: 65, ..recipe },
            Recipe { seed: SEEDS[1], ..recipe },
        ];
        let mut keys: Vec<String> = others.iter().map(Recipe::key).collect();
        keys.push(recipe.key());
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), others.len() + 1);
        assert_eq!(recipe.key(), Recipe { ..recipe }.key());
    }

    #[test]
    fn seeds_are_those_of_no_curve() {
        for seed in SEEDS.into_iter().chain([0, 1, u32::MAX]) {
            let [a, b] = seeds(seed);
            assert!(a != b && a != seed && b != seed);
        }
    }

    #[test]
    fn counts_come_back_from_a_picture() {
        for samples in [1, 7, 1000, 65_536, (1 << 22) - 1, 1 << 22] {
            let escaped: Vec<u32> = (0..64).map(|i| (u64::from(samples) * i / 63) as u32).collect();
            let traced = (0..64).map(|i| if i % 3 == 0 { 0 } else { samples }).collect();
            let sums = Sums { samples, escaped, traced };
            assert_eq!(Sums::of(&sums.picture((8, 8)), samples), sums);
        }
    }
}
