//! The pre-pass: reads the lines of an OBJ file once, judges every vertex and
//! face, and writes what is good as clean text.

use std::io::Read;
use std::mem;

use glam::DVec3;

use super::clean::{CleanWriter, Numbering};
use super::lines::{Line, Lines};
use super::report::Report;
use super::words::{self, Vertex, Words};
use crate::error::Error;

/// Holds the place of a vertex whose line is malformed.
const MALFORMED: DVec3 = DVec3::NAN;

/// Holds the place of a vertex that is not finite, whatever it was.
const NON_FINITE: DVec3 = DVec3::INFINITY;

/// Material libraries whose names are kept, and characters kept of each name:
/// a bound on what a hostile file can make the report hold.
const MATERIALS_KEPT: usize = 64;
const MATERIAL_NAME_CHARS: usize = 1024;

/// How much a mesh may hold.
pub struct Limits {
    /// Most vertices.
    pub vertices: u64,
    /// Most triangles.
    pub triangles: u64,
}

impl Default for Limits {
    /// What 32-bit indices can count, with the largest value left free.
    fn default() -> Self {
        let most = u64::from(u32::MAX - 1);
        Self { vertices: most, triangles: most }
    }
}

/// What the pre-pass learnt.
pub struct Outcome {
    /// Everything but `missing_materials`, which needs a folder to look in.
    pub report: Report,
    /// Which vertices the clean text uses, and in which order.
    pub numbering: Numbering,
}

/// Reads `lines` to the end and writes what is good to `clean`.
///
/// # Errors
/// The lines cannot be read, no usable triangle is among them, or there are
/// more vertices or triangles than `limits` allow.
pub fn run<R: Read>(lines: &mut Lines<'_, R>, clean: CleanWriter, limits: Limits) -> Result<Outcome, Error> {
    let mut pass = Prepass {
        name: lines.name(),
        limits,
        clean,
        positions: Vec::new(),
        corners: Vec::new(),
        waiting: Waiting::default(),
        report: Report::default(),
    };
    while let Some(line) = lines.next_line()? {
        pass.line(&line)?;
    }
    pass.judge_waiting()?;
    pass.report.lines = lines.lines();
    pass.report.bytes = lines.bytes();
    if pass.report.triangles == 0 {
        return Err(pass.no_triangle());
    }
    Ok(Outcome { report: pass.report, numbering: pass.clean.finish() })
}

struct Prepass<'n> {
    name: &'n str,
    limits: Limits,
    clean: CleanWriter,
    /// Every vertex so far, in scene units; bad ones are [`MALFORMED`] or
    /// [`NON_FINITE`].
    positions: Vec<DVec3>,
    /// The corners of the face at hand, counted from 0.
    corners: Vec<u32>,
    waiting: Waiting,
    report: Report,
}

/// Faces from the first on that names a vertex not yet read. They wait for the
/// end of the file, all of them, so that the order of the faces is kept.
#[derive(Default)]
struct Waiting {
    /// Line and number of corners of each face.
    faces: Vec<(u64, u32)>,
    /// The corners of all faces, end to end.
    corners: Vec<u32>,
}

