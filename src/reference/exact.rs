//! Brute force in f64 of the very f32 rays against the very f32 triangles, which also tells which answers
//! an f32 device may give: where a decision lies within the error of its arithmetic, both are right.
//!
//! # The bound
//! Let e = 2^-24: rounded to nearest, an f32 operation gives x (1 + d) with abs(d) <= e. A running error
//! analysis (Higham, "Accuracy and Stability of Numerical Algorithms", 2002, section 3.3) follows the shader
//! operation by operation: if a and b are off by no more than da and db, then the computed
//!
//! - a b is off by no more than D + e (abs(a b) + D), D = abs(a) db + abs(b) da + da db, and by what
//!   underflow takes (a product below 2^-126 may be flushed to zero); not at all if a factor is 0;
//! - a + b by no more than D + e (abs(a + b) + D), D = da + db; only by D if a summand is 0.
//!
//! With s = o - a, p = d x ac, q = s x ab this bounds the numerators det = ab . p, u det = s . p,
//! v det = d . q and t det = ac . q. Where nothing is zero it comes to at most gamma(5) for det and gamma(6)
//! for the others times the sum of the absolute values of the products involved; where rays and edges lie
//! along axes, most of that falls away. u + v rounds once more. A quotient adds 3 e: the reciprocal's 2 e
//! (measured over all f32, see its test) and the product's. The values themselves are f64's, whose errors
//! are 2^-29 of these; one part in 1000 is added for them.
//!
//! Lastly the ray must cross the triangle's own box, and t is brought into it. Slabs move t by no more than
//! 8 ulp; where they may not agree that the box is crossed, a hit is doubtful.
//!
//! The watertight intersector is followed in the same way, corner by corner ([`crossing`]): its decisions are exact, but about
//! corners that were moved when they were sheared.
//!
//! The conservative intersector is that of Möller and Trumbore, but takes weights that are a granted error below zero.
//!
//! This judges the guarded intersectors; the original's has no bound (its roundings are the driver's).

mod bounded;
mod crossing;
#[cfg(test)]
mod tests;

use bounded::{Bounded, E, SPARE, TINY};
use crossing::{Crossing, crossing_of};
pub use crossing::{Shape, Shapes};

use super::Inputs;
use super::arith::SMALLEST_DETERMINANT;
use super::intersect::padded_box_of;
use super::slabs::at_least_smallest;
use crate::layout::{HitRecord, NO_HIT, RayRecord, Triangle};

/// 8 ulp, a relative error of an f32.
const EIGHT_ULP: f64 = 16.0 * E;

/// What besides ray and triangle decides whether they meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// By how much a triangle's box is grown, scene units.
    pub box_pad: f32,
    pub robust_slabs: bool,
}

/// Where the line of a ray meets the plane of a triangle: t in units of the direction, barycentric
/// coordinates of the second and third corner, and by how much an f32 answer may differ from each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    pub t: f64,
    pub u: f64,
    pub v: f64,
    pub t_error: f64,
    pub u_error: f64,
    pub v_error: f64,
    /// Least distance from a decision that would turn the answer, in units of its bound: above 1 where
    /// the answer is certain.
    pub margin: f64,
}

impl Meeting {
    /// Whether (t, u, v) of an f32 answer lie within their bounds.
    pub fn agrees(&self, tuv: [f32; 3]) -> Result<(), String> {
        let exact = [("t", self.t, self.t_error), ("u", self.u, self.u_error), ("v", self.v, self.v_error)];
        for ((name, exact, error), got) in exact.into_iter().zip(tuv) {
            // A NaN lies within no bound.
            let within = (f64::from(got) - exact).abs() <= error;
            if !within {
                return Err(format!("{name} is {got}, exactly {exact} +- {error:e}"));
            }
        }
        Ok(())
    }
}

