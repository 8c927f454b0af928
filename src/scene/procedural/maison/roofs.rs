//! The roofs of the house, and what stands on them.

use super::super::builder::{Builder, Frame, faces};
use super::{BODY, Detail, ENDLESS, ENTRANCE, extents};
use glam::{DVec3, dvec3};

/// Half extents of the verandah roof's eaves in x and z, in units.
pub const LEAN_TO_EAVES: [f64; 2] = [105.0, 85.0];
/// Height of the verandah roof's upper surface at the eaves, in units.
pub const LEAN_TO_HEIGHT: f64 = 45.5;
/// Height of the verandah roof's upper surface at the wall, in units.
const LEAN_TO_TOP: f64 = 58.0;

/// Half extents of the main roof's eaves in x and z, in units.
const EAVES: [f64; 2] = [BODY[0] + 11.0, BODY[1] + 11.0];
/// The main roof's upper surface: distance in from the eaves and height, in units. The lower part
/// is flatter, as on old roofs whose rafters got a piece nailed on to throw the rain off.
const SLOPES: [(f64, f64); 3] = [(0.0, 90.0), (15.0, 98.0), (63.0, 138.0)];
/// Vertical thickness of the roofs, in units.
const THICKNESS: f64 = 2.2;

/// The corner `corner` (counter-clockwise from above, 0 at +x +z) of a rectangle, in units.
fn corner([x, z]: [f64; 2], corner: usize, y: f64) -> DVec3 {
    match corner % 4 {
        0 => dvec3(x, y, z),
        1 => dvec3(x, y, -z),
        2 => dvec3(-x, y, -z),
        _ => dvec3(-x, y, z),
    }
}

/// A rectangle's half extents without a rim of `inset` units.
fn shrink([x, z]: [f64; 2], inset: f64) -> [f64; 2] {
    [x - inset, z - inset]
}

/// The main roof and the roof of the verandah.
pub fn roofs(builder: &mut Builder, detail: &Detail) {
    let shingles = detail.shingles;
    for pair in SLOPES.windows(2) {
        let rims = [(shrink(EAVES, pair[0].0), pair[0].1), (shrink(EAVES, pair[1].0), pair[1].1)];
        let rise = (rims[1].1 - rims[0].1) / (SLOPES[2].1 - SLOPES[0].1);
        slab(builder, rims, (f64::from(shingles) * rise).ceil() as u32);
    }
    fascia(builder, EAVES, SLOPES[0].1);
    // The wall's own thickness hides where the slab ends.
    let top = shrink(BODY, 0.5);
    let rims = [(LEAN_TO_EAVES, LEAN_TO_HEIGHT), (top, LEAN_TO_TOP)];
    slab(builder, rims, shingles / 3);
    fascia(builder, LEAN_TO_EAVES, LEAN_TO_HEIGHT);
    if detail.trim {
        caps(builder, top);
        for side in [0, 2] {
            pediment(builder, side);
            dormer(builder, side);
        }
    }
}

/// A gable over the middle of side `side`, in units.
struct Gable {
    /// Half the width at the eaves.
    half: f64,
    /// Height of the eaves and of the ridge.
    rise: [f64; 2],
    /// Distance of the back and of the front from the vertical axis.
    depth: [f64; 2],
}

/// A gabled roof of two thick slabs, with a triangular wall a little behind its front.
fn gable(builder: &mut Builder, side: usize, gable: &Gable) {
    let frame = Frame::facade(side, 0.0);
    let Gable { half, rise: [low, high], depth: [back, front] } = *gable;
    for hand in [-1.0, 1.0] {
        let corners = std::array::from_fn(|i| {
            // The slab on the left runs from its eaves to the ridge, the other one back.
            let at_ridge = (i & 1 == 1) == (hand < 0.0);
            let (x, y) = if at_ridge { (0.0, high) } else { (hand * half, low) };
            let y = if i & 2 == 0 { y - 1.6 } else { y };
            frame.at(x, y, if i & 4 == 0 { back } else { front })
        });
        builder.hexahedron(corners, faces::ALL);
    }
    let wall = front - 3.0;
    let base = [
        frame.at(2.0 - half, low - 1.0, back),
        frame.at(half - 2.0, low - 1.0, back),
        frame.at(0.0, high - 1.6, back),
    ];
    builder.prism(&base, frame.at(0.0, 0.0, wall) - frame.at(0.0, 0.0, back));
}

/// The pediment that marks the entrance in the verandah's roof.
fn pediment(builder: &mut Builder, side: usize) {
    let (_, eaves) = extents(LEAN_TO_EAVES, side);
    let rise = [LEAN_TO_HEIGHT - 0.5, LEAN_TO_HEIGHT + 10.0];
    let depth = [eaves - 29.0, eaves + 2.5];
    gable(builder, side, &Gable { half: ENTRANCE + 3.5, rise, depth });
}

/// A dormer in the slope of the main roof: a block with a window and a gabled roof.
fn dormer(builder: &mut Builder, side: usize) {
    const FACE: f64 = 47.0;
    let frame = Frame::facade(side, FACE);
    let (low, high) = ([-9.0, 98.0, -26.0], [9.0, 116.0, 0.0]);
    builder.faces_of_block(&frame, low, high, FIXED & !faces::Y0);
    for [left, right] in [[-6.5, -5.2], [-0.6, 0.6], [5.2, 6.5]] {
        builder.faces_of_block(&frame, [left, 102.5, 0.0], [right, 114.5, 1.2], FIXED);
    }
    for low in [102.0, 108.0, 113.6] {
        builder.faces_of_block(&frame, [-6.5, low, 0.0], [6.5, low + 1.2, 1.0], FIXED);
    }
    let rise = [114.5, 123.5];
    gable(builder, side, &Gable { half: 12.5, rise, depth: [FACE - 34.0, FACE + 3.5] });
}

