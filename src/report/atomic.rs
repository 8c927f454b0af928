//! Files that appear whole or not at all: written beside their place, then renamed.

use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// A place for a result, tried before the work begins so that a folder which cannot be written is known at
/// once. Nothing is there until [`Output::write`].
pub struct Output {
    path: PathBuf,
    target: Target,
}

enum Target {
    /// Written beside and renamed, with the permissions of the file that it replaces.
    Beside(Option<Permissions>),
    /// A device or a pipe: nothing to rename.
    Direct(File),
}

/// Makes sure that a folder for results exists.
pub fn folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|error| {
        Error::other(format!(
            "The folder {} could not be made ({error}): choose another place.",
            path.display()
        ))
    })
}

/// Refuses results that would be written over each other or over what is read.
pub fn refuse_overwriting(results: &[&Path], inputs: &[&Path]) -> Result<()> {
    let place = |path: &Path| -> PathBuf {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::canonicalize(path)
            .or_else(|_| {
                Ok::<_, io::Error>(fs::canonicalize(folder)?.join(path.file_name().unwrap_or_default()))
            })
            .unwrap_or_else(|_| path.to_path_buf())
    };
    // Devices and pipes take any number of results.
    let files = |path: &&&Path| fs::metadata(path).map_or(true, |found| found.is_file());
    let mut taken: Vec<PathBuf> = inputs.iter().map(|path| place(path)).collect();
    for result in results.iter().filter(files) {
        let path = place(result);
        if taken.contains(&path) {
            return Err(Error::usage(format!(
                "{} would be written over: give what is read and each result names of their own.",
                result.display()
            )));
        }
        taken.push(path);
    }
    Ok(())
}

/// What results are written to.
pub trait WriteSeek: Write + Seek {}
impl<T: Write + Seek> WriteSeek for T {}

impl Output {
    pub fn claim(path: &Path) -> Result<Self> {
        let fail = |error: io::Error| Error::other(cannot_write(path, &error));
        let mut permissions = None;
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => {
                return Err(Error::usage(format!("{} is a folder: name a file in it.", path.display())));
            }
            Ok(found) if !found.is_file() => {
                let file = File::options().write(true).open(path).map_err(fail)?;
                return Ok(Self { path: path.to_path_buf(), target: Target::Direct(file) });
            }
            Ok(found) => permissions = Some(found.permissions()),
            Err(_) if path.is_symlink() => {
                return Err(Error::usage(format!(
                    "{} is a link to nowhere: remove it or name another file.",
                    path.display()
                )));
            }
            Err(_) => {}
        }
        // Through a link to the file itself, so that the link stays one.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        drop(file_beside(&path, None).map_err(fail)?);
        Ok(Self { path, target: Target::Beside(permissions) })
    }

    /// Where the result will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the content and puts the file in its place.
    pub fn write(self, content: impl FnOnce(&mut dyn WriteSeek) -> io::Result<()>) -> Result<()> {
        let Self { path, target } = self;
        let fail = |error: io::Error| Error::other(cannot_write(&path, &error));
        match target {
            Target::Direct(mut file) => {
                // Encoders seek; a pipe cannot.
                let mut whole = io::Cursor::new(Vec::new());
                content(&mut whole).and_then(|()| file.write_all(whole.get_ref())).map_err(fail)
            }
            Target::Beside(permissions) => {
                let mut file = file_beside(&path, permissions).map_err(fail)?;
                let mut writer = BufWriter::new(file.as_file_mut());
                content(&mut writer).and_then(|()| writer.flush()).map_err(fail)?;
                drop(writer);
                file.as_file().sync_all().map_err(fail)?;
                file.persist(&path).map_err(|error| fail(error.error))?;
                Ok(())
            }
        }
    }
}

/// A temporary file in the folder of `path`; it removes itself unless it is renamed.
fn file_beside(path: &Path, permissions: Option<Permissions>) -> io::Result<NamedTempFile> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".cousu-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.tempfile_in(folder)?;
    if let Some(permissions) = permissions {
        file.as_file().set_permissions(permissions)?;
    }
    Ok(file)
}

fn cannot_write(path: &Path, error: &io::Error) -> String {
    let advice = match error.kind() {
        io::ErrorKind::NotFound => "its folder does not exist: create it",
        io::ErrorKind::PermissionDenied => "permission was denied: choose another folder",
        io::ErrorKind::StorageFull => "the disk is full: make room or choose another folder",
        _ => {
            // Without the temporary file's name.
            let error = error
                .raw_os_error()
                .map_or_else(|| error.to_string(), |code| io::Error::from_raw_os_error(code).to_string());
            return format!("{} could not be written ({error}): choose another place.", path.display());
        }
    };
    format!("{} could not be written, because {advice}.", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result");
        fs::write(&path, "old").unwrap();
        let broken = Output::claim(&path).unwrap().write(|out| {
            out.write_all(b"half")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        assert!(broken.unwrap_err().to_string().contains("disk is full"));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        Output::claim(&path).unwrap().write(|out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        drop(Output::claim(&path).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside");
    }

    #[test]
    fn places_that_cannot_be_written_are_known_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let said = |path: &Path| Output::claim(path).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(said(folder.path()).contains("is a folder"));
        assert!(said(&folder.path().join("missing/file")).contains("does not exist"));
    }

    #[test]
    #[cfg(unix)]
    fn a_device_is_written_to_and_stays_one() {
        use std::os::unix::fs::FileTypeExt;
        let null = Path::new("/dev/null");
        Output::claim(null).unwrap().write(|out| out.write_all(b"gone")).unwrap();
        assert!(fs::metadata(null).unwrap().file_type().is_char_device());
        let full = Output::claim(Path::new("/dev/full")).unwrap().write(|out| out.write_all(b"x"));
        assert!(full.unwrap_err().to_string().contains("disk is full"));
    }
}