impl Prepass<'_> {
    fn line(&mut self, line: &Line<'_>) -> Result<(), Error> {
        let mut words = Words::new(line.text);
        let Some(keyword) = words.next() else {
            return Ok(());
        };
        match keyword {
            b"v" => self.vertex(&mut words, line.number)?,
            // `fo` is what old versions of the format called a face.
            b"f" | b"fo" => self.face(&mut words, line.number)?,
            b"vt" | b"vn" | b"vp" | b"usemtl" | b"s" => {}
            b"g" | b"o" => self.report.groups += 1,
            b"mtllib" => self.material_libraries(words.rest()),
            b"p" | b"l" | b"curv" | b"curv2" | b"surf" => {
                self.report.other_elements.add(line.number);
            }
            other if is_known(other) => {}
            _ => self.report.unknown_lines.add(line.number),
        }
        Ok(())
    }

    fn vertex(&mut self, words: &mut Words<'_>, line: u64) -> Result<(), Error> {
        self.report.vertices += 1;
        if self.report.vertices > self.limits.vertices {
            return Err(self.too_many(line, "vertices", self.limits.vertices));
        }
        let mut place = [&b"0"[..]; 3];
        let position = match words::vertex(words) {
            Vertex::Good { position, words, weighted } => {
                self.report.weighted_vertices += u64::from(weighted);
                place = words;
                position
            }
            Vertex::NonFinite => {
                self.report.non_finite_vertices.add(line);
                NON_FINITE
            }
            Vertex::Malformed => {
                self.report.malformed_vertices.add(line);
                MALFORMED
            }
        };
        // A bad vertex is written too, at the origin, to keep later indices
        // right; no face that uses it is written.
        self.clean.vertex(place);
        self.positions.push(position);
        Ok(())
    }

    fn face(&mut self, words: &mut Words<'_>, line: u64) -> Result<(), Error> {
        self.report.faces += 1;
        let Some(indices) = self.read_corners(words) else {
            self.report.dropped.malformed.add(line);
            return Ok(());
        };
        self.report.polygons += u64::from(self.corners.len() > 3);
        if self.corners.len() < 3 {
            self.report.dropped.too_few_corners.add(line);
            return Ok(());
        }
        match indices {
            Indices::Zero => self.report.dropped.index_zero.add(line),
            Indices::OutOfRange => self.report.dropped.index_out_of_range.add(line),
            Indices::Known if self.waiting.faces.is_empty() => {
                let corners = mem::take(&mut self.corners);
                self.judge(&corners, line)?;
                self.corners = corners;
            }
            Indices::Known | Indices::NotYetKnown => {
                self.waiting.faces.push((line, self.corners.len() as u32));
                self.waiting.corners.extend_from_slice(&self.corners);
            }
        }
        Ok(())
    }

    /// Reads the corners of a face into `self.corners`, as numbers of vertices
    /// counted from 0, and says the worst of them; `None` if one is malformed.
    fn read_corners(&mut self, words: &mut Words<'_>) -> Option<Indices> {
        let known = self.positions.len() as i64;
        let mut worst = Indices::Known;
        self.corners.clear();
        for word in words {
            let index = words::corner(word)?;
            let from_start = if index < 0 { known + index } else { index - 1 };
            let state = match index {
                0 => Indices::Zero,
                // No file has that many vertices, and the number must fit.
                _ if from_start < 0 || from_start >= i64::from(u32::MAX) => Indices::OutOfRange,
                _ if from_start >= known => Indices::NotYetKnown,
                _ => Indices::Known,
            };
            worst = worst.max(state);
            self.corners.push(from_start as u32);
        }
        Some(worst)
    }

    /// Judges the faces that waited for the end of the file.
    fn judge_waiting(&mut self) -> Result<(), Error> {
        let waiting = mem::take(&mut self.waiting);
        let mut corners = &waiting.corners[..];
        for (line, count) in waiting.faces {
            let (face, rest) = corners.split_at(count as usize);
            corners = rest;
            if face.iter().any(|&c| c as usize >= self.positions.len()) {
                self.report.dropped.index_out_of_range.add(line);
            } else {
                self.judge(face, line)?;
            }
        }
        Ok(())
    }

    /// Writes a face, or of its fan of triangles those with an area, or counts
    /// it as dropped. All its corners are known vertices.
    fn judge(&mut self, face: &[u32], line: u64) -> Result<(), Error> {
        let at = |corner: u32| self.positions[corner as usize];
        let dropped = &mut self.report.dropped;
        if face.iter().any(|&corner| at(corner).is_nan()) {
            dropped.malformed_vertex.add(line);
            return Ok(());
        }
        if !face.iter().all(|&corner| at(corner).is_finite()) {
            dropped.non_finite_vertex.add(line);
            return Ok(());
        }
        let fan = || face[1..].windows(2).map(|edge| [face[0], edge[0], edge[1]]);
        let flat = |triangle: &[u32; 3]| has_no_area(triangle.map(at));
        let flat_count = fan().filter(flat).count();
        if flat_count == 0 {
            self.clean.face(face);
        } else {
            for triangle in fan() {
                if flat(&triangle) {
                    dropped.zero_area.add(line);
                } else {
                    self.clean.face(&triangle);
                }
            }
        }
        self.report.triangles += (face.len() - 2 - flat_count) as u64;
        if self.report.triangles > self.limits.triangles {
            return Err(self.too_many(line, "triangles", self.limits.triangles));
        }
        Ok(())
    }

    /// Notes the names on a `mtllib` line: several if each ends in `.mtl`, and
    /// one, with blanks in it, otherwise.
    fn material_libraries(&mut self, text: &[u8]) {
        let is_library = |name: &[u8]| name.to_ascii_lowercase().ends_with(b".mtl");
        let mut names: Vec<&[u8]> = Words::new(text).collect();
        if !names.iter().all(|name| is_library(name)) {
            names = vec![text.trim_ascii()];
        }
        let kept = &mut self.report.material_libraries;
        for name in names {
            let name = String::from_utf8_lossy(name);
            let name: String = name.chars().take(MATERIAL_NAME_CHARS).collect();
            if kept.len() < MATERIALS_KEPT && !kept.contains(&name) {
                kept.push(name);
            }
        }
    }

    fn too_many(&self, line: u64, what: &str, limit: u64) -> Error {
        Error::input(format!(
            "{}, line {line}: the file has more than {limit} {what}, the most that can be \
             loaded; split the scene or simplify it",
            self.name
        ))
    }

    fn no_triangle(&self) -> Error {
        let Report { lines, vertices, faces, dropped, .. } = &self.report;
        Error::input(if *faces == 0 {
            format!(
                "{} has no face among its {lines} lines ({vertices} vertices); give a Wavefront \
                 OBJ file with `f` lines",
                self.name
            )
        } else {
            format!(
                "{} has no usable triangle, for of its {faces} faces all were dropped: {dropped}; \
                 repair these lines or export the scene again",
                self.name
            )
        })
    }
}

