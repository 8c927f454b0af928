use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3};

use super::*;
use crate::pack;
use crate::reference::intersect::{intersect_moller, intersect_watertight};
use crate::reference::slabs::slabs_of;
use crate::reference::testing::{KINDS, Random, aimed_ray, by_corners, grazing_ray, triangles_of};

/// 2^-24.
const E: f64 = f32::EPSILON as f64 / 2.0;

/// Of any size from 2^-13 to 2^12, with a few bits or all of them.
fn number(random: &mut Random) -> f32 {
    let bits = if random.below(4) == 0 { random.below(16) << 19 } else { random.bits() >> 9 };
    let value = f32::from_bits(1f32.to_bits() | bits) * 2f32.powi(random.below(25) as i32 - 13);
    if random.below(2) == 0 { value } else { -value }
}

/// p.x q.y - p.y q.x in f64: both products are exact, and the difference is within 2^-53 of itself, its sign right.
fn exact_area(p: Vec2, q: Vec2) -> f64 {
    f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x)
}

#[test]
fn the_error_of_a_product_is_what_rounding_took() {
    let mut random = Random::new(100);
    let mut rounded = 0;
    for _ in 0..1_000_000 {
        let (a, b) = (number(&mut random), number(&mut random));
        let product = a * b;
        let exact = f64::from(a) * f64::from(b) - f64::from(product);
        assert_eq!(f64::from(error_of_product(a, b, product)), exact, "{a:e} * {b:e}");
        rounded += u32::from(exact != 0.0);
    }
    assert!(rounded > 400_000, "{rounded}");
}

/// Two points whose products are far apart, some units of the last place apart, or the same.
fn edge(random: &mut Random) -> (Vec2, Vec2) {
    let p = Vec2::new(number(random), number(random));
    let q = match random.below(4) {
        0 => Vec2::new(number(random), number(random)),
        // Collinear with the origin but for rounding.
        1 => p * number(random),
        2 => p * 2f32.powi(random.below(9) as i32 - 4),
        _ => {
            let near = p * number(random);
            let nudged = |x: f32| f32::from_bits(x.to_bits().wrapping_add(random.below(3)).wrapping_sub(1));
            Vec2::from_array(near.to_array().map(nudged))
        }
    };
    (p, q)
}

#[test]
fn sides_of_an_edge_are_exact_and_opposite_for_its_neighbours() {
    let mut random = Random::new(101);
    let (mut close, mut zero) = (0, 0);
    for _ in 0..1_000_000 {
        let (p, q) = edge(&mut random);
        let exact = exact_area(p, q);
        let (side, area) = (edge_side(p, q), edge_area(p, q));
        assert_eq!(side.partial_cmp(&0.0), exact.partial_cmp(&0.0), "{p} {q}: {side:e}, exactly {exact:e}");
        assert!(
            (f64::from(area) - exact).abs() <= 3.0 * E * exact.abs(),
            "{p} {q}: {area:e}, exactly {exact:e}"
        );
        assert_eq!(side, -edge_side(q, p));
        close += u32::from(exact != 0.0 && p.x * q.y == p.y * q.x);
        zero += u32::from(exact == 0.0);
    }
    assert!(close > 50_000 && zero > 50_000, "{close} close, {zero} on the edge");
}

/// Below 2^-76 the side is the right one or the edge itself.
#[test]
fn tiny_edges_are_never_on_the_wrong_side() {
    let mut random = Random::new(102);
    for _ in 0..300_000 {
        let (p, q) = edge(&mut random);
        let scale = 2f32.powi(-25 - random.below(60) as i32);
        let (p, q) = (p * scale, q * scale);
        let exact = exact_area(p, q);
        for found in [edge_side(p, q), edge_area(p, q)] {
            assert!(f64::from(found) * exact >= 0.0, "{p} {q}: {found:e}, exactly {exact:e}");
        }
        assert_eq!(edge_side(p, q), -edge_side(q, p));
    }
}

/// A closed surface in f32.
struct Closed {
    name: &'static str,
    corners: Vec<Vec3>,
    triangles: Vec<[usize; 3]>,
    /// Points inside, away from every triangle.
    inside: Vec<Vec3>,
}

