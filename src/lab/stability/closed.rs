//! Closed meshes, and points inside them.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::lab::scenes::scene_of;
use crate::layout::Corners;
use crate::render::seeds::hash;
use crate::scene::{Mesh, Scene};

/// A cube that is turned, so that its corners are numbers which f32 rounds.
pub fn cube() -> Result<Scene> {
    let corner = |i: u32| DVec3::from([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -1.0 } else { 1.0 }));
    let quads: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Ok(scene_of("cube", Mesh { positions: (0..8).map(|i| turned(corner(i))).collect(), triangles }))
}

/// An icosahedron whose triangles are cut into four, `times` over, and pushed out to a sphere (times `bump` of the
/// direction).
fn icosphere(name: &str, times: u32, bump: impl Fn(DVec3) -> f64) -> Scene {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut positions = Vec::new();
    for [one, long] in [[1.0, golden], [-1.0, golden], [1.0, -golden], [-1.0, -golden]] {
        positions.extend([
            DVec3::new(0.0, one, long),
            DVec3::new(one, long, 0.0),
            DVec3::new(long, 0.0, one),
        ]);
    }
    // Faces are triples of corners that are 2 apart.
    let near = |a: usize, b: usize| ((positions[a] - positions[b]).length() - 2.0).abs() < 1e-9;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let outward =
                        (positions[b] - positions[a]).cross(positions[c] - positions[a]).dot(positions[a])
                            > 0.0;
                    let [b, c] = if outward { [b, c] } else { [c, b] };
                    triangles.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for _ in 0..times {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]) * 0.5);
                positions.len() as u32 - 1
            })
        };
        let cut = |&[a, b, c]: &[u32; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        triangles = triangles.iter().flat_map(cut).collect();
    }
    let pushed = positions.iter().map(|p| turned(p.normalize() * bump(p.normalize()))).collect();
    scene_of(name, Mesh { positions: pushed, triangles })
}

pub fn sphere(times: u32) -> Scene {
    icosphere("icosphere", times, |_| 1.0)
}

/// A body with hills and hollows, of triangles of many shapes.
pub fn blob(times: u32) -> Scene {
    icosphere("blob", times, |d| {
        1.0 + 0.2 * (5.0 * d.x + 1.0).sin() * (4.0 * d.y).cos() + 0.05 * (31.0 * d.z + 17.0 * d.x).sin()
    })
}

/// A cone of `slivers` triangles from base to apex, and as many in its base: `height` times as high as its radius.
pub fn cone(slivers: u32, height: f64) -> Scene {
    let rim = |i: u32| {
        let turn = f64::from(i) * std::f64::consts::TAU / f64::from(slivers);
        DVec3::new(turn.cos(), 0.0, turn.sin())
    };
    let mut positions: Vec<DVec3> = (0..slivers).map(rim).collect();
    positions.extend([DVec3::new(0.0, height, 0.0), DVec3::ZERO]);
    let triangles = (0..slivers).flat_map(|i| {
        let next = (i + 1) % slivers;
        [[i, slivers, next], [next, slivers + 1, i]]
    });
    let mesh =
        Mesh { triangles: triangles.collect(), positions: positions.into_iter().map(turned).collect() };
    scene_of("cone", mesh)
}

/// Turned about an axis that is none of the coordinates'.
fn turned(p: DVec3) -> DVec3 {
    glam::DQuat::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 0.7) * p
}

/// Whether every edge is shared by as many triangles one way round as the other.
pub fn is_closed(mesh: &Mesh) -> bool {
    // Files may repeat a corner for each of its triangles.
    let position = |corner: &u32| (mesh.positions[*corner as usize] + 0.0).to_array().map(f64::to_bits);
    let mut edges: HashMap<[[u64; 3]; 2], i64> = HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]].map(|ends| ends.map(position)) {
            *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    edges.values().all(|sum| *sum == 0)
}

/// How often the mesh winds round the point: the sum of its triangles' solid angles over 4 pi (Van Oosterom and Strackee,
/// "The Solid Angle of a Plane Triangle", 1983).
fn winding(triangles: &[Corners], point: Vec3) -> f64 {
    let sum: f64 = triangles
        .par_iter()
        .map(|corners| {
            let [a, b, c] =
                [corners.a, corners.b, corners.c].map(|corner| (Vec3::from(corner) - point).as_dvec3());
            let [x, y, z] = [a.length(), b.length(), c.length()];
            let over = a.dot(b.cross(c));
            let under = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
            2.0 * over.atan2(under)
        })
        .sum();
    sum / (4.0 * std::f64::consts::PI)
}

/// How far points inside are off the surface along each axis at least, device units (the mesh is about 2 wide).
const CLEAR: f32 = 1e-3;

/// Up to `count` points inside, between two points of the surface.
pub fn points_inside(triangles: &[Corners], count: usize, seed: u32) -> Vec<Vec3> {
    let random = |i: u32| f64::from(hash(i, seed)) / 4_294_967_296.0;
    let center = |i: u32| {
        let corners = &triangles[(random(i) * triangles.len() as f64) as usize];
        (Vec3::from(corners.a) + Vec3::from(corners.b) + Vec3::from(corners.c)) / 3.0
    };
    let is_inside = |point: Vec3| (winding(triangles, point).abs() - 1.0).abs() < 0.01;
    let is_clear = |point: Vec3| {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        axes.into_iter().all(|axis| [-CLEAR, CLEAR].into_iter().all(|step| is_inside(point + step * axis)))
    };
    (0..20 * count as u32)
        .map(|i| center(3 * i).lerp(center(3 * i + 1), 0.2 + 0.6 * random(3 * i + 2) as f32))
        .filter(|&point| is_inside(point) && is_clear(point))
        .take(count)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scenes::procedural;
    use crate::render::geometry::Geometry;

    #[test]
    fn the_meshes_are_closed_and_their_inside_is_found() {
        for scene in [cube().unwrap(), sphere(2), blob(2), cone(64, 20.0)] {
            assert!(is_closed(&scene.mesh), "{}", scene.path);
            let geometry = Geometry::build(&scene, true, crate::bvh::Builder::Sah, &|_| {}).unwrap();
            let corners = geometry.corners(&scene.mesh);
            assert!((winding(corners, Vec3::new(3.0, 0.5, 0.2))).abs() < 1e-3, "{}", scene.path);
            assert_eq!(points_inside(corners, 5, 1).len(), 5, "{}", scene.path);
        }
        let mut open = cube().unwrap().mesh;
        open.triangles.pop();
        assert!(!is_closed(&open));
        assert!(!is_closed(&procedural("maison", None, 0).unwrap().mesh));
    }

    #[test]
    fn an_icosphere_has_twenty_times_four_faces() {
        assert_eq!(sphere(0).mesh.triangles.len(), 20);
        assert_eq!(sphere(3).mesh.triangles.len(), 20 * 64);
    }
}
