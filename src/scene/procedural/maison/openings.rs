//! The walls of the house, and the windows and doors in them.

use super::super::builder::{Builder, Frame, faces};
use super::{BODY, Detail, PLINTH, WALL_TOP, extents};

/// Distance of the panes behind the face of the wall, in units.
const DEPTH: f64 = 3.0;
/// Heights at which the ground floor's and the upper floor's windows begin and end, in units.
const STOREYS: [[f64; 2]; 2] = [[20.0, 41.0], [65.0, 85.0]];

/// A hole in a wall: x and y from and to, in units.
#[derive(Clone, Copy)]
struct Opening {
    x: [f64; 2],
    y: [f64; 2],
}

/// The four walls with everything in them.
pub fn walls(builder: &mut Builder, detail: &Detail) {
    for side in 0..4 {
        let (half, distance) = extents(BODY, side);
        let frame = Frame::facade(side, distance);
        let has_door = side.is_multiple_of(2);
        let columns: &[[f64; 2]] = match (has_door, detail.trim) {
            (true, true) => &[[-58.0, -46.0], [-35.0, -23.0], [-8.0, 8.0], [23.0, 35.0], [46.0, 58.0]],
            (true, false) => &[[-51.0, -37.0], [-8.0, 8.0], [37.0, 51.0]],
            (false, true) => &[[-38.0, -26.0], [-6.0, 6.0], [26.0, 38.0]],
            (false, false) => &[[-32.0, -18.0], [18.0, 32.0]],
        };
        masonry(builder, &frame, half, columns, has_door);
        for &x in columns {
            for (storey, y) in STOREYS.into_iter().enumerate() {
                if storey == 0 && has_door && x[0] == -x[1] {
                    let opening = Opening { x, y: [PLINTH, y[1]] };
                    hole(builder, &frame, opening);
                    if detail.trim {
                        door(builder, &frame, opening);
                    }
                    continue;
                }
                let opening = Opening { x, y };
                hole(builder, &frame, opening);
                if detail.trim {
                    window(builder, &frame, opening);
                }
                if detail.shutters {
                    shutters(builder, &frame, opening);
                }
            }
        }
    }
    lid(builder);
}

/// The face of one wall: a grid of rectangles without those of the openings, so that no corner of
/// one lies inside an edge of another.
fn masonry(builder: &mut Builder, frame: &Frame, half: f64, columns: &[[f64; 2]], has_door: bool) {
    let mut xs = vec![-half];
    xs.extend(columns.iter().flatten());
    xs.push(half);
    let [[a, b], [c, d]] = STOREYS;
    let ys = [PLINTH, a, b, c, d, WALL_TOP];
    for (j, y) in ys.windows(2).enumerate() {
        for (i, x) in xs.windows(2).enumerate() {
            let is_column = i % 2 == 1;
            let under_door = j == 0 && has_door && x[0] == -x[1];
            if is_column && (j % 2 == 1 || under_door) {
                continue;
            }
            builder.patch([
                frame.at(x[0], y[0], 0.0),
                frame.at(x[1], y[0], 0.0),
                frame.at(x[1], y[1], 0.0),
                frame.at(x[0], y[1], 0.0),
            ]);
        }
    }
}

/// The top of the walls. Below, they stand on the plinth.
fn lid(builder: &mut Builder) {
    let [x, z] = BODY;
    let (low, high) = ([-x, PLINTH, -z], [x, WALL_TOP, z]);
    builder.faces_of_block(&Frame::WORLD, low, high, faces::Y1);
}

/// The sides of an opening and the pane at its back.
fn hole(builder: &mut Builder, frame: &Frame, Opening { x, y }: Opening) {
    let corner =
        |i: usize, z: f64| frame.at(x[usize::from(i % 4 == 1 || i % 4 == 2)], y[usize::from(i % 4 > 1)], z);
    builder.patch(std::array::from_fn(|i| corner(i, -DEPTH)));
    for i in 0..4 {
        builder.patch([corner(i, 0.0), corner(i + 1, 0.0), corner(i + 1, -DEPTH), corner(i, -DEPTH)]);
    }
}

