//! Where ambient rays leave their surface, off it by some ulps of the point (Wächter and Binder 2019). Twin of
//! shaders/shared/offset.glsl.
//!
//! # How far is enough
//! Let e = 2^-24 and L the largest coordinate of the scene; edges are at most 2 L long along an axis.
//!
//! - A hit's point a + u ab + v ac rounds four times a component: products of at most 2 L (u + v <= 1), and sums that lie in the
//!   triangle's box, at most L. That is off by 4 e L, and by sqrt(3) times as much along the normal: 7 e L.
//! - The intersector asks whether t det = ac . ((o - a) x ab) is positive, where exactly it is -h abs(ab x ac), or
//!   -h abs(ab) abs(ac) sin(A) with the angle A at a, for a start o at the height h. Its error is at most 6 e (see `exact`) times the
//!   sum of the absolute values of its six products, a permanent, which is at most 1.16 abs(ac) abs(o - a) abs(ab) (Carlen, Lieb
//!   and Loss 2006). So no hit is found if h > 7 e abs(o - a) / sin(A); with a right angle and the scene's whole diagonal,
//!   abs(o - a) = 2 sqrt(3) L, if h > 24 e L.
//! - Triangles in one plane of the file are not quite in one plane of f32: a corner rounds by e L, an edge by 2 e L a component, and
//!   5.2 e L along the normal. Two of them are apart by twice that, 11 e L.
//!
//! Together 42 e L with Möller and Trumbore's intersector, for the triangle itself and any other in its plane. The point moves by 256 e L, or by 256 ulps of a component
//! from L / 2 on: at least 128 e L. (256 e L as well, if L is a power of two, but where a component passes one.) What is left
//! bears angles whose sine is down to 7 abs(o - a) / (110 L): a fifth for triangles that span the scene, a hundredth for those of a
//! sixth of its half width. The constants of the paper, 2^-16 below 1/32 and ulps from there on, come down to 16 e L: one ray in 300
//! met its own plane where that was made of rectangles of 100 to 1.
//!
//! The watertight intersector (see `watertight`) accepts a triangle only if the ray passes a point of it within 8 e (L + R) in each
//! of two axes, 11.4 e (L + R) in space, and if that happens no farther behind the origin than 7 e (L + R) along the largest
//! axis, sqrt(3) times as much in space: 12.2 e (L + R). A ray that climbs from the height h is no lower than h less the latter
//! there, so it meets the triangle only if h is at most 23.6 e (L + R). That is 48 e L, for the start is as good as in the scene's
//! box, whatever the angles; with the point's 7 and the planes' 11 it makes 66 e L, of the 110 that the point is moved at least.

use glam::Vec3;

use super::Inputs;

const OFFSET_ULPS: f32 = 256.0;

