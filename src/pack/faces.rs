//! Faces for `brute`: a triangle, or two that make a flat convex quadrilateral, which four edges enclose instead of six.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::layout::{Corners, Face};

/// How far a fourth corner may lie off the plane of the other three, and how straight a corner must not be, in parts of the
/// smaller triangle: 2^-21, a sixteenth of what shaders/traverse/edges.glsl leaves open around an edge.
const FLAT: f64 = 1.0 / 2_097_152.0;

/// Seen from a start, an outer edge's function is a sum of those of the other triangle's edges at the corner where they meet,
/// -a of its outer one and b of the shared one. The exact test grants each of the two an error, the quadrilateral's
/// outer edge must grant what the sum of these is, which shaders/traverse/edges.glsl leaves room for. Of a parallelogram a = -1 and b = 1.
const LEANS: f64 = 2.25;

/// A triangle's edges, as shaders/traverse/edges.glsl numbers them: the corners that they join, and the third one.
const EDGES: [[usize; 3]; 3] = [[0, 2, 1], [0, 1, 2], [1, 2, 0]];

/// Most triangles that are joined to faces: beyond it a batch of eight rays could come near the 65,535 iterations that Mesa's software device
/// grants an invocation.
pub const MOST_TRIANGLES: usize = 4096;

/// How many faces there are and how many of them have four edges, then the faces, those with four edges first, with their boxes grown by
/// `pad`.
pub fn faces(corners: &[Corners], pad: f32) -> Vec<Face> {
    let mut waiting: HashMap<[[u32; 3]; 2], Vec<(usize, usize)>> = HashMap::new();
    let mut partner = vec![None; corners.len()];
    let mut quads = Vec::new();
    for (index, triangle) in corners.iter().enumerate() {
        for (edge, [from, to, _]) in EDGES.into_iter().enumerate() {
            let mut key = [bits(triangle, from), bits(triangle, to)];
            key.sort_unstable();
            let others = waiting.entry(key).or_default();
            let fits = |&(other, of_other): &(usize, usize)| {
                partner[other].is_none() && flat_and_convex([&corners[other], triangle], [of_other, edge])
            };
            if partner[index].is_none()
                && let Some(place) = others.iter().position(fits)
            {
                let (other, of_other) = others.swap_remove(place);
                partner[index] = Some(other);
                partner[other] = Some(index);
                quads.push(quad(corners, [other, index], [of_other, edge], pad));
            }
            others.push((index, edge));
        }
    }
    let alone = (0..corners.len()).filter(|&index| partner[index].is_none());
    let alone = alone.map(|index| {
        let [min, max] = grown_box(&corners[index..=index], pad);
        Face { first: index as u32, second: index as u32, min, max, ..Face::default() }
    });
    let count = (corners.len() - quads.len()) as u32;
    let header = Face { first: count, second: quads.len() as u32, ..Face::default() };
    std::iter::once(header).chain(quads.iter().copied()).chain(alone).collect()
}

/// Edges of all faces, from their header.
pub fn edges_of(faces: &[Face]) -> u32 {
    faces.first().map_or(0, |header| 3 * header.first + header.second)
}

fn quad(corners: &[Corners], pair: [usize; 2], shared: [usize; 2], pad: f32) -> Face {
    let [first, second] = pair.map(|index| points(&corners[index]));
    let [min, max] = grown_box(&pair.map(|index| corners[index]), pad);
    Face {
        first: pair[0] as u32,
        second: pair[1] as u32,
        seams: (shared[0] | shared[1] << 2) as u32,
        turned: u32::from(normal(first).dot(normal(second)) < 0.0),
        min,
        max,
        ..Face::default()
    }
}

fn grown_box(triangles: &[Corners], pad: f32) -> [[f32; 3]; 2] {
    let corners = || triangles.iter().flat_map(|triangle| [triangle.a, triangle.b, triangle.c]).map(Vec3::from);
    let (min, max) = (corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(Vec3::NEG_INFINITY, Vec3::max));
    [(min - pad).into(), (max + pad).into()]
}

