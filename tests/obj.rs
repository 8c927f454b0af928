//! The OBJ loader: every form it reads, every fault it leaves out.

use std::fs;
use std::io;

use cousu::scene::obj::{self, LINES_KEPT, Loaded, Tally};
use glam::{DVec3, dvec3};

/// A unit square in the plane z = 0.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn read(text: impl AsRef<[u8]>) -> Loaded {
    match obj::read(text.as_ref(), "test.obj") {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error}"),
    }
}

fn read_on_square(faces: &str) -> Loaded {
    read(format!("{SQUARE}{faces}"))
}

fn tally(count: u64, lines: &[u64]) -> Tally {
    let lines = lines.to_vec();
    Tally { count, lines }
}

/// The corners of every triangle as positions.
fn corners(loaded: &Loaded) -> Vec<[DVec3; 3]> {
    let at = |index: u32| loaded.mesh.positions[index as usize];
    loaded.mesh.triangles.iter().map(|t| t.map(at)).collect()
}

#[test]
fn every_form_of_a_corner_gives_the_same_triangle() {
    let extra = "vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n";
    for face in [
        "f 1 2 3",
        "f 1/1 2/2 3/3",
        "f 1//1 2//1 3//1",
        "f 1/1/1 2/2/1 3/3/1",
        "f 1/ 2// 3",
        "f -4 -3 -2",
        "f -4/-3/-1 -3/-2/-1 -2/-1/-1",
        "f -4//-1 2 +3/1",
        "fo 1 2 3",
        "f 1 2 3 # a comment",
    ] {
        let loaded = read_on_square(&format!("{extra}{face}"));
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2]], "{face}");
        assert!(loaded.report.dropped.is_empty(), "{face}");
    }
}

#[test]
fn polygons_become_fans() {
    let loaded = read("v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\nf 5 4 3 2\n");
    let expected = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2], [4, 2, 1]];
    assert_eq!(loaded.mesh.triangles, expected);
    assert_eq!(loaded.report.polygons, 2);
    assert_eq!(loaded.report.faces, 2);
    assert_eq!(loaded.report.triangles, 5);
}

#[test]
fn only_the_flat_part_of_a_fan_is_dropped() {
    let loaded = read("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\n");
    assert_eq!(corners(&loaded), {
        let [a, c, d, e] = [[0, 0], [2, 0], [2, 2], [0, 2]].map(|[x, y]| dvec3(x.into(), y.into(), 0.0));
        [[a, c, d], [a, d, e]]
    });
    assert_eq!(loaded.report.dropped.zero_area, tally(1, &[6]));
    assert_eq!(loaded.report.polygons, 1);
}

#[test]
fn vertices_keep_the_order_of_the_file_and_unused_ones_are_left_out() {
    let loaded = read("v 9 9 9\nv 0 0 1\nv 1 0 1\nv 8 8 8\nv 1 1 1\nf 5 3 2\n");
    let used = [dvec3(0.0, 0.0, 1.0), dvec3(1.0, 0.0, 1.0), dvec3(1.0, 1.0, 1.0)];
    assert_eq!(loaded.mesh.positions, used);
    assert_eq!(loaded.mesh.triangles, [[2, 1, 0]]);
    assert_eq!(loaded.report.vertices, 5);
}

#[test]
fn groups_and_objects_do_not_reorder() {
    let faces = "o a\nf 3 4 1\ng b c\ns 1\nusemtl red\nf 1 2 3\no a\nusemtl blue\nf 2 3 4\n";
    let loaded = read_on_square(faces);
    assert_eq!(loaded.mesh.triangles, [[2, 3, 0], [0, 1, 2], [1, 2, 3]]);
    assert_eq!(loaded.report.groups, 3);
}

#[test]
fn positive_indices_may_name_later_vertices() {
    let text = "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\nf 1 2 4\nv 0 0 1\nf 1 2 5\n";
    let loaded = read(text);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [2, 1, 0], [0, 1, 3]]);
    assert_eq!(loaded.report.dropped.index_out_of_range, tally(1, &[8]));
}

