//! Ray against triangle without leaks between neighbours: Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection"
//! (2013). Twin of shaders/shared/watertight.glsl.

use glam::{Vec2, Vec3, Vec3Swizzles};

use super::arith::{SMALLEST_DETERMINANT, reciprocal};
use super::ray::Ray;
use crate::layout::Corners;

/// The ray's largest axis (0 to 2), and what takes its direction to (0, 0, 1) from there.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    axis: u32,
    by: Vec3,
}

/// The two axes after the given one, and it.
fn turned(v: Vec3, axis: u32) -> Vec3 {
    match axis {
        0 => v.yzx(),
        1 => v.zxy(),
        _ => v,
    }
}

pub fn shear_of(direction: Vec3) -> Shear {
    let size = direction.abs();
    let axis = if size.x > size.y {
        if size.x > size.z { 0 } else { 2 }
    } else if size.y > size.z {
        1
    } else {
        2
    };
    let d = turned(direction, axis);
    let along = if d.z.abs() > 0.0 { reciprocal(d.z.abs()) } else { 0.0 };
    let along = if d.z < 0.0 { -along } else { along };
    Shear { axis, by: Vec3::new(d.x * along, d.y * along, along) }
}

fn sheared(corner: Vec3, origin: Vec3, shear: &Shear) -> Vec3 {
    let v = turned(corner - origin, shear.axis);
    Vec3::new(v.x - shear.by.x * v.z, v.y - shear.by.y * v.z, v.z)
}

/// a b = product + error, exactly, while neither over- nor underflows: Dekker, "A Floating-Point Technique for Extending
/// the Available Precision" (1971).
fn error_of_product(a: f32, b: f32, product: f32) -> f32 {
    let (big_a, big_b) = (a * 4097.0, b * 4097.0);
    let (high_a, high_b) = (big_a - (big_a - a), big_b - (big_b - b));
    let (low_a, low_b) = (a - high_a, b - high_b);
    ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b
}

/// Twice the area of the triangle (0, p, q), with an exact sign.
fn edge_side(p: Vec2, q: Vec2) -> f32 {
    let (left, right) = (p.x * q.y, p.y * q.x);
    let side = left - right;
    if side == 0.0 { error_of_product(p.x, q.y, left) - error_of_product(p.y, q.x, right) } else { side }
}

/// [det, t det, u det, v det] of a hit: the distance in units of the direction, and barycentric coordinates of the second
/// and third corner.
pub fn meets_watertight(ray: &Ray, corners: &Corners) -> Option<[f32; 4]> {
    let shear = shear_of(ray.direction);
    let [a, b, c] =
        [corners.a, corners.b, corners.c].map(|corner| sheared(corner.into(), ray.origin, &shear));
    let u = edge_side(c.xy(), b.xy());
    let v = edge_side(a.xy(), c.xy());
    let w = edge_side(b.xy(), a.xy());
    if u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0 {
        return None;
    }
    let sum = u + v + w;
    let along = u * a.z + v * b.z + w * c.z;
    let t = along * shear.by.z;
    let side = if sum < 0.0 { -1.0 } else { 1.0 };
    let det = sum.abs();
    (det > SMALLEST_DETERMINANT && side * t > 0.0).then_some([det, side * t, side * v, side * w])
}
