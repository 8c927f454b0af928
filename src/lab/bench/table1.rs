//! The report's Table 1 beside the same rows on this device.

use serde::Serialize;

use super::rows::{REPORTED, Row};
use crate::render::choices::Preset;

/// The report's scenes by the names of ours.
pub const CORNELL: &str = "cornell";
pub const HOUSE: &str = "maison";

/// A row of the table: GPU ms of a frame of 4 ambient rays a pixel.
#[derive(Clone, Debug, Serialize)]
pub struct TableRow {
    pub scene: &'static str,
    /// The report's name for it, and its triangles.
    pub title: &'static str,
    pub columns: Vec<Column>,
}

#[derive(Clone, Debug, Serialize)]
pub struct Column {
    pub method: String,
    pub published_ms: Option<f64>,
    pub measured_ms: Option<f64>,
    /// Measured on a part of the rays and scaled.
    pub subset: Option<f64>,
    pub overflowed_rays: u64,
}

/// Published times in the order of [`REPORTED`], on a device that the report does not name. Its two row labels are
/// swapped in print; here they are set right.
const PUBLISHED: [(&str, &str, [Option<f64>; 4]); 2] = [
    (CORNELL, "Cornell, 32 triangles", [Some(9.0), Some(29.0), Some(12.0), None]),
    (HOUSE, "House, 5456 triangles", [Some(980.0), Some(142.0), Some(62.0), None]),
];

pub fn is_reported(scene: &str) -> bool {
    PUBLISHED.iter().any(|(name, ..)| *name == scene)
}

/// The table, if both scenes were measured with the original's choices; of several views, the first.
pub fn table1(rows: &[Row]) -> Option<Vec<TableRow>> {
    let originals = |scene: &str| {
        let mut found: Vec<&Row> =
            rows.iter().filter(|row| row.scene == scene && row.preset == Preset::Original.name()).collect();
        found.sort_by_key(|row| row.order);
        found
    };
    PUBLISHED
        .iter()
        .map(|&(scene, title, published)| {
            let rows = originals(scene);
            let view = &rows.first()?.view;
            let columns = REPORTED.iter().zip(published).map(|(method, published_ms)| {
                let method = method.to_string();
                let row = rows.iter().find(|row| row.method == method && row.view == *view);
                Column {
                    published_ms,
                    measured_ms: row.map(|row| row.gpu_ms_median),
                    subset: row.and_then(|row| row.subset),
                    overflowed_rays: row.map_or(0, |row| row.overflowed_rays),
                    method,
                }
            });
            Some(TableRow { scene, title, columns: columns.collect() })
        })
        .collect()
}