impl Closed {
    /// Turned and moved in f64 before it becomes f32, or as it is. `inside`: of the shape as it is given.
    fn of(
        name: &'static str,
        corners: &[DVec3],
        triangles: &[[usize; 3]],
        inside: &[DVec3],
        random: Option<&mut Random>,
    ) -> Self {
        let turned: Box<dyn Fn(DVec3) -> DVec3> = match random {
            Some(random) => {
                let x = random.direction().as_dvec3();
                let y = random.direction().as_dvec3().cross(x).normalize();
                let (z, shift) = (x.cross(y), random.point().as_dvec3() * 0.3);
                Box::new(move |p: DVec3| x * p.x + y * p.y + z * p.z + shift)
            }
            None => Box::new(|p| p),
        };
        let rounded = |points: &[DVec3]| points.iter().map(|&p| turned(p).as_vec3()).collect();
        Self { name, corners: rounded(corners), triangles: triangles.to_vec(), inside: rounded(inside) }
    }

    fn all_corners(&self) -> Vec<Corners> {
        let corner = |i: usize| self.corners[i].to_array();
        let triangles = self.triangles.iter().enumerate();
        triangles
            .map(|(id, &[a, b, c])| Corners {
                a: corner(a),
                id: id as u32,
                b: corner(b),
                c: corner(c),
                ..Corners::default()
            })
            .collect()
    }

    fn largest(&self) -> f32 {
        self.corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f32::max)
    }
}

fn cube() -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let corners =
        (0..8).map(|i| DVec3::from([i & 1, i >> 1 & 1, i >> 2].map(|bit| f64::from(2 * bit - 1)))).collect();
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    (corners, triangles)
}

/// Every triangle cut into four, `times` over; neighbours share the middles of their edges.
fn subdivided(
    (mut corners, mut triangles): (Vec<DVec3>, Vec<[usize; 3]>),
    times: u32,
    moved: impl Fn(DVec3) -> DVec3,
) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    for _ in 0..times {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                corners.push(moved((corners[a] + corners[b]) * 0.5));
                corners.len() - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (corners, triangles)
}

fn tetrahedron(corners: [DVec3; 4]) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    (corners.to_vec(), vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
}

/// A cone of `count` slivers on a disc of as many.
fn cone(count: usize) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let mut corners = vec![DVec3::Y, DVec3::NEG_Y];
    corners.extend((0..count).map(|i| {
        let angle = i as f64 / count as f64 * std::f64::consts::TAU;
        DVec3::new(angle.cos(), -1.0, angle.sin())
    }));
    let triangles = (0..count).flat_map(|i| {
        let (here, next) = (2 + i, 2 + (i + 1) % count);
        [[0, next, here], [1, here, next]]
    });
    (corners, triangles.collect())
}

fn closed_meshes(random: &mut Random) -> Vec<Closed> {
    let mut meshes = Vec::new();
    let near = |random: &mut Random, size: f32| -> Vec<DVec3> {
        (0..6).map(|_| random.point().as_dvec3() * f64::from(size)).chain([DVec3::ZERO]).collect()
    };
    let (corners, triangles) = cube();
    let inside = near(random, 0.9);
    meshes.push(Closed::of("cube", &corners, &triangles, &inside, None));
    meshes.push(Closed::of("cube askew", &corners, &triangles, &inside, Some(random)));
    let (corners, triangles) = subdivided(cube(), 3, |p| p);
    meshes.push(Closed::of("cube in parts", &corners, &triangles, &inside, Some(random)));
    let (corners, triangles) = subdivided(cube(), 3, DVec3::normalize);
    let ball = near(random, 0.4);
    meshes.push(Closed::of("ball", &corners, &triangles, &ball, Some(random)));
    let corners: Vec<_> = corners.iter().map(|&p| p * DVec3::new(1.0, 1e-3, 1.0)).collect();
    let flat: Vec<_> = ball.iter().map(|&p| p * DVec3::new(1.0, 1e-3, 1.0)).collect();
    meshes.push(Closed::of("disc", &corners, &triangles, &flat, Some(random)));
    let (corners, triangles) = cone(3000);
    let inside = near(random, 0.2);
    meshes.push(Closed::of("cone of needles", &corners, &triangles, &inside, Some(random)));
    for i in 0..12 {
        let thin = DVec3::new(1.0, 1.0, [1.0, 0.01][i % 2]);
        let points = [0; 4].map(|_| random.point().as_dvec3() * thin);
        let volume = (points[1] - points[0]).cross(points[2] - points[0]).dot(points[3] - points[0]);
        if volume.abs() < 1e-4 {
            continue;
        }
        let centre = points.iter().sum::<DVec3>() * 0.25;
        let inside: Vec<_> = points.iter().map(|&p| centre + (p - centre) * 0.5).chain([centre]).collect();
        let (corners, triangles) = subdivided(tetrahedron(points), i as u32 % 3, |p| p);
        meshes.push(Closed::of("tetrahedron", &corners, &triangles, &inside, Some(random)));
    }
    meshes
}

