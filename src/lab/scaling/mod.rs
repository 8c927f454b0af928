//! How cost grows: one procedural scene with more and more triangles, more and more samples of a pixel, larger pictures; what
//! its tree and its file take to make and to read, in time and in memory.

pub mod fit;
mod fits;
pub mod memory;
mod render;
mod rows;

use std::time::Instant;

pub use fits::{Fit, curves, fits};
pub use rows::{LeftOut, Row, Study};

use super::bench::drift::Drift;
use super::bench::schedule::Effort;
use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::render::choices::{Method, Passes, Preset, Wishes};
use crate::render::geometry::Geometry;
use crate::scene::Scene;
use crate::scene::procedural::{Request, SceneKind, write_obj};
use crate::vk::{Device, DeviceKind};

/// What is asked for.
pub struct Options {
    pub kind: &'static SceneKind,
    /// Numbers of triangles to ask the scene for, in order.
    pub triangles: Vec<u64>,
    /// Numbers of samples, in order.
    pub samples: Vec<u32>,
    /// Sizes of pictures, in order.
    pub sizes: Vec<(u32, u32)>,
    /// Size and samples where they are not what grows.
    pub size: (u32, u32),
    pub spp: u32,
    /// Size of the pictures whose samples grow.
    pub samples_size: (u32, u32),
    pub methods: Vec<Method>,
    pub builders: Vec<Builder>,
    pub passes: Option<Passes>,
    pub seed: u32,
    pub effort: Effort,
}

/// Of the scene whose samples and pictures grow: as many of the numbers asked for as do not exceed this.
const MIDDLE: u64 = 100_000;
/// Most triangles of a scene; a quick look ends at [`MIDDLE`].
pub const MOST_TRIANGLES: u64 = 10_000_000;
/// Host memory that a triangle takes at the most, bytes, mesh and trees and arrays together (measured: 300 with 2 million).
const HOST_BYTES: u64 = 500;
/// `brute` is measured up to so many triangles: it takes as long for each ray as there are triangles.
const BRUTE_UP_TO: usize = 20_000;
/// Trees are built so often, unless this is enough, ms.
const BUILDS: usize = 3;
const ENOUGH_BUILDING_MS: f64 = 3000.0;

impl Options {
    /// 1, 10, 100 thousand, then 1 and 10 million triangles, and so on; `quick`: up to 100 thousand, small pictures, few
    /// samples. `most`: no more triangles than this.
    pub fn new(kind: &'static SceneKind, most: Option<u64>, quick: bool, device: DeviceKind) -> Self {
        let on_cpu = device == DeviceKind::Cpu;
        let most_triangles = most.unwrap_or(u64::MAX).min(if quick { MIDDLE } else { MOST_TRIANGLES });
        let mut triangles: Vec<u64> = [1_000, 10_000, 100_000, 1_000_000, 10_000_000]
            .into_iter()
            .filter(|n| *n <= most_triangles)
            .collect();
        // A smaller number that was asked for is there, whatever it is.
        triangles.extend(most.filter(|most| *most == most_triangles && !triangles.contains(most)));
        let most_samples = if quick { 64 } else { 4096 };
        let most_pixels = match (quick, on_cpu) {
            (true, _) => 256 * 160,
            (false, true) => 1024 * 640,
            (false, false) => 4096 * 2560,
        };
        let (samples_size, size) = match (quick, on_cpu) {
            (true, _) => ((64, 40), (128, 80)),
            (false, true) => ((64, 40), (256, 160)),
            (false, false) => ((512, 320), (1024, 640)),
        };
        Self {
            kind,
            triangles,
            samples: sample_counts(most_samples),
            sizes: (0..7).map(|k| (64 << k, 40 << k)).filter(|(w, h)| w * h <= most_pixels).collect(),
            size,
            spp: 4,
            samples_size,
            methods: match quick {
                true => vec![Method::Threaded, Method::Wide],
                false if on_cpu => vec![Method::Threaded, Method::Ordered, Method::Wide, Method::Bundle],
                false => {
                    vec![Method::Threaded, Method::Ordered, Method::Entry, Method::Postponed, Method::Wide]
                }
            },
            builders: vec![Builder::Sah, Builder::Midpoint, Builder::Reinsert, Builder::Ploc, Builder::Sbvh],
            passes: None,
            seed: 0,
            effort: if quick { Effort::QUICK } else { Effort::FULL },
        }
    }
}

