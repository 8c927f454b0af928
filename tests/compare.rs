//! The same GLSL on OpenGL and on Vulkan.

use std::process::Command;

const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");

fn compare(scene: &str, more: &[&str]) -> (serde_json::Value, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["compare", &format!("{ASSETS}/{scene}.obj"), "--quick", "--validate", "-o"])
        .arg(folder.path())
        .args(more)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("validation:"), "{said}");
    assert!(!said.contains("left out"), "{said}");
    let json = std::fs::read(folder.path().join("compare.json")).unwrap();
    (serde_json::from_slice(&json).unwrap(), folder)
}

/// After 16 frames from the same seeds at most 20 pixels in a million differ by more than a byte's step.
#[test]
fn sixteen_frames_are_the_same_on_both() {
    for (scene, methods) in
        [("cornell", "fragment,brute,stack64,stack16,threaded"), ("maison", "stack64,stack16,threaded")]
    {
        let (record, _folder) =
            compare(scene, &["--methods", methods, "--size", "320x200", "--frames", "16"]);
        let rows = record["rows"].as_array().unwrap();
        assert_eq!(rows.len(), methods.split(',').count());
        for row in rows {
            assert_eq!(row["frames"], 16, "{row}");
            let apart = row["pixels_different"].as_f64().unwrap();
            assert!(apart / (320.0 * 200.0) <= 20e-6, "{scene}: {row}");
            for key in ["gl_ms_median", "vk_ms_median", "ratio"] {
                assert!(row[key].as_f64().unwrap() > 0.0, "{key}: {row}");
            }
            for key in ["gl_ms_ci95", "vk_ms_ci95", "ratio_ci95"] {
                let ends: Vec<f64> =
                    row[key].as_array().unwrap().iter().map(|end| end.as_f64().unwrap()).collect();
                assert!(ends[0] <= ends[1], "{key}: {row}");
            }
            assert!(row["gl_timer"] == "wall" || row["gl_timer"] == "device");
        }
        let auto = &record["auto"];
        let number = |key: &str| auto[key].as_f64().unwrap_or_else(|| panic!("{key}: {auto}"));
        let fastest = rows
            .iter()
            .filter(|row| row["method"] != "fragment")
            .map(|row| row["gl_ms_median"].as_f64().unwrap());
        let of_sample = fastest.fold(f64::INFINITY, f64::min) / 4.0;
        assert!((number("original_ms_per_sample") / of_sample - 1.0).abs() < 1e-9, "{auto}");
        let ratio = of_sample / number("ms_per_sample");
        assert!((number("times_as_fast") / ratio - 1.0).abs() < 1e-9 && number("samples") == 64.0, "{auto}");
        // A camera ray a pixel, and no more ambient rays than would be if all hit.
        let rays = number("mrays_per_s") * 1e3 * number("ms_per_sample") * 64.0 / (320.0 * 200.0);
        assert!((1.0 + 64.0 * 0.1..65.0).contains(&rays), "{rays} rays a pixel");
    }
}

/// A scene that does not fit the uniform buffer of the first form is refused with the limit.
#[test]
fn the_first_form_refuses_what_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["compare", &format!("{ASSETS}/maison.obj"), "--quick", "--methods", "fragment", "-o"])
        .arg(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("holds 1024 triangles"), "{said}");
}

/// A method that OpenGL 4.3 cannot run is left out with the reason; the others are compared.
#[test]
fn methods_that_vote_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["compare", &format!("{ASSETS}/cornell.obj"), "--quick", "--frames", "3"])
        .args(["--methods", "packet,postponed,single-push", "-o"])
        .arg(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    for method in ["packet", "postponed"] {
        assert!(
            said.contains(&format!("{method} is left out: {method} needs subgroup operations")),
            "{said}"
        );
    }
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("compare.json")).unwrap()).unwrap();
    assert_eq!(record["rows"].as_array().unwrap().len(), 1);
}

#[test]
fn compare_writes_its_table_and_its_pictures() {
    let (record, folder) = compare("cornell", &["--methods", "threaded", "--frames", "3"]);
    assert_eq!(record["rows"][0]["frames"], 3);
    let csv = std::fs::read_to_string(folder.path().join("compare.csv")).unwrap();
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[0].len(), lines[1].len());
    assert_eq!(lines[1][0], "threaded");
    for (name, width) in [("gl", 160), ("vk", 160), ("both", 320), ("difference", 160)] {
        let picture = image::open(folder.path().join(format!("threaded-{name}.png"))).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (width, 100), "{name}");
        let brightest = picture.pixels().map(|pixel| pixel[0]).max().unwrap();
        assert!(name == "difference" || brightest > 100, "{name} is dark");
    }
}
