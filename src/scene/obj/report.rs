//! What was in an OBJ file and what was left out of the mesh.

use std::fmt;

/// How many line numbers a [`Tally`] keeps.
pub const LINES_KEPT: usize = 8;

/// How often something happened, and where first.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tally {
    /// How often.
    pub count: u64,
    /// The first [`LINES_KEPT`] lines where it happened, each once, ascending.
    /// Lines are counted from 1.
    pub lines: Vec<u64>,
}

impl Tally {
    /// Counts one more, at `line`.
    pub(super) fn add(&mut self, line: u64) {
        self.count += 1;
        // Faces that wait for their vertices are judged last, so lines may
        // arrive out of order.
        let place = self.lines.partition_point(|&kept| kept <= line);
        let is_new = place == 0 || self.lines[place - 1] != line;
        if is_new && place < LINES_KEPT {
            self.lines.truncate(LINES_KEPT - 1);
            self.lines.insert(place, line);
        }
    }

    /// The lines in words, such as `line 3` or `lines 3, 7`.
    fn places(&self) -> String {
        let lines: Vec<String> = self.lines.iter().map(u64::to_string).collect();
        let plural = if lines.len() == 1 { "" } else { "s" };
        let all = lines.len() < LINES_KEPT || self.count == LINES_KEPT as u64;
        let more = if all { "" } else { ", ..." };
        format!("line{plural} {}{more}", lines.join(", "))
    }
}

/// What was left out of the mesh, by reason. A face with several faults counts
/// once, under the first of these reasons that holds, except that each triangle
/// of a polygon is judged alone for its area.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Faces with a corner that is no index, such as `1/2/x`.
    pub malformed: Tally,
    /// Faces with fewer than three corners.
    pub too_few_corners: Tally,
    /// Faces with the index 0; OBJ counts from 1.
    pub index_zero: Tally,
    /// Faces with an index of a vertex that the file does not have: beyond the
    /// last vertex of the whole file, or, counted back, before the first.
    pub index_out_of_range: Tally,
    /// Faces that use a vertex from a malformed `v` line.
    pub malformed_vertex: Tally,
    /// Faces that use a vertex with a coordinate that is NaN, infinite or too
    /// large for a 32-bit float.
    pub non_finite_vertex: Tally,
    /// Triangles without area: the cross product of two edges is exactly zero
    /// in 64-bit arithmetic, or two corners coincide once rounded to 32-bit
    /// floats. Counted in triangles, not in faces.
    pub zero_area: Tally,
}

impl Dropped {
    /// The reasons in the order of the fields, in words.
    fn reasons(&self) -> [(&'static str, &'static str, &Tally); 7] {
        [
            ("face", "with a malformed corner", &self.malformed),
            ("face", "with fewer than 3 corners", &self.too_few_corners),
            ("face", "with index 0", &self.index_zero),
            ("face", "with an index out of range", &self.index_out_of_range),
            ("face", "with a malformed vertex", &self.malformed_vertex),
            ("face", "with a NaN or infinite vertex", &self.non_finite_vertex),
            ("triangle", "without area", &self.zero_area),
        ]
    }

    /// Whether nothing was dropped.
    pub fn is_empty(&self) -> bool {
        self.reasons().iter().all(|(_, _, tally)| tally.count == 0)
    }
}

impl fmt::Display for Dropped {
    /// One phrase such as `2 faces with index 0 (lines 7, 9), 1 triangle
    /// without area (line 12)`; `nothing` if nothing was dropped.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return out.write_str("nothing");
        }
        let mut separator = "";
        for (noun, fault, tally) in self.reasons() {
            if tally.count == 0 {
                continue;
            }
            let count = tally.count;
            let plural = if count == 1 { "" } else { "s" };
            let places = tally.places();
            write!(out, "{separator}{count} {noun}{plural} {fault} ({places})")?;
            separator = ", ";
        }
        Ok(())
    }
}

/// What was in the file, and what of it is not in the mesh.
///
/// Texture coordinates, normals, colours, materials and smoothing groups are
/// never read, so faults in them are not looked for, except that every number
/// on a `v` line and every index on an `f` line must be one.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Report {
    /// Lines in the file.
    pub lines: u64,
    /// Bytes in the file.
    pub bytes: u64,
    /// Vertices in the file (`v` lines), usable or not, used or not.
    pub vertices: u64,
    /// Faces in the file (`f` lines), usable or not.
    pub faces: u64,
    /// Well-formed faces with more than three corners.
    pub polygons: u64,
    /// Triangles in the mesh.
    pub triangles: u64,
    /// Group and object lines (`g`, `o`).
    pub groups: u64,
    /// Vertices with a weight other than 1 as a fourth number. It is ignored:
    /// it belongs to free-form curves, not to polygons.
    pub weighted_vertices: u64,
    /// `v` lines with fewer than three numbers or a word that is no number.
    pub malformed_vertices: Tally,
    /// `v` lines with a NaN, infinite or too large coordinate.
    pub non_finite_vertices: Tally,
    /// Points, lines, curves and surfaces: elements that have no triangles.
    pub other_elements: Tally,
    /// Lines that begin with no word of the OBJ format.
    pub unknown_lines: Tally,
    /// Names on `mtllib` lines, each once; at most 64, cut after 1,024 characters.
    pub material_libraries: Vec<String>,
    /// Those of `material_libraries` that do not exist beside the file. Empty
    /// if the source has no folder to look in. Materials are not used.
    pub missing_materials: Vec<String>,
    /// Faces and triangles that are not in the mesh.
    pub dropped: Dropped,
}
