//! Loads Wavefront OBJ files as one triangle mesh.
//!
//! OBJ files in the wild have faults: indices out of range, vertices that are
//! NaN, triangles without area. A renderer must neither fail on these nor trace
//! them. So a pre-pass (`prepass`) reads the file line by line (`lines`,
//! `words`), leaves out what is bad, counts it in a [`Report`], and streams
//! clean text (`clean`) to the OBJ reader of the `tobj` crate, which works on a
//! second thread; its parts are joined to one [`Mesh`] (`assemble`). The text is
//! never in memory as a whole.
//!
//! What is read: `v` and `f` lines, with any number of corners, in the forms
//! `v`, `v/vt`, `v//vn` and `v/vt/vn`, and lines joined by a final `\`. A
//! positive index may name a vertex further down; a negative one counts back
//! from the vertices above it. Polygons become fans: corners (0, 1, 2),
//! (0, 2, 3) and so on. Colours and weights behind the coordinates are ignored,
//! as is everything about materials, textures, normals and free-form shapes.

mod assemble;
mod clean;
mod lines;
mod prepass;
mod report;
mod words;

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;
use std::thread;

pub use lines::MAX_LINE;
pub use report::{Dropped, LINES_KEPT, Report, Tally};

use crate::error::Error;
use crate::scene::Mesh;
use lines::Lines;
use prepass::Limits;

/// A mesh and what is to be said of the file it came from.
#[derive(Debug)]
pub struct Loaded {
    /// The triangles in the order of the file, and the vertices they use in the
    /// order of the file, in scene units, all finite.
    pub mesh: Mesh,
    /// What was in the file and what was left out.
    pub report: Report,
}

/// Loads the OBJ file at `path`.
///
/// # Errors
/// An input error if the file does not exist, is a directory or cannot be read,
/// is empty or binary, has a line longer than [`MAX_LINE`], has no usable
/// triangle, or has more vertices or triangles than 32-bit indices can count.
pub fn load(path: &Path) -> Result<Loaded, Error> {
    let name = path.display().to_string();
    let refuse = |error: io::Error| cannot_open(&name, &error);
    if fs::metadata(path).map_err(refuse)?.is_dir() {
        return Err(Error::input(format!("{name} is a directory; give the path of an OBJ file")));
    }
    let file = File::open(path).map_err(refuse)?;
    let mut loaded = read(file, &name)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let missing = |library: &&String| !folder.join(library).exists();
    let report = &mut loaded.report;
    report.missing_materials = report.material_libraries.iter().filter(missing).cloned().collect();
    Ok(loaded)
}

/// Loads OBJ text from `source`, which messages call `name`. There is no folder
/// here to look for material libraries in, so none is reported as missing.
///
/// # Errors
/// As [`load`], for what can be said of text.
pub fn read(source: impl Read, name: &str) -> Result<Loaded, Error> {
    let mut lines = Lines::new(source, name)?;
    let (writer, reader) = clean::pipe();
    let (outcome, parsed) = thread::scope(|scope| {
        let parsing = thread::Builder::new()
            .name("obj reader".to_owned())
            .spawn_scoped(scope, || assemble::parse(reader))
            .map_err(|error| {
                Error::input(format!(
                    "{name} cannot be loaded, for no thread could be started ({error}); \
                     end other programs and try again"
                ))
            })?;
        let outcome = prepass::run(&mut lines, writer, Limits::default());
        let parsed = parsing.join().unwrap_or(Err("it panicked".to_owned()));
        Ok::<_, Error>((outcome?, parsed))
    })?;
    let prepass::Outcome { report, numbering } = outcome;
    let mesh =
        parsed.and_then(|models| assemble::join(models, numbering, report.triangles)).map_err(|fault| {
            Error::input(format!(
                "{name} passed the checks but the OBJ reader failed on it ({fault}); \
                 report this together with the file"
            ))
        })?;
    Ok(Loaded { mesh, report })
}

fn cannot_open(name: &str, error: &io::Error) -> Error {
    Error::input(match error.kind() {
        io::ErrorKind::NotFound => {
            format!("{name} does not exist; check the path of the OBJ file")
        }
        io::ErrorKind::PermissionDenied => {
            format!("{name} may not be read ({error}); give yourself the right to read it")
        }
        _ => format!("{name} cannot be opened ({error}); check the file and its disk"),
    })
}
