//! A creole house: two storeys under a hipped roof, with a verandah all round the ground floor.
//!
//! One unit is about 8.5 cm. The front looks to +z, and +y is up. All solids are closed, or open
//! only where an end lies inside another solid.

use super::builder::{Builder, Frame, faces};
use super::{Request, wanted};
use crate::error::Error;
use crate::scene::Mesh;
use glam::DVec3;

mod openings;
mod roofs;

/// The house as its plan has it: see `Detail::PLAN`.
pub const DEFAULT_TRIANGLES: u64 = 5_456;

/// Half extents of the walls in x and z, in units.
const BODY: [f64; 2] = [72.0, 52.0];
/// Half extents of the verandah's floor in x and z, in units.
const DECK: [f64; 2] = [100.0, 80.0];
/// Height of the masonry plinth, in units.
const PLINTH: f64 = 10.0;
/// Height of the verandah's floor, in units.
const FLOOR: f64 = 11.0;
/// Height of the underside of the plate that the posts carry, in units.
const PLATE: f64 = 43.0;
/// Height of the top of the walls, in units.
const WALL_TOP: f64 = 93.0;
/// Distance of the posts' and the railing's middle from the edge of the floor, in units.
const POST_INSET: f64 = 3.0;
/// Half the width of the gap in the railing at the front and the back steps, in units.
const ENTRANCE: f64 = 19.0;

/// How finely the house is worked out.
struct Detail {
    /// Whether the house has its trim: window frames and sills, capitals, the caps of the roofs.
    trim: bool,
    /// Whether the windows have shutters.
    shutters: bool,
    /// Boards of the verandah's floor between wall and edge.
    boards: u32,
    /// Segments and rings of the turned posts and balusters; `None` for square ones.
    turned: Option<(u32, u32)>,
    /// Rows of shingles from the eaves to the ridge.
    shingles: u32,
    /// Pointed pendants of the valance along each side of the verandah's eaves.
    pendants: u32,
    /// The most balusters that the railing is given.
    most_balusters: u64,
}

impl Detail {
    /// The house without a number of triangles asked for.
    const PLAN: Detail = Detail {
        trim: true,
        shutters: true,
        boards: 3,
        turned: None,
        shingles: 0,
        pendants: 0,
        most_balusters: 300,
    };
    /// Balusters of the house without a number of triangles asked for: seven a bay.
    const PLAN_BALUSTERS: u32 = 168;

    /// The details in order of their number of triangles.
    fn level(level: u32) -> Self {
        match level {
            0 => Self { trim: false, shutters: false, boards: 1, most_balusters: 380, ..Self::PLAN },
            1 => Self { shutters: false, most_balusters: 200, ..Self::PLAN },
            2 => Self::PLAN,
            _ => Self {
                boards: 1 + level.min(9),
                turned: Some((2 * level - 2, 2 * level - 3)),
                shingles: 4 * (level - 3),
                pendants: 12 * (level - 3).min(6),
                most_balusters: 240,
                ..Self::PLAN
            },
        }
    }

    /// Triangles of one baluster.
    fn per_baluster(&self) -> u64 {
        self.turned.map_or(8, |(segments, rings)| 2 * u64::from(segments * rings))
    }
}

/// Builds the house.
pub fn generate(request: &Request) -> Result<Mesh, Error> {
    let triangles = wanted(request, DEFAULT_TRIANGLES, "maison", 1_000..=2_000_000)?;
    if request.triangles.is_none() {
        let mut builder = house(&Detail::PLAN);
        balusters(&mut builder, &Detail::PLAN, Detail::PLAN_BALUSTERS);
        return Ok(builder.finish());
    }
    // The first level that can do with a railing's worth of balusters takes as many as fill it up.
    let mut level = 0;
    loop {
        let detail = Detail::level(level);
        let mut builder = house(&detail);
        let each = detail.per_baluster();
        let count = (triangles.saturating_sub(builder.count()) + each / 2) / each;
        if count <= detail.most_balusters {
            balusters(&mut builder, &detail, count as u32);
            return Ok(builder.finish());
        }
        level += 1;
    }
}

/// Everything but the balusters.
fn house(detail: &Detail) -> Builder {
    let mut builder = Builder::new(3);
    ground(&mut builder, detail.trim);
    floor_boards(&mut builder, detail);
    openings::walls(&mut builder, detail);
    posts(&mut builder, detail);
    rails(&mut builder);
    valance(&mut builder, detail);
    roofs::roofs(&mut builder, detail);
    roofs::chimneys(&mut builder, detail.trim);
    builder
}

