//! A ball of hair: strands that start on a small sphere and curl their way out and around it.

use super::builder::Builder;
use super::random::Pcg32;
use super::{Request, wanted};
use crate::error::Error;
use crate::scene::Mesh;
use glam::{DVec3, dvec3};

/// 2,000 strands of 64 segments.
pub const DEFAULT_TRIANGLES: u64 = 772_000;

/// Radius of the sphere that the strands start on, in scene units.
const ROOT_RADIUS: f64 = 0.35;
/// Distance from the middle that strands turn back at, in scene units.
const REACH: f64 = 1.0;
/// Length of a strand in scene units.
const LENGTH: f64 = 3.0;
/// Radius of a strand at its root, in scene units.
const THICKNESS: f64 = 0.0022;
/// A strand is a tube of three sides.
const SIDES: usize = 3;
/// Triangles of one segment of a strand.
const PER_SEGMENT: u64 = 2 * SIDES as u64;
/// Triangles that close the two ends of a strand.
const PER_STRAND: u64 = 2;

/// Builds the ball.
pub fn generate(request: &Request) -> Result<Mesh, Error> {
    let triangles = wanted(request, DEFAULT_TRIANGLES, "hairball", 100..=5_000_000)?;
    // Few triangles make few and coarse strands, so that strands stay recognizable as curls.
    let segments = ((triangles as f64).sqrt() / 10.0).clamp(8.0, 64.0) as u64;
    let per_strand = PER_SEGMENT * segments + PER_STRAND;
    let strands = ((triangles + per_strand / 2) / per_strand).max(1);
    // With few strands the rounding above is coarse; strands of unequal length make up for it.
    let total = (triangles - PER_STRAND * strands + PER_SEGMENT / 2) / PER_SEGMENT;
    let before = |strand: u64| total * strand / strands;
    let mut random = Pcg32::new(request.seed);
    let mut builder = Builder::new(5);
    // Fewer strands are thicker, so that the ball stays a ball.
    let thickness = THICKNESS * (2000.0 / strands as f64).cbrt();
    for index in 0..strands {
        let segments = before(index + 1) - before(index);
        strand(&mut builder, &mut random, segments as u32, thickness);
    }
    Ok(builder.finish())
}

/// A direction spread evenly over the sphere.
fn direction(random: &mut Pcg32) -> DVec3 {
    let y = random.range(-1.0, 1.0);
    let angle = random.range(0.0, std::f64::consts::TAU);
    let radius = (1.0 - y * y).sqrt();
    dvec3(radius * angle.cos(), y, radius * angle.sin())
}

/// Adds one strand: a thin tube round its middle line.
fn strand(builder: &mut Builder, random: &mut Pcg32, segments: u32, thickness: f64) {
    let line = middle_line(random, segments);
    let mut across = DVec3::ZERO;
    let mut below: Option<[u32; SIDES]> = None;
    for (i, &middle) in line.iter().enumerate() {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(line.len() - 1));
        let tangent = (line[after] - line[before]).normalize();
        // Carried along from ring to ring, so that the tube does not twist.
        let carried = across - tangent * across.dot(tangent);
        across = carried.try_normalize().unwrap_or_else(|| tangent.any_orthonormal_vector());
        let radius = thickness * (1.0 - 0.6 * i as f64 / f64::from(segments));
        let ring = tube_ring(builder, middle, [across, tangent.cross(across)], radius);
        match below {
            None => builder.triangle([ring[0], ring[2], ring[1]]),
            Some(low) => {
                for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                    builder.quad([low[a], low[b], ring[b], ring[a]]);
                }
            }
        }
        below = Some(ring);
    }
    if let Some(end) = below {
        builder.triangle(end);
    }
}

/// The middle line of a strand: a helix, the curl, round an axis that wanders about the ball.
fn middle_line(random: &mut Pcg32, segments: u32) -> Vec<DVec3> {
    let root = direction(random);
    let turn = direction(random);
    let curl = random.range(0.02, 0.06);
    let turns = random.range(5.0, 11.0) * f64::from(segments.min(64)) / 64.0;
    let length = LENGTH * random.range(0.6, 1.0);
    let phase = random.range(0.0, std::f64::consts::TAU);
    let drift = random.range(1.2, 2.6);
    let step = length / f64::from(segments);
    let (mut axis, mut heading) = (root * ROOT_RADIUS, root);
    let mut across = heading.any_orthonormal_vector();
    (0..=segments)
        .map(|i| {
            let t = f64::from(i) / f64::from(segments);
            let angle = phase + t * turns * std::f64::consts::TAU;
            let spoke = across * angle.cos() + heading.cross(across) * angle.sin();
            // The curl opens up from nothing at the root.
            let point = axis + spoke * (curl * (4.0 * t).min(1.0));
            axis += heading * step;
            heading = steer(axis, heading, turn, drift, step);
            across = (across - heading * across.dot(heading)).normalize();
            point
        })
        .collect()
}

/// The heading after a `step`: it veers round the axis `turn`, and back inwards near the edge.
fn steer(axis: DVec3, heading: DVec3, turn: DVec3, drift: f64, step: f64) -> DVec3 {
    let distance = axis.length();
    let outwards = axis / distance;
    let veer = turn.cross(outwards) * drift;
    let back = outwards * (-8.0 * (distance - 0.75 * REACH).max(0.0) / REACH);
    // Inside the root sphere it would only tangle; push it out again.
    let out = outwards * (8.0 * (1.2 * ROOT_RADIUS - distance).max(0.0) / ROOT_RADIUS);
    (heading + (veer + 2.0 * back + out) * step).normalize()
}

/// The vertices of a tube's ring about `middle`, in the plane of the two `spokes`.
fn tube_ring(builder: &mut Builder, middle: DVec3, spokes: [DVec3; 2], radius: f64) -> [u32; SIDES] {
    const CORNERS: [(f64, f64); SIDES] =
        [(1.0, 0.0), (-0.5, 0.866_025_403_784_438_6), (-0.5, -0.866_025_403_784_438_6)];
    CORNERS.map(|(u, v)| builder.vertex(middle + (spokes[0] * u + spokes[1] * v) * radius))
}
