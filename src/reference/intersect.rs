//! Ray against triangle. Twin of shaders/shared/intersect.glsl.

use glam::Vec3;

use super::Inputs;
use super::arith::{SMALLEST_DETERMINANT, cross3, dot3, max_abs, max3, min3, reciprocal};
use super::ray::{Hit, Ray};
use super::slabs::{Slabs, slab_interval, slabs_of};
use super::watertight::{edges_of, meets_watertight};
use crate::layout::{Corners, Triangle};

/// The box of a triangle as the slab test sees it, grown by box_pad: that of its edges as they round, with either
/// intersector, for so are the tree's.
pub fn padded_box_of(triangle: &Triangle, box_pad: f32) -> (Vec3, Vec3) {
    let a = Vec3::from(triangle.a);
    let (b, c) = (a + Vec3::from(triangle.ab), a + Vec3::from(triangle.ac));
    (min3(a, min3(b, c)) - box_pad, max3(a, max3(b, c)) + box_pad)
}

/// Error of a triple product of the direction d, a vector s and an edge f, in parts of max abs(s) and of the sum of the
/// abs(f): no less than 8 e sum abs(d), with e = 2^-24. A component of d x f is a difference of two products, each with
/// the rounding of f = corner - corner, its own and the difference's, at most gamma(3) of sum abs(d_j f_k) over its j
/// != k; the product with s = origin - corner adds the rounding of s, its own and two additions': gamma(7) in all, of
/// sum abs(s_i d_j f_k) <= max abs(s) sum abs(d) sum abs(f). s . (d x ab) is computed as d . (s x ab), with the
/// same bound. 9 e leaves room for the roundings of the bound itself.
pub fn error_of(direction: Vec3) -> f32 {
    let size = direction.abs();
    (size.x + size.y + size.z) * (9.0 * 2f32.powi(-24))
}

