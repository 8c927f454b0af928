//! Ray against triangle without leaks between neighbours: Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection"
//! (2013). Twin of shaders/shared/watertight.glsl.
//!
//! # What is exact
//! Corners are sheared into the ray's axes, where it starts at 0 and runs along z, each corner by itself: rounding moves it, but
//! to the same place for all triangles that share it. From there on every decision is exact: on which side of an edge
//! the ray passes, and so whether 0 lies in the sheared triangle, edges and corners included. What is met is a mesh of moved
//! corners, closed if the scene's is. (An edge that the ray is taken to pass counts as inside on both sides, so no
//! rounding to zero could open a gap either; it would only add hits beside the triangle.)
//!
//! # What is not
//! Let e = 2^-24, L the largest coordinate of the scene, R that of the ray's origin o, d its direction, largest along z. A corner c
//! is sheared to x = (c - o)_x - s (c - o)_z with s = d_x / d_z, at most 1. Rounded are both differences (e (L + R) each),
//! s (3 e: a reciprocal of 2 e and a product), its product (e) and the last difference, of at most 2 (L + R): together 8 e (L + R)
//! across the ray, in each axis, and none along it but the rounding of (c - o)_z.
//!
//! - If l are the exact barycentric coordinates of 0 in the sheared triangle, all at least 0, then P = sum of l c is a
//!   point of the triangle, and the ray passes P, where it is as far along z, within 8 e (L + R) in each axis.
//! - t comes of weights within 3 e of l, products, sums and differences that round: z is that of P within 7 e (L + R).
//!
//! So **the ray at t is within 15 e (L + R) of a point of the triangle in each axis**, whatever the angle. (Weights that
//! round only in their last bits, as those that decide do, would be enough for the sign, but would place t anywhere on a triangle
//! that the ray grazes.)
//!
//! So **no ray leaks from within a closed mesh** if it starts 24 e (L + R) or more off its triangles: moving the corners
//! by 11.4 e (L + R) (two axes) does not take the start out of it; then the ray crosses a triangle of some area ahead, and t
//! has the wrong sign only within 12.2 e (L + R) (7 along z, and the direction at most sqrt(3) times as long).
//!
//! # Range
//! Exact are products of at least 2^-76; where both products of an edge are smaller and round to the same, the ray is taken
//! to pass the edge itself, which both neighbours count as inside. A sheared triangle whose doubled area is below 2^-120 is
//! missed, and all if the direction's largest component is not between 2^-70 and 2^70, or something is no number.

use glam::{Vec2, Vec3, Vec3Swizzles};

use super::arith::{LARGEST_DETERMINANT, SMALLEST_DETERMINANT, reciprocal};
use super::ray::Ray;
use crate::layout::{Corners, Triangle};

/// Directions whose largest component lies between these are followed, 2^-70 and 2^70; any other, and one that is no
/// number, meets nothing.
pub const SMALLEST_DIRECTION: f32 = 8.470_329_5e-22;
pub const LARGEST_DIRECTION: f32 = 1.180_591_6e21;

/// Below this, 2^-76, the error of a product may underflow.
const SMALLEST_PRODUCT: f32 = 1.323_489e-23;

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

/// The largest of a direction's components; the last of equal ones.
pub fn axis_of(direction: Vec3) -> u32 {
    let size = direction.abs();
    if size.x > size.y {
        if size.x > size.z { 0 } else { 2 }
    } else if size.y > size.z {
        1
    } else {
        2
    }
}

pub fn shear_of(direction: Vec3) -> Shear {
    let axis = axis_of(direction);
    let d = turned(direction, axis);
    let length = d.z.abs();
    let followed = length > SMALLEST_DIRECTION && length < LARGEST_DIRECTION;
    let along = if followed { reciprocal(length) } else { 0.0 };
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

/// Twice the area of the triangle (0, p, q), within 3 e of itself: the difference of two products, which is exact where it
/// cancels, and their errors. Where both products are below [`SMALLEST_PRODUCT`], their difference as it rounds.
fn edge_area(p: Vec2, q: Vec2) -> f32 {
    let (left, right) = (p.x * q.y, p.y * q.x);
    let area = left - right;
    if left.abs().max(right.abs()) < SMALLEST_PRODUCT {
        return area;
    }
    let (left_error, right_error) = (error_of_product(p.x, q.y, left), error_of_product(p.y, q.x, right));
    let high = area + left_error;
    let low = left_error - (high - area);
    (high - right_error) + low
}

/// The same with no more than the sign right, for rounding keeps the order of two products.
fn edge_side(p: Vec2, q: Vec2) -> f32 {
    let side = p.x * q.y - p.y * q.x;
    if side == 0.0 { edge_area(p, q) } else { side }
}

/// The triangle by its edges, as `scene::condition` rounds them.
pub fn edges_of(corners: &Corners) -> Triangle {
    let [a, b, c] = [corners.a, corners.b, corners.c].map(Vec3::from);
    Triangle::new(corners.a, corners.id, (b - a).to_array(), (c - a).to_array())
}

/// [det, t det, u det, v det] of a hit: the distance in units of the direction, and barycentric coordinates of the second
/// and third corner. What is kept of the many triangles that are tested is computed anew, so that the distance is that of a
/// point of the triangle, however the ray grazes it.
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
    let ahead = if shear.by.z > 0.0 { a.z.max(b.z).max(c.z) > 0.0 } else { a.z.min(b.z).min(c.z) < 0.0 };
    if !ahead {
        return None;
    }
    let u = edge_area(c.xy(), b.xy());
    let v = edge_area(a.xy(), c.xy());
    let w = edge_area(b.xy(), a.xy());
    let sum = u + v + w;
    let along = u * a.z + v * b.z + w * c.z;
    let t = along * shear.by.z;
    let side = if sum < 0.0 { -1.0 } else { 1.0 };
    let det = sum.abs();
    let meets = det > SMALLEST_DETERMINANT && det < LARGEST_DETERMINANT && side * t > 0.0;
    meets.then_some([det, side * t, side * v, side * w])
}

#[cfg(test)]
mod tests;
