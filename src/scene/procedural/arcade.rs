//! A square court between two-storey galleries: round arches on columns, half-barrel vaults below, a
//! beamed ceiling above, balustrades, a cornice, a lean-to roof and a fountain.
//!
//! One unit is a metre; +y is up. Everything is built for one side of the court and turned.

use super::builder::{Builder, Frame, faces};
use super::random::Pcg32;
use super::{Request, wanted};
use crate::error::Error;
use crate::scene::Mesh;
use glam::{DVec3, dvec3};
use std::f64::consts::PI;

mod ornament;

/// Galleries of six bays a side.
pub const DEFAULT_TRIANGLES: u64 = 260_000;

/// Half the side of the open court, in metres.
const COURT: f64 = 12.0;
/// Depth of the galleries, in metres.
const GALLERY: f64 = 4.0;
/// Thickness of the arches' wall, in metres.
const WALL: f64 = 0.5;
/// Heights of the two floors and of the ceiling above, in metres.
const LEVELS: [f64; 3] = [0.15, 4.75, 8.75];
/// Height of a column from its floor to the springing of the arches, in metres.
const SPRINGING: [f64; 2] = [2.5, 2.1];
/// Thickness of the floor slab under the upper gallery, in metres.
const SLAB: f64 = 0.3;

/// How finely the galleries are worked out.
struct Detail {
    /// Bays along each side of the court.
    bays: u32,
    /// Segments of arches and of columns.
    segments: u32,
    /// Bands along a column's or a baluster's height.
    rings: u32,
    /// Balusters of the balustrade in each bay.
    balusters: u32,
    /// Whether mouldings, ribs, beams and the fountain's bowl are left out.
    plain: bool,
}

impl Detail {
    /// The details in order of their number of triangles.
    fn level(level: u32) -> Self {
        Self {
            bays: (2 + level / 3).min(6),
            segments: 4 + level,
            rings: 2 + level,
            balusters: level.min(9),
            plain: level == 0,
        }
    }
}

/// Builds the court. Most of the triangles are the galleries' at the finest level that leaves room
/// for a floor; the tiles of the floor take the others.
pub fn generate(request: &Request) -> Result<Mesh, Error> {
    let triangles = wanted(request, DEFAULT_TRIANGLES, "arcade", 2_000..=5_000_000)?;
    let budget = (triangles as f64 * 0.92) as u64;
    let mut builder = finest(budget);
    let tiles = triangles.saturating_sub(builder.count()) / ornament::PER_TILE;
    let mut random = Pcg32::new(request.seed);
    ornament::tiles(&mut builder, &mut random, tiles);
    Ok(builder.finish())
}

/// The finest court of at most `budget` triangles, or the plainest one.
fn finest(budget: u64) -> Builder {
    let mut best = court(&Detail::level(0));
    // Doubled steps and then halved ones: close to the budget, courts are costly to build.
    let (mut level, mut step, mut grows) = (0, 1, true);
    while step > 0 {
        let finer = court(&Detail::level(level + step));
        if finer.count() <= budget {
            best = finer;
            level += step;
        } else {
            grows = false;
        }
        step = if grows { 2 * step } else { step / 2 };
    }
    best
}

/// Everything but the tiles of the court.
fn court(detail: &Detail) -> Builder {
    let mut builder = Builder::new(4);
    let outer = COURT + GALLERY + 0.4;
    builder.block(&Frame::WORLD, [-outer, -0.6, -outer], [outer, -0.1, outer]);
    for side in 0..4 {
        // Seen from the middle of the court, x runs along the side and z away from it.
        let frame = Frame::facade(side, 0.0);
        shell(&mut builder, &frame);
        for storey in 0..2 {
            arches(&mut builder, &frame, detail, storey);
            columns(&mut builder, &frame, detail, storey);
        }
        vault(&mut builder, &frame, detail);
        ceiling(&mut builder, &frame, detail);
        ornament::balustrade(&mut builder, &frame, detail);
        ornament::cornice(&mut builder, &frame, detail.plain);
    }
    ornament::fountain(&mut builder, detail);
    builder
}

/// A block whose ends are mitred at the corners of the court: x runs from -z to z.
fn mitred(builder: &mut Builder, frame: &Frame, y: [f64; 2], z: [f64; 2]) {
    let corners = std::array::from_fn(|i| {
        let out = z[usize::from(i & 4 != 0)];
        let x = if i & 1 == 0 { -out } else { out };
        frame.at(x, y[usize::from(i & 2 != 0)], out)
    });
    // The mitres touch those of the neighbouring sides.
    builder.hexahedron(corners, faces::ALL & !(faces::X0 | faces::X1));
}