/// The faces of a bar that lies against something with its back and both its ends.
const UPRIGHT: u8 = faces::X0 | faces::X1 | faces::Z1;
const LEVEL: u8 = faces::Y0 | faces::Y1 | faces::Z1;
/// The faces of something fixed to a wall.
const FIXED: u8 = faces::ALL & !faces::Z0;

/// The four bars of a frame inside an opening.
fn casing(builder: &mut Builder, frame: &Frame, Opening { x, y }: Opening) {
    const WIDTH: f64 = 1.1;
    const FRONT: f64 = -1.0;
    let outer = |i: usize| [x[usize::from(i % 4 == 1 || i % 4 == 2)], y[usize::from(i % 4 > 1)]];
    let inner = |i: usize| {
        let [u, v] = outer(i);
        [u + if u == x[0] { WIDTH } else { -WIDTH }, v + if v == y[0] { WIDTH } else { -WIDTH }]
    };
    for i in 0..4 {
        let at = |p: [f64; 2], z: f64| frame.at(p[0], p[1], z);
        let (a, b, c, d) = (outer(i), outer(i + 1), inner(i + 1), inner(i));
        builder.patch([at(a, FRONT), at(b, FRONT), at(c, FRONT), at(d, FRONT)]);
        builder.patch([at(d, FRONT), at(c, FRONT), at(c, -DEPTH), at(d, -DEPTH)]);
    }
}

/// What a window has in and under its opening: frame, glazing bars and sill.
fn window(builder: &mut Builder, frame: &Frame, opening: Opening) {
    let Opening { x, y } = opening;
    casing(builder, frame, opening);
    let (middle, height) = ((x[0] + x[1]) / 2.0, y[1] - y[0]);
    // The bars end inside the frame.
    let (low, high) = ([middle - 0.7, y[0] + 0.5, -DEPTH], [middle + 0.7, y[1] - 0.5, -1.3]);
    builder.faces_of_block(frame, low, high, UPRIGHT);
    let bar = y[0] + 0.6 * height;
    let (low, high) = ([x[0] + 0.5, bar - 0.5, -DEPTH], [x[1] - 0.5, bar + 0.5, -1.6]);
    builder.faces_of_block(frame, low, high, LEVEL);
    let low = [x[0] - 1.0, y[0] - 1.4, 0.0];
    builder.faces_of_block(frame, low, [x[1] + 1.0, y[0], 2.0], FIXED);
}

/// A pair of open shutters beside a window.
fn shutters(builder: &mut Builder, frame: &Frame, Opening { x, y }: Opening) {
    let leaf = (x[1] - x[0]) / 2.0;
    for left in [x[0] - leaf, x[1]] {
        let (low, high) = ([left, y[0] + 0.2, 0.0], [left + leaf, y[1], 0.9]);
        builder.faces_of_block(frame, low, high, FIXED);
    }
}

/// What a double door has in its opening: frame and leaves with raised panels, under a hood.
fn door(builder: &mut Builder, frame: &Frame, opening: Opening) {
    let Opening { x, y } = opening;
    casing(builder, frame, opening);
    let leaf = (x[1] - x[0]) / 2.0;
    for left in [x[0], x[0] + leaf] {
        for [low, high] in [[0.06, 0.3], [0.35, 0.62], [0.67, 0.95]] {
            let at = |share: f64| y[0] + share * (y[1] - y[0]);
            let low = [left + 1.7, at(low), -DEPTH];
            builder.faces_of_block(frame, low, [left + leaf - 1.7, at(high), -2.2], FIXED);
        }
    }
    let low = [-0.5, y[0], -DEPTH];
    builder.faces_of_block(frame, low, [0.5, y[1], -1.8], UPRIGHT);
    let low = [x[0] - 2.5, y[1], 0.0];
    builder.faces_of_block(frame, low, [x[1] + 2.5, y[1] + 1.6, 3.0], FIXED);
}
