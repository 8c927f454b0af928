//! Directions of ambient rays. Twin of shaders/shared/sampling.glsl.

use glam::{Vec2, Vec3};

use super::arith::{cos_sin_turn, dot3, max_abs, reciprocal, reciprocal_sqrt};

/// A unit vector along v; v must not be zero.
pub fn normalized(v: Vec3) -> Vec3 {
    let largest = max_abs(v);
    let scaled = v * reciprocal(largest);
    scaled * reciprocal_sqrt(dot3(scaled, scaled))
}

/// Tangent and bitangent that complete n to an orthonormal basis: Duff et al., "Building an Orthonormal
/// Basis, Revisited" (2017).
pub fn basis_of(n: Vec3) -> (Vec3, Vec3) {
    let side = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -side * reciprocal(1.0 + n.z.abs());
    let b = n.x * n.y * a;
    let first = Vec3::new(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    let second = Vec3::new(b, side + n.y * n.y * a, -n.y);
    (first, second)
}

/// A direction with density cos(theta) / pi about n (Malley's method); u in [0, 1]^2.
pub fn cosine_direction(u: Vec2, n: Vec3, tangent: Vec3, bitangent: Vec3) -> Vec3 {
    let rest = 1.0 - u.x;
    let cos_theta = u.x * reciprocal_sqrt(u.x);
    let sin_theta = rest * reciprocal_sqrt(rest);
    let turn = cos_sin_turn(u.y);
    (sin_theta * turn.x) * tangent + (sin_theta * turn.y) * bitangent + cos_theta * n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::testing::Random;

    fn normals() -> Vec<Vec3> {
        let mut random = Random::new(4);
        let mut normals: Vec<Vec3> = (0..100_000).map(|_| random.direction()).collect();
        for sign in [1.0, -1.0] {
            normals.extend([Vec3::X * sign, Vec3::Y * sign, Vec3::Z * sign]);
            normals.push(Vec3::new(0.6, 0.8 * sign, -0.0));
            normals.push(normalized(Vec3::new(1e-4, -2e-5, sign)));
            normals.push(normalized(Vec3::new(1.0, sign, -1e-7)));
        }
        normals
    }

    #[test]
    fn normalized_has_unit_length_at_any_size() {
        let mut worst = 0f64;
        for (i, n) in normals().into_iter().enumerate() {
            let v = normalized(n * 2f32.powi(i as i32 % 200 - 100)).as_dvec3();
            worst = worst.max((v.length() - 1.0).abs()).max((v - n.as_dvec3().normalize()).length());
        }
        println!("normalized: {worst:e}");
        assert!(worst < 4e-7, "{worst:e}");
    }

    #[test]
    fn basis_is_orthonormal_within_1e_6() {
        let mut worst = 0f64;
        for n in normals() {
            let (tangent, bitangent) = basis_of(n);
            let [n, t, b] = [n, tangent, bitangent].map(|v| v.as_dvec3());
            for deviation in [t.dot(n), b.dot(n), t.dot(b), t.length() - 1.0, b.length() - 1.0] {
                worst = worst.max(deviation.abs());
            }
            assert!(t.cross(b).dot(n) > 0.0, "left-handed basis of {n}");
        }
        println!("basis_of: {worst:e}");
        assert!(worst < 1e-6, "{worst:e}");
    }

    #[test]
    fn cosine_directions_have_mean_cosine_two_thirds() {
        let mut random = Random::new(5);
        let (mut sum, count) = (0f64, 1_000_000);
        let (mut least, mut longest) = (f64::INFINITY, 0f64);
        for i in 0..count {
            let n = if i % 1000 == 0 { Vec3::Z } else { random.direction() };
            let (tangent, bitangent) = basis_of(n);
            let u = Vec2::new(random.unit(), random.unit());
            let direction = cosine_direction(u, n, tangent, bitangent).as_dvec3();
            let cosine = direction.dot(n.as_dvec3());
            sum += cosine;
            least = least.min(cosine);
            longest = longest.max((direction.length() - 1.0).abs());
        }
        let standard_error = (1.0 / 18.0 / f64::from(count)).sqrt();
        println!("mean {}, least {least:e}, length off by {longest:e}", sum / f64::from(count));
        assert!((sum / f64::from(count) - 2.0 / 3.0).abs() < 4.0 * standard_error);
        assert!(least > -1e-6 && longest < 1e-6, "{least:e} {longest:e}");
    }

    #[test]
    fn ends_of_the_unit_square_give_finite_directions() {
        for u in [Vec2::ZERO, Vec2::ONE, Vec2::X, Vec2::Y] {
            let direction = cosine_direction(u, Vec3::Z, Vec3::X, Vec3::Y);
            assert!((direction.length() - 1.0).abs() < 1e-6, "{u}: {direction}");
        }
    }
}