/// The gallery's floors, its back wall and its roof.
fn shell(builder: &mut Builder, frame: &Frame) {
    let back = COURT + GALLERY;
    mitred(builder, frame, [-0.1, LEVELS[0]], [COURT - 0.3, back]);
    mitred(builder, frame, [LEVELS[1] - SLAB, LEVELS[1]], [COURT, back]);
    mitred(builder, frame, [-0.1, LEVELS[2]], [back, back + 0.4]);
    let corners = std::array::from_fn(|i| {
        let (out, y) = if i & 4 == 0 { (COURT - 0.7, 9.0) } else { (back + 0.5, 10.6) };
        let x = if i & 1 == 0 { -out } else { out };
        frame.at(x, if i & 2 == 0 { y } else { y + 0.18 }, out)
    });
    builder.hexahedron(corners, faces::ALL & !(faces::X0 | faces::X1));
    // The back wall goes on up to the roof.
    mitred(builder, frame, [LEVELS[2], 10.55], [back + 0.1, back + 0.4]);
}

/// Half the clear width of an arch, in metres.
fn arch_radius(detail: &Detail) -> f64 {
    COURT / f64::from(detail.bays) - 0.28
}

/// Middles of the bays along one side, in metres.
fn bays(detail: &Detail) -> impl Iterator<Item = f64> {
    let (count, width) = (detail.bays, 2.0 * COURT / f64::from(detail.bays));
    (0..count).map(move |bay| (f64::from(bay) + 0.5) * width - COURT)
}

/// Height of the springing of the arches of `storey`, in metres. Wide arches spring lower.
fn springing(storey: usize, detail: &Detail) -> f64 {
    let top = [LEVELS[1] - SLAB, LEVELS[2]][storey] - 0.25;
    (LEVELS[storey] + SPRINGING[storey]).min(top - arch_radius(detail) * rise(detail))
}

/// Height of an arch over its half width: round, but flatter where few bays make it too wide.
fn rise(detail: &Detail) -> f64 {
    (1.75 / arch_radius(detail)).min(1.0)
}

/// The wall above the columns with its round arches: two faces with the spandrels, and the soffits.
fn arches(builder: &mut Builder, frame: &Frame, detail: &Detail, storey: usize) {
    let (radius, low) = (arch_radius(detail), springing(storey, detail));
    let top = [LEVELS[1] - SLAB, LEVELS[2] + 0.3][storey];
    let half = COURT / f64::from(detail.bays);
    let n = detail.segments;
    for x in bays(detail) {
        let arch = |i: u32, z: f64| {
            let angle = PI * f64::from(i) / f64::from(n);
            let (across, up) = (-radius * angle.cos(), radius * angle.sin() * rise(detail));
            frame.at(x + across, low + up, COURT + z)
        };
        // Over the arch, the wall's upper edge is cut at the arch's own places.
        let edge = |i: u32, z: f64| {
            let across = -radius * (PI * f64::from(i) / f64::from(n)).cos();
            frame.at(x + across, top, COURT + z)
        };
        builder.grid(n, 1, |i, j| if j == 0 { edge(i, 0.0) } else { arch(i, 0.0) });
        builder.grid(n, 1, |i, j| if j == 0 { arch(i, WALL) } else { edge(i, WALL) });
        builder.grid(n, 1, |i, j| arch(i, if j == 0 { 0.0 } else { WALL }));
        for (from, to) in [(-half, -radius), (radius, half)] {
            let (low, high) = ([x + from, low, COURT], [x + to, top, COURT + WALL]);
            builder.faces_of_block(frame, low, high, faces::Z0 | faces::Z1 | faces::Y0);
        }
    }
}

