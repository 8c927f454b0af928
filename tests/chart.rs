//! `cousu chart`: references against a closed form, what its files hold, and what is known of curves. Nothing here depends
//! on how fast the device is.

mod common;

use std::path::Path;
use std::process::{Command, Output};

use common::{geometry, scene_named, scene_of, with_device};
use cousu::error::Result;
use cousu::lab::chart::reference::{Recipe, Store, Sums, make};
use cousu::render::choices::Preset;
use cousu::scene::camera::Camera;
use glam::DVec3;
use serde_json::Value;

/// What was kept of a reference, and what is kept of it.
#[derive(Default)]
struct Kept {
    before: Option<Sums>,
    after: Option<Sums>,
}

impl Store for Kept {
    fn load(&mut self, _: &Recipe<'_>) -> Option<Sums> {
        self.before.take()
    }

    fn save(&mut self, _: &Recipe<'_>, sums: &Sums) -> Result<()> {
        self.after = Some(sums.clone());
        Ok(())
    }
}

/// A box 4 wide, 2 deep and 3 high, open at the top.
const ROOM: &str = "v -2 0 -1\nv 2 0 -1\nv 2 0 1\nv -2 0 1\nv -2 3 -1\nv 2 3 -1\nv 2 3 1\nv -2 3 1\n\
                    f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// Light on a floor that sees a rectangle of the sky: the sum over its edges of the angle they subtend times the cosine of
/// their plane's tilt, over 2 pi (Lambert 1760).
fn light(point: DVec3, sky: &[DVec3; 4]) -> f64 {
    let sum: f64 = (0..4)
        .map(|i| {
            let (a, b) = ((sky[i] - point).normalize(), (sky[(i + 1) % 4] - point).normalize());
            a.angle_between(b) * a.cross(b).normalize().y
        })
        .sum();
    sum.abs() / (2.0 * std::f64::consts::PI)
}

#[test]
fn a_reference_is_the_closed_form_within_its_standard_error() {
    with_device(|device| {
        let scene = scene_of(ROOM);
        let geometry = geometry(&scene, Preset::Auto);
        let (width, height, fov, high) = (16u32, 10u32, 20.0f64, 9.0);
        let camera = Camera::Pinhole { eye: [0.0, high, 0.0], target: [0.0; 3], up: [0.0, 0.0, -1.0], fov };
        let spp = 16_384;
        let recipe =
            Recipe { scene: &scene, camera, size: (width, height), max_distance: None, spp, seed: 5 };
        let sums = make(device, &recipe, &geometry, &mut Kept::default(), &mut |_| {}).unwrap();
        assert!(sums.traced.iter().all(|&traced| traced == spp));
        let picture = sums.picture((width, height));
        let sky = [(-2.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-2.0, 1.0)].map(|(x, z)| DVec3::new(x, 3.0, z));
        let unit = 2.0 * (fov.to_radians() * 0.5).tan() / f64::from(height) * high;
        let (mut pixels, mut sum, mut variance) = (0.0, 0.0, 0.0);
        for place in 0..width * height {
            let (x, y) = (f64::from(place % width) + 0.5, f64::from(place / width) + 0.5);
            let floor =
                DVec3::new((x - f64::from(width) * 0.5) * unit, 0.0, (y - f64::from(height) * 0.5) * unit);
            if floor.x.abs() > 1.3 || floor.z.abs() > 0.65 {
                continue; // The camera sees a wall there.
            }
            let exact = light(floor, &sky);
            let error = f64::from(picture.light[place as usize]) - exact;
            let of_pixel = exact * (1.0 - exact) / f64::from(spp);
            // Rays leave the floor some 10^-4 of the scene above it at most.
            assert!(error.abs() < 5.0 * of_pixel.sqrt() + 5e-4, "{floor}: {error}");
            pixels += 1.0;
            sum += error;
            variance += of_pixel;
        }
        assert!(pixels >= 30.0, "{pixels}");
        assert!(
            sum.abs() < 4.0 * variance.sqrt() + 3e-4 * pixels,
            "{} {}",
            sum / pixels,
            variance.sqrt() / pixels
        );
    });
}