/// A point of an edge or a corner, as f32 rounds it.
fn rim_point(random: &mut Random, mesh: &Closed) -> Vec3 {
    let [a, b, _] = mesh.triangles[random.below(mesh.triangles.len() as u32) as usize];
    let (a, b) = (mesh.corners[a], mesh.corners[b]);
    match random.below(4) {
        0 => a,
        1 => (a + b) * 0.5,
        2 => a + (b - a) * (random.below(16) as f32 / 16.0),
        _ => a + (b - a) * random.unit(),
    }
}

/// A ray from inside to the rim of a triangle, as near as f32 comes or some ulps beside.
fn ray_at_the_rim(random: &mut Random, mesh: &Closed) -> Ray {
    let origin = mesh.inside[random.below(mesh.inside.len() as u32) as usize];
    let direction = rim_point(random, mesh) - origin;
    let steps = [0, 1, 8][random.below(3) as usize];
    let mut nudged = |x: f32| {
        let by = random.below(2 * steps + 1) as i32 - steps as i32;
        if x == 0.0 { x } else { f32::from_bits((x.to_bits() as i32).wrapping_add(by) as u32) }
    };
    let direction = Vec3::from_array(direction.to_array().map(&mut nudged));
    Ray { origin, direction: if direction == Vec3::ZERO { Vec3::X } else { direction }, t_max: f32::MAX }
}

/// No ray from inside gets out, wherever it is aimed; Möller and Trumbore's do.
#[test]
fn no_ray_leaks_out_of_a_closed_mesh() {
    let mut random = Random::new(103);
    let (mut rays, mut leaks_of_moller) = (0, 0);
    for mesh in closed_meshes(&mut random) {
        let corners = mesh.all_corners();
        let triangles: Vec<_> = corners.iter().map(edges_of).collect();
        let largest = mesh.largest();
        let pad = pack::watertight_pad(largest, largest.into());
        let moller_pad = pack::box_pad(&triangles);
        for _ in 0..(20_000_000 / corners.len()).min(100_000) {
            let ray = ray_at_the_rim(&mut random, &mesh);
            let slabs = slabs_of(&ray, true);
            let met =
                corners.iter().any(|one| intersect_watertight(&ray, &slabs, one, pad, f32::MAX).is_some());
            assert!(met, "{}: {ray:?} got out", mesh.name);
            rays += 1;
            let moller = |conservative: bool| {
                triangles.iter().any(|one| {
                    intersect_moller(&ray, &slabs, one, conservative, moller_pad, f32::MAX).is_some()
                })
            };
            assert!(moller(true), "{}: {ray:?} got out of the conservative intersector", mesh.name);
            leaks_of_moller += u32::from(!moller(false));
        }
    }
    println!("{rays} rays; moller lets {leaks_of_moller} out");
    assert!(rays > 500_000 && leaks_of_moller > 100, "{rays} rays, {leaks_of_moller} with moller");
}

/// A ray that starts up to `reach` away, inside the scene, or on a face or a corner.
fn ray_from_anywhere(random: &mut Random, target: &Triangle, reach: f32) -> Ray {
    let ray = if random.below(2) == 0 { aimed_ray(random, target) } else { grazing_ray(random, target) };
    let [a, ab, ac] = [target.a, target.ab, target.ac].map(Vec3::from);
    let at = ray.origin + ray.direction;
    let origin = match random.below(6) {
        0 => a + ab * (random.unit() * 0.5) + ac * (random.unit() * 0.5),
        1 => [a, a + ab, a + ac][random.below(3) as usize],
        2 | 3 => ray.origin,
        _ => random.point() * reach,
    };
    // At the rim, where a box is as tight as it gets.
    let rim = a + ab * random.unit() + random.point() * (reach * 2f32.powi(-22));
    let direction = match random.below(4) {
        0 => random.direction(),
        1 => rim - origin,
        _ => at - origin,
    };
    let origin = origin.clamp(Vec3::splat(-reach), Vec3::splat(reach));
    Ray { origin, direction: direction.try_normalize().unwrap_or(Vec3::Y), t_max: f32::MAX }
}

