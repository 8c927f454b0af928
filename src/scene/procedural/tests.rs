use super::*;

/// A mesh of `name` with about `triangles` triangles.
fn generate(name: &str, triangles: Option<u64>, seed: u32) -> Result<Mesh, Error> {
    let kind = find(name).ok_or_else(|| Error::usage(name.to_owned()))?;
    (kind.generate)(&Request { triangles, seed })
}

/// The mesh, which a test takes for granted.
fn mesh(name: &str, triangles: Option<u64>, seed: u32) -> Mesh {
    generate(name, triangles, seed).unwrap_or_else(|error| panic!("{name}: {error:?}"))
}

/// The mesh's OBJ text.
fn text(mesh: &Mesh) -> String {
    let mut out = Vec::new();
    write_obj(mesh, "first\nsecond", &mut out).unwrap();
    String::from_utf8(out).unwrap()
}

/// Checks that indices are in range and that every triangle has an area, also in single precision.
fn assert_sound(name: &str, mesh: &Mesh) {
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|index| mesh.positions[index as usize]);
        assert!(a.is_finite() && b.is_finite() && c.is_finite());
        let area = (b - a).cross(c - a).length();
        assert!(area > 0.0, "{name}: {a} {b} {c}");
        let [a, b, c] = [a, b, c].map(|p| p.as_vec3());
        assert!(a != b && b != c && c != a, "{name}: {a} {b} {c}");
    }
}

#[test]
fn names_are_distinct_and_unknown_ones_are_not_found() {
    for (i, kind) in KINDS.iter().enumerate() {
        assert_eq!(KINDS.iter().position(|other| other.name == kind.name), Some(i));
    }
    assert!(find("nothing").is_none());
}

#[test]
fn counts_are_within_five_percent_and_meshes_are_sound() {
    let wanted: [(&str, &[u64]); 5] = [
        ("maison", &[1_000, 1_234, 2_500, 3_800, 5_000, 6_400, 8_000, 15_000, 40_000, 120_000]),
        ("arcade", &[2_000, 2_700, 3_500, 5_000, 9_000, 20_000, 70_000]),
        ("terrain", &[20_000]),
        ("hairball", &[100, 150, 333, 1_000, 7_777, 50_000]),
        ("stadium", &[2_000, 3_000, 10_000, 60_000]),
    ];
    for (name, counts) in wanted {
        for &count in counts {
            let mesh = mesh(name, Some(count), 1);
            let error = mesh.triangles.len() as f64 / count as f64 - 1.0;
            assert!(error.abs() < 0.05, "{name} {count}: {}", mesh.triangles.len());
            assert_sound(name, &mesh);
        }
    }
}

#[test]
fn maison_has_its_own_number_of_triangles() {
    let mesh = mesh("maison", None, 0);
    assert_eq!(mesh.triangles.len(), 5_456);
    assert_sound("maison", &mesh);
}

#[test]
fn terrain_is_the_largest_grid_that_fits() {
    for (wanted, side) in [(2, 1), (7, 1), (8, 2), (199, 9), (5_000, 50)] {
        let mesh = mesh("terrain", Some(wanted), 3);
        assert_eq!(mesh.triangles.len(), 2 * side * side);
    }
}

#[test]
fn cornell_has_sixteen_faces_and_takes_no_count() {
    let mesh = mesh("cornell", None, 0);
    assert_eq!((cornell::faces().len(), mesh.triangles.len()), (16, 32));
    assert_sound("cornell", &mesh);
    assert!(matches!(generate("cornell", Some(32), 0), Err(Error::Usage(_))));
}

#[test]
fn cornell_asset_is_what_is_written() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/cornell.obj");
    let asset = std::fs::read_to_string(path).unwrap();
    let mut out = Vec::new();
    cornell::write_quads(&mut out).unwrap();
    assert_eq!(asset, String::from_utf8(out).unwrap());
    assert_eq!(asset.lines().filter(|line| line.starts_with("f ")).count(), 16);
}

#[test]
fn counts_out_of_range_are_usage_errors() {
    let cases = [
        ("maison", [999, 2_000_001]),
        ("arcade", [1_999, 5_000_001]),
        ("terrain", [1, 20_000_001]),
        ("hairball", [99, 5_000_001]),
        ("stadium", [1_999, 5_000_001]),
    ];
    for (name, counts) in cases {
        for count in counts {
            assert!(matches!(generate(name, Some(count), 0), Err(Error::Usage(_))));
        }
    }
}

#[test]
fn the_seed_decides() {
    for (name, seeded) in
        [("maison", false), ("stadium", false), ("arcade", true), ("terrain", true), ("hairball", true)]
    {
        let [first, again, other] = [5, 5, 6].map(|seed| text(&mesh(name, Some(4_000), seed)));
        assert!(first == again, "{name}");
        assert_eq!(first != other, seeded, "{name}");
    }
}

#[test]
fn obj_text_reads_back_as_the_same_mesh() {
    let mesh = mesh("hairball", Some(100), 9);
    let text = text(&mesh);
    assert!(text.starts_with("# first\n# second\nv "));
    let numbers =
        |line: &str| -> Vec<f64> { line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect() };
    let lines = |tag: &'static str| text.lines().filter(move |line| line.starts_with(tag));
    for (line, p) in lines("v ").zip(&mesh.positions) {
        assert_eq!(numbers(line), p.to_array());
    }
    for (line, triangle) in lines("f ").zip(&mesh.triangles) {
        assert_eq!(numbers(line), triangle.map(|index| f64::from(index + 1)));
    }
    assert_eq!(lines("f ").count(), mesh.triangles.len());
}