#[test]
fn a_reference_that_was_cut_goes_on_to_the_same_counts() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let recipe = |spp: u32| Recipe {
            scene: &scene,
            camera: Camera::Orbit { rx: 0.0, ry: 0.0 },
            size: (24, 17),
            max_distance: Some(1.0),
            spp,
            seed: 3,
        };
        let run = |spp: u32, kept: &mut Kept| {
            let mut parts = Vec::new();
            let sums = make(device, &recipe(spp), &geometry, kept, &mut |progress| parts.push(progress.done));
            assert!(parts.is_sorted() && parts.last().is_none_or(|last| *last == 1.0), "{parts:?}");
            sums.unwrap()
        };
        let mut kept = Kept::default();
        let whole = run(1300, &mut kept);
        assert_eq!(kept.after.as_ref(), Some(&whole), "it is kept in the end");
        for cut in [100, 1024, 1300] {
            let mut kept = Kept { before: Some(run(cut, &mut Kept::default())), after: None };
            assert!(run(1300, &mut kept) == whole, "cut after {cut}");
        }
        let other =
            make(device, &Recipe { seed: 4, ..recipe(1300) }, &geometry, &mut kept, &mut |_| {}).unwrap();
        assert!(other != whole && other.traced == whole.traced);
    });
}

/// The counts that [`cousu::lab::chart::reference::VERSION`] stands for. If this fails, camera rays, sampler, offset or
/// intersector give other counts than before: raise the version, so that references which people keep are made again, and
/// write the new hash here.
#[test]
fn kept_references_are_those_of_this_version() {
    with_device(|device| {
        let scene = scene_named("cornell", None);
        let geometry = geometry(&scene, Preset::Auto);
        let camera = Camera::Orbit { rx: 10.0, ry: 20.0 };
        let recipe = Recipe { scene: &scene, camera, size: (32, 20), max_distance: None, spp: 4096, seed: 1 };
        let sums = make(device, &recipe, &geometry, &mut Kept::default(), &mut |_| {}).unwrap();
        let bytes: Vec<u8> = sums.escaped.iter().chain(&sums.traced).flat_map(|n| n.to_le_bytes()).collect();
        let hash = xxhash_rust::xxh3::xxh3_64(&bytes);
        assert_eq!(
            (cousu::lab::chart::reference::VERSION, format!("{hash:016x}")),
            (1, "d1497f7b69a919ce".into())
        );
    });
}

fn cousu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cousu")).args(arguments).output().expect("the program starts")
}

/// A run of `chart` that succeeds: its record and what it said.
fn chart(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let [place, cache] = ["chart", "cache"].map(|name| folder.join(name).to_string_lossy().into_owned());
    let common = ["chart", "--validate", "-o", &place, "--cache", &cache];
    let output = cousu(&[&common[..], arguments].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {said}");
    assert!(!said.contains("validation:"), "{said}");
    (read(folder), said)
}

fn read(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("chart/chart.json")).unwrap()).unwrap()
}

fn points<'a>(record: &'a Value, label: &str) -> &'a Vec<Value> {
    let curves = record["curves"].as_array().unwrap();
    let curve =
        curves.iter().find(|curve| curve["label"] == label).unwrap_or_else(|| panic!("no curve {label}"));
    curve["points"].as_array().unwrap()
}

fn curve<'a>(record: &'a Value, label: &str) -> &'a Value {
    record["curves"].as_array().unwrap().iter().find(|curve| curve["label"] == label).unwrap()
}

fn last(record: &Value, label: &str, key: &str) -> f64 {
    let last = points(record, label).last().unwrap_or_else(|| panic!("{label} has no point"));
    last[key].as_f64().unwrap_or_else(|| panic!("{label} has no {key}: {last}"))
}