/// Whether a ray meets a triangle at 0 < t <= t_max.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    Hit(Meeting),
    /// `margin`: how far beyond the nearest bound that rules the hit out, in units of it; above 1.
    Miss {
        margin: f64,
    },
    /// Either answer is right: within the bound of an edge, of t = 0, of t_max, of the box or of det = 0 (then
    /// nothing is known of where they meet).
    Doubtful(Option<Meeting>),
}

pub fn verdict<'a>(ray: &RayRecord, triangle: impl Into<Shape<'a>>, rules: &Rules) -> Verdict {
    let triangle = triangle.into();
    if ray.origin.iter().chain(&ray.direction).any(|component| component.is_nan()) {
        // det or u is NaN, and every comparison of the shader is false.
        return Verdict::Miss { margin: f64::INFINITY };
    }
    let Crossing { det, weights, granted, t, t_error, t_margin } = match crossing_of(ray, triangle) {
        crossing::Found::Crossing(crossing) => crossing,
        crossing::Found::Never => return Verdict::Miss { margin: f64::INFINITY },
        crossing::Found::Overflows => return Verdict::Doubtful(None),
    };
    let size = det.value.abs();
    let smallest = f64::from(SMALLEST_DETERMINANT);
    if size + det.error <= smallest {
        return Verdict::Miss { margin: (smallest - size) / det.error };
    }
    if size - det.error <= smallest {
        // The side is unknown, but on neither can a weight exceed det and what is granted to the others.
        let most = size + granted.iter().sum::<f64>() * 1.00001;
        let margin = weights
            .iter()
            .map(|weight| (weight.value.abs() - most) / (weight.error + det.error))
            .fold(f64::NEG_INFINITY, f64::max);
        return if margin > 1.0 { Verdict::Miss { margin } } else { Verdict::Doubtful(None) };
    }
    let weights = weights.map(|weight| weight.times(det.value.signum()));
    let [_, u, v] = weights;
    // What is granted is off by some roundings of its own.
    let margin_of = |(weight, granted): (&Bounded, f64)| {
        let weight = Bounded { value: weight.value + granted, error: weight.error + 1e-5 * granted };
        weight.margin(f64::INFINITY)
    };
    let inside = weights.iter().zip(granted).map(margin_of);
    let least = inside.chain([t_margin, (size - smallest) / det.error]).fold(f64::INFINITY, f64::min);
    if least < -1.0 {
        return Verdict::Miss { margin: -least };
    }
    let meeting = Meeting {
        t,
        u: u.value / size,
        v: v.value / size,
        t_error: t_error + SPARE * (EIGHT_ULP * t.abs() + TINY),
        // The point is brought into the triangle.
        u_error: u.quotient_error(det, 3.0 * E) + granted.iter().sum::<f64>() / size,
        v_error: v.quotient_error(det, 3.0 * E) + granted.iter().sum::<f64>() / size,
        margin: least,
    };
    within_reach(ray, &triangle.edges(), rules, meeting)
}

/// The verdict on a meeting that no edge rules out: against t_max, and against the triangle's box.
fn within_reach(ray: &RayRecord, triangle: &Triangle, rules: &Rules, meeting: Meeting) -> Verdict {
    let (enter, leave) = own_box(ray, triangle, rules);
    // What the conservative intersector grants may cross the plane outside the box, into which t is brought.
    let brought = (enter - meeting.t).max(meeting.t - leave).max(0.0);
    let brought = if brought.is_finite() { brought } else { 0.0 };
    let meeting = Meeting { t_error: meeting.t_error + brought, ..meeting };
    let reach = (f64::from(ray.t_max) - meeting.t) / meeting.t_error;
    if reach < -1.0 {
        return Verdict::Miss { margin: -reach };
    }
    // Robust slabs leave later than they should by 16 e less the 8 e that they may err; plain ones may
    // err either way.
    let slack = if rules.robust_slabs { 7.0 * E } else { -EIGHT_ULP };
    let entry = (meeting.t - enter) / meeting.t_error + 1.0;
    let exit = (leave - meeting.t) / meeting.t_error + 1.0;
    let crosses = enter <= leave + slack * (leave.abs() + enter.abs());
    let crossing = if crosses { f64::INFINITY } else { 0.0 };
    let margin = [meeting.margin, reach, entry, exit, crossing].into_iter().fold(f64::INFINITY, f64::min);
    let meeting = Meeting { margin, ..meeting };
    if margin > 1.0 { Verdict::Hit(meeting) } else { Verdict::Doubtful(Some(meeting)) }
}

