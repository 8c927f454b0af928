//! The teapot in a stadium: a small dense knot in the middle of a wide sparse building.
//!
//! One unit is a metre, and the knot is a thousand times smaller than the stadium. A structure that
//! splits space evenly needs many levels to tell the knot's triangles apart.

use super::builder::{Builder, Frame};
use super::{Request, wanted};
use crate::error::Error;
use crate::scene::Mesh;
use glam::{DVec3, dvec3};
use std::f64::consts::TAU;

/// A stadium with some 40,000 triangles and a knot with the others.
pub const DEFAULT_TRIANGLES: u64 = 100_000;

/// Half extents of the field in x and z, in metres.
const FIELD: [f64; 2] = [62.0, 44.0];
/// Depth of the stands from the field outwards, in metres.
const STANDS: f64 = 46.0;
/// Height of the parapet before the lowest row, in metres.
const PARAPET: f64 = 1.5;
/// Height of the top row, in metres.
const STANDS_HEIGHT: f64 = 27.0;
/// Height of the wall between the lower and the upper tier, in metres.
const TIER_WALL: f64 = 3.5;
/// The roof's inner and outer rim: distance from the field and height, in metres.
const ROOF: [(f64, f64); 2] = [(17.0, 37.0), (54.0, 43.0)];
/// Height of the pedestal under the knot, in metres.
const PEDESTAL: f64 = 1.2;
/// Radius of the knot's core and of its tube, in metres.
const KNOT: [f64; 2] = [0.062, 0.021];

/// Builds the stadium with two fifths of the triangles, and the knot with the others.
pub fn generate(request: &Request) -> Result<Mesh, Error> {
    let triangles = wanted(request, DEFAULT_TRIANGLES, "stadium", 2_000..=5_000_000)?;
    // Stands of r rows and 6 r sectors have 24 r^2 triangles.
    let rows = ((0.36 * triangles as f64 / 24.0).sqrt() as u32).max(3);
    let sectors = 6 * rows;
    let mut builder = Builder::new(3);
    field(&mut builder);
    stands(&mut builder, rows, sectors);
    roof(&mut builder, sectors);
    pylons(&mut builder, (sectors / 6).min(32));
    knot(&mut builder, triangles);
    Ok(builder.finish())
}

/// The point of the oval `out` metres outside the field's edge, at the turn `t` from 0 to 1 (from
/// +x by -z) and the height `y` in metres.
fn oval(t: f64, out: f64, y: f64) -> DVec3 {
    let (sine, cosine) = (t * TAU).sin_cos();
    dvec3((FIELD[0] + out) * cosine, y, -(FIELD[1] + out) * sine)
}

/// Adds the strip round the oval from the rim (distance from the field, height; in metres) `low`
/// to the rim `high`. It faces inwards where `high` is farther out or above.
fn strip(builder: &mut Builder, sectors: u32, low: (f64, f64), high: (f64, f64)) {
    builder.grid(sectors, 1, |i, j| {
        let (out, y) = if j == 0 { low } else { high };
        // Turned against the sense of the oval, so that the inside is the front.
        oval(-f64::from(i) / f64::from(sectors), out, y)
    });
}

/// The ground about the stadium, and the field, whose corners the stands cover.
fn field(builder: &mut Builder) {
    let ground = [-160.0, -0.5, -140.0];
    builder.block(&Frame::WORLD, ground, [160.0, -0.1, 140.0]);
    let [x, z] = FIELD;
    builder.block(&Frame::WORLD, [-x, -0.1, -z], [x, 0.0, z]);
}

