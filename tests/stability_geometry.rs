//! Scenes of every size at every place and triangles that nobody wants: `cousu stability --only offset,degenerate`, what
//! `cousu inspect` says of files whose digits are gone, and a heap of one triangle from the file to the picture.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::Command;

use cousu::report::exr_read;
use cousu::scene::Mesh;
use cousu::scene::procedural::{Request, find, write_obj};
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

/// `auto` loses no ray wherever the scene lies, and each other way fails where it must.
#[test]
fn rays_leave_their_surface_at_any_scale_and_place() {
    let (rows, folder) = stability("offset");
    for survivor in ["auto", "ulp"] {
        let row = &rows[survivor];
        assert!(row["verdict"] == "survives" && number(row, "trials") > 10_000, "{row}");
        assert!(row["cases"].as_array().unwrap().iter().all(|case| number(case, "trials") > 100), "{row}");
    }
    let failures = |variant: &str, case: &str| {
        let cases = rows[variant]["cases"].as_array().unwrap();
        let case = cases.iter().find(|known| known["case"] == case).unwrap();
        (number(case, "failures"), case["note"].as_str().unwrap_or("").to_string(), number(case, "trials"))
    };
    // A length of the file is nothing in a large scene and more than all of a small one.
    let (self_hits, note, _) = failures("fixed", "plane x 1e6 + 0e0");
    assert!(self_hits > 10 && note.contains(" 0 leaks"), "{note}");
    let (leaks, _, trials) = failures("fixed", "box x 1e-6 + 0e0");
    assert_eq!(leaks, trials, "every ray starts outside");
    assert_eq!(failures("fixed", "plane x 1e0 + 0e0").0, 0);
    // Unconditioned, digits of the place are taken from those of the shape.
    assert!(failures("scaled, unconditioned", "plane x 1e0 + 1e4").0 > 10);
    let (leaks, _, trials) = failures("ulp, unconditioned", "box x 1e-3 + 1e6");
    assert_eq!(leaks, trials, "ulps of the place are wider than the box");
    let told = &rows["auto, file of 32-bit floats"];
    assert!(told["verdict"] == "tells" && number(told, "failures") > 0, "{told}");
    for name in ["offset-fixed-self-hits", "offset-fixed-leaks", "offset-unconditioned"] {
        let picture = image::open(folder.path().join(format!("{name}.png"))).unwrap().to_rgb8();
        let red = picture.pixels().filter(|pixel| pixel.0 == [255, 0, 0]).count();
        assert!(red > 100, "{name}: {red} red pixels");
    }
}

fn inspect(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.obj");
    std::fs::write(&path, text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cousu")).arg("inspect").arg(path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn cornell(shift: f64) -> Mesh {
    let mut mesh = (find("cornell").unwrap().generate)(&Request { triangles: None, seed: 0 }).unwrap();
    mesh.positions.iter_mut().for_each(|position| *position += shift);
    mesh
}

/// As text, from the file to the warning: nothing while the digits are there, and which are gone when they are not.
#[test]
fn inspect_tells_which_digits_are_gone() {
    for shift in [0.0, 2e2, 2e6] {
        let mesh = cornell(shift);
        let mut whole = Vec::new();
        write_obj(&mesh, "", &mut whole).unwrap();
        let said = inspect(&String::from_utf8(whole).unwrap());
        assert!(!said.contains("digits "), "{said}");
        let mut floats = String::new();
        for p in &mesh.positions {
            let p = p.as_vec3();
            writeln!(floats, "v {} {} {}", p.x, p.y, p.z).unwrap();
        }
        for [a, b, c] in &mesh.triangles {
            writeln!(floats, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
        }
        let said = inspect(&floats);
        let lines: Vec<&str> = said.lines().filter(|line| line.starts_with("digits ")).collect();
        if shift < 1e6 {
            assert!(lines.is_empty(), "{said}");
        } else {
            assert_eq!(lines.len(), 3, "{said}");
            assert!(lines[0].contains("x is written in steps of 1.25e-1 (32-bit floats)"), "{said}");
        }
    }
}

#[test]
fn degenerate_triangles_give_right_hits_and_no_nan() {
    let (rows, folder) = stability("degenerate");
    let all =
        "auto moller watertight brute stack threaded single-push ordered entry packet postponed wide bundle";
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
