//! Failures of stacks, accumulators and random numbers: what must be true of the matrix on every device.

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;

/// Runs an experiment under the validation layer; rows by their variant.
fn matrix(only: &str) -> (BTreeMap<String, Value>, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["stability", "--quick", "--validate", "--only", only, "-o"])
        .arg(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("validation:"), "{said}");
    let text = std::fs::read(folder.path().join("stability.json")).unwrap();
    let json: Value = serde_json::from_slice(&text).unwrap();
    let rows = json["rows"].as_array().unwrap().iter();
    (rows.map(|row| (row["variant"].as_str().unwrap().to_string(), row.clone())).collect(), folder)
}

fn verdict(row: &Value) -> &str {
    row["verdict"].as_str().unwrap()
}

fn count(row: &Value, what: &str) -> u64 {
    row[what].as_u64().unwrap()
}

fn note(value: &Value) -> &str {
    value["note"].as_str().unwrap()
}

fn case<'a>(row: &'a Value, name: &str) -> &'a Value {
    let mut cases = row["cases"].as_array().unwrap().iter();
    cases.find(|case| case["case"] == name).unwrap_or_else(|| panic!("{name}: {row}"))
}

/// The number before these words.
fn before(text: &str, words: &str) -> f64 {
    let (head, _) = text.split_once(words).unwrap_or_else(|| panic!("{words}: {text}"));
    head.trim().rsplit([' ', ';', ',']).next().unwrap().parse().unwrap()
}

fn red_pixels(folder: &tempfile::TempDir, name: &str) -> usize {
    let picture = image::open(folder.path().join(name)).unwrap().to_rgb8();
    picture.pixels().filter(|pixel| pixel.0 == [255, 0, 0]).count()
}

#[test]
fn only_stacks_that_are_too_short_lose_rays_and_they_say_so() {
    let (rows, folder) = matrix("stack");
    for (variant, row) in &rows {
        match variant.as_str() {
            "stack16" => {
                assert_eq!((verdict(row), count(row, "failures")), ("refuses", 0), "{row}");
                assert!(
                    note(row).contains("needs up to 200 entries") && note(row).contains("threaded"),
                    "{row}"
                );
            }
            "stack16 --allow-overflow" => {
                assert_eq!(verdict(row), "tells", "{row}");
                let chain = case(row, "chain-200");
                assert_eq!(chain["worst"], 12.5, "{chain}");
                let lost = before(note(chain), " rays lose a subtree");
                assert_eq!(lost, before(note(chain), " reported"), "{chain}");
                assert!(count(chain, "failures") > 100 && count(chain, "failures") as f64 <= lost, "{chain}");
            }
            _ => assert_eq!((verdict(row), count(row, "failures")), ("survives", 0), "{row}"),
        }
    }
    for survivor in
        ["brute", "threaded", "single-push", "ordered", "wide", "stack as deep as the tree", "auto"]
    {
        assert!(count(&rows[survivor], "trials") > 1000, "{survivor}");
    }
    assert!(red_pixels(&folder, "stack-chain-200-stack8.png") > 100);
}

#[test]
fn counts_are_exact_floats_hold_and_eight_bits_freeze() {
    let (rows, folder) = matrix("accumulation");
    for exact in ["count", "auto"] {
        let row = &rows[exact];
        assert_eq!((verdict(row), count(row, "failures")), ("survives", 0), "{row}");
        assert!(row["worst"].as_f64().unwrap() < 3.1e-8, "{row}");
        assert!(note(row).contains("bits are the twin's"), "{row}");
    }
    let floats = &rows["rgba32f"];
    assert_eq!((verdict(floats), count(floats, "failures")), ("survives", 0), "{floats}");
    assert!(floats["worst"].as_f64().unwrap() < 1e-4, "{floats}");
    let bytes = &rows["rgba8"];
    assert_eq!(verdict(bytes), "fails", "{bytes}");
    let (_, last) = note(bytes).split_once("no pixel changes after frame ").unwrap();
    assert!(last.split(';').next().unwrap().parse::<u32>().unwrap() <= 510, "{bytes}");
    let frozen = case(bytes, "1024 frames");
    assert!(2 * count(frozen, "failures") > count(frozen, "trials"), "{frozen}");
    assert!(red_pixels(&folder, "accumulation-rgba8.png") > 100);
}

#[test]
fn numbers_are_as_good_as_independent_but_for_those_that_come_again() {
    let (rows, folder) = matrix("random");
    for good in ["pcg", "philox", "sobol", "strata", "auto"] {
        let row = &rows[good];
        assert_eq!((verdict(row), count(row, "failures")), ("survives", 0), "{row}");
        assert!(row["worst"].as_f64().unwrap() < 0.01, "{row}");
    }
    let slope =
        |variant: &str| before(&note(case(&rows[variant], "slope")).replace("samples^", "samples "), ":");
    assert!((slope("pcg") + 0.5).abs() <= 0.05, "{}", rows["pcg"]);
    assert!(slope("auto") < -0.6, "{}", rows["auto"]);
    assert!(slope("fixed-seed").abs() < 1e-6, "{}", rows["fixed-seed"]);
    let frames = case(&rows["fixed-seed"], "successive frames");
    assert_eq!((count(frames, "failures"), frames["worst"].as_f64().map(f64::round)), (6, Some(1.0)));
    // The original's generator fails by nothing but its period.
    let lcg = &rows["lcg"];
    assert_eq!((count(lcg, "failures"), count(case(lcg, "period"), "failures")), (1, 1), "{lcg}");
    assert!(note(case(lcg, "period")).contains("410 frames"), "{lcg}");
    assert!(red_pixels(&folder, "random-fixed-seed.png") > 100);
}
