//! Faces for `brute`: a triangle, or two that make a flat convex quadrilateral, which four edges enclose instead of six.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::layout::{Corners, FACE_TURNED, Face, Triangle};

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

/// 2^-17: the sizes of start, edges and direction times this are what an edge function may err and must leave open, see
/// shaders/traverse/edges.glsl.
const EDGE_ERROR: f64 = 1.0 / 131_072.0;

/// Which triangles make a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Places of the triangles; the same twice for one alone.
    pub places: [usize; 2],
    /// The edge of each that it shares with the other, by its number in [`EDGES`].
    shared: [usize; 2],
    /// Whether they are wound unlike.
    turned: bool,
}

impl Pair {
    fn is_alone(&self) -> bool {
        self.places[0] == self.places[1]
    }
}

/// The faces, those with four edges first.
pub fn pairs(corners: &[Corners]) -> Vec<Pair> {
    let mut waiting: HashMap<[[u32; 3]; 2], Vec<(usize, usize)>> = HashMap::new();
    let mut partner = vec![None; corners.len()];
    let mut pairs = Vec::new();
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
                let [first, second] = [other, index].map(|place| normal(points(&corners[place])));
                pairs.push(Pair {
                    places: [other, index],
                    shared: [of_other, edge],
                    turned: first.dot(second) < 0.0,
                });
            }
            others.push((index, edge));
        }
    }
    let alone = (0..corners.len()).filter(|&index| partner[index].is_none());
    pairs.extend(alone.map(|index| Pair { places: [index; 2], shared: [0; 2], turned: false }));
    pairs
}

/// Edges of all faces.
pub fn edges_of(pairs: &[Pair]) -> u32 {
    pairs.iter().map(|pair| if pair.is_alone() { 3 } else { 4 }).sum()
}

/// The faces as the shaders read them, after their header. Boxes are grown by `pad`; `size` is the most that the largest component of a
/// start's difference from a corner may be, L + R in the terms of [`crate::pack::grown_pad`].
pub fn faces(pairs: &[Pair], triangles: &[Triangle], pad: f32, size: f64) -> Vec<Face> {
    let fours = pairs.iter().filter(|pair| !pair.is_alone()).count();
    let header = Face { first: pairs.len() as u32, second: fours as u32, ..Face::default() };
    std::iter::once(header).chain(pairs.iter().map(|pair| face(pair, triangles, pad, size))).collect()
}

/// What of a start p the function of an edge is linear in: the direction's factor is moment + p x along.
#[derive(Clone, Copy, Default)]
struct EdgeFunction {
    along: DVec3,
    moment: DVec3,
}

/// Those of the edges ac, ab and bc, as [`EDGES`] numbers them, above 0 within if the triangle's plane is above 0 at the start.
fn edge_functions(triangle: &Triangle) -> [EdgeFunction; 3] {
    let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(|v| Vec3::from(v).as_dvec3());
    let u = EdgeFunction { along: -ac, moment: a.cross(ac) };
    let v = EdgeFunction { along: ab, moment: ab.cross(a) };
    let w = EdgeFunction { along: -u.along - v.along, moment: ac.cross(ab) - u.moment - v.moment };
    [u, v, w]
}

