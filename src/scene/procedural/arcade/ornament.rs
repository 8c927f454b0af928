//! What adorns the court: balustrades, cornices, the fountain and the tiles of the floor.

use super::super::builder::{Builder, Frame, faces};
use super::super::random::Pcg32;
use super::{COURT, Detail, LEVELS, SLAB, WALL, bays, middle, mitred};
use std::f64::consts::{PI, TAU};

/// Triangles of one tile: the top and four sides.
pub const PER_TILE: u64 = 10;

/// The balustrade between the columns of the upper gallery.
pub fn balustrade(builder: &mut Builder, frame: &Frame, detail: &Detail) {
    let (floor, z) = (LEVELS[1], COURT + WALL / 2.0);
    mitred(builder, frame, [floor, floor + 0.14], [z - 0.12, z + 0.12]);
    mitred(builder, frame, [floor + 0.84, floor + 0.96], [z - 0.14, z + 0.14]);
    let profile: Vec<(f64, f64)> = (0..=detail.rings)
        .map(|i| {
            let t = f64::from(i) / f64::from(detail.rings);
            let belly = (PI * (1.0 - (1.0 - t).powi(2))).sin();
            (0.045 + 0.035 * belly - 0.008 * (t * 6.0 * PI).sin(), floor + 0.1 + 0.78 * t)
        })
        .collect();
    let half = COURT / f64::from(detail.bays);
    for x in bays(detail) {
        for i in 0..detail.balusters {
            let share = f64::from(i + 1) / f64::from(detail.balusters + 1);
            let foot = frame.at(x + half * (2.0 * share - 1.0), 0.0, z);
            builder.lathe(foot, &profile, (detail.segments / 2).max(4));
        }
    }
}

/// The string course between the storeys and the cornice under the roof.
pub fn cornice(builder: &mut Builder, frame: &Frame, plain: bool) {
    let floor = LEVELS[1];
    if plain {
        return;
    }
    mitred(builder, frame, [floor - SLAB, floor - 0.12], [COURT - 0.08, COURT]);
    mitred(builder, frame, [floor - 0.12, floor], [COURT - 0.16, COURT]);
    for (step, out) in [0.1, 0.22, 0.36].into_iter().enumerate() {
        let y = LEVELS[2] + 0.3 + 0.12 * step as f64;
        mitred(builder, frame, [y, y + 0.12], [COURT - out, COURT + WALL]);
    }
}

/// The fountain: two steps, a round basin with water, and a bowl on a foot.
pub fn fountain(builder: &mut Builder, detail: &Detail) {
    let segments = 2 * detail.segments;
    builder.lathe(middle(-0.05), &[(2.7, 0.0), (2.7, 0.2), (0.0, 0.2)], segments);
    builder.lathe(middle(0.1), &[(2.3, 0.0), (2.3, 0.2), (0.0, 0.2)], segments);
    let basin = [
        (1.85, 0.0),
        (1.75, 0.1),
        (1.75, 0.45),
        (1.92, 0.55),
        (1.92, 0.62),
        (1.6, 0.62),
        (1.6, 0.45),
        (0.0, 0.45),
    ];
    builder.lathe(middle(0.3), &basin, segments);
    if detail.plain {
        return;
    }
    let rings = 2 * detail.rings;
    let foot: Vec<(f64, f64)> = (0..=rings)
        .map(|i| {
            let t = f64::from(i) / f64::from(rings);
            // A waist that opens up into the bowl.
            (0.16 + 0.1 * (1.0 - t).powi(4) + 0.8 * t.powi(6) + 0.02 * (t * 3.0 * TAU).sin(), 1.2 * t)
        })
        .chain([(0.9, 1.2), (0.5, 1.1), (0.0, 1.06)])
        .collect();
    builder.lathe(middle(0.7), &foot, segments);
    let spout = [(0.12, 0.0), (0.07, 0.3), (0.14, 0.36), (0.06, 0.5), (0.0, 0.54)];
    builder.lathe(middle(1.7), &spout, segments);
}

/// About `count` tiles over the court. Each lies a little higher or lower than the next, tilts a
/// little and has a joint round it.
pub fn tiles(builder: &mut Builder, random: &mut Pcg32, count: u64) {
    let rows = ((count as f64).sqrt() as u64).max(1);
    let columns = (count + rows / 2) / rows;
    let half = COURT - 0.3;
    let (width, depth) = (2.0 * half / columns as f64, 2.0 * half / rows as f64);
    let joint = 0.02 * width.min(depth);
    for row in 0..rows {
        for column in 0..columns {
            let (x, z) = (width * column as f64 - half, depth * row as f64 - half);
            let level = random.range(-0.006, 0.006);
            let tilt = [random.range(-0.006, 0.006), random.range(-0.006, 0.006)];
            let corners = std::array::from_fn(|i| {
                let (right, up, far) = (i & 1 != 0, i & 2 != 0, i & 4 != 0);
                let lean = if right { tilt[0] } else { -tilt[0] } + if far { tilt[1] } else { -tilt[1] };
                Frame::WORLD.at(
                    if right { x + width - joint } else { x + joint },
                    if up { level + lean } else { -0.1 },
                    if far { z + depth - joint } else { z + joint },
                )
            });
            builder.hexahedron(corners, faces::ALL & !faces::Y0);
        }
    }
}
