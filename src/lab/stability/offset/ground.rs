//! Points that a camera sees, and what rays from there meet: in f64, over the numbers of the file, and only where an answer
//! does not hang on a rounding.

use glam::DVec3;
use rayon::prelude::*;

use crate::render::seeds::hash;
use crate::scene::camera::{Camera, RayModel};
use crate::scene::condition::Placement;
use crate::scene::{Mesh, Scene};

/// By how much a start may be moved without turning a certain answer, in widths of the scene: eight times the way that `ulp`
/// moves it, a third of the way of `scaled`.
const NUDGE: f64 = 1.0 / 16384.0;
/// The same for each corner of a triangle by itself: some roundings of an f32.
const GRAIN: f64 = 1.0 / 1_048_576.0;
/// What lies no higher than this over a plane lies in it, widths of the scene.
const IN_PLANE: f64 = 1e-9;

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// The pixel that sees it, row by row.
    pub pixel: u32,
    /// Place in the file.
    pub triangle: u32,
    /// Barycentric coordinates of the second and third corner.
    pub uv: [f32; 2],
    point: DVec3,
    /// Of unit length, on the side of the eye.
    normal: DVec3,
}

struct Facet {
    corners: [DVec3; 3],
    /// Of unit length.
    normal: DVec3,
    /// Longest edge, and the height over it.
    length: f64,
    height: f64,
}

/// A scene in f64.
pub struct Ground {
    facets: Vec<Facet>,
    width: f64,
}

impl Ground {
    pub fn new(mesh: &Mesh) -> Self {
        let bounds = mesh.bounds();
        let facet = |triangle: &[u32; 3]| {
            let corners = triangle.map(|corner| mesh.positions[corner as usize]);
            let [a, b, c] = corners;
            let cross = (b - a).cross(c - a);
            let length = (b - a).length().max((c - b).length()).max((a - c).length());
            Facet { corners, normal: cross.normalize_or_zero(), length, height: cross.length() / length }
        };
        Self {
            facets: mesh.triangles.iter().map(facet).collect(),
            width: (bounds.max - bounds.min).max_element(),
        }
    }

    /// What the pixels' camera rays hit, those that hit something.
    pub fn starts(&self, scene: &Scene, camera: &Camera, size: (u32, u32)) -> Vec<Start> {
        let fan = camera.rays(&scene.bounds, &Placement::IDENTITY, size, RayModel::Eye);
        let at = |parts: &[DVec3; 3], x: f64, y: f64| parts[0] + parts[1] * x + parts[2] * y;
        let start = |pixel: u32| {
            let [x, y] = [pixel % size.0, pixel / size.0].map(|i| f64::from(i) + fan.pixel_shift);
            self.seen(pixel, at(&fan.origin, x, y), at(&fan.direction, x, y))
        };
        (0..size.0 * size.1).into_par_iter().filter_map(start).collect()
    }

    fn seen(&self, pixel: u32, origin: DVec3, direction: DVec3) -> Option<Start> {
        let mut nearest: Option<(f64, Start)> = None;
        for (place, facet) in self.facets.iter().enumerate() {
            let [a, b, c] = facet.corners;
            let (ab, ac, s) = (b - a, c - a, origin - a);
            let p = direction.cross(ac);
            let (det, q) = (ab.dot(p), s.cross(ab));
            let [u, v, t] = [s.dot(p), direction.dot(q), ac.dot(q)].map(|numerator| numerator / det);
            let known = nearest.map_or(f64::INFINITY, |(t, _)| t);
            if det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < known {
                // The point is that of the coordinates as the device gets them.
                let uv = [u as f32, v as f32];
                let point = a + ab * f64::from(uv[0]) + ac * f64::from(uv[1]);
                let normal = facet.normal * -facet.normal.dot(direction).signum();
                nearest = Some((t, Start { pixel, triangle: place as u32, uv, point, normal }));
            }
        }
        nearest.map(|(_, start)| start)
    }

    /// Whether a ray from a start meets anything; `None` if that may hang on a rounding.
    pub fn meets(&self, start: &Start, direction: DVec3) -> Option<bool> {
        let mut sure = true;
        for facet in &self.facets {
            match self.meets_facet(start, direction, facet) {
                Some(true) => return Some(true),
                Some(false) => {}
                None => sure = false,
            }
        }
        sure.then_some(false)
    }