/// Powers of two, half of the way between two of them, and one more than every second: where dispatches end, there or one
/// further on something would show.
fn sample_counts(most: u32) -> Vec<u32> {
    let around =
        |power: u32| [power, power + u32::from(power.trailing_zeros().is_multiple_of(2)), power + power / 2];
    let powers = (0..).map(|exponent| 1 << exponent).take_while(|power| *power <= most);
    let mut counts: Vec<u32> = powers.flat_map(around).filter(|count| *count <= most).collect();
    counts.sort_unstable();
    counts.dedup();
    counts
}

/// Who hears of rows. An error ends the run.
pub trait Watch {
    /// What is done next.
    fn begin(&mut self, what: &str);
    fn rows(&mut self, rows: Vec<Row>) -> Result<()>;
    fn left_out(&mut self, left_out: LeftOut, error: Error) -> Result<()>;
}

/// A study under way.
struct Scaling<'a> {
    device: &'a Device,
    options: &'a Options,
    drift: Drift<'a>,
}

/// Measures everything. What fails is left out and told; only what `watch` returns is an error.
pub fn run(device: &Device, options: &Options, watch: &mut dyn Watch) -> Result<()> {
    let scaling = Scaling { device, options, drift: Drift::new(device)? };
    let mut subjects = Vec::new();
    for &triangles in &options.triangles {
        let name = format!("{}:{triangles}", options.kind.name);
        match scaling.scene(triangles, &name, watch) {
            Ok(scene) => {
                if let Some(geometry) = scaling.builds(&scene, &name, watch)? {
                    subjects.push(Subject { name, triangles, scene, geometry });
                }
            }
            Err(error) => watch.left_out(LeftOut::new(Study::Triangles, &name, "", &error), error)?,
        }
    }
    let middle = subjects.iter().rposition(|subject| subject.triangles <= MIDDLE).unwrap_or(0);
    if let Some(subject) = subjects.get(middle) {
        scaling.samples(subject, watch)?;
        scaling.sizes(subject, watch)?;
    }
    scaling.methods(&subjects, watch)
}

/// A scene of so many triangles, and the tree that renders read. All are kept, so that their frames can be measured in
/// turn: what else the machine does then falls on all alike.
struct Subject {
    name: String,
    /// That were asked for.
    triangles: u64,
    scene: Scene,
    geometry: Geometry,
}

