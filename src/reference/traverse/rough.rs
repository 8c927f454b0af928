//! What of a ray and a triangle is sure whatever rounding does. Twin of shaders/traverse/rough.glsl, whose products and sums a GPU may fuse.
//!
//! With S = `error_of`(direction) max abs(s), the exact test's u, v and t are within S `ac_sum`, S `ab_sum` and S `ab_sum` `ac_sum` of those of the
//! exact ray, det within the same with its other edge for s, and so are fused ones, which round less often. So the two are within twice that of each
//! other, and the conservative intersector grants it once more: four times leave one for the sums. t has no need of it to be told from 0,
//! for it is rounded as in the exact test. A ray whose t is beyond its error meets the triangle after its start, and so crosses the
//! triangle's own box there, which the robust slab test does not miss. A triangle seen edge-on, the sign of whose det is open, may be met only where u, v and det - u - v have
//! one sign give or take their errors, so where neither |u| nor |v| is more than |det| and twice the sum of the errors: of heaps of needles, of which a ray passes hundreds, next to none.
//! Bounds hold while no product underflows.

use glam::Vec3;

use crate::layout::Triangle;
use crate::reference::arith::{SMALLEST_DETERMINANT, cross3, dot3, max_abs};
use crate::reference::intersect::error_of;
use crate::reference::ray::Ray;

const ROUGH_ERROR: f32 = 4.0;
/// 36 e.
const ROUGH_ERROR_T: f32 = 36.0 / 16_777_216.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Misses,
    MayMeet,
    Meets,
}

/// Of a ray without an end. `sum`(a, b, c): a b + c, rounded once or twice.
fn verdict_by(ray: &Ray, triangle: &Triangle, sum: impl Fn(f32, f32, f32) -> f32) -> Verdict {
    let (a, ab, ac) = (Vec3::from(triangle.a), Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let dot = |v: Vec3, w: Vec3| sum(v.x, w.x, sum(v.y, w.y, v.z * w.z));
    let cross = |v: Vec3, w: Vec3| {
        let component = |i: usize, j: usize| sum(v[i], w[j], -(v[j] * w[i]));
        Vec3::new(component(1, 2), component(2, 0), component(0, 1))
    };
    let s = ray.origin - a;
    let p = cross(ray.direction, ac);
    let q = cross3(s, ab);
    let det = dot(ab, p);
    let side = if det.is_sign_negative() { -1.0 } else { 1.0 };
    let [t, u, v] = [dot3(ac, q), dot(s, p), dot(ray.direction, q)].map(|x| x * side);
    let det = det.abs();
    let error = ROUGH_ERROR * error_of(ray.direction);
    let error_s = error * max_abs(s);
    let error_u = error_s * triangle.ac_sum;
    let error_v = error_s * triangle.ab_sum;
    let error_det = error * triangle.ab_sum * triangle.ac_sum;
    let error_sum = error_u + error_v + error_det;
    let meets = u >= error_u
        && v >= error_v
        && u + v + error_sum <= det
        && t > ROUGH_ERROR_T * max_abs(s) * triangle.ab_sum * triangle.ac_sum
        && det > 2.0 * SMALLEST_DETERMINANT;
    let inside = u >= -error_u && v >= -error_v && u + v <= det + error_sum && t > 0.0;
    let edge_on = det <= error_det && u.abs().max(v.abs()) <= det + 2.0 * error_sum;
    match () {
        () if meets => Verdict::Meets,
        () if inside || edge_on => Verdict::MayMeet,
        () => Verdict::Misses,
    }
}

pub fn verdict(ray: &Ray, triangle: &Triangle) -> Verdict {
    verdict_by(ray, triangle, |a, b, c| a * b + c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::box_pad;
    use crate::reference::intersect::intersect_moller;
    use crate::reference::slabs::slabs_of;
    use crate::reference::testing::{KINDS, Random, aimed_ray, grazing_ray, triangles_of};

    /// What is sure is what both exact tests say, with products rounded or fused, and little is left open but along edges.
    #[test]
    fn what_is_sure_is_so() {
        let mut random = Random::new(11);
        let [mut sure, mut open, mut outside, mut grazed] = [0u32; 4];
        for kind in KINDS {
            let triangles = triangles_of(kind, 5, 200);
            let pad = box_pad(&triangles);
            for round in 0..60_000 {
                let aim = &triangles[random.below(200) as usize];
                let triangle = if round % 4 == 0 { &triangles[random.below(200) as usize] } else { aim };
                let ray = match round % 3 {
                    0 => grazing_ray(&mut random, aim),
                    _ => aimed_ray(&mut random, aim),
                };
                let scale = 2f32.powi(random.below(41) as i32 - 20);
                let ray = Ray { direction: ray.direction * scale, t_max: f32::MAX, ..ray };
                let slabs = slabs_of(&ray, true);
                let exact = [false, true].map(|conservative| {
                    intersect_moller(&ray, &slabs, triangle, conservative, pad, ray.t_max).is_some()
                });
                for fused in [false, true] {
                    let sum = |a: f32, b: f32, c: f32| if fused { f32::mul_add(a, b, c) } else { a * b + c };
                    let verdict = verdict_by(&ray, triangle, sum);
                    match verdict {
                        Verdict::Meets => assert_eq!(exact, [true; 2], "{kind:?}: {ray:?} {triangle:?}"),
                        Verdict::Misses => assert_eq!(exact, [false; 2], "{kind:?}: {ray:?} {triangle:?}"),
                        Verdict::MayMeet => {}
                    }
                    grazed += u32::from(verdict == Verdict::MayMeet && !exact[1]);
                    sure += u32::from(verdict == Verdict::Meets);
                    outside += u32::from(verdict == Verdict::Misses);
                    open += u32::from(verdict == Verdict::MayMeet && round % 3 != 0);
                }
            }
        }
        assert!(sure > 100_000 && outside > 100_000 && open < 200_000, "{sure} {outside} {open}");
        // So there are rays that have to walk again.
        assert!(grazed > 1000, "{grazed}");
    }
}
