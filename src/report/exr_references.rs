//! References kept in a folder from run to run: OpenEXR files named by what they follow from, which any machine can
//! take from any other.

use std::fs;
use std::path::{Path, PathBuf};

use super::atomic::{Output, folder};
use super::{exr, exr_read};
use crate::cache;
use crate::error::Result;
use crate::lab::chart::reference::{Recipe, Store, Sums};

/// The text of [`Recipe`], and the samples that the file holds.
const RECIPE: &str = "cousu-reference";
const SAMPLES: &str = "cousu-samples";

/// A folder of references, or none.
pub struct References {
    folder: Option<PathBuf>,
    manifest: String,
    /// Something was kept that could not be read.
    pub note: Option<String>,
}

/// The folder for them, if there is one.
pub fn usual_folder() -> Option<PathBuf> {
    cache::folder("references")
}

/// Makes the folder, if need be, and finds out whether it can be written.
pub fn try_folder(place: &Path) -> Result<()> {
    folder(place)?;
    Output::claim(&place.join("probe")).map(drop)
}

impl References {
    /// `manifest`: what is written into each file about its origin.
    pub fn new(folder: Option<PathBuf>, manifest: String) -> Self {
        Self { folder, manifest, note: None }
    }

    fn path(&self, recipe: &Recipe<'_>, whole: bool) -> Option<PathBuf> {
        let ending = if whole { "exr" } else { "part.exr" };
        Some(self.folder.as_ref()?.join(format!("{}.{ending}", recipe.key())))
    }

    fn read(&mut self, recipe: &Recipe<'_>, whole: bool) -> Option<Sums> {
        let path = self.path(recipe, whole).filter(|path| path.exists())?;
        let read = match exr_read::read(&path, recipe.size) {
            Ok(read) => read,
            Err(error) => {
                self.note = Some(format!("A kept reference is made again: {error}"));
                return None;
            }
        };
        let samples = read.text(SAMPLES).and_then(|text| text.parse().ok()).unwrap_or(0);
        let fits = read.text(RECIPE) == Some(&recipe.text())
            && samples > 0
            && if whole { samples == recipe.spp } else { samples <= recipe.spp };
        if !fits {
            self.note = Some(format!("{} holds another reference: it is made again.", path.display()));
            return None;
        }
        Some(Sums::of(&read.picture, samples))
    }
}

impl Store for References {
    fn load(&mut self, recipe: &Recipe<'_>) -> Option<Sums> {
        self.read(recipe, true).or_else(|| self.read(recipe, false))
    }

    fn save(&mut self, recipe: &Recipe<'_>, sums: &Sums) -> Result<()> {
        let whole = sums.samples == recipe.spp;
        let Some(path) = self.path(recipe, whole) else { return Ok(()) };
        let texts =
            [("cousu", self.manifest.clone()), (RECIPE, recipe.text()), (SAMPLES, sums.samples.to_string())];
        let picture = sums.picture(recipe.size);
        Output::claim(&path)?.write(|out| exr::write_with_texts(&picture, &texts, out))?;
        if let (true, Some(part)) = (whole, self.path(recipe, false)) {
            // It may not be there, and it does no harm.
            let _ = fs::remove_file(part);
        }
        Ok(())
    }
}
