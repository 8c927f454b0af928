//! The same seed on two devices.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use serde::Deserialize;
use xxhash_rust::xxh3::xxh3_64;

use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::lab::scenes::procedural;
use crate::layout::Count;
use crate::reference::render_counts;
use crate::render::choices::{Accumulator, Intersector, Method, Preset, Sampler, Wishes};
use crate::render::picture::{Accumulated, Picture};
use crate::render::seeds::lcg_seeds;
use crate::render::tiles::Tiles;
use crate::render::twin::Twin;
use crate::vk::Device;

pub const EXPERIMENT: Experiment = Experiment {
    name: "bits",
    what: "The same pictures on two devices: pixels that differ.",
    counts: "pixels",
    worst: "pixels apart in a million",
    run,
};

/// Ambient rays of a pixel.
const SAMPLES: u32 = 16;
/// Scenes and their triangles.
const SCENES: [(&str, Option<u64>); 5] = [
    ("cornell", None),
    ("maison", None),
    ("arcade", Some(3000)),
    ("terrain", Some(5000)),
    ("hairball", Some(4000)),
];
/// Scenes of a variant that is not `auto`.
const FEWER: usize = 2;

/// Pictures that another run of this experiment kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Earlier {
    pub device: String,
    pub driver: String,
    quick: bool,
    seed: u32,
    /// By variant and scene, as [`encoded`].
    pictures: BTreeMap<(String, String), String>,
}

/// What is read of a `stability.json`.
#[derive(Deserialize)]
struct Record {
    device: String,
    driver: String,
    quick: bool,
    manifest: Manifest,
    rows: Vec<Line>,
}

#[derive(Deserialize)]
struct Manifest {
    seed: u32,
}

#[derive(Deserialize)]
struct Line {
    experiment: String,
    variant: String,
    cases: Vec<Kept>,
}

#[derive(Deserialize)]
struct Kept {
    case: String,
    picture: Option<String>,
}

impl Earlier {
    /// Reads the `stability.json` of another run.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display();
        let text = std::fs::read_to_string(path).map_err(|error| {
            Error::input(format!("{name} can't be read ({error}): give a stability.json"))
        })?;
        let record: Record = serde_json::from_str(&text)
            .map_err(|error| Error::input(format!("{name} is no stability.json ({error}): give one")))?;
        let mut pictures = BTreeMap::new();
        for Line { variant, cases, .. } in
            record.rows.into_iter().filter(|row| row.experiment == EXPERIMENT.name)
        {
            for Kept { case, picture } in cases {
                if let (Some((scene, _)), Some(picture)) = (case.split_once(AGAINST), picture) {
                    pictures.insert((variant.clone(), scene.into()), picture);
                }
            }
        }
        if pictures.is_empty() {
            return Err(Error::input(format!(
                "{name} holds no pictures: give a stability.json of a run with the experiment bits"
            )));
        }
        let Record { device, driver, quick, manifest, .. } = record;
        Ok(Self { device, driver, quick, seed: manifest.seed, pictures })
    }
}

impl Earlier {
    /// Pictures of another seed or length cannot be compared.
    pub fn check(&self, quick: bool, seed: u32) -> Result<()> {
        if (self.quick, self.seed) == (quick, seed) {
            return Ok(());
        }
        Err(Error::input(format!(
            "The other device's pictures have seed {} and were made with{} --quick: make them alike",
            self.seed,
            if self.quick { "" } else { "out" }
        )))
    }
}

/// Between a scene and the device that it is compared with, in the names of cases.
const AGAINST: &str = " against ";

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let others = others(lab);
    let variants = variants();
    let mut rows = Vec::new();
    let mut figures = Vec::new();
    for (place, &(name, ref wishes)) in variants.iter().enumerate() {
        let all = name == "auto";
        let scenes = if all { SCENES.len() } else { FEWER };
        let scenes = &SCENES[..lab.pick(scenes.min(FEWER), scenes)];
        let mut cases = Vec::new();
        for (number, (scene, triangles)) in scenes.iter().enumerate() {
            let done = (place as f64 + number as f64 / scenes.len() as f64) / variants.len() as f64;
            lab.observe(&format!("{name}, {scene}"), done);
            let mut found = compared(lab, &others, (name, wishes), scene, *triangles)?;
            cases.append(&mut found.cases);
            if figures.is_empty() {
                figures.extend(found.figure);
            }
        }
        let row = Row::of(name, cases);
        rows.push(match wishes.preset {
            Some(_) => row.noting(ORIGINAL),
            None => row,
        });
    }
    Ok(Findings { rows, figures })
}

