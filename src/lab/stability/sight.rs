//! What the pixels of a camera truly see: f64 brute force on the triangles of the file, which shares nothing with what a
//! device is given.

use glam::DVec3;
use rayon::prelude::*;

use super::Case;
use crate::render::picture::Picture;
use crate::scene::camera::{Camera, RayFan, RayModel};
use crate::scene::condition::Placement;
use crate::scene::{Mesh, Scene};

/// What the ray through a pixel's centre meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sight {
    Nothing,
    /// A surface that gets this much light.
    Surface(f64),
    /// It passes an edge, or a surface at the eye, within the rounding of 32-bit floats.
    Doubtful,
}

/// A difference of light that is no noise with 128 or more samples a pixel: the largest that some 10,000 pixels showed is
/// 0.06, and 0.003 with 4,096 samples.
pub(super) const SEEN: f64 = 0.1;

/// How far rays are moved to tell whether rounding may decide, pixels.
const ASIDE: f64 = 1e-3;
/// Rounding of a direction, in parts of its length: some ulps of a 32-bit float.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;
/// A surface nearer than this part of the scene's size may lie on either side of a rounded eye.
const AT_THE_EYE: f64 = 1e-6;
/// Ambient rays start off their surface by this part of the scene's size.
const OFF: f64 = 1e-9;
/// Planes at a smaller sine to a ray are parallel to it.
const PARALLEL: f64 = 1e-14;

/// Triangles in the units of the file.
struct Exact {
    triangles: Vec<[DVec3; 3]>,
    size: f64,
}

impl Exact {
    fn of(mesh: &Mesh, size: f64) -> Self {
        let corners = |triangle: &[u32; 3]| triangle.map(|index| mesh.positions[index as usize]);
        Self { triangles: mesh.triangles.iter().map(corners).collect(), size }
    }

    /// Where the ray's line meets a triangle, in units of `direction` (Möller and Trumbore 1997).
    fn meeting(&self, place: usize, origin: DVec3, direction: DVec3) -> Option<f64> {
        let [a, b, c] = self.triangles[place];
        let (ab, ac, s) = (b - a, c - a, origin - a);
        let (p, q) = (direction.cross(ac), s.cross(ab));
        let det = ab.dot(p);
        let (u, v) = (s.dot(p) / det, direction.dot(q) / det);
        let parallel = det.abs() <= PARALLEL * ab.length() * ac.length() * direction.length();
        (!parallel && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q) / det)
    }

    /// The nearest triangle, or `None` where nothing is met; an error where one lies at the eye.
    fn nearest(&self, origin: DVec3, direction: DVec3) -> Result<Option<(usize, f64)>, ()> {
        let mut nearest: Option<(usize, f64)> = None;
        let at_the_eye = AT_THE_EYE * self.size / direction.length();
        for place in 0..self.triangles.len() {
            let Some(t) = self.meeting(place, origin, direction) else { continue };
            // Exactly at the eye is no rounding: what contains the eye is not before it.
            if t != 0.0 && t.abs() < at_the_eye {
                return Err(());
            }
            if t > 0.0 && nearest.is_none_or(|(_, known)| t < known) {
                nearest = Some((place, t));
            }
        }
        Ok(nearest)
    }

    fn hidden(&self, origin: DVec3, direction: DVec3) -> bool {
        (0..self.triangles.len()).any(|place| self.meeting(place, origin, direction).is_some_and(|t| t > 0.0))
    }

    /// Light at a point of a triangle that is seen along `direction`, by so many directions from an additive recurrence in two
    /// dimensions (Roberts 2018), which lines up with no edge.
    fn light(&self, place: usize, point: DVec3, direction: DVec3, rays: u32) -> f64 {
        let [a, b, c] = self.triangles[place];
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let origin = point + normal * (OFF * self.size);
        let escapes = |number: u32| {
            let [u, v] = STEPS.map(|step| (0.5 + step * f64::from(number)).fract());
            let (sine, angle) = (u.sqrt(), v * std::f64::consts::TAU);
            let across = tangent * angle.cos() + bitangent * angle.sin();
            !self.hidden(origin, across * sine + normal * (1.0 - u).sqrt())
        };
        (0..rays).filter(|&number| escapes(number)).count() as f64 / f64::from(rays)
    }
}

/// 1 / g and 1 / g^2 of the real g with g^3 = g + 1.
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// What each pixel sees, row by row from the top, with the light of so many ambient rays.
pub(super) fn sights(scene: &Scene, camera: &Camera, size: (u32, u32), rays: u32) -> Vec<Sight> {
    let exact = Exact::of(&scene.mesh, scene.bounds.diagonal());
    let fan = camera.rays(&scene.bounds, &Placement::IDENTITY, size, RayModel::Eye);
    let step = fan.direction[1].length().min(fan.direction[2].length());
    let aside = ASIDE + ROUNDING * fan.direction[0].length() / step;
    let of = |number: usize| {
        let (x, y) = (number as u32 % size.0, number as u32 / size.0);
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let nearest = |x, y| {
            let [origin, direction] = ray(&fan, x, y);
            exact.nearest(origin, direction)
        };
        let Ok(centre) = nearest(x, y) else { return Sight::Doubtful };
        let same = |(dx, dy): (f64, f64)| {
            nearest(x + dx * aside, y + dy * aside)
                .is_ok_and(|other| other.map(|(place, _)| place) == centre.map(|(place, _)| place))
        };
        if ![(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)].into_iter().all(same) {
            return Sight::Doubtful;
        }
        let Some((place, t)) = centre else { return Sight::Nothing };
        let [origin, direction] = ray(&fan, x, y);
        Sight::Surface(exact.light(place, origin + direction * t, direction, rays))
    };
    (0..size.0 as usize * size.1 as usize).into_par_iter().map(of).collect()
}