#[test]
fn what_is_known_of_curves_shows() {
    let folder = tempfile::tempdir().unwrap();
    let only = "original-unbiased,auto,lcg,pcg,fixed-seed,wide,threaded,single,sobol,strata";
    let sized = ["--quick", "--size", "48x30", "--spp", "256", "--budget", "60"];
    let (record, _) = chart(folder.path(), &[&["cornell", "--only", only], &sized[..]].concat());
    for label in ["original-unbiased", "lcg", "pcg"] {
        let slope = curve(&record, label)["slope"].as_f64().unwrap();
        assert!((slope + 0.5).abs() < 0.06, "{label}: independent samples' errors fall as N^{slope}");
        let (bias, error) = (last(&record, label, "bias"), last(&record, label, "bias_error"));
        assert!(bias.abs() < 4.5 * error, "{label}: {bias} +- {error}");
        assert!(error < 0.003);
    }
    // Methods and passes make the same picture, bit for bit.
    for label in ["threaded", "single", "wide"] {
        assert_eq!(last(&record, label, "mse"), last(&record, "auto", "mse"), "{label}");
    }
    // Better spread numbers are better.
    for label in ["sobol", "strata"] {
        assert!(last(&record, label, "rmse") < 0.95 * last(&record, "pcg", "rmse"), "{label}");
    }
    // Four numbers again and again: the error stays what it was.
    let fixed = points(&record, "fixed-seed");
    assert!(fixed.len() == 4 && fixed.iter().all(|point| point["mse"] == fixed[0]["mse"]), "{fixed:?}");
    assert!(last(&record, "auto", "rmse") < 0.2 * last(&record, "fixed-seed", "rmse"));
    let times = record["time_to_rmse"].as_array().unwrap();
    let to = |label: &str| {
        times.iter().find(|time| time["label"] == label && time["rmse"] == 0.01).expect("a time for each")
    };
    assert!(to("fixed-seed")["gpu_ms"].is_null());
    let pcg = to("pcg");
    assert!(pcg["gpu_ms"].as_f64().unwrap() > last(&record, "pcg", "gpu_ms") && pcg["extrapolated"] == true);
}

/// The running mean in 8 bits drifts upwards and stalls; so do faults of preset original that no sample mends.
#[test]
fn the_original_stalls() {
    let folder = tempfile::tempdir().unwrap();
    let sized = ["--quick", "--size", "32x20", "--spp", "1024", "--budget", "60", "--only"];
    let only = ["original,8-bit,original-unbiased"];
    let (record, _) = chart(folder.path(), &[&["cornell"], &sized[..], &only].concat());
    assert!(last(&record, "8-bit", "bias") > 5.0 * last(&record, "8-bit", "bias_error"));
    for label in ["8-bit", "original"] {
        let [.., before, after] = &points(&record, label)[..] else { panic!("{label} has no two points") };
        let [before, after] = [before, after].map(|point| point["rmse"].as_f64().unwrap());
        assert!(
            after > 0.85 * before,
            "{label}: four times as many samples should halve {before}, not {after}"
        );
        assert!(after > 2.0 * last(&record, "original-unbiased", "rmse"), "{label}: {after}");
        let times = record["time_to_rmse"].as_array().unwrap();
        assert!(times.iter().filter(|time| time["label"] == label).all(|time| time["gpu_ms"].is_null()));
    }
}

