//! Where a ray crosses the plane of a triangle, as each of the guarded intersectors computes it, with bounds.

use glam::Vec3;

use super::bounded::{Bounded, E, SPARE, Vector, cross, dot, largest};
use crate::layout::{Corners, RayRecord, Triangle};
use crate::reference::intersect::error_of;
use crate::reference::watertight::{LARGEST_DIRECTION, SMALLEST_DIRECTION, axis_of, edges_of};

/// 2^120: products beyond this may overflow in f32, where three of them are added.
const HUGE: f64 = 1.329_227_995_784_916e36;

/// A triangle as its intersector takes it.
#[derive(Clone, Copy, Debug)]
pub enum Shape<'a> {
    /// Möller and Trumbore.
    Edges(&'a Triangle),
    /// Möller and Trumbore within their errors.
    Conservative(&'a Triangle),
    /// Watertight.
    Corners(&'a Corners),
}

impl Shape<'_> {
    pub fn id(self) -> u32 {
        match self {
            Self::Edges(triangle) | Self::Conservative(triangle) => triangle.id,
            Self::Corners(corners) => corners.id,
        }
    }

    /// By its edges, of which its box is made.
    pub fn edges(self) -> Triangle {
        match self {
            Self::Edges(triangle) | Self::Conservative(triangle) => *triangle,
            Self::Corners(corners) => edges_of(corners),
        }
    }
}

impl<'a> From<&'a Triangle> for Shape<'a> {
    fn from(triangle: &'a Triangle) -> Self {
        Self::Edges(triangle)
    }
}

impl<'a> From<&'a Corners> for Shape<'a> {
    fn from(corners: &'a Corners) -> Self {
        Self::Corners(corners)
    }
}