fn face(pair: &Pair, triangles: &[Triangle], pad: f32, size: f64) -> Face {
    let both = pair.places.map(|place| &triangles[place]);
    let sums = both.map(|triangle| [triangle.ab_sum, triangle.ac_sum].map(f64::from));
    let product = |[ab, ac]: [f64; 2]| ab * ac;
    let error = sums.map(|[ab, ac]| size * (ab + ac) + ab * ac).into_iter().fold(1e-30, f64::max);
    // The second triangle's as if it were wound like the first.
    let turns = [1.0, if pair.turned { -1.0 } else { 1.0 }];
    let planes = [0, 1].map(|i| {
        let [a, ab, ac] = [both[i].a, both[i].ab, both[i].ac].map(|v| Vec3::from(v).as_dvec3());
        let normal = ab.cross(ac) * turns[i] / (EDGE_ERROR * size * product(sums[i])).max(1e-60);
        (normal, -a.dot(normal))
    });
    let [first, second] = both.map(edge_functions);
    let scaled = |function: EdgeFunction, turn: f64| {
        let scale = turn / (EDGE_ERROR * error);
        EdgeFunction { along: function.along * scale, moment: function.moment * scale }
    };
    let functions = if pair.is_alone() {
        let [u, v, w] = first.map(|function| scaled(function, 1.0));
        [u, v, w, EdgeFunction::default()]
    } else {
        let outer = |functions: [EdgeFunction; 3], shared: usize, turn: f64| {
            [0, 1, 2]
                .into_iter()
                .filter(move |&edge| edge != shared)
                .map(move |edge| scaled(functions[edge], turn))
        };
        let mut all = outer(first, pair.shared[0], turns[0]).chain(outer(second, pair.shared[1], turns[1]));
        std::array::from_fn(|_| all.next().unwrap_or_default())
    };
    let [min, max] = grown_box(both, pad);
    let [a, b, c, d] = functions.map(|function| {
        let [along, moment] = [function.along, function.moment].map(|v| v.as_vec3().to_array());
        (along, moment)
    });
    let [plane0, plane1] = planes.map(|(normal, offset)| (normal.as_vec3().to_array(), offset as f32));
    Face {
        min,
        first: pair.places[0] as u32,
        max,
        second: pair.places[1] as u32 | if pair.turned { FACE_TURNED } else { 0 },
        normal0: plane0.0,
        offset0: plane0.1,
        normal1: plane1.0,
        offset1: plane1.1,
        along_a: a.0,
        moment_ax: a.1[0],
        along_b: b.0,
        moment_ay: a.1[1],
        along_c: c.0,
        moment_az: a.1[2],
        along_d: d.0,
        moment_bx: b.1[0],
        moment_by: b.1[1],
        moment_bz: b.1[2],
        moment_cx: c.1[0],
        moment_cy: c.1[1],
        moment_cz: c.1[2],
        moment_dx: d.1[0],
        moment_dy: d.1[1],
        moment_dz: d.1[2],
    }
}

fn grown_box(triangles: [&Triangle; 2], pad: f32) -> [[f32; 3]; 2] {
    let corners = || {
        triangles.into_iter().flat_map(|triangle| {
            let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::from);
            [a, a + ab, a + ac]
        })
    };
    let (min, max) =
        (corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(Vec3::NEG_INFINITY, Vec3::max));
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
        for (other, turns) in [(second, false), (turned, true)] {
            let pairs = pairs(&[first, other]);
            assert_eq!((pairs.len(), pairs[0].places, pairs[0].turned), (1, [0, 1], turns));
            // They share the diagonal.
            let edges = pairs[0].shared.map(|edge| EDGES[edge]);
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
        for both in [halves(bent), halves(hollow), halves(straight), halves(leaning), folded, apart] {
            let pairs = pairs(&both);
            assert_eq!((pairs.len(), edges_of(&pairs)), (2, 6), "{both:?}");
        }
    }

    #[test]
    fn a_long_rectangle_and_a_slanted_parallelogram_are_one_face() {
        let long = [[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0], [1000.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let slanted = [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [5.0, 1.5, 1.25], [4.0, 1.0, 1.0]];
        for corners in [long, slanted] {
            assert_eq!(edges_of(&pairs(&halves(corners))), 4, "{corners:?}");
        }
    }

    #[test]
    fn each_triangle_stands_in_one_face() {
        // A strip of eight triangles, flat: each has two neighbours to choose from.
        let at = |i: u32| [(i / 2) as f32, (i % 2) as f32, 0.0];
        let strip: Vec<_> = (0..8).map(|i| triangle(at(i), at(i + 1), at(i + 2))).collect();
        let pairs = pairs(&strip);
        let mut seen = vec![0; 8];
        for pair in &pairs {
            seen[pair.places[0]] += 1;
            if !pair.is_alone() {
                seen[pair.places[1]] += 1;
            }
        }
        assert_eq!(seen, [1; 8]);
        let fours = pairs.iter().take_while(|pair| !pair.is_alone()).count();
        assert!(fours >= 3 && pairs[fours..].iter().all(Pair::is_alone));
    }
}