/// Whether two triangles that share these edges are together flat and convex, and lie on either side of the shared edge.
fn flat_and_convex(pair: [&Corners; 2], shared: [usize; 2]) -> bool {
    let [first, second] = pair.map(points);
    let [from, to, apex] = EDGES[shared[0]].map(|corner| first[corner]);
    let other = second[EDGES[shared[1]][2]];
    let areas = [normal(first).length(), normal(second).length()];
    let smallest = areas[0].min(areas[1]);
    let reach = [to - from, apex - from, other - from].map(DVec3::length).into_iter().fold(0.0, f64::max);
    // Six times the volume of the four corners: the distance of the fourth from the plane times twice the area.
    let off_plane = (other - from).dot(normal([from, to, apex])).abs();
    let up = normal([from, to, apex]) / areas[0];
    let mut leans = [[from, to], [to, from]].into_iter().flat_map(|[at, end]| {
        let [end, apex, other] = [end - at, apex - at, other - at];
        let area = |v: DVec3, w: DVec3| v.cross(w).dot(up);
        // other = a apex + b end, and the other way round.
        let lean = |apex: DVec3, other: DVec3| {
            [area(other, end), area(apex, other)].map(|part| part / area(apex, end))
        };
        [lean(apex, other), lean(other, apex)]
    });
    let fits = leans.all(|[a, b]| a < 0.0 && b > FLAT && b - a <= LEANS);
    smallest > 0.0 && off_plane * reach <= FLAT * smallest * areas[0] && fits
}

fn bits(triangle: &Corners, corner: usize) -> [u32; 3] {
    // -0 is 0.
    [triangle.a, triangle.b, triangle.c][corner].map(|x| (x + 0.0).to_bits())
}

fn points(triangle: &Corners) -> [DVec3; 3] {
    [triangle.a, triangle.b, triangle.c].map(|corner| Vec3::from(corner).as_dvec3())
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> Corners {
        Corners { a, b, c, ..Corners::default() }
    }

    const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    fn halves([a, b, c, d]: [[f32; 3]; 4]) -> [Corners; 2] {
        [triangle(a, b, c), triangle(a, c, d)]
    }

    #[test]
    fn a_square_s_halves_are_one_face_however_they_are_wound() {
        let [first, second] = halves(SQUARE);
        let turned = triangle(second.b, second.a, second.c);
        for (other, turns) in [(second, 0), (turned, 1)] {
            let faces = faces(&[first, other], 0.0);
            assert_eq!((faces.len(), faces[0].first, faces[0].second), (2, 1, 1));
            assert_eq!((faces[1].first, faces[1].second, faces[1].turned), (0, 1, turns));
            // They share the diagonal.
            let edges = [faces[1].seams & 3, faces[1].seams >> 2].map(|edge| EDGES[edge as usize]);
            let ends = |triangle: &Corners, [from, to, _]: [usize; 3]| {
                let mut ends = [bits(triangle, from), bits(triangle, to)];
                ends.sort_unstable();
                ends
            };
            assert_eq!(ends(&first, edges[0]), ends(&other, edges[1]));
        }
    }

    #[test]
    fn what_is_bent_hollow_folded_or_apart_stays_triangles() {
        let mut bent = SQUARE;
        bent[3][2] = 1e-4;
        let mut hollow = SQUARE;
        hollow[3] = [0.9, 0.1, 0.0];
        let mut straight = SQUARE;
        straight[3] = [0.5, 0.5, 0.0];
        let mut folded = halves(SQUARE);
        folded[1].c = [0.9, 0.2, 0.0];
        // Convex, but the far corners lean over each other's edges.
        let leaning = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.1, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let apart = [halves(SQUARE)[0], triangle([5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0])];
        for pair in [halves(bent), halves(hollow), halves(straight), halves(leaning), folded, apart] {
            let faces = faces(&pair, 0.0);
            assert_eq!((faces.len(), faces[0].first, faces[0].second), (3, 2, 0), "{pair:?}");
        }
    }

    #[test]
    fn a_long_rectangle_and_a_slanted_parallelogram_are_one_face() {
        let long = [[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0], [1000.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let slanted = [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [5.0, 1.5, 1.25], [4.0, 1.0, 1.0]];
        for corners in [long, slanted] {
            assert_eq!(faces(&halves(corners), 0.0).len(), 2, "{corners:?}");
        }
    }

    #[test]
    fn each_triangle_stands_in_one_face() {
        // A strip of eight triangles, flat: each has two neighbours to choose from.
        let at = |i: u32| [(i / 2) as f32, (i % 2) as f32, 0.0];
        let strip: Vec<_> = (0..8).map(|i| triangle(at(i), at(i + 1), at(i + 2))).collect();
        let faces = faces(&strip, 0.0);
        let mut seen = vec![0; 8];
        for face in &faces[1..] {
            seen[face.first as usize] += 1;
            if face.second != face.first {
                seen[face.second as usize] += 1;
            }
        }
        assert_eq!(seen, [1; 8]);
        assert_eq!(faces.len() as u32, faces[0].first + 1);
        assert!(faces[0].second >= 3);
    }
}