/// The faces of something fixed to a wall.
const FIXED: u8 = faces::ALL & !faces::Z0;

/// The upper and the lower surface of a roof between two rims, which are half extents and heights
/// in units, and its shingles. An upper rim may shrink to a line, which leaves two triangles.
fn slab(builder: &mut Builder, rims: [([f64; 2], f64); 2], shingles: u32) {
    for side in 0..4 {
        let slope = [
            corner(rims[0].0, side + 3, rims[0].1),
            corner(rims[0].0, side, rims[0].1),
            corner(rims[1].0, side, rims[1].1),
            corner(rims[1].0, side + 3, rims[1].1),
        ];
        let under = slope.map(|p| p - DVec3::Y * THICKNESS);
        if slope[2] == slope[3] {
            for [a, b, c] in [[slope[0], slope[1], slope[2]], [under[0], under[2], under[1]]] {
                let triangle = [builder.vertex(a), builder.vertex(b), builder.vertex(c)];
                builder.triangle(triangle);
            }
        } else {
            builder.patch(slope);
            builder.patch([under[0], under[3], under[2], under[1]]);
        }
        shingle(builder, slope, shingles);
    }
}

/// The vertical board that closes a roof at its eaves.
fn fascia(builder: &mut Builder, eaves: [f64; 2], y: f64) {
    for side in 0..4 {
        let (a, b) = (corner(eaves, side + 3, y), corner(eaves, side, y));
        let down = DVec3::Y * THICKNESS;
        builder.patch([a - down, b - down, b, a]);
    }
}

/// Covers a slope (corners: eaves left and right, top right and left) with `rows` of shingles,
/// each a thin block whose lower edge lies on the row below.
fn shingle(builder: &mut Builder, slope: [DVec3; 4], rows: u32) {
    let normal = (slope[1] - slope[0]).cross(slope[3] - slope[0]).normalize();
    let at = |u: f64, v: f64| slope[0].lerp(slope[1], u).lerp(slope[3].lerp(slope[2], u), v);
    let height = slope[0].distance(slope[3]) / f64::from(rows.max(1));
    for row in 0..rows {
        let (low, high) = (f64::from(row) / f64::from(rows), f64::from(row + 1) / f64::from(rows));
        let width = at(0.0, low).distance(at(1.0, low));
        let columns = (width / (1.6 * height)).ceil();
        // Every other row starts half a shingle later.
        let shift = if row % 2 == 0 { 0.0 } else { 0.5 };
        for column in 0..columns as u32 {
            let u = |edge: f64| ((f64::from(column) + shift + edge) / columns).min(1.0);
            let (left, right) = (u(0.03), u(0.97));
            let corners = std::array::from_fn(|i| {
                let v = if i & 4 == 0 { high - 0.03 * (high - low) } else { low };
                let lift = match (i & 2 == 0, i & 4 == 0) {
                    (true, _) => -0.1,
                    (false, true) => 0.15,
                    (false, false) => 0.15 + 0.06 * height,
                };
                at(if i & 1 == 0 { left } else { right }, v) + normal * lift
            });
            builder.hexahedron(corners, faces::ALL);
        }
    }
}

/// The caps over the hips and the ridge, and a finial at either end of the ridge.
fn caps(builder: &mut Builder, lean_to_top: [f64; 2]) {
    const WIDTH: f64 = 2.4;
    const HEIGHT: f64 = 1.2;
    let sunk = DVec3::Y * 0.3;
    for i in 0..4 {
        let hip: Vec<DVec3> =
            SLOPES.iter().map(|&(inset, y)| corner(shrink(EAVES, inset), i, y) - sunk).collect();
        for pair in hip.windows(2) {
            builder.beam(pair[0], pair[1], WIDTH, HEIGHT);
        }
        let eaves = corner(LEAN_TO_EAVES, i, LEAN_TO_HEIGHT) - sunk;
        let top = corner(lean_to_top, i, LEAN_TO_TOP) - sunk;
        builder.beam(eaves, top, WIDTH, HEIGHT);
    }
    let (half, _) = extents(shrink(EAVES, SLOPES[2].0), 0);
    let ridge = DVec3::Y * SLOPES[2].1 - sunk;
    let end = DVec3::X * (half + 1.0);
    builder.beam(ridge - end, ridge + end, WIDTH + 0.4, HEIGHT + 0.3);
    for foot in [ridge - DVec3::X * half, ridge + DVec3::X * half] {
        builder.lathe(foot, &[(0.7, 0.0), (0.7, 3.0), (1.5, 4.5), (0.0, 12.0)], 6);
    }
}

/// Two chimneys in the slopes of the main roof, with caps and pots.
pub fn chimneys(builder: &mut Builder, trim: bool) {
    for [x, z] in [[-44.0, 8.0], [44.0, 8.0]] {
        let shaft = ([x - 6.0, 105.0, z - 4.5], [x + 6.0, 143.0, z + 4.5]);
        builder.faces_of_block(&Frame::WORLD, shaft.0, shaft.1, ENDLESS);
        if trim {
            let (low, high) = ([x - 7.2, 141.0, z - 5.7], [x + 7.2, 143.5, z + 5.7]);
            builder.block(&Frame::WORLD, low, high);
            for side in [-3.0, 3.0] {
                let foot = dvec3(x + side, 143.0, z);
                builder.lathe(foot, &[(1.9, 0.0), (1.5, 5.5), (0.0, 4.0)], 6);
            }
        }
    }
}
