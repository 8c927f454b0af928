//! The matrix of failures at the limits: cameras, sizes, work beyond a dispatch, another device's bits.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

use cousu::vk::{Adapter, Instance};
use serde_json::Value;

fn command(folder: &Path, only: &str, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["stability", "--quick", "--validate", "--only", only, "-o"])
        .arg(folder)
        .args(more)
        .output()
        .unwrap()
}

/// Rows of an experiment under the validation layer, by variant.
fn rows(folder: &Path, only: &str, more: &[&str]) -> BTreeMap<String, Value> {
    let output = command(folder, only, more);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("validation:"), "{said}");
    let json: Value = serde_json::from_slice(&std::fs::read(folder.join("stability.json")).unwrap()).unwrap();
    let rows = json["rows"].as_array().unwrap().iter();
    rows.map(|row| (row["variant"].as_str().unwrap().to_string(), row.clone())).collect()
}

fn case<'a>(row: &'a Value, name: &str) -> &'a Value {
    let cases = row["cases"].as_array().unwrap();
    let found = cases.iter().find(|case| case["case"].as_str().unwrap().contains(name));
    found.unwrap_or_else(|| panic!("no case {name} in {row}"))
}

fn failures(value: &Value) -> u64 {
    value["failures"].as_u64().unwrap()
}

fn survives(row: &Value, trials: u64) {
    assert_eq!(row["verdict"], "survives", "{row}");
    assert_eq!(failures(row), 0, "{row}");
    assert!(row["trials"].as_u64().unwrap() >= trials, "{row}");
}

#[test]
fn cameras_are_f64_s_and_the_original_s_fail_where_its_formulas_say() {
    let folder = tempfile::tempdir().unwrap();
    let rows = rows(folder.path(), "camera", &[]);
    survives(&rows["auto"], 2000);
    assert_eq!(rows["auto"]["cases"].as_array().unwrap().len(), 7, "{}", rows["auto"]);
    for name in ["original", "original-unbiased"] {
        let row = &rows[name];
        assert_eq!(row["verdict"], "fails");
        for provoked in ["far cuts", "near cuts", "5000 units"] {
            assert!(failures(case(row, provoked)) > 10, "{provoked}: {row}");
        }
    }
    let unbiased = &rows["original-unbiased"];
    for spared in ["plain view", "in the plane of a top", "on a wall"] {
        assert_eq!(failures(case(unbiased, spared)), 0, "{spared}: {unbiased}");
    }
    for name in ["rgba8, no reset", "rgba32f, no reset"] {
        assert_eq!(rows[name]["verdict"], "fails");
        let note = case(&rows[name], "a move")["note"].as_str().unwrap();
        assert!(note.contains("see nothing show a surface"), "{note}");
    }
    survives(&rows["rgba32f, reset"], 300);
    for name in ["camera-moves", "camera-planes", "camera-limit"] {
        let picture = image::open(folder.path().join(format!("{name}.png"))).unwrap().to_rgb8();
        let (left, right): (Vec<_>, Vec<_>) =
            picture.enumerate_pixels().partition(|(x, ..)| *x < picture.width() / 2);
        let red = |half: &[(u32, u32, &image::Rgb<u8>)]| {
            half.iter().filter(|(_, _, pixel)| pixel[0] > 200 && pixel[1] < 50).count()
        };
        assert!(red(&left) > 0 && red(&right) == 0, "{name}");
    }
}

#[test]
fn odd_sizes_are_right_or_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let rows = rows(folder.path(), "size", &[]);
    survives(&rows["auto"], 17);
    for (case, part) in
        [("x1, above the limit", "smaller size"), ("32 camera rays", "2^32"), ("0 triangles", "no triangles")]
    {
        let found = rows["auto"]["cases"].as_array().unwrap().iter();
        let notes: Vec<&str> = found
            .filter(|found| found["case"].as_str().unwrap().contains(case))
            .filter_map(|found| found["note"].as_str())
            .collect();
        // A device with larger images takes fewer rays a pixel to come to 2^32.
        assert!(
            case == "32 camera rays" || notes.iter().any(|note| note.contains(part)),
            "{case}: {notes:?}"
        );
        assert!(notes.iter().all(|note| note.ends_with('.') && note.contains(part)), "{case}: {notes:?}");
    }
    let methods =
        ["brute", "threaded", "single-push", "ordered", "entry", "packet", "postponed", "wide", "bundle"];
    for method in methods {
        survives(&rows[method], 2);
    }
    let floats = &rows["ids as 32-bit floats"];
    assert_eq!(failures(case(floats, "triangles 0 and 1")), 0, "{floats}");
    assert_eq!(failures(case(floats, "triangles 16777216 and")), 1, "{floats}");
    // Of equal hits the original keeps the last.
    assert_eq!(failures(case(&rows["original"], "coincident")), 1);
    assert_eq!(failures(&rows["original"]), 1, "{}", rows["original"]);
}