/// The box rejects no hit that the intersector accepts, and brings t no farther than rounding. What the derivation grants
/// is measured: by how much of the pad the ray passes by the triangle's box.
#[test]
fn no_hit_is_lost_to_the_triangle_s_own_box() {
    let mut random = Random::new(104);
    let mut worst = 0f64;
    for reach in [1.0, 8.0, 1000.0] {
        let mut hits = 0;
        for kind in KINDS {
            let (corners, triangles) = by_corners(&triangles_of(kind, 105, 200));
            let largest = pack::box_pad(&triangles) * 2f32.powi(21);
            let reach = largest * reach;
            let pad = pack::watertight_pad(largest, reach.into());
            for i in 0..30_000 {
                let (one, edges) = (&corners[i % corners.len()], &triangles[i % corners.len()]);
                let ray = ray_from_anywhere(&mut random, edges, reach);
                if meets_watertight(&ray, one).is_none() {
                    continue;
                }
                hits += 1;
                let slabs = slabs_of(&ray, true);
                let guarded = |pad| intersect_watertight(&ray, &slabs, one, pad, f32::MAX);
                assert!(guarded(pad).is_some(), "{kind:?} to {reach}: {ray:?} {one:?}");
                if guarded(pad * worst as f32).is_none() {
                    worst = (1..=100)
                        .map(|i| f64::from(i) / 100.0)
                        .find(|&part| guarded(pad * part as f32).is_some())
                        .unwrap_or(1.0);
                }
            }
        }
        assert!(hits > 30_000, "{hits} hits to {reach}");
    }
    println!("{worst} of the pad is needed");
    assert!(worst > 0.02, "{worst}: the test proves little");
}

/// The ray's point at t is within 15 e (L + R) of the triangle in each axis, at every angle.
#[test]
fn a_hit_is_a_point_of_the_triangle() {
    let mut random = Random::new(106);
    let (mut hits, mut worst) = (0, 0f64);
    for kind in KINDS {
        let (corners, triangles) = by_corners(&triangles_of(kind, 107, 200));
        let largest = pack::box_pad(&triangles) * 2f32.powi(21);
        for i in 0..60_000 {
            let (one, edges) = (&corners[i % corners.len()], &triangles[i % corners.len()]);
            let ray = ray_from_anywhere(&mut random, edges, 8.0 * largest);
            let Some([det, t, v, w]) = meets_watertight(&ray, one) else { continue };
            hits += 1;
            let [t, v, w] = [t, v, w].map(|value| f64::from(value) / f64::from(det));
            let [a, b, c] = [one.a, one.b, one.c].map(|corner| Vec3::from(corner).as_dvec3());
            let on_triangle = a + (b - a) * v + (c - a) * w;
            let on_ray = ray.origin.as_dvec3() + ray.direction.as_dvec3() * t;
            let apart = (on_ray - on_triangle).abs().max_element();
            let reach = f64::from(ray.origin.abs().max_element().max(largest));
            worst = worst.max(apart / (E * (f64::from(largest) + reach)));
        }
    }
    println!("{hits} hits, at most {worst} e (L + R) beside their triangle");
    assert!(hits > 50_000);
    assert!(worst < 15.0, "{worst}");
}

/// An answer, if there is one, is made of numbers.
fn answer(ray: &Ray, one: &Corners) -> Option<[f32; 3]> {
    let found = intersect_watertight(ray, &slabs_of(ray, true), one, 1e-5, ray.t_max);
    if let Some(tuv) = found {
        assert!(tuv.iter().all(|value| value.is_finite()), "{ray:?} {one:?}: {tuv:?}");
        assert!(tuv[0] >= 0.0 && tuv[0] <= ray.t_max, "{ray:?} {one:?}: {tuv:?}");
    }
    found
}

fn right_angle() -> Corners {
    Corners { a: [0.0; 3], b: [1.0, 0.0, 0.0], c: [0.0, 1.0, 0.0], ..Corners::default() }
}