pub fn moved_off(inputs: &Inputs, point: Vec3, normal: Vec3) -> Vec3 {
    let near = 0.5 * inputs.frame.largest;
    let fixed_length = 2f32.powi(-16) * inputs.frame.largest;
    let moved = |point: f32, normal: f32| {
        if point.abs() < near {
            return point + fixed_length * normal;
        }
        let steps = (OFFSET_ULPS * normal) as i32;
        let bits = point.to_bits() as i32;
        // Bits of floats count away from zero.
        f32::from_bits((if point < 0.0 { bits.wrapping_sub(steps) } else { bits.wrapping_add(steps) }) as u32)
    };
    Vec3::new(moved(point.x, normal.x), moved(point.y, normal.y), moved(point.z, normal.z))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec2};
    use rayon::prelude::*;

    use super::*;
    use crate::layout::NO_HIT;
    use crate::reference::intersect::any_of_triangle;
    use crate::reference::ray::{Ray, no_hit};
    use crate::reference::slabs::slabs_of;
    use crate::reference::surface::{ambient_ray, surface_at};
    use crate::reference::testing::{Random, Scene, aimed_ray, procedural};
    use crate::reference::{Traversal, traverse};
    use crate::scene::Mesh;
    use crate::scene::condition::{Placement, place, place_corners};

    /// 2^-24.
    const E: f64 = f32::EPSILON as f64 / 2.0;

    /// A plane as a render places it.
    struct Plane {
        scene: Scene,
        normal: DVec3,
        point: DVec3,
    }

    /// `parts` x `parts` rectangles whose sides are as `ratio` to 1, turned and shifted at random.
    fn plane(random: &mut Random, parts: u32, ratio: f64, watertight: bool) -> Plane {
        let normal = random.direction().as_dvec3();
        let side = random.direction().as_dvec3().cross(normal).normalize();
        let other = normal.cross(side) * ratio;
        let shift = random.point().as_dvec3() * 10.0;
        let mut mesh = Mesh::default();
        for row in 0..=parts {
            for column in 0..=parts {
                let [x, y] = [column, row].map(|i| 2.0 * f64::from(i) / f64::from(parts) - 1.0);
                mesh.positions.push(shift + side * x + other * y);
            }
        }
        for row in 0..parts {
            for column in 0..parts {
                let corner = row * (parts + 1) + column;
                let [a, b, c, d] = [corner, corner + 1, corner + parts + 2, corner + parts + 1];
                mesh.triangles.extend([[a, b, c], [c, d, a]]);
            }
        }
        let placement = Placement::conditioned(&mesh.bounds());
        let triangles = place(&mesh, &placement);
        let ids = (0..triangles.len()).into_par_iter().map(|id| id as u32);
        let corners = place_corners(&mesh, &placement, ids);
        let scene = if watertight {
            let tree = crate::bvh::midpoint::build(&triangles);
            Scene::watertight_with(&tree, &corners, &triangles)
        } else {
            Scene::of(triangles)
        };
        Plane { scene, normal, point: placement.point(shift) }
    }

    /// Starts lie on the outer side of the true plane, as high as the bound says, and no ray from there meets the plane:
    /// one in two leaves within half a degree of it. The paper's constants lose rays where the rectangles are thin.
    #[test]
    fn no_ray_meets_the_plane_that_it_leaves() {
        let mut random = Random::new(60);
        for (parts, ratio) in [(1, 1.0), (5, 1.0), (1, 0.1), (1, 0.01), (3, 0.01)] {
            let (mut starts, mut met) = (0, 0);
            for round in 0..1200 {
                let Plane { scene, normal, point } = plane(&mut random, parts, ratio, round % 2 == 1);
                let mut inputs = scene.by(Traversal::Brute);
                inputs.choices.ulp_offset = true;
                let largest = f64::from(scene.frame.largest);
                for _ in 0..8 {
                    let target = &scene.triangles[random.below(scene.triangles.len() as u32) as usize];
                    let ray = Ray { t_max: f32::MAX, ..aimed_ray(&mut random, target) };
                    let slope = normal.dot(ray.direction.as_dvec3().normalize());
                    let (hit, _) = traverse::closest_hit(&inputs, &ray, no_hit(f32::MAX));
                    if hit.index == NO_HIT || slope.abs() < 1e-3 {
                        continue;
                    }
                    starts += 1;
                    let surface = surface_at(&inputs, &ray, &hit);
                    let height =
                        -slope.signum() * normal.dot(surface.start.as_dvec3() - point) / (E * largest);
                    assert!((110.0..530.0).contains(&height), "{height} e L over the plane at {surface:?}");
                    for i in 0..8 {
                        let u = Vec2::new(random.unit() * [1.0, 1e-4][i % 2], random.unit());
                        met += u32::from(traverse::any_hit(&inputs, &ambient_ray(&inputs, &surface, u)).0);
                    }
                }
            }
            assert!(starts > 5000, "{starts} hits");
            assert_eq!(met, 0, "rays from {starts} starts on {parts} x {parts} rectangles of 1 to {ratio}");
        }
    }

    /// The procedural scenes, thin triangles among them: no ray meets the triangle that it leaves.
    #[test]
    fn no_ray_meets_its_own_triangle() {
        let mut random = Random::new(61);
        let names = ["cornell", "maison", "arcade", "terrain", "hairball", "stadium"];
        for (name, watertight) in names.into_iter().flat_map(|name| [(name, false), (name, true)]) {
            let triangles = procedural(name, (name != "cornell" && name != "maison").then_some(3000));
            let scene = if watertight { Scene::watertight(&triangles) } else { Scene::of(triangles) };
            let mut inputs = scene.by(Traversal::Threaded);
            inputs.choices.ulp_offset = true;
            let (mut starts, mut met) = (0, 0);
            while starts < 4000 {
                let target = &scene.triangles[random.below(scene.triangles.len() as u32) as usize];
                let ray = aimed_ray(&mut random, target);
                let (hit, _) = traverse::closest_hit(&inputs, &ray, no_hit(ray.t_max));
                if hit.index == NO_HIT {
                    continue;
                }
                starts += 1;
                let surface = surface_at(&inputs, &ray, &hit);
                for i in 0..16 {
                    let u = Vec2::new(random.unit() * [1.0, 1e-4][i % 2], random.unit());
                    let ray = ambient_ray(&inputs, &surface, u);
                    met += u32::from(any_of_triangle(&inputs, &ray, &slabs_of(&ray, true), hit.index));
                }
            }
            assert_eq!(met, 0, "{name}, watertight {watertight}: rays from {starts} starts");
        }
    }

    /// By hand: ulps away from the origin and towards it, the fixed length near it, for either sign.
    #[test]
    fn components_move_by_ulps_or_by_a_length() {
        let mut scene =
            Scene::of(vec![crate::reference::testing::triangle(0, Vec3::ONE, -Vec3::X, -Vec3::Y)]);
        scene.frame.largest = 1.0;
        let moved = |x: f32, n: f32| moved_off(&scene.inputs(), Vec3::X * x, Vec3::X * n).x;
        for sign in [1.0, -1.0] {
            assert_eq!(moved(sign * 0.75, sign), sign * (0.75 + 2f32.powi(-16)));
            assert_eq!(moved(sign * 0.75, -sign), sign * (0.75 - 2f32.powi(-16)));
            assert_eq!(moved(sign * 0.75, sign * 0.5), sign * (0.75 + 2f32.powi(-17)));
            assert_eq!(moved(sign, -sign), sign * (1.0 - 2f32.powi(-16)), "below 1 ulps are half as long");
            assert_eq!(moved(sign, sign), sign * (1.0 + 2f32.powi(-15)));
            assert_eq!(moved(sign * 0.25, sign * 0.5), sign * (0.25 + 2f32.powi(-17)));
            assert_eq!(moved(0.0, sign), sign * 2f32.powi(-16));
        }
    }
}