#[test]
fn line_forms() {
    let text = "\u{FEFF}# comment \\\r\n\r\n  \t v\t0 0.0 0e0  \r\n v 1 0 0\nv +1.0 1.5E+0 -.5 \n\
                \x0Bv 0 1. 0\t# comment\nf 1 \\\r\n 2\\\n3 \\  \n\t4\nf 1 2 3";
    let loaded = read(text);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert_eq!(loaded.mesh.positions[2], dvec3(1.0, 1.5, -0.5));
    assert_eq!(loaded.report.lines, 11);
    assert_eq!(loaded.report.bytes, text.len() as u64);
    assert_eq!(loaded.report.unknown_lines, Tally::default());
}

#[test]
fn a_comment_is_not_joined_to_the_next_line() {
    let loaded = read(format!("# from C:\\models\\\n{SQUARE}f 1 2 3 # half \\\nf 1 3 4\n"));
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(loaded.report.dropped.is_empty());
}

#[test]
fn carriage_returns_alone_end_lines_too() {
    let loaded = read(format!("# old\n{SQUARE}f 1 2 3\nf 2 3\n").replace('\n', "\r"));
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(loaded.report.dropped.too_few_corners, tally(1, &[7]));
}

#[test]
fn joined_lines_are_known_by_the_first_and_may_end_with_the_file() {
    let loaded = read_on_square("f 1 2 3\nf 1 \\\n\\\n2\nf 9 \\\n9 9\nf 1 2 4 \\");
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 1, 3]]);
    assert_eq!(loaded.report.dropped.too_few_corners, tally(1, &[6]));
    assert_eq!(loaded.report.dropped.index_out_of_range, tally(1, &[9]));
    assert_eq!(loaded.report.lines, 11);
}

#[test]
fn colours_and_weights_are_ignored() {
    let loaded = read("v 0 0 0 1\nv 2 0 0 2.0\nv 0 2 0 0.1 0.2 0.3\nv 0 0 2 0\nf 1 2 3 4\n");
    assert_eq!(loaded.mesh.positions[1], dvec3(2.0, 0.0, 0.0));
    assert_eq!(loaded.mesh.positions[3], dvec3(0.0, 0.0, 2.0));
    assert_eq!(loaded.report.weighted_vertices, 2);
}

#[test]
fn what_has_no_triangles_is_left_out() {
    let faces = "vt 1\nvn x\nvp 0\nl 1 2 3\np 1\nbevel on\nnonsense\nf 1 2 3\n# f 1 2 4\n";
    let loaded = read_on_square(faces);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(loaded.report.other_elements, tally(2, &[8, 9]));
    assert_eq!(loaded.report.unknown_lines, tally(1, &[11]));
}

#[test]
fn positions_are_read_in_double_precision() {
    let loaded = read("v 0.1 1e-3 123456789.123456789\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(loaded.mesh.positions[0], dvec3(0.1, 1e-3, 123_456_789.123_456_79));
}

#[test]
fn bad_indices_are_told_apart() {
    let loaded = read_on_square(
        "f 1 2 3\nf 0 1 2\nf 1 2 5\nf -5 1 2\nf 99999999999999999999 1 2\nf 1 2\nf\n\
         f 1/2/x 2 3\nf 1 2 3.5\nf 1/1/1/1 2 3\nf /1 2 3\nf 4294967296 1 2\nf 0 1 99\n",
    );
    let dropped = &loaded.report.dropped;
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(dropped.index_zero, tally(2, &[6, 17]));
    assert_eq!(dropped.index_out_of_range, tally(4, &[7, 8, 9, 16]));
    assert_eq!(dropped.too_few_corners, tally(2, &[10, 11]));
    assert_eq!(dropped.malformed, tally(4, &[12, 13, 14, 15]));
    assert_eq!(loaded.report.faces, 13);
}

#[test]
fn malformed_vertices_keep_their_place() {
    let loaded = read(
        "v 0 0\nv 0 0 0\nv a b c\nv 1 0 0\nv\nv 0 1 0\nv 1 1 1 red\nv 1,0 0 0\n\
         f 2 4 6\nf 1 2 4\nf 2 3 4 6\nf 5 6 2\nf 2 4 7\nf 8 2 4\n",
    );
    let triangle = [DVec3::ZERO, dvec3(1.0, 0.0, 0.0), dvec3(0.0, 1.0, 0.0)];
    assert_eq!(corners(&loaded), [triangle]);
    assert_eq!(loaded.report.malformed_vertices, tally(5, &[1, 3, 5, 7, 8]));
    assert_eq!(loaded.report.dropped.malformed_vertex, tally(5, &[10, 11, 12, 13, 14]));
    assert_eq!(loaded.report.vertices, 8);
}

#[test]
fn vertices_that_are_not_finite() {
    let words = ["nan", "-NaN", "inf", "-Infinity", "1e400", "-1e39", "-nan(ind)", "1.#INF"];
    for (axis, word) in words.iter().enumerate() {
        let mut place = ["0"; 3];
        place[axis % 3] = word;
        let text = format!("v {}\nf 1 2 3\nf 1 2 5\nf 5 5 5 0\n", place.join(" "));
        let loaded = read_on_square(&text);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2]], "{word}");
        assert_eq!(loaded.report.non_finite_vertices, tally(1, &[5]), "{word}");
        assert_eq!(loaded.report.dropped.non_finite_vertex, tally(1, &[7]), "{word}");
        assert_eq!(loaded.report.dropped.index_zero, tally(1, &[8]), "{word}");
    }
}