/// Why the original's pixels differ.
const ORIGINAL: &str =
    "its division, square root, sine and contraction of products and sums are left to the driver";

fn variants() -> Vec<(&'static str, Wishes)> {
    let sampler = |sampler| Wishes { sampler: Some(sampler), ..Wishes::default() };
    vec![
        ("auto", Wishes::default()),
        ("pcg", sampler(Sampler::Pcg)),
        ("strata", sampler(Sampler::Strata)),
        ("watertight", Wishes { intersector: Some(Intersector::Watertight), ..Wishes::default() }),
        (
            "original, counted",
            Wishes {
                preset: Some(Preset::Original),
                accumulator: Some(Accumulator::Count),
                ..Wishes::default()
            },
        ),
    ]
}

/// The other devices of this machine.
fn others(lab: &Lab<'_>) -> Vec<Device> {
    let mine = lab.device.adapter();
    let instance = lab.device.instance();
    let other = |adapter: &crate::vk::Adapter| {
        adapter.unusable.is_none() && (&adapter.name, &adapter.driver) != (&mine.name, &mine.driver)
    };
    let adapters = instance.adapters().unwrap_or_default();
    // One that does not open is no device to compare with.
    adapters.iter().filter(|adapter| other(adapter)).filter_map(|a| Device::open(instance, a).ok()).collect()
}

/// A picture's comparisons.
struct Compared {
    cases: Vec<Case>,
    figure: Option<Figure>,
}

fn size(lab: &Lab<'_>) -> (u32, u32) {
    lab.pick((64, 40), (160, 100))
}

fn compared(
    lab: &Lab<'_>,
    others: &[Device],
    (variant, wishes): (&str, &Wishes),
    name: &str,
    triangles: Option<u64>,
) -> Result<Compared> {
    // The scene's own seed stays: the random numbers are what the lab's seed is for.
    let scene = procedural(name, triangles, 1)?;
    let geometry = lab.geometry(&scene, wishes)?;
    let job = || lab.job(&scene, size(lab), SAMPLES);
    let counts = |lab: &Lab<'_>| -> Result<Vec<Count>> {
        match lab.render(&lab.plan(job(), &scene, &geometry, wishes)?)?.accumulated {
            Accumulated::Counts(counts) => Ok(counts),
            Accumulated::Means(_) => Err(Error::other("Rays were to be counted: report this as a bug.")),
        }
    };
    let mine = counts(lab)?;
    let tiles = job().tiles();
    let kept = encoded(tiles, &mine);
    let case = |against: &str| format!("{name}{AGAINST}{against}");
    let twin = {
        // Any method gives these counts; this one is the fastest here.
        let threaded = Wishes { method: Some(Method::Threaded), ..*wishes };
        let plan = lab.plan(job(), &scene, &geometry, &threaded)?;
        let mut seeds = lcg_seeds(0, plan.tiles.padded_pixels() as u32, lab.seed);
        render_counts(&Twin::new(&plan).inputs(&plan), 0..SAMPLES, Some(&mut seeds)).counts
    };
    let mut cases = vec![Case {
        note: Some(format!("hash of the counts {:016x}", xxh3_64(kept.as_bytes()))),
        picture: Some(kept.clone()),
        ..differing(case("the twin"), &apart(tiles, &mine, &twin))
    }];
    let fails = apart(tiles, &mine, &twin);
    let picture = |counts: &[Count]| Picture::new(tiles, &Accumulated::Counts(counts.to_vec()));
    let figure =
        fails.contains(&true).then(|| Figure::of_failure("bits", &picture(&mine), &picture(&twin), &fails));
    for device in others {
        let adapter = device.adapter();
        let theirs = Lab { device, methods: Vec::new(), with: None, compiled: Rc::default(), ..*lab };
        let name = case(&format!("{} ({})", adapter.name, adapter.driver));
        cases.push(match counts(&theirs) {
            Ok(theirs) => differing(name, &apart(tiles, &mine, &theirs)),
            Err(error) => Case::of_error(name, &error),
        });
    }
    if let Some(earlier) = lab.with {
        let name = case(&format!("{} ({})", earlier.device, earlier.driver));
        cases.push(match earlier.pictures.get(&(variant.to_string(), scene.path.clone())) {
            Some(theirs) => differing(name, &letters_apart(&kept, theirs)),
            None => Case { case: name, note: Some("it has no such picture".into()), ..Case::default() },
        });
    }
    Ok(Compared { cases, figure })
}

