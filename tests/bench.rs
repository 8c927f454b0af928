//! `cousu bench`: what its files hold. Nothing here depends on how fast the device is.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn bench(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cousu"))
        .arg("bench")
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// The record and the CSV's lines of a run that succeeds, and what it said.
fn record(arguments: &[&str]) -> (Value, Vec<String>, String) {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().to_string_lossy();
    let output = bench(&[arguments, &["--quick", "--validate", "-o", &place]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {said}");
    assert!(!said.contains("validation:"), "{said}");
    let json = std::fs::read(folder.path().join("bench.json")).unwrap();
    let csv = std::fs::read_to_string(folder.path().join("bench.csv")).unwrap();
    let lines = csv.lines().map(str::to_string).collect();
    (serde_json::from_slice(&json).unwrap(), lines, said)
}

fn rows(record: &Value) -> &Vec<Value> {
    record["rows"].as_array().unwrap()
}

fn check_keys(row: &Value) {
    for key in ["scene", "view", "method", "builder", "passes", "api", "preset"] {
        assert!(row[key].is_string(), "{key}: {row}");
    }
    for key in ["triangles", "frames", "max_stack", "overflowed_rays", "bvh_bytes", "rays_per_frame"] {
        assert!(row[key].is_u64(), "{key}: {row}");
    }
    for key in ["gpu_ms_median", "mrays_per_s", "build_ms"] {
        assert!(row[key].as_f64().unwrap() > 0.0, "{key}: {row}");
    }
    let ends: Vec<f64> =
        row["gpu_ms_ci95"].as_array().unwrap().iter().map(|end| end.as_f64().unwrap()).collect();
    let median = row["gpu_ms_median"].as_f64().unwrap();
    assert!(ends.len() == 2 && ends[0] <= median && median <= ends[1], "{row}");
    for key in ["traversal_ms", "mismatched_pixels", "registers", "stack_bytes", "closest", "any", "subset"] {
        let value = row.get(key).unwrap_or_else(|| panic!("{key}: {row}"));
        assert!(value.is_null() || value.is_number() || value.is_object(), "{key}: {row}");
    }
    for key in ["closest", "any"] {
        if let Some(work) = row[key].as_object() {
            for figure in ["visits", "tests", "lanes"] {
                assert!(work[figure].as_f64().unwrap() >= 0.0, "{row}");
            }
        }
    }
    assert_eq!(row["api"], "vulkan");
}

#[test]
fn every_row_counts_the_same_rays_and_tells_all_its_keys() {
    let methods = "brute,stack2,stack64,threaded,ordered";
    let sized = ["--size", "96x60", "--frames", "3"];
    let (record, csv, _) =
        record(&[&["cornell", "--methods", methods, "--passes", "single,split,staged"], &sized[..]].concat());
    for key in ["device", "driver", "size", "manifest"] {
        assert!(!record[key].is_null(), "{key}");
    }
    assert_eq!(record["failed"].as_array().unwrap().len(), 0, "{record}");
    let rows = rows(&record);
    let original = rows.iter().filter(|row| row["preset"] == "original").count();
    assert_eq!(original, 3, "brute, stack64 and threaded are the report's");
    assert_eq!(rows.len(), 5 * 3 + original);
    for row in rows {
        check_keys(row);
        assert_eq!(row["frames"], 3);
        assert!(row["traversal_ms"].as_f64().unwrap() > 0.0, "{row}");
        if row["preset"] == "auto" {
            assert!(row["any"]["tests"].as_f64().unwrap() > 0.0, "{row}");
        }
        let undersized = row["method"] == "stack2";
        assert_eq!(row["overflowed_rays"].as_u64().unwrap() > 0, undersized, "{row}");
        match row["mismatched_pixels"].as_u64() {
            Some(pixels) => assert!(pixels == 0 || undersized, "{row}"),
            None => assert_eq!(row["preset"], "original", "{row}"),
        }
        assert_eq!(row["first_frame_ms"].is_number(), row["passes"] != "single", "{row}");
        assert_eq!(row["bvh_bytes"].as_u64().unwrap() > 0, row["method"] != "brute", "{row}");
    }
    assert_eq!(csv.len(), 1 + rows.len());
    let columns = csv[0].split(',').count();
    assert!(csv.iter().all(|line| line.split(',').count() == columns), "{csv:?}");
}

/// brute takes too long on 4,000 triangles for a first look at a software device; what runs of it is right.
#[test]
fn a_slow_row_runs_on_a_part_of_the_pixels() {
    let (record, ..) = record(&["terrain:4000", "--methods", "brute,threaded", "--size", "128x80"]);
    for row in rows(&record) {
        check_keys(row);
        assert_eq!(row["mismatched_pixels"], 0, "{row}");
        if let Some(share) = row["subset"].as_f64() {
            assert!(share > 0.0 && share < 1.0);
        }
    }
    let rays = |place: usize| rows(&record)[place]["rays_per_frame"].as_f64().unwrap();
    assert!((rays(0) / rays(1) - 1.0).abs() < 0.01, "both tell the whole picture's rays");
    if record["device"].as_str().unwrap().contains("llvmpipe") {
        assert!(rows(&record)[0]["subset"].is_number(), "{record}");
    }
}

#[test]
fn what_fails_does_not_lose_the_rest() {
    let missing = "no-such-scene.obj";
    let common = ["--methods", "brute,threaded", "--passes", "split", "--size", "32x20", "--frames", "1"];
    let (record, _, said) = record(&[&[missing, "terrain:60000"], &common[..]].concat());
    assert!(said.contains("no-such-scene.obj is left out"), "{said}");
    let measured: Vec<&Value> = rows(&record).iter().map(|row| &row["method"]).collect();
    assert!(measured.contains(&&Value::from("threaded")), "{said}");
    let failed = record["failed"].as_array().unwrap();
    assert!(failed[0]["scene"] == missing && failed[0]["method"] == "", "{failed:?}");
    if record["device"].as_str().unwrap().contains("llvmpipe") {
        assert!(
            failed.len() == 2 && failed[1]["method"] == "brute",
            "its loops are too short for that: {failed:?}"
        );
        assert!(said.contains("brute midpoint split is left out"), "{said}");
    }
    for (arguments, code, words) in [
        (&[missing][..], 3, missing),
        (&["cornell:many"], 2, "cornell:32"),
        (&["cornell", "--views", "up"], 2, "orbit"),
        (&["cornell", "--methods", "magic"], 2, "stackN"),
    ] {
        let output = bench(&[arguments, &["--quick"]].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(words) && !said.contains("panicked"), "{said}");
    }
}

fn write_rays(folder: &Path) -> [String; 2] {
    let rays: Vec<[f32; 7]> = (0..300)
        .map(|i| {
            let turn = i as f32 * 0.021;
            let end = if i % 2 == 0 { f32::INFINITY } else { 0.5 };
            [0.1, 1.0, 0.2, turn.cos(), 0.1 - 0.001 * i as f32, turn.sin(), end]
        })
        .collect();
    let text: String = rays
        .iter()
        .map(|ray| {
            let words: Vec<String> = ray.iter().map(f32::to_string).collect();
            words.join(" ") + "\n"
        })
        .collect();
    let bytes: Vec<u8> = rays.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
    let place = |name: &str| folder.join(name).to_string_lossy().into_owned();
    std::fs::write(folder.join("rays.txt"), format!("# own rays\n{text}")).unwrap();
    std::fs::write(folder.join("rays.bin"), bytes).unwrap();
    [place("rays.txt"), place("rays.bin")]
}

#[test]
fn own_rays_are_traced_from_text_and_from_records() {
    let folder = tempfile::tempdir().unwrap();
    for file in write_rays(folder.path()) {
        let common = ["--methods", "brute,stack64,threaded,ordered", "--frames", "2", "--rays", &file];
        let (record, csv, _) = record(&[&["maison", "cornell"], &common[..]].concat());
        assert_eq!(rows(&record).len(), 2 * 4 * 2);
        assert_eq!(csv.len(), 1 + 16);
        for row in rows(&record) {
            check_keys(row);
            assert_eq!(
                (row["rays_per_frame"].as_u64(), row["mismatched_pixels"].as_u64()),
                (Some(300), Some(0))
            );
            assert!(row["query"] == "closest" || row["query"] == "any");
            assert_eq!(row["passes"], "trace");
        }
    }
    let broken = folder.path().join("broken.txt");
    std::fs::write(&broken, "0 0 0 1 0 0\n0 0 0 1 0\n").unwrap();
    let output = bench(&["cornell", "--quick", "--rays", &broken.to_string_lossy()]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("line 2"), "{said}");
}

#[test]
fn camera_rays_of_each_view_and_random_rays_are_lists_too() {
    let common = ["cornell", "--methods", "stack64,threaded,ordered", "--frames", "1", "--size", "100x60"];
    let (primary, ..) = record(&[&common[..], &["--rays", "primary", "--views", "default;20,140"]].concat());
    let views: Vec<&Value> = rows(&primary).iter().map(|row| &row["view"]).collect();
    assert_eq!(views, ["default", "default", "default", "20,140", "20,140", "20,140"]);
    let (random, ..) = record(&[&common[..], &["--rays", "random"]].concat());
    assert_eq!(rows(&random).len(), 3);
    for row in rows(&primary).iter().chain(rows(&random)) {
        check_keys(row);
        assert_eq!(row["mismatched_pixels"], 0, "{row}");
        assert!(row["query"] == "closest");
    }
    assert!(rows(&primary).iter().all(|row| row["rays_per_frame"] == 100 * 60));
}

/// Growth: rows of every study, counts that agree, fits, plots; no time is judged.
#[test]
fn scaling_tells_of_every_study() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().to_string_lossy();
    let output =
        bench(&["--scaling", "--quick", "terrain:20000", "--frames", "1", "--validate", "-o", &place]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && !said.contains("validation:"), "{said}");
    let record: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("bench.json")).unwrap()).unwrap();
    let rows = record["scaling"]["rows"].as_array().unwrap();
    let of = |study: &str| rows.iter().filter(|row| row["study"] == study).collect::<Vec<_>>();
    let mut triangles: Vec<u64> = of("load").iter().map(|row| row["triangles"].as_u64().unwrap()).collect();
    triangles.dedup();
    assert_eq!(triangles, [968, 9800, 20_000], "squares of two triangles, no more than asked for");
    assert_eq!(of("build").len(), 3 * 5, "five builders");
    let frames = of("triangles");
    assert_eq!(frames.len(), 3 * 2, "two methods");
    for pair in frames.chunks(2) {
        assert_eq!(pair[0]["rays"], pair[1]["rays"]);
        assert!(pair.iter().all(|row| row["mismatched_pixels"] == 0), "{pair:?}");
        assert!(pair[0]["device_bytes"].as_u64().unwrap() > 0);
    }
    let samples = of("samples");
    assert!(samples.len() > 8, "{}", samples.len());
    let rays = |row: &Value| row["rays"].as_u64().unwrap();
    let (one, last) = (samples[0], samples[samples.len() - 1]);
    let (camera, spp) = (64 * 40, last["spp"].as_u64().unwrap());
    assert_eq!(rays(last) - camera, (rays(one) - camera) * spp, "each sample traces as many rays");
    assert_eq!(of("size").len(), 3);
    let fits = record["scaling"]["fits"].as_array().unwrap();
    let studies: Vec<&str> = fits.iter().map(|fit| fit["study"].as_str().unwrap()).collect();
    for study in ["triangles", "samples", "size", "build", "load"] {
        assert!(studies.contains(&study), "{study}");
        let plot = std::fs::read_to_string(folder.path().join(format!("scaling-{study}.svg"))).unwrap();
        assert!(plot.starts_with("<svg") && plot.contains("terrain"), "{study}");
    }
    let csv = std::fs::read_to_string(folder.path().join("bench.csv")).unwrap();
    assert_eq!(csv.lines().count(), rows.len() + 1);
}

/// In a single pass each frame traces its camera rays anew, those that hit nothing too.
#[test]
fn scaling_renders_frame_after_frame_in_a_single_pass() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().to_string_lossy();
    let arguments = ["--scaling", "--quick", "terrain:1000", "--methods", "threaded", "--passes", "single"];
    let output = bench(&[&arguments[..], &["--builders", "sah", "--frames", "2", "-o", &place]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let record: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("bench.json")).unwrap()).unwrap();
    assert_eq!(record["scaling"]["left_out"], Value::Array(Vec::new()));
}

#[test]
fn scaling_tells_what_it_cannot_do() {
    let refused = |arguments: &[&str], text: &str| {
        let output = bench(&[&["--scaling", "--quick"], arguments].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(text), "{arguments:?}: {said}");
    };
    refused(&["cornell"], "does not come in every number of triangles");
    refused(&["terrain:10000001"], "more than the 10000000 triangles");
    refused(&["no-such-scene.obj"], "choose one of maison");
    refused(&["terrain:many"], "no number of triangles after the colon");
    refused(&["--rays", "random"], "cannot be used with");
    refused(&["--passes", "single,split"], "single value");
    refused(&["terrain:2000", "--json", "-"], "name a file");
}