/// Half the length of side `side` of a rectangle with the half extents `half`, and its distance
/// from the middle, in units.
fn extents(half: [f64; 2], side: usize) -> (f64, f64) {
    (half[side % 2], half[1 - side % 2])
}

/// The garden, the plinth and the steps before the front and the back door.
fn ground(builder: &mut Builder, trim: bool) {
    // What stands on or against something else leaves out the face that touches it.
    const STANDING: u8 = faces::ALL & !faces::Y0;
    const LEANING: u8 = STANDING & !faces::Z0;
    builder.block(&Frame::WORLD, [-145.0, -4.0, -145.0], [145.0, 0.0, 145.0]);
    let low = [-DECK[0], 0.0, -DECK[1]];
    builder.faces_of_block(&Frame::WORLD, low, [DECK[0], PLINTH, DECK[1]], STANDING);
    let steps = if trim { 5 } else { 3 };
    for side in [0, 2] {
        let frame = Frame::facade(side, DECK[1]);
        let rise = FLOOR / f64::from(steps + 1);
        for step in 0..steps {
            let reach = 20.0 * f64::from(steps - step) / f64::from(steps);
            let low = [-16.0, rise * f64::from(step), 0.0];
            let high = [16.0, rise * f64::from(step + 1), reach];
            builder.faces_of_block(&frame, low, high, LEANING);
        }
        if trim {
            for x in [-19.0, 16.0] {
                let high = [x + 3.0, 7.0, 22.0];
                builder.faces_of_block(&frame, [x, 0.0, 0.0], high, LEANING & !faces::Y1);
                let high = [x + 3.5, 8.2, 22.5];
                builder.faces_of_block(&frame, [x - 0.5, 7.0, 0.0], high, faces::ALL & !faces::Z0);
            }
        }
    }
}

/// The boards of the verandah, which run along the walls and meet at the corners.
fn floor_boards(builder: &mut Builder, detail: &Detail) {
    const OVERHANG: f64 = 1.0;
    let width = (DECK[0] - BODY[0] + OVERHANG) / f64::from(detail.boards);
    for side in 0..4 {
        let (half, distance) = extents(BODY, side);
        let frame = Frame::facade(side, distance);
        for board in 0..detail.boards {
            let near = width * f64::from(board);
            let far = near + width - 0.3;
            // Mitred ends: each board is as long as the square corner lets it.
            let corners = std::array::from_fn(|i| {
                let out = if i & 4 == 0 { near } else { far };
                let x = if i & 1 == 0 { -half - out } else { half + out };
                frame.at(x, if i & 2 == 0 { PLINTH } else { FLOOR }, out)
            });
            builder.hexahedron(corners, faces::ALL);
        }
    }
}

/// Places of the posts along side `side` but for the corner at its right end, in units.
fn post_places(side: usize) -> Vec<f64> {
    let half = extents(DECK, side).0 - POST_INSET;
    if side.is_multiple_of(2) {
        // The entrance is in the middle; three equal bays lie on either side of it.
        let bay = (half - ENTRANCE) / 3.0;
        let right = (0..3).map(|i| ENTRANCE + bay * f64::from(i));
        let left = (0..4).map(|i| -half + bay * f64::from(i));
        left.chain(right).collect()
    } else {
        (0..6).map(|i| half * (f64::from(i) / 3.0 - 1.0)).collect()
    }
}

/// The frame of the railing of side `side`: its z is 0 in the middle of the posts.
fn railing(side: usize) -> Frame {
    Frame::facade(side, extents(DECK, side).1 - POST_INSET)
}

/// The faces of an upright piece whose ends lie inside others.
const ENDLESS: u8 = faces::ALL & !(faces::Y0 | faces::Y1);

/// The posts with their capitals, and the plate that lies on them.
fn posts(builder: &mut Builder, detail: &Detail) {
    for side in 0..4 {
        let frame = railing(side);
        let half = extents(DECK, side).0 - POST_INSET;
        for x in post_places(side) {
            let block = |builder: &mut Builder, r: f64, low: f64, high: f64, which| {
                builder.faces_of_block(&frame, [x - r, low, -r], [x + r, high, r], which);
            };
            if detail.trim {
                block(builder, 2.1, PLATE - 2.5, PLATE, faces::ALL & !faces::Y1);
            }
            match detail.turned {
                None => block(builder, 1.4, FLOOR - 0.5, PLATE + 0.5, ENDLESS),
                Some((segments, rings)) => {
                    block(builder, 2.1, FLOOR, FLOOR + 12.0, faces::ALL);
                    let shaft = turned(rings, 1.8, FLOOR + 11.5, PLATE - 2.0);
                    builder.lathe(frame.at(x, 0.0, 0.0), &shaft, segments);
                }
            }
        }
        // Each plate reaches over the corner post at one end and butts there on the next plate.
        let low = [-half - 1.6, PLATE, -1.6];
        builder.block(&frame, low, [half - 1.6, PLATE + 3.0, 1.6]);
    }
}

