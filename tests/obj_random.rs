//! The OBJ loader on random input: meshes written in every way come back as
//! they were, and damaged text never makes it panic or return a bad mesh.

use std::fmt::Write;

use cousu::scene::obj::{self, Loaded};
use glam::DVec3;

/// A small generator of random numbers, so that every run is the same.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    fn coordinate(&mut self) -> f64 {
        (self.next() >> 11) as f64 * 1e-13 - 400.0
    }
}

/// Writes one corner in one of the forms there are.
fn write_corner(text: &mut String, random: &mut Random, vertex: usize, known: usize) {
    let index = match random.below(3) {
        0 if vertex < known => vertex as i64 - known as i64,
        _ => vertex as i64 + 1,
    };
    let form = ["", "/7", "//7", "/7/7", "/-1/-1"][random.below(5)];
    let _ = write!(text, " {index}{form}");
}

/// A text of `faces` random polygons, and the triangles that they stand for.
fn random_mesh(random: &mut Random, faces: usize) -> (String, Vec<[DVec3; 3]>) {
    let count = faces / 2 + 8;
    let vertices: Vec<DVec3> =
        (0..count).map(|_| DVec3::from_array([(); 3].map(|()| random.coordinate()))).collect();
    let mut text = String::new();
    let mut triangles = Vec::new();
    let mut known = 0;
    let forward = random.below(2) == 0;
    for face in 0..faces {
        // Either faces and vertices alternate, with uses ahead of the
        // definitions, or all vertices come first.
        let due = if forward { face * count / faces } else { count };
        while known < due {
            let DVec3 { x, y, z } = vertices[known];
            let _ = writeln!(text, "v {x:?} {y:e} {z}");
            known += 1;
        }
        if random.below(50) == 0 {
            let _ = writeln!(text, "{} part{face}", ["o", "g", "usemtl", "s"][random.below(4)]);
        }
        let start = random.below(count);
        let step = 1 + random.below(count / 8);
        let corners = 3 + random.below(4);
        let polygon: Vec<usize> = (0..corners).map(|k| (start + k * step) % count).collect();
        text.push('f');
        for &vertex in &polygon {
            write_corner(&mut text, random, vertex, known);
        }
        text.push_str(["\n", "\r\n", " \n"][random.below(3)]);
        for k in 2..corners {
            triangles.push([0, k - 1, k].map(|corner| vertices[polygon[corner]]));
        }
    }
    for DVec3 { x, y, z } in &vertices[known..] {
        let _ = writeln!(text, "v {x} {y} {z} 0.5 0.5 0.5");
    }
    (text, triangles)
}

fn corners(loaded: &Loaded) -> Vec<[DVec3; 3]> {
    let at = |index: u32| loaded.mesh.positions[index as usize];
    loaded.mesh.triangles.iter().map(|t| t.map(at)).collect()
}

#[test]
fn meshes_come_back_as_they_were() {
    let mut random = Random(1);
    // The larger ones span several of the parts that the reader works in.
    for faces in [1, 2, 10, 100, 1000, 1000, 1000, 1000, 30_000, 80_000, 80_000] {
        let (text, triangles) = random_mesh(&mut random, faces);
        let Ok(loaded) = obj::read(text.as_bytes(), "random.obj") else {
            panic!("{faces} faces were refused");
        };
        assert!(loaded.report.dropped.is_empty(), "{}", loaded.report.dropped);
        assert_eq!(loaded.report.triangles, triangles.len() as u64);
        assert!(corners(&loaded) == triangles, "{faces} faces came back changed");
    }
}

/// Text with something of everything.
const SEED: &str = "# seed\nmtllib a.mtl\no one\nv 0 0 0\nv 1.5 0 0 1\nv +1 1e0 .5\nv 0 1 -0.25\n\
                    vt 0 0\nvn 0 0 1\ng first\nusemtl m\ns 1\nf 1 2 3\nf 1/1 2/1 3/1 4/1\n\
                    f -1 -2 \\\n-3\nl 1 2\nv 2 2 2 0.1 0.2 0.3\nf 1//1 4//1 5//1\nf 6 7 8 5 4\n\
                    v 5 1 2\r\nv -7 6 8\r\n\tv 1 -1 1\r\nf 1/1/1 2/1/1 6/1/1\nf 8 7 6 5 4 3 2 1\n";

fn damage(text: &mut Vec<u8>, random: &mut Random) {
    const LIKELY: &[u8] = b"0123456789-+./\\ \t\r\n#eEvflonai\0\xFF";
    for _ in 0..1 + random.below(8) {
        let at = random.below(text.len().max(1)).min(text.len());
        let byte = match random.below(3) {
            0 => random.next() as u8,
            _ => LIKELY[random.below(LIKELY.len())],
        };
        match random.below(5) {
            0 if at < text.len() => text[at] ^= 1 << random.below(8),
            1 if at < text.len() => text[at] = byte,
            2 if at < text.len() => drop(text.remove(at)),
            3 => {
                let end = (at + random.below(30)).min(text.len());
                let piece = text[at..end].to_vec();
                let to = random.below(text.len() + 1);
                text.splice(to..to, piece);
            }
            _ => text.insert(at, byte),
        }
    }
}

fn assert_sound(loaded: &Loaded) {
    let positions = &loaded.mesh.positions;
    assert!(positions.iter().all(|position| position.is_finite()));
    assert!(!loaded.mesh.triangles.is_empty());
    let mut used = vec![false; positions.len()];
    for triangle in &loaded.mesh.triangles {
        let [a, b, c] = triangle.map(|index| positions[index as usize]);
        assert_ne!((b - a).cross(c - a), DVec3::ZERO);
        let [p, q, r] = [a, b, c].map(|corner| corner.as_vec3());
        assert!(p != q && q != r && r != p);
        triangle.iter().for_each(|&index| used[index as usize] = true);
    }
    assert!(used.iter().all(|&used| used), "a vertex is not used");
    assert_eq!(loaded.report.triangles, loaded.mesh.triangles.len() as u64);
}

#[test]
fn damaged_text_never_panics() {
    let mut random = Random(2);
    let (mut loaded, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut text = SEED.as_bytes().to_vec();
        damage(&mut text, &mut random);
        match obj::read(&text[..], "damaged.obj") {
            Ok(mesh) => {
                assert_sound(&mesh);
                loaded += 1;
            }
            Err(error) => {
                let message = error.to_string();
                assert!(!message.contains("passed the checks"), "{message}: {text:?}");
                refused += 1;
            }
        }
    }
    assert!(loaded > 10_000 && refused > 100, "{loaded} loaded, {refused} refused");
}