fn ray(fan: &RayFan, x: f64, y: f64) -> [DVec3; 2] {
    [fan.origin, fan.direction].map(|[corner, dx, dy]| corner + dx * x + dy * y)
}

/// A picture against what its pixels see: a case whose trials are the pixels without doubt, and which pixels fail.
pub(super) fn judge(case: &str, picture: &Picture, sights: &[Sight]) -> (Case, Vec<bool>) {
    let (mut trials, mut worst) = (0, 0f64);
    let mut fails = vec![false; sights.len()];
    for (place, sight) in sights.iter().enumerate() {
        let (light, covered) = (f64::from(picture.light[place]), picture.coverage[place] > 0.0);
        let (truth, surface) = match *sight {
            Sight::Doubtful => continue,
            Sight::Nothing => (0.0, false),
            Sight::Surface(light) => (light, true),
        };
        trials += 1;
        let apart = (light - truth).abs();
        // A NaN is as far off as can be.
        let apart = if apart.is_nan() { 1.0 } else { apart };
        worst = worst.max(apart);
        fails[place] = covered != surface || apart > SEEN;
    }
    let failures = fails.iter().filter(|fails| **fails).count() as u64;
    let doubtful = sights.len() as u64 - trials;
    let case = Case {
        case: case.into(),
        trials,
        failures,
        worst: Some(worst),
        note: (doubtful > 0).then(|| format!("{doubtful} pixels within rounding are not judged")),
        ..Case::default()
    };
    (case, fails)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scenes::scene_of;
    use crate::lab::stability::shapes::{Shapes, faces};

    fn room() -> Scene {
        let mut shapes = Shapes::default();
        // Without its front, which is the last face.
        faces([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]).iter().take(5).for_each(|face| shapes.inner_quad(*face));
        scene_of("room", shapes.mesh())
    }

    const FRONT: Camera =
        Camera::Pinhole { eye: [0.0, 1.0, 9.0], target: [0.0, 1.0, 0.0], up: [0.0, 1.0, 0.0], fov: 20.0 };

    /// The middle of the back wall of a cube sees the missing front by the form factor of a square from a point two
    /// half-sides before its centre (Lambert 1760): 4 / pi times X / sqrt(1 + X^2) atan(X / sqrt(1 + X^2)), X = 1 / 2.
    #[test]
    fn a_back_wall_gets_the_light_of_the_missing_front() {
        let size = (33, 33);
        let all = sights(&room(), &FRONT, size, 4096);
        let slope = 0.5 / 1.25f64.sqrt();
        let truth = 4.0 / std::f64::consts::PI * slope * slope.atan();
        let near: Vec<f64> = [16 * 33 + 15, 17 * 33 + 14, 15 * 33 + 18]
            .iter()
            .filter_map(|&pixel| if let Sight::Surface(light) = all[pixel] { Some(light) } else { None })
            .collect();
        assert!(!near.is_empty());
        assert!(near.iter().all(|light| (light - truth).abs() < 0.02), "{near:?}, exactly {truth}");
        assert_eq!(all[0], Sight::Nothing);
    }

    #[test]
    fn edges_are_doubtful_and_nothing_else() {
        let all = sights(&room(), &FRONT, (66, 66), 1);
        let doubtful = all.iter().filter(|sight| **sight == Sight::Doubtful).count();
        // The diagonals of the faces pass through the centres of pixels; of all others few.
        assert!(doubtful <= 2 * 66, "{doubtful}");
        let picture = |light: f32, coverage: f32| Picture {
            width: 66,
            height: 66,
            light: vec![light; 66 * 66],
            coverage: vec![coverage; 66 * 66],
        };
        let surfaces = all.iter().filter(|sight| matches!(sight, Sight::Surface(_))).count() as u64;
        let nothing = all.iter().filter(|sight| **sight == Sight::Nothing).count() as u64;
        assert!(surfaces > 1000 && nothing > 500, "{surfaces} and {nothing}");
        let (empty, fails) = judge("empty", &picture(0.0, 0.0), &all);
        assert_eq!((empty.trials, empty.failures), (surfaces + nothing, surfaces));
        assert_eq!(fails.iter().filter(|fails| **fails).count() as u64, surfaces);
        let (full, _) = judge("all white", &picture(1.0, 1.0), &all);
        assert!(full.failures >= nothing && full.worst == Some(1.0), "{full:?}");
        let (broken, _) = judge("NaN", &picture(f32::NAN, 1.0), &all);
        assert_eq!((broken.failures, broken.worst), (broken.trials, Some(1.0)));
    }

    /// An eye in the plane of a face, exactly: it is not seen, and that is certain.
    #[test]
    fn what_contains_the_eye_is_not_seen() {
        let mut shapes = Shapes::default();
        shapes.outer_box([-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]);
        let scene = scene_of("box", shapes.mesh());
        let camera = Camera::Pinhole {
            eye: [0.25, 1.0, 0.5],
            target: [0.25, 9.0, 0.5],
            up: [0.0, 0.0, 1.0],
            fov: 60.0,
        };
        assert!(sights(&scene, &camera, (8, 8), 1).iter().all(|sight| *sight == Sight::Nothing));
    }
}
