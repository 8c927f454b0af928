use glam::Vec3;

use super::*;
use crate::reference::testing::{Random, corners_of, triangle};
use crate::reference::watertight::edges_of;

const RULES: Rules = Rules { box_pad: 1e-6, robust_slabs: true };

/// The verdict with each intersector.
fn verdicts(ray: &RayRecord, triangle: &Triangle) -> [Verdict; 2] {
    [verdict(ray, triangle, &RULES), verdict(ray, &corners_of(triangle), &RULES)]
}

/// What each intersector may answer.
fn check_truths(triangles: &[Triangle], check: impl Fn(&Truth<'_>)) {
    let corners: Vec<_> = triangles.iter().map(corners_of).collect();
    for triangles in [Shapes::Edges(triangles), Shapes::Corners(&corners)] {
        check(&Truth { triangles, rules: RULES });
    }
}

fn right_angle() -> Triangle {
    triangle(7, Vec3::ZERO, Vec3::X, Vec3::Y)
}

fn down(x: f32, y: f32, t_max: f32) -> RayRecord {
    RayRecord { origin: [x, y, 2.0], t_max, direction: [0.0, 0.0, -1.0], weight: 0.0 }
}

/// The same to (x, y, 0), but slanted, so that nothing is exactly zero.
fn slanted(x: f32, y: f32, t_max: f32) -> RayRecord {
    RayRecord { origin: [x + 0.3, y - 0.7, 2.0], direction: [-0.15, 0.35, -1.0], ..down(x, y, t_max) }
}

fn kind(verdict: Verdict) -> char {
    match verdict {
        Verdict::Hit(_) => 'h',
        Verdict::Miss { .. } => 'm',
        Verdict::Doubtful(_) => 'd',
    }
}

#[test]
fn clear_cases_are_certain_and_close_ones_doubtful() {
    let far = f32::MAX;
    for (x, y, t_max, expected) in [
        (0.25, 0.5, far, 'h'),
        (-0.25, 0.5, far, 'm'),
        (0.5, -0.1, far, 'm'),
        (0.6, 0.6, far, 'm'),
        (0.5, 0.5, far, 'd'),
        (0.6, 0.4, far, 'd'),
        // Zero is zero in f32 too, and counts as inside.
        (0.0, 0.5, far, 'h'),
        (0.5, 1e-5, far, 'h'),
        (0.5, -1e-5, far, 'm'),
        (0.25, 0.5, 1.9, 'm'),
        (0.25, 0.5, 2.0, 'd'),
        (0.25, 0.5, 2.1, 'h'),
    ] {
        for verdict in verdicts(&down(x, y, t_max), &right_angle()) {
            assert_eq!(kind(verdict), expected, "({x}, {y}) to {t_max}: {verdict:?}");
        }
    }
    let start = |z: f32| RayRecord { origin: [0.25, 0.25, z], ..down(0.0, 0.0, far) };
    assert_eq!(verdicts(&start(0.0), &right_angle()).map(kind), ['m'; 2], "t is exactly 0");
    assert_eq!(verdicts(&start(-1e-3), &right_angle()).map(kind), ['m'; 2], "behind");
}

#[test]
fn a_ray_in_the_plane_is_doubtful_and_one_beside_it_misses() {
    let along =
        |y: f32| RayRecord { origin: [-1.0, y, 0.0], direction: [1.0, 0.0, 0.0], ..down(0.0, 0.0, 9.0) };
    assert_eq!(verdicts(&along(0.5), &right_angle()).map(kind), ['m'; 2], "det is exactly 0");
    let (a, ab, ac) = (Vec3::new(0.1, 0.0, 0.1), Vec3::new(0.3, 0.7, 0.1), Vec3::new(0.6, -0.9, 0.2));
    let direction = 0.3 * ab + 0.2 * ac;
    for (aside, expected) in [(0.0, 'd'), (0.1, 'm'), (-0.1, 'm')] {
        let origin = a - direction + aside * ab.cross(ac);
        let ray = RayRecord { origin: origin.to_array(), direction: direction.to_array(), ..along(0.0) };
        for verdict in verdicts(&ray, &triangle(0, a, ab, ac)) {
            assert_eq!(kind(verdict), expected, "{aside}: {verdict:?}");
        }
    }
}

#[test]
fn a_hit_is_where_the_geometry_says() {
    let mut random = Random::new(30);
    let mut certain = 0;
    for _ in 0..10_000 {
        let corners = corners_of(&triangle(0, random.point(), random.point(), random.point()));
        let target = edges_of(&corners);
        let (u, v) = (random.unit() * 0.5, random.unit() * 0.5);
        let [a, ab, ac] = [target.a, target.ab, target.ac].map(Vec3::from);
        let origin = random.point() * 3.0;
        let direction = a + u * ab + v * ac - origin;
        let ray =
            RayRecord { origin: origin.to_array(), direction: direction.to_array(), ..down(0.0, 0.0, 9.0) };
        let [b, c] = [corners.b, corners.c].map(|corner| Vec3::from(corner).as_dvec3() - a.as_dvec3());
        for (verdict, [ab, ac]) in
            verdicts(&ray, &target).into_iter().zip([[ab, ac].map(|v| v.as_dvec3()), [b, c]])
        {
            let Verdict::Hit(meeting) = verdict else { continue };
            certain += 1;
            // Independent of Möller–Trumbore: the ray's point is the triangle's.
            let on_ray = origin.as_dvec3() + meeting.t * direction.as_dvec3();
            let on_triangle = a.as_dvec3() + meeting.u * ab + meeting.v * ac;
            assert!((on_ray - on_triangle).length() < 1e-9, "{ray:?} {target:?}");
            let near = |got: f64, meant: f64, error: f64| (got - meant).abs() < 1e-4 + error;
            assert!(near(meeting.u, f64::from(u), meeting.u_error) || meeting.margin < 1e3);
            assert!(meeting.t_error < 0.1 && meeting.margin > 1.0);
        }
    }
    assert!(certain > 18_000, "{certain}");
}

#[test]
fn accepts_the_right_answer_and_no_other() {
    let behind = triangle(3, Vec3::new(0.0, 0.0, -1.0), Vec3::X, Vec3::Y);
    check_truths(&[behind, right_angle()], accepts_the_right_one);
}

fn accepts_the_right_one(truth: &Truth<'_>) {
    let ray = down(0.25, 0.5, 100.0);
    let exact = truth.closest(&ray);
    assert_eq!(exact.certain.map(|(candidate, _)| (candidate.index, candidate.id)), Some((1, 7)));
    assert!((exact.gap - 1.0).abs() < 1e-12 && exact.edge_margin > 1.0, "{exact:?}");
    let right = HitRecord { t: 2.0, u: 0.25, v: 0.5, index: 1 };
    exact.accepts(&right).unwrap();
    exact.accepts(&HitRecord { t: 2f32.next_up(), ..right }).unwrap();
    for (wrong, why) in [
        (HitRecord { t: 3.0, index: 0, ..right }, "nearer"),
        (HitRecord { t: 2.00001, ..right }, "t is"),
        (HitRecord { u: 0.2501, ..right }, "u is"),
        (HitRecord { v: f32::NAN, ..right }, "v is"),
        (HitRecord { index: 5, ..right }, "missed for certain"),
        (HitRecord { t: 100.0, u: 0.0, v: 0.0, index: NO_HIT }, "no hit"),
    ] {
        let error = exact.accepts(&wrong).expect_err(why);
        assert!(error.contains(why), "{error}");
    }
    let past = truth.closest(&down(-0.5, 0.5, 100.0));
    past.accepts(&HitRecord { t: 100.0, u: 0.0, v: 0.0, index: NO_HIT }).unwrap();
    past.accepts(&HitRecord { t: 99.0, u: 0.0, v: 0.0, index: NO_HIT }).expect_err("t is not t_max");
    past.accepts(&right).expect_err("a hit of nothing");
}

#[test]
fn ties_and_edges_leave_a_choice() {
    let triangles = [right_angle(), right_angle(), triangle(9, Vec3::ZERO, Vec3::Y, Vec3::NEG_X)];
    check_truths(&triangles, leaves_a_choice);
}

fn leaves_a_choice(truth: &Truth<'_>) {
    let tied = truth.closest(&down(0.25, 0.5, 9.0));
    assert_eq!(tied.gap, 0.0);
    for index in [0, 1] {
        tied.accepts(&HitRecord { t: 2.0, u: 0.25, v: 0.5, index }).unwrap();
    }
    // On the edge that all share: any of them, or none.
    let edge = truth.closest(&slanted(0.0, 0.5, 9.0));
    assert!(edge.edge_margin <= 1.0 && edge.certain.is_none());
    edge.accepts(&HitRecord { t: 2.0, u: 0.0, v: 0.5, index: 0 }).unwrap();
    edge.accepts(&HitRecord { t: 2.0, u: 0.5, v: 0.0, index: 2 }).unwrap();
    edge.accepts(&HitRecord { t: 9.0, u: 0.0, v: 0.0, index: NO_HIT }).unwrap();
    edge.accepts(&HitRecord { t: 1.9, u: 0.0, v: 0.5, index: 0 }).expect_err("too near");
}

#[test]
fn any_hit_needs_one_certain_hit() {
    check_truths(&[right_angle()], needs_one_certain_hit);
}

fn needs_one_certain_hit(truth: &Truth<'_>) {
    let (met, escaped) = (HitRecord::default(), HitRecord { index: NO_HIT, ..HitRecord::default() });
    for (x, may_meet, may_escape) in [(0.25, true, false), (0.0, true, true), (-0.25, false, true)] {
        let exact = truth.any(&slanted(x, 0.5, 9.0));
        assert_eq!(exact.accepts(&met).is_ok(), may_meet, "{x}");
        assert_eq!(exact.accepts(&escaped).is_ok(), may_escape, "{x}");
        assert_eq!(exact.edge_margin > 1.0, may_meet != may_escape, "{x}: {exact:?}");
    }
}

#[test]
fn overflow_and_nan_are_not_judged_wrongly() {
    let ray = RayRecord { origin: [f32::NAN; 3], ..down(0.0, 0.0, 9.0) };
    assert_eq!(verdicts(&ray, &right_angle()).map(kind), ['m'; 2]);
    let huge = triangle(0, Vec3::ZERO, Vec3::X * 1e20, Vec3::Y * 1e20);
    assert_eq!(verdicts(&down(1e18, 1e18, 9.0), &huge).map(kind), ['d'; 2]);
}
