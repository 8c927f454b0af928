//! The report's statements as experiments: what does not depend on a clock.

mod common;

use std::collections::BTreeMap;
use std::process::Command;

use common::scene_named;
use cousu::bvh::{Builder, stack};
use cousu::lab::claims::EXPERIMENTS;
use cousu::render::geometry::Geometry;
use serde_json::Value;

/// Runs experiments under the validation layer; rows by their claim.
fn claims(only: &str) -> (BTreeMap<String, Value>, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["claims", "--quick", "--validate", "--only", only, "-o"])
        .arg(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("validation:"), "{said}");
    let json: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("claims.json")).unwrap()).unwrap();
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut rows = BTreeMap::new();
    for row in json["rows"].as_array().unwrap() {
        let claim = row["claim"].as_str().unwrap();
        let verdict = row["verdict"].as_str().unwrap();
        assert!(["holds", "does not hold", "not decided"].contains(&verdict), "{row}");
        let measured = row["measured"].as_str().unwrap();
        assert!(measured.len() > 20 && !measured.contains("could not be run"), "{row}");
        assert!(table.contains(claim), "{table}");
        for ratio in row["ratios"].as_array().unwrap() {
            for key in ["over", "under", "scene", "clock"] {
                assert!(ratio[key].is_string(), "{key}: {ratio}");
            }
            let [low, high] = [0, 1].map(|end| ratio["ci95"][end].as_f64().unwrap());
            let middle = ratio["ratio"].as_f64().unwrap();
            assert!(0.0 < low && low <= middle && middle <= high, "{ratio}");
            assert!(ratio["pairs"].as_u64().unwrap() >= 3, "{ratio}");
        }
        rows.insert(claim.to_string(), row.clone());
    }
    assert_eq!(rows.len(), only.split(',').count());
    (rows, folder)
}

/// Mean brightness of the left and the right half of a picture.
fn halves(folder: &tempfile::TempDir, name: &str) -> [f64; 2] {
    let picture = image::open(folder.path().join(name)).unwrap().to_luma8();
    let (width, height) = picture.dimensions();
    let mean = |columns: std::ops::Range<u32>| {
        let sum: f64 = columns
            .clone()
            .flat_map(|x| (0..height).map(move |y| (x, y)))
            .map(|(x, y)| f64::from(picture[(x, y)][0]))
            .sum();
        sum / f64::from(columns.len() as u32 * height)
    };
    [mean(0..width / 2), mean(width / 2..width)]
}

#[test]
fn numbers_and_cameras_are_told_by_the_pixels() {
    let (rows, folder) = claims("same-seeds,ghosts,misaligned");
    let seeds = &rows["same-seeds"];
    assert_eq!(seeds["verdict"], "holds");
    assert!(seeds["slope_same"].as_f64().unwrap().abs() < 1e-6, "{seeds}");
    assert!((seeds["slope_fresh"].as_f64().unwrap() + 0.5).abs() < 0.1, "{seeds}");
    let ghosts = &rows["ghosts"];
    assert_eq!(ghosts["verdict"], "holds");
    assert!(ghosts["empty_pixels_lit"].as_u64().unwrap() > 0, "{ghosts}");
    assert!(ghosts["share_off"].as_f64() > ghosts["share_off_by_noise"].as_f64(), "{ghosts}");
    let misaligned = &rows["misaligned"];
    assert_eq!(misaligned["verdict"], "holds");
    assert!(misaligned["lost"].as_u64().unwrap() + misaligned["others"].as_u64().unwrap() > 0);
    for name in ["ghosts.png", "misaligned.png"] {
        let [left, right] = halves(&folder, name);
        assert!(left > 1.0 && right > 1.0 && left != right, "{name}: {left} {right}");
    }
}

#[test]
fn stacks_overflow_and_atomics_count_the_same() {
    let (rows, _folder) = claims("small-stack,no-sync,round-trips");
    let stack = &rows["small-stack"];
    assert!(stack["overflowed_rays"].as_u64().unwrap() > 0, "{stack}");
    assert!(stack["stack_bound"].as_u64().unwrap() > 16, "{stack}");
    let added = &rows["no-sync"];
    assert_eq!(added["counts_equal"], true, "{added}");
    let counts = added["escaped_rays"].as_array().unwrap();
    assert!(counts[0].as_u64().unwrap() > 1000, "{added}");
    assert_eq!(added["escaped_rays_in_one_place"], counts[0], "{added}");
}

/// Of two children both methods visit the right one first, so one holds exactly one entry less; and that is what the
/// experiment tells.
#[test]
fn a_single_push_saves_one_entry() {
    let (rows, _folder) = claims("single-push,divergence");
    let row = &rows["single-push"];
    let mut told = row["stack_bounds"].as_array().unwrap().iter();
    for name in ["maison", "cornell"] {
        let scene = scene_named(name, None);
        for builder in [Builder::Midpoint, Builder::Sah] {
            let tree = Geometry::build(&scene, true, builder, &|_| {}).unwrap().tree;
            let (one, both) = (stack::single_push_bound(&tree), stack::stack_bound(&tree));
            assert_eq!(one + 1, both, "{name} {builder}");
            assert_eq!(*told.next().unwrap(), serde_json::json!([one, both]), "{row}");
        }
    }
    assert_eq!(row["verdict"], "does not hold");
    let lanes = rows["divergence"]["lanes_any"].as_array().unwrap();
    assert!(lanes.iter().all(|share| (0.05..=1.0).contains(&share.as_f64().unwrap())), "{lanes:?}");
}

#[test]
fn unknown_statements_are_refused_with_the_known_ones() {
    let output =
        Command::new(env!("CARGO_BIN_EXE_cousu")).args(["claims", "--only", "nonsense"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    for experiment in EXPERIMENTS {
        assert!(said.contains(experiment.name), "{said}");
    }
}