/// Möller and Trumbore (1997): [det, t det, u det, v det] of a hit.
///
/// With `conservative`, u det and v det may be as far below 0, and their sum as far above det, as their errors allow:
/// ab . (d x ac) has that of s, with ab in its place. So a triangle that the exact ray meets is met, and of a closed surface at
/// least one, if t det and det are further from 0 than their errors: unless the ray starts on the triangle's plane or runs within
/// it, as far as f32 can tell. A triangle may also be met by a ray that passes it within twice the errors. Bounds hold while no
/// product underflows. The point is brought into the triangle.
fn meets_moller(ray: &Ray, triangle: &Triangle, conservative: bool) -> Option<[f32; 4]> {
    let (a, ab, ac) = (Vec3::from(triangle.a), Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let p = cross3(ray.direction, ac);
    let det = dot3(ab, p);
    let side = if det < 0.0 { -1.0 } else { 1.0 };
    let s = ray.origin - a;
    let q = cross3(s, ab);
    let det = det.abs();
    let u = side * dot3(s, p);
    let v = side * dot3(ray.direction, q);
    let t = side * dot3(ac, q);
    let u_plus_v = u + v;
    if !conservative {
        let meets = det > SMALLEST_DETERMINANT && u >= 0.0 && v >= 0.0 && u_plus_v <= det && t > 0.0;
        return meets.then_some([det, t, u, v]);
    }
    let error = error_of(ray.direction);
    let error_s = error * max_abs(s);
    let error_u = error_s * triangle.ac_sum;
    let error_v = error_s * triangle.ab_sum;
    let most = det + (error_u + error_v + error * triangle.ab_sum * triangle.ac_sum);
    let inside_u = u.max(0.0).min(det);
    let inside_v = v.max(0.0).min(det - inside_u);
    let meets = det > SMALLEST_DETERMINANT && u >= -error_u && v >= -error_v && u_plus_v <= most && t > 0.0;
    meets.then_some([det, t, inside_u, inside_v])
}

/// The ray must also cross the triangle's own box as the robust slab test sees it, and the hit's distance is brought into
/// that box: then every tree of boxes finds the same hits at the same distances, exactly.
fn guarded(
    ray: &Ray,
    slabs: &Slabs,
    (pmin, pmax): (Vec3, Vec3),
    [det, t, u, v]: [f32; 4],
    t_max: f32,
) -> Option<[f32; 3]> {
    let own = if slabs.robust { *slabs } else { slabs_of(ray, true) };
    let [enter, leave] = slab_interval(&own, pmin, pmax);
    let scale = reciprocal(det);
    let t = (t * scale).max(enter).min(leave);
    (enter.max(0.0) <= leave && t <= t_max).then_some([t, u * scale, v * scale])
}

/// (t, u, v) of a hit with the intersector of Möller and Trumbore.
pub fn intersect_moller(
    ray: &Ray,
    slabs: &Slabs,
    triangle: &Triangle,
    conservative: bool,
    box_pad: f32,
    t_max: f32,
) -> Option<[f32; 3]> {
    let numerators = meets_moller(ray, triangle, conservative)?;
    guarded(ray, slabs, padded_box_of(triangle, box_pad), numerators, t_max)
}

/// (t, u, v) of a hit with the watertight intersector.
pub fn intersect_watertight(
    ray: &Ray,
    slabs: &Slabs,
    corners: &Corners,
    box_pad: f32,
    t_max: f32,
) -> Option<[f32; 3]> {
    let numerators = meets_watertight(ray, corners)?;
    guarded(ray, slabs, padded_box_of(&edges_of(corners), box_pad), numerators, t_max)
}

/// The original's form: the division is not guarded, so a zero determinant gives NaN, which no comparison
/// rejects. The shader leaves its roundings to the driver: only this twin has them in the written order.
#[expect(clippy::manual_range_contains, reason = "a NaN passes these comparisons, but is in no range")]
pub fn intersect_original(ray: &Ray, triangle: &Triangle, t_max: f32) -> Option<[f32; 3]> {
    let (a, ab, ac) = (Vec3::from(triangle.a), Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let p = cross3(ray.direction, ac);
    let inverse = 1.0 / dot3(ab, p);
    let s = ray.origin - a;
    let u = dot3(s, p) * inverse;
    if u < 0.0 || u > 1.0 {
        return None;
    }
    let q = cross3(s, ab);
    let v = dot3(ray.direction, q) * inverse;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let t = dot3(ac, q) * inverse;
    if t < 0.0 || t > t_max {
        return None;
    }
    Some([t, u, v])
}

pub fn intersect(inputs: &Inputs, ray: &Ray, slabs: &Slabs, index: u32, t_max: f32) -> Option<[f32; 3]> {
    let (choices, pad) = (&inputs.choices, inputs.frame.box_pad);
    if choices.watertight {
        return intersect_watertight(ray, slabs, &inputs.corners[index as usize], pad, t_max);
    }
    let triangle = inputs.load_triangle(index);
    if choices.original {
        intersect_original(ray, triangle, t_max)
    } else {
        intersect_moller(ray, slabs, triangle, choices.conservative, pad, t_max)
    }
}

/// Keeps the closer hit; of equal ones the smaller id, so that the order of visits does not matter (the
/// original kept the last).
pub fn closest_of_triangle(inputs: &Inputs, ray: &Ray, slabs: &Slabs, index: u32, hit: &mut Hit) {
    let id = inputs.load_triangle(index).id;
    if let Some([t, u, v]) = intersect(inputs, ray, slabs, index, hit.t)
        && (inputs.choices.original || t < hit.t || id < hit.id)
    {
        *hit = Hit { t, u, v, index, id };
    }
}

pub fn any_of_triangle(inputs: &Inputs, ray: &Ray, slabs: &Slabs, index: u32) -> bool {
    intersect(inputs, ray, slabs, index, ray.t_max).is_some()
}

/// How far a box may lie to be worth opening: the original asked every box over its fixed range.
pub const ORIGINAL_BOX_RANGE: f32 = 1000.0;

pub fn box_limit(inputs: &Inputs, t_closest: f32) -> f32 {
    if inputs.choices.original { ORIGINAL_BOX_RANGE } else { t_closest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::exact::{Rules, Shape, Verdict, verdict};
    use crate::reference::testing::{KINDS, REACH, Random, aimed_ray, by_corners, triangle, triangles_of};
    use crate::render::choices::Intersector;

    fn guarded(ray: &Ray, triangle: &Triangle, pad: f32) -> Option<[f32; 3]> {
        intersect_moller(ray, &slabs_of(ray, true), triangle, false, pad, ray.t_max)
    }

    #[test]
    fn agrees_with_the_exact_verdict() {
        let mut random = Random::new(10);
        let all = [Intersector::Moller, Intersector::Conservative, Intersector::Watertight];
        for (kind, intersector) in KINDS.into_iter().flat_map(|kind| all.map(|one| (kind, one))) {
            let (corners, triangles) = by_corners(&triangles_of(kind, 11, 100));
            let mut pad = crate::pack::box_pad(&triangles);
            if intersector == Intersector::Watertight {
                pad = crate::pack::watertight_pad(pad * 2f32.powi(21), REACH);
            }
            let (mut hits, mut doubtful, count) = (0, 0, 20_000);
            for i in 0..count {
                let (triangle, corners) = (&triangles[i % triangles.len()], &corners[i % triangles.len()]);
                let ray = aimed_ray(&mut random, triangle);
                let rules = Rules { box_pad: pad, robust_slabs: true };
                let slabs = slabs_of(&ray, true);
                let moller =
                    |conservative| intersect_moller(&ray, &slabs, triangle, conservative, pad, ray.t_max);
                let (shape, got) = match intersector {
                    Intersector::Moller => (Shape::Edges(triangle), moller(false)),
                    Intersector::Conservative => (Shape::Conservative(triangle), moller(true)),
                    Intersector::Watertight => {
                        (Shape::Corners(corners), intersect_watertight(&ray, &slabs, corners, pad, ray.t_max))
                    }
                };
                match verdict(&ray.record(), shape, &rules) {
                    Verdict::Hit(meeting) => {
                        hits += 1;
                        let got = got.unwrap_or_else(|| panic!("{kind:?}: lost {ray:?} {triangle:?}"));
                        meeting.agrees(got).unwrap_or_else(|e| panic!("{kind:?}: {e}: {ray:?} {triangle:?}"));
                    }
                    Verdict::Miss { .. } => {
                        assert!(got.is_none(), "{kind:?}: made up {got:?}: {ray:?} {triangle:?}");
                    }
                    Verdict::Doubtful(_) => doubtful += 1,
                }
            }
            println!("{kind:?}, {intersector}: {hits} certain hits, {doubtful} doubtful of {count}");
            assert!(hits > count / 20, "{kind:?}: too few hits to prove anything");
            assert!(doubtful < count * 2 / 3, "{kind:?}: the bound decides too little");
        }
    }

    #[test]
    fn degenerate_triangles_and_nan_rays_are_missed() {
        let ray = Ray { origin: Vec3::new(0.25, 0.25, 1.0), direction: Vec3::NEG_Z, t_max: 9.0 };
        let good = Triangle { ab: [1.0, 0.0, 0.0], ac: [0.0, 1.0, 0.0], ..Triangle::default() };
        assert!(guarded(&ray, &good, 1e-6).is_some_and(|[t, u, v]| (t - 1.0).abs() < 1e-6 && u == v));
        for flat in [Triangle::default(), Triangle { ac: good.ab, ..good }] {
            assert_eq!(guarded(&ray, &flat, 1e-6), None);
        }
        let nan = Ray { origin: Vec3::NAN, ..ray };
        assert_eq!(guarded(&nan, &good, 1e-6), None);
        assert!(intersect_original(&nan, &good, 9.0).is_some_and(|tuv| tuv[0].is_nan()));
    }

    #[test]
    fn the_original_accepts_t_zero_and_takes_both_sides() {
        let good = Triangle { ab: [1.0, 0.0, 0.0], ac: [0.0, 1.0, 0.0], ..Triangle::default() };
        let mut ray = Ray { origin: Vec3::new(0.25, 0.25, 0.0), direction: Vec3::NEG_Z, t_max: 9.0 };
        assert_eq!(intersect_original(&ray, &good, 9.0), Some([0.0, 0.25, 0.25]));
        assert_eq!(guarded(&ray, &good, 1e-6), None);
        ray.origin.z = -2.0;
        assert_eq!(intersect_original(&ray, &good, 9.0), None);
        ray.direction = Vec3::Z;
        assert_eq!(intersect_original(&ray, &good, 9.0), Some([2.0, 0.25, 0.25]));
        assert_eq!(intersect_original(&ray, &good, 1.5), None);
    }

    #[test]
    fn smallest_determinant_is_2_to_the_minus_120() {
        assert_eq!(SMALLEST_DETERMINANT, 2f32.powi(-120));
    }

    /// A disc in the plane y = 0, cut into thin triangles: its boxes are thinner than the error of t, and
    /// no hit that lies well inside a triangle may be lost for that.
    #[test]
    fn thin_triangles_in_flat_boxes_keep_their_hits() {
        let count = 512;
        let rim = |i: u32| {
            let angle = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
            Vec3::new(angle.cos() as f32, 0.0, angle.sin() as f32)
        };
        let rules = Rules { box_pad: 2f32.powi(-21), robust_slabs: true };
        let mut random = Random::new(11);
        let mut met = 0;
        for i in 0..8 * count {
            let fan = triangle(0, Vec3::ZERO, rim(i), rim(i + 1));
            let (u, v) = (0.1 + 0.4 * random.unit(), 0.1 + 0.4 * random.unit());
            let target = rim(i) * u + rim(i + 1) * v;
            let direction = random.direction();
            let ray = Ray { origin: target - direction * 10.0, direction, t_max: f32::MAX };
            if !matches!(verdict(&ray.record(), &fan, &rules), Verdict::Hit(_)) {
                continue;
            }
            met += 1;
            let hit = guarded(&ray, &fan, rules.box_pad);
            assert!(hit.is_some(), "{ray:?} {fan:?}");
        }
        assert!(met > 2000, "{met}");
    }
}
