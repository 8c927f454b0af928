//! Ray against axis-aligned box. Twin of shaders/shared/slabs.glsl.

use glam::Vec3;

use super::arith::{max3, min3, reciprocal};
use super::ray::Ray;

/// What the slab test needs of a ray, once a ray.
#[derive(Clone, Copy, Debug)]
pub struct Slabs {
    pub origin: Vec3,
    pub inverse: Vec3,
    /// Whether exits are pushed back by [`EXIT_SLACK`].
    pub robust: bool,
}

/// Smallest direction component that robust slabs divide by, 2^-100.
pub const SMALLEST_COMPONENT: f32 = 7.888_609e-31;

/// 1 + 2 gamma(7), rounded up: exit distances grow by the error that both distances may have (Ize 2013
/// has gamma(3) for a correctly rounded division; ours may be off by 2 ulp).
pub const EXIT_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;

/// Keeps the sign of d but not a size below [`SMALLEST_COMPONENT`]; both zeros become positive.
pub fn at_least_smallest(d: f32) -> f32 {
    let size = d.abs().max(SMALLEST_COMPONENT);
    if d < 0.0 { -size } else { size }
}

fn inverse_component(d: f32) -> f32 {
    let inverse = reciprocal(at_least_smallest(d).abs());
    if d < 0.0 { -inverse } else { inverse }
}

pub fn slabs_of(ray: &Ray, robust: bool) -> Slabs {
    let d = ray.direction;
    let inverse = if robust {
        Vec3::new(inverse_component(d.x), inverse_component(d.y), inverse_component(d.z))
    } else {
        1.0 / d
    };
    Slabs { origin: ray.origin, inverse, robust }
}

/// Where the ray enters the box and leaves it, in units of the direction. Every operation is monotonic in
/// the bounds, so a box inside another is never entered earlier nor left later.
pub fn slab_interval(slabs: &Slabs, pmin: Vec3, pmax: Vec3) -> [f32; 2] {
    let t0 = (pmin - slabs.origin) * slabs.inverse;
    let t1 = (pmax - slabs.origin) * slabs.inverse;
    let near = min3(t0, t1);
    let far = max3(t0, t1);
    let enter = near.x.max(near.y).max(near.z);
    let mut leave = far.x.min(far.y).min(far.z);
    if slabs.robust {
        leave *= EXIT_SLACK;
    }
    [enter, leave]
}

pub fn meets_box(slabs: &Slabs, pmin: Vec3, pmax: Vec3, t_max: f32) -> bool {
    let [enter, leave] = slab_interval(slabs, pmin, pmax);
    enter.max(0.0) <= leave.min(t_max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::testing::Random;

    fn component(random: &mut Random) -> f32 {
        match random.below(8) {
            0 => 0.0,
            1 => -0.0,
            2 => random.signed() * 1e-32,
            3 => random.signed() * 1e-6,
            4 => 1.0,
            _ => random.signed(),
        }
    }

    #[test]
    fn intervals_of_nested_boxes_are_nested() {
        let mut random = Random::new(6);
        for _ in 0..300_000 {
            // Coordinates of a coarse grid, so that boxes share faces, are flat, and hold the origin on
            // a face; and of a fine one.
            let steps = if random.below(2) == 0 { 4.0 } else { 1e6 };
            let mut point = || {
                Vec3::new(random.signed(), random.signed(), random.signed())
                    .map(|c| (c * steps).round() / steps)
            };
            let corners = [point(), point(), point(), point()];
            let origin = point();
            let inner = (min3(corners[0], corners[1]), max3(corners[0], corners[1]));
            let outer =
                (min3(inner.0, min3(corners[2], corners[3])), max3(inner.1, max3(corners[2], corners[3])));
            let direction = Vec3::new(component(&mut random), component(&mut random), component(&mut random));
            let slabs = slabs_of(&Ray { origin, direction, t_max: 1.0 }, true);
            let [enter, leave] = slab_interval(&slabs, outer.0, outer.1);
            let [later, sooner] = slab_interval(&slabs, inner.0, inner.1);
            assert!(enter <= later && sooner <= leave, "{origin} {direction} {inner:?} {outer:?}");
            let met = meets_box(&slabs, inner.0, inner.1, 1.0);
            assert!(!met || meets_box(&slabs, outer.0, outer.1, 1.0));
        }
    }

    #[test]
    fn meets_what_lies_ahead_and_within_reach() {
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::X * 2.0, t_max: 1.0 };
        for robust in [false, true] {
            let slabs = slabs_of(&ray, robust);
            let meets = |x: f32, t_max| {
                let center = Vec3::X * x;
                meets_box(&slabs, center - 0.5, center + 0.5, t_max)
            };
            assert!(meets(2.0, 1.0) && meets(0.0, 1.0), "ahead, around");
            assert!(!meets(-2.0, 1.0) && !meets(2.0, 0.7), "behind, out of reach");
            assert!(!meets_box(&slabs, Vec3::new(1.0, 1.0, -1.0), Vec3::splat(2.0), 9.0), "beside");
        }
    }

    #[test]
    fn a_ray_in_a_face_is_inside_a_padded_box() {
        let ray = Ray { origin: Vec3::new(-2.0, 1.0, 0.0), direction: Vec3::X, t_max: 9.0 };
        let slabs = slabs_of(&ray, true);
        let pad = 2f32.powi(-21);
        assert!(meets_box(&slabs, Vec3::NEG_ONE - pad, Vec3::ONE + pad, 9.0));
        assert!(!meets_box(&slabs, Vec3::NEG_ONE, Vec3::ONE, 9.0), "it is the pad that takes it in");
    }

    #[test]
    fn the_constants_are_the_shaders() {
        assert_eq!(SMALLEST_COMPONENT, 2f32.powi(-100));
        assert_eq!(Ok(EXIT_SLACK), "1.0000009".parse());
        let gamma7 = 7.0 * 2f64.powi(-24) / (1.0 - 7.0 * 2f64.powi(-24));
        assert!(f64::from(EXIT_SLACK) >= 1.0 + 2.0 * gamma7);
    }
}
