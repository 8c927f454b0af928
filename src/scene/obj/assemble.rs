//! Runs the OBJ reader on the clean text and puts its parts together.

use glam::DVec3;

use super::clean::{CleanReader, Numbering};
use crate::scene::Mesh;

/// Reads the clean text: one model for each part, in order, polygons cut into
/// fans.
///
/// # Errors
/// What the reader says, which on clean text would be a fault of the pre-pass.
pub fn parse(mut text: CleanReader) -> Result<Vec<tobj::Model>, String> {
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    // The clean text names no material library.
    let no_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    match tobj::load_obj_buf(&mut text, &options, no_materials) {
        Ok((models, _)) => Ok(models),
        Err(error) => Err(error.to_string()),
    }
}

/// Joins the parts to one mesh: triangles in the order of the file, and those
/// vertices that a triangle uses, each once, in the order of the file.
///
/// # Errors
/// The parts are not those that `numbering` describes.
pub fn join(models: Vec<tobj::Model>, numbering: Numbering, triangles: u64) -> Result<Mesh, String> {
    let Numbering { last_part: mut rank, parts } = numbering;
    // From "used or not" to the number of each used vertex in the mesh.
    let mut used = 0;
    for slot in rank.iter_mut().filter(|slot| **slot != 0) {
        *slot = used;
        used += 1;
    }
    let mut mesh = Mesh {
        positions: vec![DVec3::ZERO; used as usize],
        triangles: Vec::with_capacity(triangles as usize),
    };
    if models.len() != parts.len() {
        return Err(disagreement("parts", parts.len(), models.len()));
    }
    for (model, mut numbers) in models.into_iter().zip(parts) {
        let part = model.mesh;
        if part.positions.len() != 3 * numbers.len() {
            let count = part.positions.len() / 3;
            return Err(disagreement("vertices in a part", numbers.len(), count));
        }
        for (number, position) in numbers.iter_mut().zip(part.positions.chunks_exact(3)) {
            *number = rank[*number as usize];
            mesh.positions[*number as usize] = DVec3::from_slice(position);
        }
        let corners = part.indices.chunks_exact(3);
        let number = |&index: &u32| numbers[index as usize];
        let renumbered = corners.map(|c| [number(&c[0]), number(&c[1]), number(&c[2])]);
        mesh.triangles.extend(renumbered);
    }
    if mesh.triangles.len() as u64 != triangles {
        return Err(disagreement("triangles", triangles as usize, mesh.triangles.len()));
    }
    Ok(mesh)
}

fn disagreement(what: &str, expected: usize, found: usize) -> String {
    format!("{found} {what} instead of {expected}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_do_not_match_are_an_error() {
        let numbering = || Numbering { last_part: vec![1], parts: vec![vec![0]] };
        assert_eq!(join(Vec::new(), numbering(), 0).err().as_deref(), Some("0 parts instead of 1"));
        assert_eq!(
            join(vec![tobj::Model::new(tobj::Mesh::default(), String::new())], numbering(), 0)
                .err()
                .as_deref(),
            Some("0 vertices in a part instead of 1")
        );
    }
}