/// All triangles of a scene, as the intersector takes them.
#[derive(Clone, Copy, Debug)]
pub enum Shapes<'a> {
    Edges(&'a [Triangle]),
    Conservative(&'a [Triangle]),
    Corners(&'a [Corners]),
}

impl<'a> Shapes<'a> {
    pub fn iter(self) -> impl Iterator<Item = Shape<'a>> {
        let (edges, corners): (&[Triangle], &[Corners]) = match self {
            Self::Edges(edges) | Self::Conservative(edges) => (edges, &[]),
            Self::Corners(corners) => (&[], corners),
        };
        let shape = match self {
            Self::Conservative(_) => Shape::Conservative,
            _ => Shape::Edges,
        };
        edges.iter().map(shape).chain(corners.iter().map(Shape::Corners))
    }
}

/// The line of a ray against the plane of a triangle.
#[derive(Clone, Copy)]
pub struct Crossing {
    pub det: Bounded,
    /// The corners' barycentric coordinates times det: a hit has all of det's sign, or zero.
    pub weights: [Bounded; 3],
    /// How far each may be on the wrong side of zero and still be taken: what the conservative intersector grants.
    pub granted: [f64; 3],
    /// Where, in units of the direction, and by how much an f32 quotient may differ, if det is certain.
    pub t: f64,
    pub t_error: f64,
    /// Of the decision whether t is above 0, if det is certain.
    pub t_margin: f64,
}

pub enum Found {
    Crossing(Crossing),
    /// Whatever the roundings.
    Never,
    /// f32 may overflow.
    Overflows,
}

pub fn crossing_of(ray: &RayRecord, triangle: Shape<'_>) -> Found {
    match triangle {
        Shape::Edges(triangle) => of_edges(ray, triangle, false),
        Shape::Conservative(triangle) => of_edges(ray, triangle, true),
        Shape::Corners(corners) => of_corners(ray, corners),
    }
}

/// Möller–Trumbore.
fn of_edges(ray: &RayRecord, triangle: &Triangle, conservative: bool) -> Found {
    let [o, d, a, ab, ac] = [ray.origin, ray.direction, triangle.a, triangle.ab, triangle.ac]
        .map(|vector| vector.map(Bounded::exact));
    let s = [o[0] - a[0], o[1] - a[1], o[2] - a[2]];
    let (p, q) = (cross(d, ac), cross(s, ab));
    let most = [largest(p) * largest(s).max(largest(ab)), largest(q) * largest(d).max(largest(ac))];
    if most.into_iter().any(|product| product > HUGE) {
        return Found::Overflows;
    }
    let [det, u, v, t] = [dot(ab, p), dot(s, p), dot(d, q), dot(ac, q)];
    let t = t.times(det.value.signum());
    // u + v is rounded, and compared with det.
    let sum_error = u.error + v.error;
    let first = Bounded {
        value: det.value - u.value - v.value,
        error: sum_error + det.error + E * ((u.value + v.value).abs() + sum_error),
    };
    let granted = match conservative {
        true => granted(ray, triangle),
        false => [0.0; 3],
    };
    // What u + v may come to is a sum that rounds.
    let rounding = if conservative { E * (det.value.abs() + det.error + 2.0 * granted[0]) } else { 0.0 };
    let first = Bounded { error: first.error + rounding, ..first };
    Found::Crossing(Crossing {
        det,
        weights: [first, u, v],
        granted,
        t: t.value / det.value.abs(),
        t_error: t.quotient_error(det, 3.0 * E),
        t_margin: t.margin(f64::NEG_INFINITY),
    })
}

/// What the conservative intersector grants to the weights of the first, second and third corner.
fn granted(ray: &RayRecord, triangle: &Triangle) -> [f64; 3] {
    let error = f64::from(error_of(Vec3::from(ray.direction)));
    let s = Vec3::from(ray.origin).as_dvec3() - Vec3::from(triangle.a).as_dvec3();
    let error_s = error * s.abs().max_element();
    let [ab, ac] = [triangle.ab_sum, triangle.ac_sum].map(f64::from);
    [error_s * (ab + ac) + error * ab * ac, error_s * ac, error_s * ab]
}

/// Watertight. Running error analysis goes as far as the weights, which are within their bounds of those of the very corners.
/// t is the mean of the corners' z by the computed weights, which have one sign where there is a hit. So what the weights are
/// off by moves it by no more than the corners are apart along z; and z, three products, four sums, the quotients by the
/// direction and by det round by 12 e of the largest z together.
fn of_corners(ray: &RayRecord, corners: &Corners) -> Found {
    let axis = axis_of(Vec3::from(ray.direction)) as usize;
    let turned = |v: [f32; 3]| [v[(axis + 1) % 3], v[(axis + 2) % 3], v[axis]].map(Bounded::exact);
    let (o, d) = (turned(ray.origin), turned(ray.direction));
    let along = d[2].value;
    let followed = f64::from(SMALLEST_DIRECTION)..f64::from(LARGEST_DIRECTION);
    if !followed.contains(&along.abs()) || along.abs() == followed.start {
        return Found::Never;
    }
    let inverse = Bounded { value: 1.0 / along, error: 2.0 * E / along.abs() };
    let slope = [d[0] * inverse, d[1] * inverse];
    let [a, b, c] = [corners.a, corners.b, corners.c].map(|corner| {
        let corner = turned(corner);
        let [x, y, z] = [corner[0] - o[0], corner[1] - o[1], corner[2] - o[2]];
        [x - slope[0] * z, y - slope[1] * z, z]
    });
    let z = [a[2], b[2], c[2]];
    // The sign of a difference is exact.
    if z.iter().all(|z| z.value * along <= 0.0) {
        return Found::Never;
    }
    let deepest = largest(z);
    let widest = [a, b, c]
        .map(|corner| corner[0].value.abs().max(corner[1].value.abs()))
        .into_iter()
        .fold(0.0, f64::max);
    if widest * widest * deepest.max(1.0) > HUGE / 16.0 {
        return Found::Overflows;
    }
    // Products and difference as they would round by themselves, and once more: what is kept rounds by 3 e in all.
    let side = |p: Vector, q: Vector| {
        let area = p[0] * q[1] - p[1] * q[0];
        Bounded { error: area.error + E * area.value.abs(), ..area }
    };
    let weights = [side(c, b), side(a, c), side(b, a)];
    let det = weights[0] + weights[1] + weights[2];
    let mean = (0..3).map(|i| weights[i].value * z[i].value).sum::<f64>() / det.value;
    let moved = (0..3).map(|i| weights[i].error * (z[i].value - mean).abs()).sum::<f64>();
    let t = mean / along;
    let t_error = SPARE * (moved / (det.value.abs() - det.error) + 12.0 * E * deepest) / along.abs();
    Found::Crossing(Crossing { det, weights, granted: [0.0; 3], t, t_error, t_margin: t / t_error })
}