#[test]
fn no_ray_is_lost_however_much_work_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let rows = rows(folder.path(), "work", &[]);
    for name in ["auto", "single", "split", "staged", "one dispatch, taken up again", "auto, other paces"] {
        survives(&rows[name], 66_000);
    }
    let instance = Instance::new(false).unwrap();
    let adapters = instance.adapters().unwrap();
    let limited = Adapter::choose(&adapters, None).unwrap().limits.loop_iterations.is_some();
    let unguarded = &rows["one dispatch, unguarded"];
    if limited {
        assert_eq!(unguarded["verdict"], "fails");
        for load in ["samples", "triangles"] {
            assert!(failures(case(unguarded, load)) > 0, "{unguarded}");
        }
        let again = case(&rows["one dispatch, taken up again"], "samples");
        assert!(again["note"].as_str().unwrap().contains("taken up again"), "{again}");
    } else {
        survives(unguarded, 66_000);
    }
}

#[test]
fn another_run_s_pictures_are_compared_pixel_by_pixel() {
    let [first, second, third] = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let rows_of_first = rows(first.path(), "bits", &[]);
    survives(&rows_of_first["auto"], 5000);
    for name in ["pcg", "strata", "watertight"] {
        assert_ne!(rows_of_first[name]["verdict"], "not-decided", "{}", rows_of_first[name]);
    }
    // The other device: this one, with one ray more in one pixel.
    let path = first.path().join("stability.json");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    json["device"] = "Changed".into();
    let kept = &mut json["rows"][0]["cases"][0]["picture"];
    let text = kept.as_str().unwrap().to_string();
    let place = text.rfind(|letter: char| letter.is_ascii_uppercase() && letter != 'Z').unwrap();
    let run = text[..place].rfind(|letter: char| !letter.is_ascii_digit()).map_or(0, |other| other + 1);
    let times: usize = text[run..place].parse().unwrap_or(1);
    let next = char::from(text.as_bytes()[place] + 1);
    let before = if times > 1 { format!("{}{}", times - 1, &text[place..=place]) } else { String::new() };
    *kept = format!("{}{before}{next}{}", &text[..run], &text[place + 1..]).into();
    std::fs::write(&path, json.to_string()).unwrap();
    let path = path.to_str().unwrap();
    let rows = rows(second.path(), "bits", &["--with", path]);
    for (name, row) in &rows {
        for case in row["cases"].as_array().unwrap() {
            if case["case"].as_str().unwrap().contains("Changed") {
                let changed = name == "auto" && case["case"].as_str().unwrap().starts_with("cornell");
                assert_eq!(failures(case), u64::from(changed), "{name}: {case}");
                assert_eq!(case["trials"], 64 * 40, "{name}: {case}");
            }
        }
    }
    assert_eq!(rows["auto"]["verdict"], "fails");

    let other_seed = command(third.path(), "bits", &["--seed", "5", "--with", path]);
    let said = String::from_utf8_lossy(&other_seed.stderr).into_owned();
    assert_eq!(other_seed.status.code(), Some(3), "{said}");
    assert!(said.contains("have seed 0"), "{said}");
    // The other device's record is no place for this one's.
    let folder = std::path::Path::new(path).parent().unwrap();
    let over = command(folder, "bits", &["--with", path]);
    assert_eq!(over.status.code(), Some(2), "{}", String::from_utf8_lossy(&over.stderr));
    for (content, why) in [("", "is no stability.json"), ("{}", "is no stability.json")] {
        let file = third.path().join("other.json");
        std::fs::write(&file, content).unwrap();
        let refused = command(second.path(), "bits", &["--with", file.to_str().unwrap()]);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(3), "{said}");
        assert!(said.contains(why), "{said}");
    }
}