impl Scaling<'_> {
    /// The scene, by way of a file: written, and read as `render` reads one.
    fn scene(&self, triangles: u64, name: &str, watch: &mut dyn Watch) -> Result<Scene> {
        let needed = triangles.saturating_mul(HOST_BYTES);
        if let Some(available) = memory::available().filter(|available| *available < needed) {
            return Err(Error::other(format!(
                "{name} may take {:.1} GB of the host's memory, of which {:.1} GB are left: end other programs or choose \
                 fewer triangles with {}:N",
                needed as f64 / 1e9,
                available as f64 / 1e9,
                self.options.kind.name
            )));
        }
        watch.begin(&format!("{name}: writing and loading its file"));
        let kind = self.options.kind;
        let mesh = (kind.generate)(&Request { triangles: Some(triangles), seed: self.options.seed })?;
        let fail = |error: std::io::Error| {
            Error::other(format!(
                "{name} could not be written into {} ({error}): make room, or name another folder with TMPDIR",
                std::env::temp_dir().display()
            ))
        };
        let mut file = tempfile::Builder::new().prefix("cousu-").suffix(".obj").tempfile().map_err(fail)?;
        write_obj(&mesh, "", file.as_file_mut()).map_err(fail)?;
        let bytes = file.as_file().metadata().map_err(fail)?.len();
        drop(mesh);
        memory::forget_peak();
        let mut scene = Scene::load(file.path())?;
        scene.path = kind.name.into();
        let row = Row {
            load_ms: Some(scene.load_ms),
            file_bytes: Some(bytes),
            peak_host_bytes: memory::peak(),
            ..Row::new(Study::Load, name, &scene)
        };
        watch.rows(vec![row])?;
        Ok(scene)
    }

    /// Each builder's time; gives the first one's tree, which the renders read.
    fn builds(&self, scene: &Scene, name: &str, watch: &mut dyn Watch) -> Result<Option<Geometry>> {
        let (mut first, mut rows) = (None, Vec::new());
        for &builder in &self.options.builders {
            watch.begin(&format!("{name}: building trees by {builder}"));
            match build(scene, builder) {
                Ok((geometry, build_ms, geometry_ms, peak)) => {
                    let row = Row {
                        builder: Some(builder.name()),
                        build_ms: Some(build_ms),
                        geometry_ms: Some(geometry_ms),
                        sah_cost: Some(geometry.quality().sah_cost),
                        peak_host_bytes: peak,
                        ..Row::new(Study::Build, name, scene)
                    };
                    rows.push(row);
                    first.get_or_insert(geometry);
                }
                Err(error) => {
                    watch.left_out(LeftOut::new(Study::Build, name, builder.name(), &error), error)?;
                }
            }
        }
        watch.rows(rows)?;
        Ok(first)
    }

    fn wishes(&self, method: Option<Method>, builder: Builder) -> Wishes {
        Wishes {
            preset: Some(Preset::Auto),
            method,
            builder: Some(builder),
            passes: self.options.passes,
            ..Wishes::default()
        }
    }
}

/// The least times of a few builds, ms: of the tree alone, and with placing the triangles and leaving out copies; the memory
/// that they took.
fn build(scene: &Scene, builder: Builder) -> Result<(Geometry, f64, f64, Option<u64>)> {
    memory::forget_peak();
    let begin = Instant::now();
    let (mut build_ms, mut geometry_ms) = (f64::INFINITY, f64::INFINITY);
    let mut built = 0;
    loop {
        let start = Instant::now();
        let geometry = Geometry::build(scene, true, builder, &|_| {})?;
        geometry_ms = geometry_ms.min(start.elapsed().as_secs_f64() * 1e3);
        build_ms = build_ms.min(geometry.build_ms);
        built += 1;
        if built == BUILDS || begin.elapsed().as_secs_f64() * 1e3 > ENOUGH_BUILDING_MS {
            return Ok((geometry, build_ms, geometry_ms, memory::peak()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::procedural::find;

    #[test]
    fn samples_lie_around_the_ends_of_dispatches() {
        let counts = sample_counts(64);
        assert_eq!(counts, [1, 2, 3, 4, 5, 6, 8, 12, 16, 17, 24, 32, 48, 64]);
        assert_eq!(sample_counts(1), [1]);
    }

    #[test]
    fn numbers_of_triangles_end_where_asked() {
        let terrain = find("terrain").expect("a scene of this name");
        let numbers = |most, quick| Options::new(terrain, most, quick, DeviceKind::Cpu).triangles;
        assert_eq!(numbers(None, false), [1_000, 10_000, 100_000, 1_000_000, 10_000_000]);
        assert_eq!(numbers(None, true), [1_000, 10_000, 100_000]);
        assert_eq!(numbers(Some(25_000), true), [1_000, 10_000, 25_000]);
        assert_eq!(numbers(Some(3_000_000), true), [1_000, 10_000, 100_000], "quick is quick");
        assert_eq!(numbers(Some(500), false), [500]);
    }
}
