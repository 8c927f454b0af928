//! A mountain range: a regular grid whose heights are a sum of gradient noises.
//!
//! Octaves add up as fractional Brownian motion. Each is damped where the octaves before it are
//! steep, which leaves smooth flanks and rough crests as erosion does, and a ridged layer draws
//! sharp watersheds (F. K. Musgrave in "Texturing and Modeling: A Procedural Approach", 2003).

use super::random::hash;
use super::{Request, wanted};
use crate::error::Error;
use crate::scene::Mesh;
use glam::{DVec2, DVec3, dvec2, dvec3};

/// A grid of 1,000 by 1,000 squares.
pub const DEFAULT_TRIANGLES: u64 = 2_000_000;

/// Side of the terrain in scene units.
const EXTENT: f64 = 1000.0;
/// Height in scene units that noise of value 1 stands for.
const RELIEF: f64 = 420.0;
/// Lattice cells of the first octave along one side.
const CELLS: f64 = 3.2;
/// Octaves of noise. The last has about two grid squares a cell in the default grid.
const OCTAVES: u32 = 9;

/// Builds the terrain: two triangles a square of the largest square grid that the wanted number
/// has room for.
pub fn generate(request: &Request) -> Result<Mesh, Error> {
    let triangles = wanted(request, DEFAULT_TRIANGLES, "terrain", 2..=20_000_000)?;
    let side = (triangles / 2).isqrt() as u32;
    let step = EXTENT / f64::from(side);
    let round = |value: f64| (value * 1000.0).round() / 1000.0 + 0.0;
    let line: Vec<f64> = (0..=side).map(|i| round(f64::from(i) * step - EXTENT / 2.0)).collect();
    let mut positions = Vec::with_capacity(line.len() * line.len());
    for &z in &line {
        for &x in &line {
            positions.push(dvec3(x, round(height(x, z, request.seed)), z));
        }
    }
    Ok(Mesh { triangles: squares(side, &positions), positions })
}

/// The triangles of a grid of `side` by `side` squares, counter-clockwise from above. Each square
/// is cut along the diagonal whose ends differ less in height, which follows ridges and valleys.
fn squares(side: u32, positions: &[DVec3]) -> Vec<[u32; 3]> {
    let mut triangles = Vec::with_capacity(2 * side as usize * side as usize);
    let y = |index: u32| positions[index as usize].y;
    for j in 0..side {
        for i in 0..side {
            let a = j * (side + 1) + i;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            if (y(a) - y(d)).abs() < (y(b) - y(c)).abs() {
                triangles.extend([[a, c, d], [a, d, b]]);
            } else {
                triangles.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    triangles
}

/// Height of the terrain above (`x`, `z`), all in scene units.
fn height(x: f64, z: f64, seed: u32) -> f64 {
    let mut p = dvec2(x, z) * (CELLS / EXTENT) + dvec2(17.3, 41.9);
    // A gentle warp bends the ridges, which would else follow the lattice.
    let bend = noise(p * 0.7, seed ^ 0x5bd1).0;
    p += dvec2(bend, -bend) * 0.35;
    let mut slope = DVec2::ZERO;
    let (mut sum, mut amplitude, mut frequency) = (0.0, 0.55, 1.0);
    for octave in 0..OCTAVES {
        let (value, gradient) = noise(p * frequency, seed.wrapping_add(octave));
        slope += gradient * (amplitude * 1.6);
        let damping = 1.0 / (1.0 + slope.length_squared());
        let ridge = 1.0 - (2.0 * value).abs();
        let mixed = if octave < 3 { value + 0.3 * ridge * ridge } else { value };
        sum += amplitude * mixed * damping;
        amplitude *= 0.5;
        // Not 2, so that lattice points of the octaves do not coincide.
        frequency *= 1.97;
        // A turn by the angle of a 3-4-5 triangle keeps the octaves' axes apart.
        p = dvec2(0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y);
        slope = dvec2(0.8 * slope.x - 0.6 * slope.y, 0.6 * slope.x + 0.8 * slope.y);
    }
    RELIEF * sum
}

/// Gradient noise at `p` (lattice cells), about -0.7 to 0.7, and its gradient.
fn noise(p: DVec2, seed: u32) -> (f64, DVec2) {
    let cell = p.floor();
    let f = p - cell;
    let (column, row) = (cell.x as i32 as u32, cell.y as i32 as u32);
    let corner = |i: u32, j: u32| {
        let bits = hash(hash(hash(seed) ^ column.wrapping_add(i)) ^ row.wrapping_add(j));
        let slope = DIRECTIONS[(bits >> 28) as usize];
        (slope, slope.dot(f - dvec2(f64::from(i), f64::from(j))))
    };
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let fade_slope = 30.0 * f * f * (f * (f - 2.0) + 1.0);
    let [(ga, a), (gb, b), (gc, c), (gd, d)] = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
    let twist = a - b - c + d;
    let value = a + fade.x * (b - a) + fade.y * (c - a) + fade.x * fade.y * twist;
    let gradient = ga
        + fade.x * (gb - ga)
        + fade.y * (gc - ga)
        + fade.x * fade.y * (ga - gb - gc + gd)
        + fade_slope * (dvec2(fade.y, fade.x) * twist + dvec2(b - a, c - a));
    (value, gradient)
}

/// Sixteen directions round the circle. Literals, since a sine may differ between machines.
const DIRECTIONS: [DVec2; 16] = {
    const C: f64 = 0.923_879_532_511_286_7;
    const S: f64 = 0.382_683_432_365_089_8;
    const H: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        dvec2(1.0, 0.0),
        dvec2(C, S),
        dvec2(H, H),
        dvec2(S, C),
        dvec2(0.0, 1.0),
        dvec2(-S, C),
        dvec2(-H, H),
        dvec2(-C, S),
        dvec2(-1.0, 0.0),
        dvec2(-C, -S),
        dvec2(-H, -H),
        dvec2(-S, -C),
        dvec2(0.0, -1.0),
        dvec2(S, -C),
        dvec2(H, -H),
        dvec2(C, -S),
    ]
};