/// The profile of a turned shaft of the given number of bands, in units: a foot, a belly and a
/// neck.
fn turned(rings: u32, radius: f64, low: f64, high: f64) -> Vec<(f64, f64)> {
    (0..=rings)
        .map(|i| {
            let t = f64::from(i) / f64::from(rings);
            let belly = (std::f64::consts::PI * (1.0 - (1.0 - t).powi(2))).sin();
            let beads = 0.06 * (t * 9.0 * std::f64::consts::PI).cos();
            (radius * (0.55 + 0.4 * belly + beads), low + t * (high - low))
        })
        .collect()
}

/// Height of the bottom and the hand rail's underside above the floor, in units.
const RAILS: [f64; 2] = [1.6, 10.0];

/// The ends of the railing's runs along side `side`, in units: one run, or two beside the steps.
fn runs(side: usize) -> Vec<(f64, f64)> {
    let half = extents(DECK, side).0 - POST_INSET;
    if side.is_multiple_of(2) { vec![(-half, -ENTRANCE), (ENTRANCE, half)] } else { vec![(-half, half)] }
}

/// The bottom rails and the handrails on all four sides.
fn rails(builder: &mut Builder) {
    for side in 0..4 {
        let frame = railing(side);
        for (from, to) in runs(side) {
            let [bottom, hand] = RAILS.map(|height| FLOOR + height);
            // Their ends lie inside the posts.
            const RAIL: u8 = faces::ALL & !(faces::X0 | faces::X1);
            let rail = |builder: &mut Builder, low: f64, high: f64, r: f64| {
                builder.faces_of_block(&frame, [from, low, -r], [to, high, r], RAIL);
            };
            rail(builder, bottom, bottom + 1.0, 0.7);
            rail(builder, hand, hand + 1.2, 1.1);
        }
    }
}

/// `count` balusters, spread over the bays between the posts as evenly as it goes.
fn balusters(builder: &mut Builder, detail: &Detail, count: u32) {
    let bays: Vec<(usize, f64, f64)> = (0..4)
        .flat_map(|side| {
            let mut places = post_places(side);
            places.push(extents(DECK, side).0 - POST_INSET);
            let pairs: Vec<_> = places.windows(2).map(|pair| (side, pair[0], pair[1])).collect();
            pairs
        })
        .filter(|&(side, from, to)| side % 2 == 1 || from + to != 0.0)
        .collect();
    let share = |bay: usize| count * bay as u32 / bays.len() as u32;
    // The ends lie inside the two rails, so a shaft needs no end faces.
    let (low, high) = (FLOOR + RAILS[0] + 0.5, FLOOR + RAILS[1] + 0.5);
    for (index, &(side, from, to)) in bays.iter().enumerate() {
        let frame = railing(side);
        let here = share(index + 1) - share(index);
        for i in 0..here {
            let x = from + (to - from) * f64::from(i + 1) / f64::from(here + 1);
            match detail.turned {
                None => {
                    let (low, high) = ([x - 0.55, low, -0.55], [x + 0.55, high, 0.55]);
                    builder.faces_of_block(&frame, low, high, ENDLESS);
                }
                Some((segments, rings)) => {
                    let profile = turned(rings, 0.85, low, high);
                    builder.lathe(frame.at(x, 0.0, 0.0), &profile, segments);
                }
            }
        }
    }
}

/// The valance: pointed boards that hang from the verandah's eaves.
fn valance(builder: &mut Builder, detail: &Detail) {
    for side in 0..4 {
        let (half, distance) = extents(roofs::LEAN_TO_EAVES, side);
        let frame = Frame::facade(side, distance - 1.2);
        let width = 2.0 * (half - 1.2) / f64::from(detail.pendants.max(1));
        for i in 0..detail.pendants {
            let x = width * f64::from(i) + 1.2 - half;
            let y = roofs::LEAN_TO_HEIGHT - 1.5;
            let corner = |dx: f64, dy: f64| frame.at(x + dx * width, y + dy, 0.0);
            let base: [DVec3; 5] =
                [corner(0.0, 0.0), corner(0.0, -1.5), corner(0.5, -4.0), corner(1.0, -1.5), corner(1.0, 0.0)];
            let sweep = frame.at(0.0, 0.0, 0.7) - frame.at(0.0, 0.0, 0.0);
            builder.prism(&base, sweep);
        }
    }
}