#[test]
fn triangles_without_area() {
    let loaded = read(
        "v 0 0 0\nv 1 1 1\nv 3 3 3\nv 1 1 1.00000001\nv 1 0 0\nv -0.0 0 0\nv 1e-200 0 0\n\
         f 1 2 5\nf 1 2 3\nf 1 2 1\nf 1 2 4\nf 1 6 5\nf 1 7 2\nf 5 5 5 5\n",
    );
    // What f64 tells apart stays: only where the scene will lie decides what f32 can.
    assert_eq!(loaded.mesh.triangles.len(), 3);
    assert_eq!(loaded.report.dropped.zero_area, tally(5, &[9, 10, 12, 14]));
}

#[test]
fn only_the_first_lines_are_kept() {
    let text = "f 9 9 9\n".repeat(20) + "f 0 0 0\nf 1 2 3\nf -9 1 2\n";
    let loaded = read_on_square(&text);
    let lines: Vec<u64> = (5..).take(LINES_KEPT).collect();
    assert_eq!(loaded.report.dropped.index_out_of_range, tally(21, &lines));
    let words = loaded.report.dropped.to_string();
    assert_eq!(
        words,
        "1 face with index 0 (line 25), 21 faces with an index out of range \
         (lines 5, 6, 7, 8, 9, 10, 11, 12, ...)"
    );
    assert_eq!(read_on_square("f 1 2 3").report.dropped.to_string(), "nothing");
}

#[test]
fn missing_material_libraries_are_named_once() -> io::Result<()> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("scene.obj");
    let libraries = "mtllib here.mtl gone.mtl\nmtllib with blank.mtl\nmtllib  lost one.mtl \r\n\
                     mtllib gone.mtl # no more\nmtllib\n";
    fs::write(folder.path().join("here.mtl"), "")?;
    fs::write(folder.path().join("with blank.mtl"), "")?;
    fs::write(&path, format!("{libraries}{SQUARE}f 1 2 3\n"))?;
    let Ok(loaded) = obj::load(&path) else {
        panic!("missing libraries must not matter");
    };
    let named = ["here.mtl", "gone.mtl", "with blank.mtl", "lost one.mtl"];
    assert_eq!(loaded.report.material_libraries, named);
    assert_eq!(loaded.report.missing_materials, ["gone.mtl", "lost one.mtl"]);
    assert_eq!(loaded.report.dropped.to_string(), "nothing");
    Ok(())
}

#[test]
fn comments_in_any_encoding_are_text() {
    let umlauts = b"# Stra\xDFe, Geb\xE4ude, B\xE4ume\n";
    let text = [umlauts, SQUARE.as_bytes(), b"f 1 2 3\n"].concat();
    assert_eq!(read(text).mesh.triangles.len(), 1);
    let text = format!("# {}\n{SQUARE}f 1 2 3\n", "\u{5EFA}\u{7269}".repeat(500));
    assert_eq!(read(text).mesh.triangles.len(), 1);
}