/// A column under the end of every arch: base, shaft with entasis, capital and abacus. The one in
/// the corner belongs to the side that it ends.
fn columns(builder: &mut Builder, frame: &Frame, detail: &Detail, storey: usize) {
    let (floor, top) = (LEVELS[storey], springing(storey, detail));
    let width = 2.0 * COURT / f64::from(detail.bays);
    let profile = column_profile(detail, floor, top);
    for bay in 0..detail.bays {
        let (x, z) = (width * f64::from(bay + 1) - COURT, COURT + WALL / 2.0);
        // The corner columns of two sides are one.
        let x = if bay + 1 == detail.bays { z } else { x };
        let block = |builder: &mut Builder, r: f64, low: f64, high: f64| {
            builder.block(frame, [x - r, low, z - r], [x + r, high, z + r]);
        };
        if !detail.plain {
            block(builder, 0.32, floor, floor + 0.12);
        }
        builder.lathe(frame.at(x, 0.0, z), &profile, detail.segments.max(4));
        block(builder, 0.33, top - 0.12, top);
    }
}

/// The profile of a column that stands on `floor` and reaches to `top`, in metres.
fn column_profile(detail: &Detail, floor: f64, top: f64) -> Vec<(f64, f64)> {
    if detail.plain {
        return vec![(0.24, floor - 0.05), (0.2, top - 0.1)];
    }
    let shaft = |t: f64| 0.2 - 0.035 * t * t;
    let (low, high) = (floor + 0.3, top - 0.42);
    let mut profile = vec![(0.27, floor + 0.1), (0.27, floor + 0.2), (0.21, low)];
    for i in 0..=detail.rings {
        let t = f64::from(i) / f64::from(detail.rings);
        profile.push((shaft(t), low + 0.02 + t * (high - low - 0.02)));
    }
    profile.extend([(0.21, high + 0.04), (0.18, high + 0.1)]);
    let bell = (detail.rings / 2).max(1);
    for i in 0..=bell {
        // The bell of the capital opens up as a quarter of an ellipse.
        let t = f64::from(i) / f64::from(bell) * PI / 2.0;
        profile.push((0.3 - 0.11 * t.cos(), high + 0.12 + 0.18 * t.sin()));
    }
    // Into the abacus, so that the end is closed.
    profile.push((0.3, top - 0.1));
    profile
}

/// The half-barrel vault over the lower gallery, with ribs at the columns. Its crown lies behind the
/// arches, which a whole barrel would block at its springing.
fn vault(builder: &mut Builder, frame: &Frame, detail: &Detail) {
    let (near, far) = (COURT + WALL, COURT + GALLERY);
    let (crown, spring) = (LEVELS[1] - SLAB - 0.1, LEVELS[1] - SLAB - 1.7);
    let n = detail.segments;
    let place = |j: u32, drop: f64| {
        let (sine, cosine) = (PI / 2.0 * f64::from(j) / f64::from(n)).sin_cos();
        let z = near + (far - near) * sine;
        (z, spring + (crown - spring) * cosine - drop)
    };
    let columns = 2 * detail.bays;
    builder.grid(columns, n, |i, j| {
        let (z, y) = place(j, 0.0);
        frame.at(z * (2.0 * f64::from(i) / f64::from(columns) - 1.0), y, z)
    });
    let ribs = if detail.plain { 0 } else { detail.bays as usize };
    for x in bays(detail).take(ribs).skip(1) {
        let x = x - COURT / f64::from(detail.bays);
        builder.grid(1, n, |i, j| {
            let (z, y) = place(j, 0.1);
            frame.at(x + if i == 0 { -0.15 } else { 0.15 }, y, z)
        });
        for hand in [-0.15, 0.15] {
            builder.grid(n, 1, |i, j| {
                let (z, y) = place(i, if (j == 0) == (hand < 0.0) { 0.1 } else { 0.0 });
                frame.at(x + hand, y, z)
            });
        }
    }
}

/// The ceiling of the upper gallery: boards over beams from the arches' wall to the back wall.
fn ceiling(builder: &mut Builder, frame: &Frame, detail: &Detail) {
    let back = COURT + GALLERY;
    mitred(builder, frame, [LEVELS[2], LEVELS[2] + 0.1], [COURT + WALL, back]);
    let beams = if detail.plain { 0 } else { detail.bays * detail.rings.min(5) };
    for i in 0..beams {
        let x = 2.0 * COURT * (f64::from(i) + 0.5) / f64::from(beams) - COURT;
        let low = [x - 0.1, LEVELS[2] - 0.22, COURT + WALL];
        let which = faces::X0 | faces::X1 | faces::Y0;
        builder.faces_of_block(frame, low, [x + 0.1, LEVELS[2], back], which);
    }
}

/// The foot of a solid of revolution in the middle of the court, at the height `y` in metres.
fn middle(y: f64) -> DVec3 {
    dvec3(0.0, y, 0.0)
}