/// Where all is dark, a mean in 8 bits is too bright: a byte that is rounded down stays, one that is rounded up grows.
#[test]
fn eight_bits_drift_upwards_in_the_dark() {
    let folder = tempfile::tempdir().unwrap();
    // A shaft that is open at the top: little light comes down.
    let shaft = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 6 -1\nv 1 6 -1\nv 1 6 1\nv -1 6 1\n\
                 f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let path = folder.path().join("shaft.obj");
    std::fs::write(&path, shaft).unwrap();
    let camera = ["--eye", "0,5.5,0", "--target", "0,0,0", "--up", "0,0,-1", "--fov", "15"];
    let sized = [
        "--quick",
        "--size",
        "16x10",
        "--spp",
        "1024",
        "--budget",
        "60",
        "--only",
        "8-bit,original-unbiased",
    ];
    let (record, _) = chart(folder.path(), &[&[path.to_str().unwrap()], &camera[..], &sized[..]].concat());
    let bias = last(&record, "8-bit", "bias");
    assert!(bias > 10.0 * last(&record, "8-bit", "bias_error") && bias > 0.01, "{bias}");
    let (bias, error) =
        (last(&record, "original-unbiased", "bias"), last(&record, "original-unbiased", "bias_error"));
    assert!(bias.abs() < 4.5 * error, "{bias} +- {error}");
}

const SMALL: [&str; 9] = ["cornell", "--quick", "--size", "32x20", "--spp", "64", "--budget", "30", "--only"];

#[test]
fn every_file_is_there_with_its_keys() {
    let folder = tempfile::tempdir().unwrap();
    let (record, said) =
        chart(folder.path(), &[&SMALL[..], &["original,original-unbiased,auto,wide,ordered,sobol"]].concat());
    for key in ["device", "driver", "size", "seed", "scenes", "notes", "pictures", "manifest"] {
        assert!(!record[key].is_null(), "{key}");
    }
    let scene = &record["scenes"][0];
    assert!(
        scene["pixels"].as_u64().unwrap() > 100 && scene["resolution"].as_f64().unwrap() > 0.0,
        "{scene}"
    );
    assert_eq!(scene["references"].as_array().unwrap().len(), 2);
    assert!(said.contains("8192 samples a pixel"), "a quick look says so: {said}");
    let mut front = 0;
    for curve in record["curves"].as_array().unwrap() {
        assert!(curve["scene"] == "cornell" && curve["label"].is_string() && curve["choices"].is_object());
        let points = curve["points"].as_array().unwrap();
        let spp: Vec<u64> = points.iter().map(|point| point["spp"].as_u64().unwrap()).collect();
        assert_eq!(spp, [4, 16, 64], "{curve}");
        for point in points {
            for key in ["gpu_ms", "rmse", "mse", "mse_error", "bias_error"] {
                assert!(point[key].as_f64().unwrap() > 0.0, "{key}: {point}");
            }
            assert!(
                point["bias"].is_f64() && point["pareto"].is_boolean() && point["runs"].as_u64().unwrap() > 0
            );
            front += u32::from(point["pareto"] == true);
        }
    }
    assert!(front > 0);
    let same = ["sobol", "wide"].map(|label| curve(&record, label));
    for curve in same.into_iter().filter(|curve| curve["same_as"] == "auto") {
        assert_eq!(&curve["points"], &Value::from(points(&record, "auto").clone()));
    }
    assert_eq!(curve(&record, "sobol")["same_as"], "auto");
    for time in record["time_to_rmse"].as_array().unwrap() {
        assert!(time["scene"] == "cornell" && time["label"].is_string());
        assert!([0.01, 0.003, 0.001].contains(&time["rmse"].as_f64().unwrap()));
        assert!(time["gpu_ms"].is_null() || time["gpu_ms"].as_f64().unwrap() > 0.0);
    }
    let file = |name: &str| std::fs::read(folder.path().join("chart").join(name)).unwrap();
    assert!(file("chart-cornell.png").starts_with(b"\x89PNG"));
    let svg = String::from_utf8(file("chart-cornell.svg")).unwrap();
    assert!(svg.contains("cornell: error over GPU time") && svg.trim_end().ends_with("</svg>"));
    assert!(svg.contains("spirv_hash"), "the manifest is in it");
    let csv = String::from_utf8(file("chart.csv")).unwrap();
    let columns: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert!(columns.len() == 1 + 6 * 3 && columns.iter().all(|&count| count == columns[0]), "{csv}");
}

