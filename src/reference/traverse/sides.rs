//! A triangle as seen from where rays start. Twin of shaders/traverse/sides.glsl, whose products and sums a GPU may fuse, and of
//! what bundle_sides.glsl makes of it.

use glam::Vec3;

use crate::layout::Triangle;
use crate::reference::arith::{cross3, dot3, max_abs};

/// 2^-17.
const EDGE_ERROR: f32 = 1.0 / 131_072.0;
/// So little is no triangle's.
const LEAST_ERROR: f32 = 1e-30;

/// What edge functions tell of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Outside,
    Unsure,
    Within,
}

/// Edge functions, zero along the edges ac, ab and bc and positive within, and the most that rounding may change them.
pub struct Side {
    pub u: Vec3,
    pub v: Vec3,
    pub w: Vec3,
    pub error: f32,
    /// Too close to the plane to tell.
    pub near: bool,
}

pub fn side_from(start: Vec3, triangle: &Triangle) -> Side {
    let (ab, ac) = (Vec3::from(triangle.ab), Vec3::from(triangle.ac));
    let s = start - Vec3::from(triangle.a);
    let q = cross3(s, ab);
    let volume = dot3(ac, q);
    let size = max_abs(s);
    let product = triangle.ab_sum * triangle.ac_sum;
    let sign = if volume < 0.0 { -1.0 } else { 1.0 };
    let (u, v) = (cross3(ac * sign, s), q * sign);
    Side {
        u,
        v,
        w: cross3(ac * sign, ab) - u - v,
        error: EDGE_ERROR * (size * (triangle.ab_sum + triangle.ac_sum) + product),
        near: volume.abs() < EDGE_ERROR * size * product,
    }
}

impl Side {
    /// Of a direction whose components add up to 1.74 at most, without their signs.
    pub fn verdict(&self, direction: Vec3) -> Verdict {
        let least = [self.u, self.v, self.w]
            .map(|side| side.x * direction.x + (side.y * direction.y + (side.z * direction.z + self.error)));
        let least = least.into_iter().fold(f32::MAX, f32::min);
        if least < 0.0 {
            Verdict::Outside
        } else if least > 2.0 * self.error.max(LEAST_ERROR) && !self.near {
            Verdict::Within
        } else {
            Verdict::Unsure
        }
    }
}