/// The rows of the stands, each a riser and a tread, in two tiers, and the wall behind them.
fn stands(builder: &mut Builder, rows: u32, sectors: u32) {
    let depth = STANDS / f64::from(rows);
    let height = |row: u32| {
        // The farther out, the steeper, so that all can see the field.
        let t = f64::from(row) / f64::from(rows);
        let tier = if row >= rows / 2 { TIER_WALL } else { 0.0 };
        PARAPET + tier + (STANDS_HEIGHT - PARAPET - TIER_WALL) * t * (0.6 + 0.4 * t)
    };
    let mut below = 0.0;
    for row in 0..rows {
        let (out, y) = (depth * f64::from(row), height(row));
        strip(builder, sectors, (out, below), (out, y));
        strip(builder, sectors, (out, y), (out + depth, y));
        below = y;
    }
    strip(builder, sectors, (STANDS, below), (STANDS + 2.0, below));
    // Seen from outside, the back wall faces the other way.
    strip(builder, sectors, (STANDS + 2.0, below), (STANDS + 2.0, -0.1));
}

/// The roof: a closed ring that covers the stands and leaves the field open.
fn roof(builder: &mut Builder, sectors: u32) {
    let [(inner, low), (outer, high)] = ROOF;
    let (rim, thickness) = (0.4, 1.5);
    strip(builder, sectors, (inner, low + rim), (outer, high + thickness));
    strip(builder, sectors, (outer, high), (inner, low));
    strip(builder, sectors, (inner, low), (inner, low + rim));
    strip(builder, sectors, (outer, high + thickness), (outer, high));
}

/// The pylons outside the stands, and the beams from their tops to the roof's inner rim.
fn pylons(builder: &mut Builder, count: u32) {
    for i in 0..count {
        let t = (f64::from(i) + 0.5) / f64::from(count);
        let foot = oval(t, ROOF[1].0 + 2.5, -0.1);
        builder.lathe(foot, &[(1.2, 0.0), (0.6, 56.0), (0.0, 58.0)], 6);
        let top = oval(t, ROOF[1].0 + 2.5, 54.0);
        builder.beam(oval(t, ROOF[0].0 + 1.0, ROOF[0].1 + 0.4), top, 0.3, 0.3);
    }
}

/// The pedestal in the middle of the field and the knot on it, which brings the count of triangles
/// to `triangles` or just short of it.
fn knot(builder: &mut Builder, triangles: u64) {
    builder.block(&Frame::WORLD, [-0.12, 0.0, -0.12], [0.12, PEDESTAL, 0.12]);
    let quads = triangles.saturating_sub(builder.count()) / 2;
    // The knot's core is some fourteen times as long as its tube is round.
    let around = ((quads as f64 / 14.0).sqrt() as u32).max(4);
    let along = (quads / u64::from(around)) as u32;
    builder.keep_decimals(7);
    builder.grid(around, along, |i, j| {
        let (angle, turn) = (f64::from(i) / f64::from(around), f64::from(j) / f64::from(along));
        knot_surface(angle, turn)
    });
}

/// The point of a tube round the (2, 3) torus knot at `turn` of the core's length and `angle` of
/// the tube's section, both from 0 to 1.
fn knot_surface(angle: f64, turn: f64) -> DVec3 {
    let core = |turn: f64| {
        let (sine, cosine) = (3.0 * turn * TAU).sin_cos();
        let (across, up) = ((2.0 * turn * TAU).sin_cos(), KNOT[0] * 0.5 * sine);
        let radius = KNOT[0] * (1.0 + 0.45 * cosine);
        dvec3(radius * across.1, up, radius * across.0)
    };
    let middle = core(turn);
    let tangent = (core(turn + 1e-4) - core(turn - 1e-4)).normalize();
    let side = tangent.cross(DVec3::Y).normalize();
    let (sine, cosine) = (angle * TAU).sin_cos();
    let spoke = side * cosine + tangent.cross(side) * sine;
    // Flutes along the tube keep the surface from being smooth at any scale that it is cut to.
    let radius = KNOT[1] * (1.0 + 0.08 * (angle * 10.0 * TAU).cos());
    dvec3(0.0, PEDESTAL + 0.055, 0.0) + middle + spoke * radius
}