/// What the indices of a face are, from best to worst.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Indices {
    /// All name vertices that were read.
    Known,
    /// Some may name a vertex further down.
    NotYetKnown,
    /// Some name a vertex that cannot be in the file.
    OutOfRange,
    /// Some are 0.
    Zero,
}

/// Whether a triangle has no area: the cross product of two of its edges is
/// exactly zero in 64-bit arithmetic. (What 32-bit floats can tell apart is known
/// once the scene has been placed: `render::geometry`.)
fn has_no_area([a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    // Scaled, so that the product of tiny edges does not vanish.
    let largest = ab.abs().max(ac.abs()).max_element();
    largest == 0.0 || (ab / largest).cross(ac / largest) == DVec3::ZERO
}

/// Whether `keyword` is a word of the OBJ format that has no bearing on the
/// triangles of a mesh and was not matched before.
fn is_known(keyword: &[u8]) -> bool {
    const KNOWN: &str = "bevel bmat bsp bzp c_interp call cdc cdp con csh cstype ctech d_interp \
                         deg end hole lod maplib mg parm res scrv shadow_obj sp stech step \
                         trace_obj trim usemap";
    KNOWN.split(' ').any(|known| known.as_bytes() == keyword)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::obj::clean;

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

    fn run_within(vertices: u64, triangles: u64) -> Result<Outcome, Error> {
        let (writer, _reader) = clean::pipe();
        let limits = Limits { vertices, triangles };
        run(&mut Lines::new(SQUARE.as_bytes(), "square")?, writer, limits)
    }

    #[test]
    fn more_than_the_limits_is_refused() {
        assert!(run_within(4, 2).is_ok());
        let message = |result: Result<Outcome, Error>| match result {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        };
        let vertices = message(run_within(3, 2));
        assert!(vertices.contains("line 4: the file has more than 3 vertices"), "{vertices}");
        let triangles = message(run_within(4, 1));
        assert!(triangles.contains("line 5: the file has more than 1 triangles"), "{triangles}");
    }
}