#[test]
fn a_run_that_was_cut_goes_on_and_keeps_what_it_had() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [&SMALL[..], &["auto,threaded,8-bit"]].concat();
    let (first, said) = chart(folder.path(), &arguments);
    assert!(said.contains("reference 1 of 2") && said.contains("reference 2 of 2"), "{said}");
    // As if it had been cut: a point is missing in the middle, a curve's end, and all of a curve.
    let mut cut = first.clone();
    for (place, missing) in [(0, 1..2), (1, 2..3), (2, 0..3)] {
        cut["curves"][place]["points"].as_array_mut().unwrap().drain(missing);
    }
    let kept: Vec<Value> = cut["curves"].as_array().unwrap().clone();
    std::fs::write(folder.path().join("chart/chart.json"), cut.to_string()).unwrap();
    let (second, said) = chart(folder.path(), &arguments);
    assert!(said.contains("4 points are taken over"), "{said}");
    assert!(!said.contains("reference 1"), "references are found again: {said}");
    let mut same_time = 0;
    for before in kept {
        let after = points(&second, before["label"].as_str().unwrap());
        assert_eq!(after.len(), 3);
        for point in before["points"].as_array().unwrap() {
            assert!(
                after.iter().any(|other| other["gpu_ms"] == point["gpu_ms"] && other["mse"] == point["mse"])
            );
        }
        let first = points(&first, before["label"].as_str().unwrap());
        assert!(first.iter().zip(after).all(|(a, b)| a["mse"] == b["mse"]), "the pictures are the same");
        same_time += first.iter().zip(after).filter(|(a, b)| a["gpu_ms"] == b["gpu_ms"]).count();
    }
    assert!(same_time < 9, "what was missing was measured again");
    let (third, said) = chart(folder.path(), &arguments);
    assert!(said.contains("9 points are taken over"), "{said}");
    assert_eq!(third["curves"], second["curves"]);
    // A kept reference that is damaged is made again.
    let references = std::fs::read_dir(folder.path().join("cache")).unwrap();
    let references: Vec<_> = references.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(references.len(), 2);
    std::fs::write(&references[0], "no picture").unwrap();
    let (_, said) = chart(folder.path(), &arguments);
    assert!(said.contains("made again") && said.contains("9 points are taken over"), "{said}");
    // Fewer curves, or another question: nothing of what was there is lost.
    let aside = |number| -> Value {
        let path = folder.path().join(format!("chart/chart-before-{number}.json"));
        serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
    };
    let (_, said) = chart(folder.path(), &[&SMALL[..], &["auto"]].concat());
    assert!(said.contains("chart-before-1.json"), "{said}");
    assert_eq!(aside(1)["curves"], third["curves"]);
    // Another question begins anew and says why.
    let (_, said) = chart(folder.path(), &[&arguments[..], &["--seed", "9"]].concat());
    assert!(said.contains("its seed was 0") && !said.contains("taken over"), "{said}");
    assert_eq!(aside(2)["seed"], 0);
    let (_, said) = chart(folder.path(), &[&arguments[..], &["--seed", "9", "--orbit", "5,5"]].concat());
    assert!(said.contains("its camera was") && !said.contains("taken over"), "{said}");
    std::fs::write(folder.path().join("chart/chart.json"), "{}").unwrap();
    let (_, said) = chart(folder.path(), &arguments);
    assert!(said.contains("no chart's record"), "{said}");
}