    /// The direction has unit length.
    fn meets_facet(&self, start: &Start, direction: DVec3, facet: &Facet) -> Option<bool> {
        let (nudge, grain) = (NUDGE * self.width, GRAIN * self.width);
        let corners = facet.corners.map(|corner| corner - start.point);
        let behind = corners.iter().all(|corner| corner.dot(direction) < -nudge - grain);
        let under = corners.iter().all(|corner| corner.dot(start.normal) <= IN_PLANE * self.width);
        if behind || under {
            return Some(false);
        }
        let [a, b, c] = corners;
        // Volumes over the edges, and what they may be off by: 1 inside, -1 outside, seen from either side.
        let side = |p: DVec3, q: DVec3| {
            let volume = direction.dot(p.cross(q));
            let error = (q - p).length() * nudge + (p.length() + q.length()) * grain;
            if volume.abs() > error { volume.signum() } else { 0.0 }
        };
        let sides = [side(b, c), side(c, a), side(a, b)];
        if sides.contains(&1.0) && sides.contains(&-1.0) {
            return Some(false);
        }
        let tilt = grain / facet.height;
        let (height, slope) = (facet.normal.dot(a), facet.normal.dot(direction));
        let off = nudge + grain + tilt * (a.length() + facet.length);
        if height.abs() <= off || slope.abs() <= 4.0 * tilt {
            return None;
        }
        if height.signum() != slope.signum() {
            return Some(false);
        }
        (!sides.contains(&0.0)).then_some(true)
    }
}

/// A direction with density cos(theta) / pi about the start's normal, as 32-bit floats hold it.
pub fn direction_from(start: &Start, seed: u32, number: u32) -> DVec3 {
    let unit =
        |dimension| (f64::from(hash(hash(start.pixel, 2 * number + dimension), seed)) + 0.5) / 2f64.powi(32);
    let (square, turn) = (unit(0), unit(1) * std::f64::consts::TAU);
    let tangent = start.normal.any_orthonormal_vector();
    let around = tangent * turn.cos() + start.normal.cross(tangent) * turn.sin();
    (around * (1.0 - square).sqrt() + start.normal * square.sqrt()).as_vec3().as_dvec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scenes::{procedural, scene_of};

    /// In the Cornell box: straight up from the floor is the ceiling, out through the open side nothing, and towards an edge
    /// nobody knows.
    #[test]
    fn certain_answers_are_right_and_doubtful_ones_are_none() {
        let scene = procedural("cornell", None, 0).unwrap();
        let ground = Ground::new(&scene.mesh);
        let floor = ground.seen(0, DVec3::new(0.8, 1.0, 0.9), DVec3::NEG_Y).unwrap();
        assert!(floor.point.y.abs() < 1e-9 && floor.normal.dot(DVec3::Y) > 0.999);
        assert_eq!(ground.meets(&floor, DVec3::Y), Some(true));
        assert_eq!(ground.meets(&floor, DVec3::Z), Some(false));
        let edge = DVec3::new(0.0, scene.bounds.max.y, scene.bounds.max.z);
        assert_eq!(ground.meets(&floor, (edge - floor.point).normalize()), None);
    }

    /// From a plane nothing is met, from within a box everything is, and cosines average two thirds.
    #[test]
    fn planes_are_open_and_boxes_are_shut() {
        let [plane, closed] = [super::super::scenes::plane(), super::super::scenes::closed_box()];
        for (mesh, camera, shut) in
            [(plane, Camera::default_for("plane"), false), (closed, super::super::scenes::INSIDE, true)]
        {
            let scene = scene_of("of one kind", mesh);
            let ground = Ground::new(&scene.mesh);
            let starts = ground.starts(&scene, &camera, (32, 20));
            let (mut known, mut cosines) = (0, 0.0);
            for start in &starts {
                for number in 0..16 {
                    let direction = direction_from(start, 1, number);
                    cosines += direction.dot(start.normal);
                    let answer = ground.meets(start, direction);
                    assert_ne!(answer, Some(!shut), "{start:?} {direction}");
                    known += usize::from(answer.is_some());
                }
            }
            let rays = 16 * starts.len();
            assert!(starts.len() > 30 && known > rays * 9 / 10, "{known} of {rays}");
            assert!((cosines / rays as f64 - 2.0 / 3.0).abs() < 0.01);
        }
    }
}
