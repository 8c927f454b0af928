//! The surface point that a camera ray met, and the ambient rays that start there. Twin of
//! shaders/shared/surface.glsl.

use crate::layout::Triangle;
use glam::{Vec2, Vec3};

use super::Inputs;
use super::arith::{cross3, dot3, max_abs, reciprocal};
use super::offset::moved_off;
use super::ray::{Hit, Ray};
use super::sampling::{basis_of, cosine_direction, normalized};

/// Where ambient rays start, and the basis they are drawn in.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub start: Vec3,
    pub normal: Vec3,
    pub tangent: Vec3,
    pub bitangent: Vec3,
}

/// The unit normal of a triangle as it is wound; not finite where its area is lost to rounding.
pub fn normal_of(triangle: &Triangle) -> Vec3 {
    let (ab, ac) = (Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let scale = reciprocal(max_abs(ab).max(max_abs(ac)));
    normalized(cross3(ab * scale, ac * scale))
}

/// Barycentric coordinates place the point on the triangle. The normal faces the camera ray (the
/// original's does not turn).
pub fn surface_at(inputs: &Inputs, ray: &Ray, hit: &Hit) -> Surface {
    let triangle = inputs.load_triangle(hit.index);
    let (a, ab, ac) = (Vec3::from(triangle.a), Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let point = a + hit.u * ab + hit.v * ac;
    let mut normal = normal_of(triangle);
    if inputs.choices.facing && dot3(normal, ray.direction) > 0.0 {
        normal = -normal;
    }
    let start = match inputs.choices.ulp_offset {
        true => moved_off(inputs, point, normal),
        false => point + inputs.frame.offset * normal,
    };
    let (tangent, bitangent) = basis_of(normal);
    Surface { start, normal, tangent, bitangent }
}

/// Where a camera ray met nothing the original still traced ambient rays, from nowhere.
pub fn surface_nowhere() -> Surface {
    Surface { start: Vec3::NAN, normal: Vec3::NAN, tangent: Vec3::NAN, bitangent: Vec3::NAN }
}

/// An ambient ray for the random numbers u in [0, 1]^2.
pub fn ambient_ray(inputs: &Inputs, surface: &Surface, u: Vec2) -> Ray {
    let direction = cosine_direction(u, surface.normal, surface.tangent, surface.bitangent);
    Ray { origin: surface.start, direction, t_max: inputs.frame.ambient_t_max }
}

/// The original's weight of an escaped ray: max(0, n.w) / (pi pdf) with pdf = cos(theta) / pi. Its square
/// root, divisions and dot product are the driver's: only this twin rounds each of them correctly.
pub fn original_weight(surface: &Surface, direction: Vec3, u: Vec2) -> f32 {
    const PI: f32 = std::f32::consts::PI;
    let pdf = u.x.sqrt() / PI;
    0f32.max(dot3(surface.normal, direction)) / (PI * pdf)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::testing::{Random, Scene, soup};

    #[test]
    fn the_point_lies_off_the_surface_on_the_side_that_is_seen() {
        let mut scene = Scene::of(soup(7, 50, 1.0));
        scene.frame.offset = 1e-3;
        let mut random = Random::new(8);
        for index in 0..50 {
            for original in [false, true] {
                let inputs = Inputs { choices: scene.choices(original), ..scene.inputs() };
                let triangle = inputs.load_triangle(index);
                let hit = Hit { t: 1.0, u: 0.25, v: 0.5, index, id: triangle.id };
                let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(|v| Vec3::from(v).as_dvec3());
                let direction = random.direction();
                let ray = Ray { origin: Vec3::ZERO, direction, t_max: 1.0 };
                let surface = surface_at(&inputs, &ray, &hit);
                let mut normal = ab.cross(ac).normalize();
                if !original && normal.dot(direction.as_dvec3()) > 0.0 {
                    normal = -normal;
                }
                assert!((surface.normal.as_dvec3() - normal).length() < 1e-5, "{triangle:?}");
                let expected = a + 0.25 * ab + 0.5 * ac + 1e-3 * normal;
                assert!((surface.start.as_dvec3() - expected).length() < 1e-6);
            }
        }
    }

    #[test]
    fn the_originals_weight_is_one_up_to_rounding() {
        let mut random = Random::new(9);
        for _ in 0..1000 {
            let normal = random.direction();
            let (tangent, bitangent) = basis_of(normal);
            let surface = Surface { start: Vec3::ZERO, normal, tangent, bitangent };
            let u = Vec2::new(random.unit().max(1e-3), random.unit());
            let weight = original_weight(&surface, cosine_direction(u, normal, tangent, bitangent), u);
            assert!((weight - 1.0).abs() < 1e-4, "{weight} at {u}");
        }
        let flat = Surface { normal: Vec3::Z, ..surface_nowhere() };
        assert!(original_weight(&flat, Vec3::X, Vec2::ZERO).is_nan(), "0 / 0 at u1 = 0");
    }
}