fn differing(case: String, apart: &[bool]) -> Case {
    let failures = apart.iter().filter(|apart| **apart).count() as u64;
    let trials = apart.len() as u64;
    Case {
        case,
        trials,
        failures,
        worst: Some(failures as f64 * 1e6 / trials.max(1) as f64),
        ..Case::default()
    }
}

/// Which pixels have other counts, row by row.
fn apart(tiles: Tiles, mine: &[Count], theirs: &[Count]) -> Vec<bool> {
    let number = |pixel: u32| tiles.number(pixel % tiles.width, pixel / tiles.width) as usize;
    (0..tiles.width * tiles.height)
        .map(|pixel| mine.get(number(pixel)) != theirs.get(number(pixel)))
        .collect()
}

/// Letters of a picture: how many rays escaped. Nothing is seen where there is none.
const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";
const NOTHING: u8 = b'.';

/// Escaped rays of each pixel as letters, row by row; a number before a letter says how often it comes.
fn encoded(tiles: Tiles, counts: &[Count]) -> String {
    let letter = |pixel: u32| {
        let count = &counts[tiles.number(pixel % tiles.width, pixel / tiles.width) as usize];
        let escaped = (count.escaped0 + count.escaped1) as usize;
        if count.traced0 + count.traced1 == 0 { NOTHING } else { LETTERS[escaped.min(LETTERS.len() - 1)] }
    };
    let letters: Vec<u8> = (0..tiles.width * tiles.height).map(letter).collect();
    let run = |run: &[u8]| match run.len() {
        1 => char::from(run[0]).to_string(),
        times => format!("{times}{}", char::from(run[0])),
    };
    letters.chunk_by(|a, b| a == b).map(run).collect()
}

/// More than any picture of this experiment has pixels: a text that goes on is another.
const MOST_LETTERS: usize = 1 << 22;

/// The letters of a picture; those of a text that is none are none.
fn decoded(text: &str) -> Vec<u8> {
    let mut letters = Vec::new();
    let mut times = None;
    for byte in text.bytes() {
        match byte {
            b'0'..=b'9' => {
                let more = usize::from(byte - b'0');
                times = Some((times.unwrap_or(0) * 10 + more).min(MOST_LETTERS));
            }
            letter => {
                let room = MOST_LETTERS.saturating_sub(letters.len());
                letters.extend(std::iter::repeat_n(letter, times.take().unwrap_or(1).min(room)));
            }
        }
    }
    letters
}

/// Which pixels of two pictures have other letters; a pixel that one of them lacks has another one.
fn letters_apart(mine: &str, theirs: &str) -> Vec<bool> {
    let (mine, theirs) = (decoded(mine), decoded(theirs));
    (0..mine.len().max(theirs.len())).map(|pixel| mine.get(pixel) != theirs.get(pixel)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILES: Tiles = Tiles { width: 9, height: 2, jitters: 1 };

    fn counts(escaped: impl Fn(u32) -> Option<u32>) -> Vec<Count> {
        let mut counts = vec![Count::default(); TILES.numbers() as usize];
        for pixel in 0..18 {
            if let Some(escaped0) = escaped(pixel) {
                counts[TILES.number(pixel % 9, pixel / 9) as usize] =
                    Count { escaped0, traced0: 16, ..Count::default() };
            }
        }
        counts
    }

    #[test]
    fn pictures_are_told_by_letters_and_read_back() {
        let counts = counts(|pixel| [None, Some(0), Some(pixel), Some(16)][pixel as usize / 5]);
        let text = encoded(TILES, &counts);
        assert_eq!(text, "5.5AKLMNO3Q");
        assert_eq!(decoded(&text), b".....AAAAAKLMNOQQQ");
    }

    #[test]
    fn each_pixel_that_differs_is_counted() {
        let mine = counts(Some);
        let theirs = counts(|pixel| if pixel % 9 == 8 { None } else { Some(pixel) });
        let fails = apart(TILES, &mine, &theirs);
        let places: Vec<usize> = (0..18).filter(|&pixel| fails[pixel]).collect();
        assert_eq!(places, [8, 17]);
        assert_eq!(letters_apart(&encoded(TILES, &mine), &encoded(TILES, &theirs)), fails);
        let case = differing("a".into(), &fails);
        assert_eq!((case.trials, case.failures), (18, 2));
        assert_eq!(letters_apart("3A", "2A"), [false, false, true]);
    }
}