#[test]
fn pictures_of_one_s_own_are_references() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let obj = path("cornell.obj");
    assert!(cousu(&["scene", "cornell", "-o", &obj]).status.success());
    for seed in ["1", "2"] {
        let exr = path(&format!("{seed}.exr"));
        let common = [
            "render",
            &obj,
            "--size",
            "32x20",
            "--spp",
            "4096",
            "--seed",
            seed,
            "--sampler",
            "pcg",
            "-o",
            &exr,
        ];
        assert!(cousu(&common).status.success());
    }
    let (one, two) = (path("1.exr"), path("2.exr"));
    let sized = ["--quick", "--size", "32x20", "--only", "pcg", "--seed", "5", "--budget", "30", "--spp"];
    let both = [&[&obj[..]], &sized[..], &["1024", "--reference", &one, "--reference", &two]].concat();
    let (both, said) = chart(folder.path(), &both);
    assert!(!said.contains("reference 1 of 2") && both["scenes"][0]["reference_spp"].is_null(), "{said}");
    let alone = [&[&obj[..]], &sized[..], &["1024", "--reference", &one]].concat();
    let (alone, said) = chart(folder.path(), &alone);
    assert!(said.contains("There is one reference"), "{said}");
    assert!(
        alone["notes"]
            .as_array()
            .unwrap()
            .iter()
            .any(|note| note.as_str().unwrap().contains("one reference"))
    );
    assert!(alone["scenes"][0]["resolution"].is_null());
    // The one's noise, a quarter of the variance of 1024 samples, is in it.
    let ratio = last(&alone, "pcg", "mse") / last(&both, "pcg", "mse");
    assert!((1.1..1.45).contains(&ratio), "{ratio}");
}

#[test]
fn bad_references_and_arguments_are_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let exr = path("small.exr");
    let obj = path("cornell.obj");
    assert!(cousu(&["scene", "cornell", "-o", &obj]).status.success());
    assert!(cousu(&["render", &obj, "--size", "8x8", "--spp", "4", "-o", &exr]).status.success());
    std::fs::write(path("text.exr"), "no picture").unwrap();
    let whole = std::fs::read(&exr).unwrap();
    std::fs::write(path("cut.exr"), &whole[..whole.len() / 2]).unwrap();
    let (text, cut, missing, out) = (path("text.exr"), path("cut.exr"), path("missing.exr"), path("out"));
    let inside = path("out/chart.json");
    let refused: &[(&[&str], i32, &str)] = &[
        (&["cornell", "--reference", &exr], 3, "is 8x8 pixels where the pictures are 64x40"),
        (&["cornell", "--reference", &text], 3, "is not a whole EXR"),
        (&["cornell", "--size", "8x8", "--reference", &cut], 3, "cut.exr"),
        (&["cornell", "--reference", &missing], 3, "there is no such file"),
        (&["cornell", "maison", "--reference", &exr], 2, "one scene"),
        (&["cornell", "--size", "8x8", "--reference", &exr, "--reference", &exr], 2, "the same picture"),
        (&["cornell", "--only", "magic"], 2, "original-unbiased"),
        (&["cornell", "--budget", "0"], 2, "a time in seconds"),
        (&["cornell", "--spp", "3"], 2, "--spp"),
        (&["cornell", "--methods", "magic"], 2, "stackN"),
        (&["cornell", "--eye", "0,50,0", "--target", "0,90,0", "--up", "1,0,0"], 3, "covered fully"),
        (&["no-such.obj"], 3, "no-such.obj"),
        (&[&inside], 2, "written over"),
    ];
    std::fs::create_dir(&out).unwrap();
    std::fs::write(&inside, "v 0 0 0\n").unwrap();
    for (arguments, code, words) in refused {
        if *arguments != [&inside[..]] {
            let _ = std::fs::remove_file(&inside);
        }
        let cache = path("cache");
        let common = ["chart", "--quick", "-o", &out, "--cache", &cache, "--reference-spp", "16"];
        let output = cousu(&[&common[..], arguments].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {said}");
        assert!(said.contains(words) && !said.contains("panicked"), "{arguments:?}: {said}");
        std::fs::write(&inside, "v 0 0 0\n").unwrap();
    }
}
