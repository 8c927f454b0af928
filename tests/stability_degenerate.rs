//! Triangles that nobody wants: `cousu stability --only degenerate`, and a heap of one triangle from the file to the picture.

use std::collections::BTreeMap;
use std::process::Command;

use cousu::report::exr_read;
use serde_json::Value;

fn stability(only: &str) -> (BTreeMap<String, Value>, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["stability", "--quick", "--validate", "--only", only, "-o"])
        .arg(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("validation:"), "{said}");
    let text = std::fs::read(folder.path().join("stability.json")).unwrap();
    let json: Value = serde_json::from_slice(&text).unwrap();
    let rows = json["rows"].as_array().unwrap();
    (rows.iter().map(|row| (row["variant"].as_str().unwrap().to_string(), row.clone())).collect(), folder)
}

fn number(value: &Value, key: &str) -> u64 {
    value[key].as_u64().unwrap()
}

#[test]
fn degenerate_triangles_give_right_hits_and_no_nan() {
    let (rows, folder) = stability("degenerate");
    let all = "auto moller watertight brute stack threaded single-push ordered packet postponed wide";
    for name in all.split(' ') {
        let row = &rows[name];
        assert!(row["verdict"] == "survives" && number(row, "trials") >= 1200, "{row}");
    }
    let auto = rows["auto"]["cases"].as_array().unwrap();
    let case = |name: &str| auto.iter().find(|case| case["case"].as_str().unwrap().contains(name)).unwrap();
    for name in
        ["zero area", "needles", "duplicated", "coplanar", "overlapping", "tiny", "one triangle", "picture"]
    {
        assert!(number(case(name), "trials") > 0, "{}", case(name));
    }
    let heap = case("100000 identical triangles");
    assert!(number(heap, "trials") > 0, "{heap}");
    assert_eq!(heap["note"], "99999 copies left out on load");
    assert_eq!(number(case("kept"), "trials"), 20_000);
    assert!(number(case("a terrain x 1e-4, hit"), "trials") >= 1000);
    let original = &rows["original"];
    assert!(original["verdict"] == "fails" && number(original, "failures") > 100, "{original}");
    let picture = image::open(folder.path().join("degenerate-nans.png")).unwrap().to_rgb8();
    let (width, height) = picture.dimensions();
    let red = |columns: std::ops::Range<u32>| {
        columns
            .flat_map(|x| (0..height).map(move |y| (x, y)))
            .filter(|&(x, y)| picture[(x, y)].0 == [255, 0, 0])
            .count()
    };
    assert!(red(0..width / 2) > 500 && red(width / 2..width) == 0);
}

/// More copies than lavapipe's loops have iterations: the picture is that of one, and `inspect` counts them.
#[test]
fn a_heap_of_one_triangle_is_that_triangle() {
    let folder = tempfile::tempdir().unwrap();
    let corners = "v -1 0 -1\nv 1 0.1 -1\nv 0 0.2 1\n";
    let render = |copies: usize| {
        let path = folder.path().join(format!("{copies}.obj"));
        std::fs::write(&path, format!("{corners}{}", "f 1 2 3\n".repeat(copies))).unwrap();
        let said = Command::new(env!("CARGO_BIN_EXE_cousu")).arg("inspect").arg(&path).output().unwrap();
        let picture = folder.path().join(format!("{copies}.exr"));
        let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
            .args(["render", "--size", "32x20", "--spp", "8", "--validate", "-o"])
            .args([&picture, &path])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = exr_read::read(&picture, (32, 20)).unwrap().picture;
        (picture, String::from_utf8(said.stdout).unwrap())
    };
    let ((one, alone), (heap, said)) = (render(1), render(100_000));
    assert!(one.light.iter().any(|light| *light > 0.5) && one.light.iter().all(|light| light.is_finite()));
    assert!(one == heap);
    assert!(!alone.contains("copies"), "{alone}");
    assert!(said.contains("copies      99999 triangles with the corners of another"), "{said}");
}