/// Where the ray enters and leaves the triangle's box; nowhere (infinity, -infinity) if plain slabs may
/// meet 0 x infinity.
fn own_box(ray: &RayRecord, triangle: &Triangle, rules: &Rules) -> (f64, f64) {
    let (pmin, pmax) = padded_box_of(triangle, rules.box_pad);
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let d = ray.direction[axis];
        let d = if rules.robust_slabs { at_least_smallest(d) } else { d };
        let [low, high] =
            [pmin, pmax].map(|p| (f64::from(p[axis]) - f64::from(ray.origin[axis])) / f64::from(d));
        if low.is_nan() || high.is_nan() {
            return (f64::INFINITY, f64::NEG_INFINITY);
        }
        enter = enter.max(low.min(high));
        leave = leave.min(low.max(high));
    }
    (enter, leave)
}

/// A triangle that a ray meets or may meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Place in the triangle array.
    pub index: u32,
    pub id: u32,
    pub verdict: Verdict,
}

impl Candidate {
    fn certain(&self) -> Option<Meeting> {
        match self.verdict {
            Verdict::Hit(meeting) => Some(meeting),
            _ => None,
        }
    }
}

/// The closest hit of a ray, and every answer that an f32 device may give.
#[derive(Clone, Debug)]
pub struct ExactClosest {
    /// The nearest of the certain hits.
    pub certain: Option<(Candidate, Meeting)>,
    /// All hits and doubtful ones, in the order of the array.
    pub candidates: Vec<Candidate>,
    /// Least margin of any miss, and of any hit that does not lie clearly behind the closest one: above 1
    /// where every decision is certain, with room the further above.
    pub edge_margin: f64,
    /// From the closest certain hit to the next, in units of the direction; infinite without a next.
    pub gap: f64,
    t_max: f32,
}

/// Whether a ray meets anything, and whether an f32 device may say otherwise.
#[derive(Clone, Debug)]
pub struct ExactAny {
    /// How many triangles it meets for certain.
    pub hits: usize,
    /// How many it may meet.
    pub doubtful: usize,
    /// Largest margin of a certain hit if there is one, otherwise the least of any miss: above 1 where the
    /// answer is certain.
    pub edge_margin: f64,
}

/// Triangles and the rules that decide.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    pub triangles: Shapes<'a>,
    pub rules: Rules,
}

impl<'a> Truth<'a> {
    pub fn of(inputs: &Inputs<'a>) -> Self {
        let rules = Rules { box_pad: inputs.frame.box_pad, robust_slabs: inputs.choices.robust_slabs };
        let triangles = match (inputs.choices.watertight, inputs.choices.conservative) {
            (true, _) => Shapes::Corners(inputs.corners),
            (_, true) => Shapes::Conservative(inputs.triangles),
            _ => Shapes::Edges(inputs.triangles),
        };
        Self { triangles, rules }
    }