#[test]
fn directions_that_lead_nowhere_meet_nothing() {
    let down = Ray { origin: Vec3::new(0.25, 0.25, 1.0), direction: Vec3::NEG_Z, t_max: f32::MAX };
    let to = |x: f32, y: f32, z: f32| answer(&Ray { direction: Vec3::new(x, y, z), ..down }, &right_angle());
    for (x, y) in [(0.0, 0.0), (-0.0, -0.0), (1e-45, -1e-40)] {
        let found = to(x, y, -1.0).expect("a hit");
        let apart = (Vec3::from(found) - Vec3::new(1.0, 0.25, 0.25)).abs().max_element();
        assert!(apart < 1e-6, "({x}, {y}): {found:?}");
    }
    for size in [1e-20, 1e-6, 1e6, 1e20] {
        let found = to(0.1 * size, 0.0, -size).expect("a hit");
        assert!((found[0] * size - 1.0).abs() < 1e-6 && (found[1] - 0.35).abs() < 1e-6, "{size}: {found:?}");
    }
    let none = [0.0, -0.0, 1e-45, 1e-22, 1e22, f32::MAX, f32::INFINITY, f32::NAN];
    for size in none {
        assert_eq!(to(0.0, 0.0, -size), None, "{size}");
        assert_eq!(to(-size, size, -size), None, "{size}");
    }
    for wrong in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(to(wrong, 0.0, -1.0), None);
        assert_eq!(to(0.0, wrong, -1.0), None);
        let origin = Vec3::new(0.25, wrong, 1.0);
        assert_eq!(answer(&Ray { origin, ..down }, &right_angle()), None);
        let corners = Corners { b: [wrong, 0.0, 0.0], ..right_angle() };
        assert_eq!(answer(&down, &corners), None);
    }
    let huge = 1.5e19;
    let corners = Corners { b: [huge, 0.0, 0.0], c: [0.0, huge, 0.0], ..right_angle() };
    let middle = Ray { origin: Vec3::new(0.25 * huge, 0.25 * huge, 1.0), ..down };
    assert_eq!(answer(&middle, &corners), None, "a determinant without a reciprocal");
}

/// In the plane exactly there is nothing across the ray to meet; beside it by rounding, a hit lies on the triangle.
#[test]
fn a_ray_in_the_plane_meets_nothing_or_a_point_of_the_triangle() {
    for y in [-0.5, 0.0, 0.25, 1.0] {
        for direction in [Vec3::X, Vec3::NEG_X, Vec3::new(1.0, 0.5, 0.0)] {
            let ray = Ray { origin: Vec3::new(-1.0, y, 0.0), direction, t_max: f32::MAX };
            assert_eq!(answer(&ray, &right_angle()), None, "{ray:?}");
        }
    }
    let flat = Corners { c: [2.0, 0.0, 0.0], ..right_angle() };
    let down = Ray { origin: Vec3::new(0.25, 0.0, 1.0), direction: Vec3::NEG_Z, t_max: f32::MAX };
    assert_eq!(answer(&down, &flat), None, "no area");
    assert_eq!(answer(&down, &Corners::default()), None, "a point");
}

/// Numbers of any kind anywhere.
#[test]
fn no_answer_is_anything_but_a_number() {
    let mut random = Random::new(108);
    let mut met = 0;
    for _ in 0..400_000 {
        let mut any = || match random.below(12) {
            0 => 0.0,
            1 => -0.0,
            2 => f32::from_bits(random.below(1 << 23)),
            3 => f32::INFINITY,
            4 => f32::NAN,
            5 => f32::from_bits(random.bits()),
            6 => f32::MAX * random.signed(),
            _ => random.signed(),
        };
        let mut vector = || if any() > -0.5 { [any(), any(), any()] } else { [0.5, -0.25, 1.0] };
        let (a, b, c) = (vector(), vector(), vector());
        let ray = Ray { origin: vector().into(), direction: vector().into(), t_max: f32::MAX };
        met += u32::from(answer(&ray, &Corners { a, b, c, ..Corners::default() }).is_some());
    }
    println!("{met} hits");
    assert!(met > 100, "{met}");
}

#[test]
fn the_constants_are_the_shaders() {
    assert_eq!(SMALLEST_DIRECTION, 2f32.powi(-70));
    assert_eq!(LARGEST_DIRECTION, 2f32.powi(70));
    assert_eq!(SMALLEST_PRODUCT, 2f32.powi(-76));
    assert_eq!(LARGEST_DETERMINANT, 2f32.powi(120));
}
