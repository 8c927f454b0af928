//! The Cornell box, from the measurements that Cornell University's Program of Computer Graphics
//! published of the physical box.
//!
//! The measured coordinates are in millimetres, with the open side at z = 0, x running to the left
//! of somebody who looks in, and the camera at negative z. The scene is 2 units wide and centred,
//! y is up, and the box opens towards +z.

use super::Request;
use super::builder::Builder;
use crate::error::Error;
use crate::scene::Mesh;
use glam::{DVec3, dvec3};
use std::io::{self, Write};

/// Half the width of the ceiling in millimetres: one unit of the scene.
const UNIT: f64 = 278.0;
/// Half the depth of the room in millimetres.
const HALF_DEPTH: f64 = 279.6;
/// How far the lamp hangs under the ceiling, in scene units. In the measured box it fills a hole
/// in the ceiling; a gap keeps the two surfaces from fighting.
const LAMP_DROP: f64 = 0.01;
/// Decimals that the scene's coordinates keep.
const DECIMALS: i32 = 4;

/// A planar face with a name.
pub struct Face {
    /// The part of the scene that the face belongs to.
    pub group: &'static str,
    /// What the face is.
    pub label: &'static str,
    /// Its corners in scene units, counter-clockwise as seen from the side that it faces.
    pub corners: [DVec3; 4],
}

/// The room's faces in millimetres, counter-clockwise as seen from inside the room.
const ROOM: [(&str, [[f64; 3]; 4]); 5] = [
    ("floor", [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]]),
    ("ceiling", [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]]),
    ("back wall", [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]]),
    ("right wall", [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]]),
    ("left wall", [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]]),
];

/// The lamp in millimetres, at the height of the ceiling.
const LAMP: [[f64; 3]; 4] =
    [[343.0, 548.8, 227.0], [343.0, 548.8, 332.0], [213.0, 548.8, 332.0], [213.0, 548.8, 227.0]];

/// The boxes: name, height in millimetres and the (x, z) corners of the top in millimetres,
/// counter-clockwise as seen from above.
const BOXES: [(&str, f64, [[f64; 2]; 4]); 2] = [
    ("tall_box", 330.0, [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]]),
    ("short_box", 165.0, [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]]),
];

/// Millimetres of the measured box to scene units. Turning x and z both keeps the winding.
fn place([x, y, z]: [f64; 3]) -> DVec3 {
    dvec3((UNIT - x) / UNIT, y / UNIT, (HALF_DEPTH - z) / UNIT)
}

/// The sixteen faces of the scene.
pub fn faces() -> Vec<Face> {
    let mut faces: Vec<Face> = ROOM
        .iter()
        .map(|&(label, corners)| Face { group: "room", label, corners: corners.map(place) })
        .collect();
    faces.push(Face {
        group: "lamp",
        label: "lamp, facing down",
        corners: LAMP.map(|corner| place(corner) - DVec3::Y * LAMP_DROP),
    });
    const SIDES: [&str; 4] = ["first side", "second side", "third side", "fourth side"];
    for (group, height, top) in BOXES {
        let corner = |i: usize, y: f64| place([top[i % 4][0], y, top[i % 4][1]]);
        faces.push(Face { group, label: "top", corners: std::array::from_fn(|i| corner(i, height)) });
        for (i, label) in SIDES.into_iter().enumerate() {
            faces.push(Face {
                group,
                label,
                corners: [corner(i, height), corner(i, 0.0), corner(i + 1, 0.0), corner(i + 1, height)],
            });
        }
    }
    faces
}

/// Builds the scene, two triangles a face.
pub fn generate(request: &Request) -> Result<Mesh, Error> {
    if request.triangles.is_some() {
        return Err(Error::usage(
            "the scene cornell always has 32 triangles, so it takes no number of triangles".to_owned(),
        ));
    }
    Ok(mesh_of(&faces()))
}

/// The triangles of `faces`, each with its own four vertices.
fn mesh_of(faces: &[Face]) -> Mesh {
    let mut builder = Builder::new(DECIMALS);
    for face in faces {
        builder.patch(face.corners);
    }
    builder.finish()
}

/// Writes the scene as an OBJ file of sixteen quadrilaterals in named groups: the text of the
/// file `assets/cornell.obj`.
pub fn write_quads(out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# The Cornell box, after the measurements published by Cornell University's")?;
    writeln!(out, "# Program of Computer Graphics. One unit is {UNIT} mm; y is up; the box opens to +z.")?;
    writeln!(out, "# Faces of the room look inwards, those of the boxes outwards.")?;
    let mut group = "";
    let mesh = mesh_of(&faces());
    for (index, face) in faces().iter().enumerate() {
        if face.group != group {
            group = face.group;
            writeln!(out, "\ng {group}")?;
        }
        writeln!(out, "# {}", face.label)?;
        let first = 4 * index;
        for p in &mesh.positions[first..first + 4] {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        writeln!(out, "f {} {} {} {}", first + 1, first + 2, first + 3, first + 4)?;
    }
    Ok(())
}