    pub fn closest(&self, ray: &RayRecord) -> ExactClosest {
        let (mut candidates, mut nearest_miss) = (Vec::new(), f64::INFINITY);
        let mut certain: Option<(Candidate, Meeting)> = None;
        let mut gap = f64::INFINITY;
        for (index, triangle) in self.triangles.iter().enumerate() {
            let verdict = verdict(ray, triangle, &self.rules);
            let candidate = Candidate { index: index as u32, id: triangle.id(), verdict };
            match verdict {
                Verdict::Miss { margin } => {
                    nearest_miss = nearest_miss.min(margin);
                    continue;
                }
                Verdict::Hit(meeting) => {
                    let known = certain.map_or(f64::INFINITY, |(_, nearest)| nearest.t);
                    gap = if meeting.t < known { known - meeting.t } else { gap.min(meeting.t - known) };
                    if meeting.t < known {
                        certain = Some((candidate, meeting));
                    }
                }
                Verdict::Doubtful(_) => {}
            }
            candidates.push(candidate);
        }
        let limit = certain.map_or(f64::INFINITY, |(_, nearest)| nearest.t + nearest.t_error);
        let edge_margin = candidates
            .iter()
            .filter_map(|candidate| match candidate.verdict {
                Verdict::Hit(m) | Verdict::Doubtful(Some(m)) => {
                    (m.t - m.t_error <= limit).then_some(m.margin)
                }
                _ => Some(0.0),
            })
            .fold(nearest_miss, f64::min);
        ExactClosest { certain, candidates, edge_margin, gap, t_max: ray.t_max }
    }

    pub fn any(&self, ray: &RayRecord) -> ExactAny {
        let (mut hits, mut doubtful) = (0, 0);
        let (mut surest_hit, mut nearest_miss) = (0f64, f64::INFINITY);
        for triangle in self.triangles.iter() {
            match verdict(ray, triangle, &self.rules) {
                Verdict::Hit(meeting) => {
                    hits += 1;
                    surest_hit = surest_hit.max(meeting.margin);
                }
                Verdict::Miss { margin } => nearest_miss = nearest_miss.min(margin),
                Verdict::Doubtful(_) => doubtful += 1,
            }
        }
        let without_hit = if doubtful > 0 { 0.0 } else { nearest_miss };
        ExactAny { hits, doubtful, edge_margin: if hits > 0 { surest_hit } else { without_hit } }
    }
}

impl ExactClosest {
    /// Whether an f32 answer is the closest hit, but for decisions that are doubtful and distances closer
    /// together than their errors.
    pub fn accepts(&self, answer: &HitRecord) -> Result<(), String> {
        if answer.index == NO_HIT {
            return match self.certain {
                Some((candidate, meeting)) => {
                    Err(format!("no hit, but triangle {} is met: {meeting:?}", candidate.index))
                }
                None if answer.t.to_bits() != self.t_max.to_bits() => {
                    Err(format!("no hit at t {}, which is not t_max {}", answer.t, self.t_max))
                }
                None => Ok(()),
            };
        }
        let Some(hit) = self.candidates.iter().find(|candidate| candidate.index == answer.index) else {
            return Err(format!("triangle {} is missed for certain", answer.index));
        };
        if let Verdict::Hit(meeting) | Verdict::Doubtful(Some(meeting)) = hit.verdict {
            meeting
                .agrees([answer.t, answer.u, answer.v])
                .map_err(|error| format!("triangle {}: {error}", answer.index))?;
        }
        let in_range = answer.t >= 0.0 && answer.t <= self.t_max;
        if !in_range {
            return Err(format!("t {} is beyond t_max {}", answer.t, self.t_max));
        }
        for other in &self.candidates {
            if let Some(meeting) = other.certain()
                && f64::from(answer.t) > meeting.t + meeting.t_error
            {
                let nearer = other.index;
                return Err(format!(
                    "triangle {} at t {}, but {nearer} is nearer: {meeting:?}",
                    answer.index, answer.t
                ));
            }
        }
        Ok(())
    }
}

impl ExactAny {
    /// Whether an f32 answer (index 0 or `NO_HIT`) is right, but for doubtful triangles.
    pub fn accepts(&self, answer: &HitRecord) -> Result<(), String> {
        match (answer.index == NO_HIT, self.hits, self.doubtful) {
            (true, 1.., _) => Err(format!("escaped, but {} triangles are met", self.hits)),
            (false, 0, 0) => Err(format!("occluded, but nothing is met; margin {}", self.edge_margin)),
            _ => Ok(()),
        }
    }
}
