//! Faces against rays that start at one point. Twin of shaders/traverse/edges.glsl, one ray at a time; fused products and the
//! division round otherwise there, which the room around an edge covers.

use glam::Vec3;

use super::sides::Verdict;
use crate::layout::{FACE_TURNED, Face, Triangle};
use crate::reference::arith::{cross3, dot3};

/// 2^-20.
const NEAR_SCALE: f32 = 1.0 / 1_048_576.0;
/// From here on a direction is within.
const WITHIN: f32 = 2.0;

/// Whether the exact test's t of rays that leave the plane upwards is below 0.
fn below(start: Vec3, triangle: &Triangle) -> bool {
    let (ab, ac) = (Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    dot3(ac, cross3(start - Vec3::from(triangle.a), ab)) < 0.0
}

/// A face's edge functions from a start, and what is added to them.
pub struct Edges {
    sides: Vec<Vec3>,
    base: f32,
}

impl Edges {
    pub fn from(start: Vec3, face: &Face, triangles: &[Triangle]) -> Self {
        let first = dot3(face.normal0.into(), start) + face.offset0;
        let second = dot3(face.normal1.into(), start) + face.offset1;
        let mut sign = if first < 0.0 { -1.0 } else { 1.0 };
        let mut base = 1.0;
        if first.abs().min(second.abs()) < 1.0 || (first < 0.0) != (second < 0.0) {
            let places = [face.first, face.second & !FACE_TURNED];
            let [first, second] = places.map(|place| below(start, &triangles[place as usize]));
            let turned = face.second & FACE_TURNED != 0;
            base = NEAR_SCALE;
            sign = if first != (second != turned) {
                0.0
            } else if first {
                -NEAR_SCALE
            } else {
                NEAR_SCALE
            };
        }
        let functions = [
            (face.along_a, [face.moment_ax, face.moment_ay, face.moment_az]),
            (face.along_b, [face.moment_bx, face.moment_by, face.moment_bz]),
            (face.along_c, [face.moment_cx, face.moment_cy, face.moment_cz]),
            (face.along_d, [face.moment_dx, face.moment_dy, face.moment_dz]),
        ];
        let count = if face.first == face.second { 3 } else { 4 };
        let side = |(along, moment): &([f32; 3], [f32; 3])| {
            (cross3(start, Vec3::from(*along)) + Vec3::from(*moment)) * sign
        };
        Self { sides: functions[..count].iter().map(side).collect(), base }
    }

    /// Of a direction whose components add up to 1.74 at most, without their signs.
    pub fn verdict(&self, direction: Vec3) -> Verdict {
        let least = self.sides.iter().map(|side| dot3(*side, direction) + self.base).fold(f32::MAX, f32::min);
        match least {
            least if least > WITHIN => Verdict::Within,
            least if least >= 0.0 => Verdict::Unsure,
            _ => Verdict::Outside,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Corners;
    use crate::pack::{faces, pairs};
    use crate::reference::intersect::any_of_triangle;
    use crate::reference::ray::Ray;
    use crate::reference::slabs::slabs_of;
    use crate::reference::testing::{Random, Scene};
    use crate::reference::traverse::sides::{Side, side_from};
    use crate::reference::{Choices, Inputs, Traversal};

    /// A parallelogram, up to a thousand times as long as wide, a kite, a trapezoid or a lone triangle, of any size.
    fn corners_of(random: &mut Random, kind: u32) -> Vec<Corners> {
        let size = 0.3 * 10f32.powf(-3.0 * random.unit());
        let u = random.direction() * size;
        let v = u.cross(random.direction()).normalize_or(Vec3::X) * size * 10f32.powf(-3.0 * random.unit());
        let a = random.point() * 0.6;
        let (b, d) = (a + u, a + v + u * random.signed());
        let c = match kind {
            0 => d + u,
            1 => d + u * (0.7 + 0.6 * random.unit()),
            _ => d + u * 0.9 + v * 0.1 * random.signed(),
        };
        let corners =
            |[a, b, c]: [Vec3; 3]| Corners { a: a.into(), b: b.into(), c: c.into(), ..Corners::default() };
        let second = if random.below(2) == 0 { [a, c, d] } else { [c, a, d] };
        let both = [corners([a, b, c]), corners(second)];
        both[..if kind == 3 { 1 } else { 2 }].to_vec()
    }

    /// What is said to be within or outside is so by the exact test, for rays aimed at edges, corners and the middle from anywhere, from next to the
    /// plane and from next to a corner; and few of those that go anywhere are not sure.
    #[test]
    fn sure_verdicts_are_those_of_the_exact_test() {
        let mut random = Random::new(77);
        let (mut quads, mut unsure, mut anywhere) = (0, 0, 0);
        let mut seen = [0u32; 3];
        // Triangles alone, and what is wrong with a sixteenth of the measure, of triangles and of faces.
        let mut seen_alone = [0u32; 3];
        let mut wrong_if_narrow = [0; 2];
        for round in 0..4_000 {
            let corners = corners_of(&mut random, round % 4);
            let (triangles, points): (Vec<_>, Vec<_>) = corners
                .iter()
                .enumerate()
                .map(|(id, corners)| {
                    let [a, b, c] = [corners.a, corners.b, corners.c].map(Vec3::from);
                    (Triangle::new(a.into(), id as u32, (b - a).into(), (c - a).into()), [a, b, c])
                })
                .unzip();
            let pairs = pairs(&corners);
            let largest = |points: &[Vec3]| points.iter().map(|v| v.abs().max_element()).fold(0.0, f32::max);
            let reach = largest(&points.concat());
            quads += (corners.len() - pairs.len()) as u32;
            let scene = Scene::of(triangles.clone());
            let inputs = scene.by(Traversal::Brute);
            // In the order of the faces, not of the tree.
            let choices = Choices { conservative: true, watertight: false, ..inputs.choices };
            let inputs = Inputs { triangles: &triangles, choices, ..inputs };
            for _ in 0..60 {
                let corners = points[random.below(points.len() as u32) as usize];
                let [p, q, r] = [0, 1, 2].map(|i| corners[(i + random.below(3) as usize) % 3]);
                let close = 10f32.powf(-8.0 * random.unit());
                let from = random.below(4);
                let start = match from {
                    0 => {
                        p + (q - p) * random.signed() * 3.0
                            + (r - p) * random.signed()
                            + random.point() * close
                    }
                    1 => p + random.point() * close,
                    _ => random.point(),
                };
                let aimed = random.below(8) != 0;
                let edge = p + (q - p) * random.unit();
                let inside = (corners[0] + corners[1] + corners[2]) / 3.0;
                let target = match random.below(4) {
                    0 => edge + (inside - edge) * random.unit(),
                    _ => edge + random.point() * 10f32.powf(-4.0 - 5.0 * random.unit()),
                };
                let direction =
                    if aimed { (target - start).normalize_or(Vec3::Z) } else { random.direction() };
                let ray = Ray { origin: start, direction, t_max: f32::MAX };
                let slabs = slabs_of(&ray, true);
                for (index, triangle) in triangles.iter().enumerate() {
                    let exact = any_of_triangle(&inputs, &ray, &slabs, index as u32);
                    let side = side_from(start, triangle);
                    let verdict = side.verdict(direction);
                    seen_alone[verdict as usize] += 1;
                    let wrong = if exact { Verdict::Outside } else { Verdict::Within };
                    assert!(verdict != wrong, "round {round}: {verdict:?}, {exact}: {ray:?} {triangle:?}");
                    let narrow = Side { error: side.error / 16.0, ..side };
                    wrong_if_narrow[0] += u32::from(narrow.verdict(direction) == wrong);
                }
                let size = f64::from(reach) + f64::from(largest(&[start]));
                // A sixty-fourth: starts here lie closer than they are granted to.
                let narrow = faces(&pairs, &triangles, 0.0, size / 64.0);
                for (face, narrow) in faces(&pairs, &triangles, 0.0, size).iter().zip(&narrow).skip(1) {
                    let exact = [face.first, face.second & !FACE_TURNED]
                        .iter()
                        .any(|&index| any_of_triangle(&inputs, &ray, &slabs, index));
                    let verdict = Edges::from(start, face, &triangles).verdict(direction);
                    seen[verdict as usize] += 1;
                    let said =
                        format!("round {round}: {verdict:?} of {face:?}, {exact}: {ray:?} {corners:?}");
                    assert!(verdict != Verdict::Within || exact, "{said}");
                    assert!(verdict != Verdict::Outside || !exact, "{said}");
                    let wrong = if exact { Verdict::Outside } else { Verdict::Within };
                    let narrow = Edges::from(start, narrow, &triangles).verdict(direction);
                    wrong_if_narrow[1] += u32::from(narrow == wrong);
                    if !aimed && from > 1 {
                        anywhere += 1;
                        unsure += u32::from(verdict == Verdict::Unsure);
                    }
                }
            }
        }
        assert!(quads > 800, "{quads}");
        assert!(seen.iter().all(|&count| count > 10_000), "{seen:?}");
        assert!(seen_alone.iter().all(|&count| count > 5_000), "{seen_alone:?}");
        assert!(
            wrong_if_narrow.iter().all(|&count| count > 0),
            "nothing needs the measure: {wrong_if_narrow:?}"
        );
        assert!(unsure * 100 < anywhere, "{unsure} of {anywhere} are not sure");
    }
}
