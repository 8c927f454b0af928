//! A study of scaling as tables for a person and as CSV.

use std::io::{self, Write};

use comfy_table::{CellAlignment, Table, presets};

use super::bench::{digits, quoted, shown};
use crate::lab::scaling::fit::Estimate;
use crate::lab::scaling::{Fit, Row, Study};

/// Columns of the CSV, in the order of the values of [`write_csv`].
const COLUMNS: &str = "study,scene,triangles,log2_triangles,method,builder,passes,accessor,width,height,spp,frames,\
                       dispatches,rays,gpu_ms_median,gpu_ms_low,gpu_ms_high,gpu_ms_min,ms_per_ray,mismatched_pixels,build_ms,\
                       geometry_ms,sah_cost,load_ms,file_bytes,peak_host_bytes,device_bytes";

/// Writes a line of names and a line a row; what a row does not have is empty.
pub fn write_csv(rows: &[Row], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "{COLUMNS}")?;
    for row in rows {
        let values = [
            row.study.name().into(),
            quoted(&row.scene),
            row.triangles.to_string(),
            row.log2_triangles.to_string(),
            row.method.clone().unwrap_or_default(),
            shown(row.builder),
            shown(row.passes),
            shown(row.accessor),
            shown(row.size.map(|size| size[0])),
            shown(row.size.map(|size| size[1])),
            shown(row.spp),
            shown(row.frames),
            shown(row.dispatches),
            shown(row.rays),
            shown(row.gpu_ms_median),
            shown(row.gpu_ms_ci95.map(|ends| ends[0])),
            shown(row.gpu_ms_ci95.map(|ends| ends[1])),
            shown(row.gpu_ms_min),
            shown(row.ms_per_ray),
            shown(row.mismatched_pixels),
            shown(row.build_ms),
            shown(row.geometry_ms),
            shown(row.sah_cost),
            shown(row.load_ms),
            shown(row.file_bytes),
            shown(row.peak_host_bytes),
            shown(row.device_bytes),
        ];
        writeln!(out, "{}", values.join(","))?;
    }
    Ok(())
}

/// Rows, which should be of one study; columns that nothing fills are left out.
pub fn table(rows: &[Row]) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let megabytes = |bytes: Option<u64>| bytes.map(|bytes| digits(bytes as f64 * 1e-6)).unwrap_or_default();
    let ms = |ms: Option<f64>| ms.map(digits).unwrap_or_default();
    let mut columns: Vec<(&str, Vec<String>)> = Vec::new();
    let mut column = |name, value: &dyn Fn(&Row) -> String| {
        columns.push((name, rows.iter().map(value).collect()));
    };
    column("triangles", &|row| row.triangles.to_string());
    column("method", &|row| row.method.clone().unwrap_or_default());
    column("builder", &|row| shown(row.builder));
    column("passes", &|row| shown(row.passes));
    column("size", &|row| row.size.map(|[w, h]| format!("{w}x{h}")).unwrap_or_default());
    column("spp", &|row| shown(row.spp));
    column("ms", &|row| ms(row.gpu_ms_median));
    column("95%", &|row| {
        row.gpu_ms_ci95.map(|[low, high]| format!("{}..{}", digits(low), digits(high))).unwrap_or_default()
    });
    column("least", &|row| ms(row.gpu_ms_min));
    column("ns/ray", &|row| ms(row.ms_per_ray.map(|ms| ms * 1e6)));
    column("dispatches", &|row| shown(row.dispatches));
    column("differ", &|row| shown(row.mismatched_pixels));
    column("build ms", &|row| ms(row.build_ms));
    column("with placing ms", &|row| ms(row.geometry_ms));
    column("SAH", &|row| ms(row.sah_cost));
    column("load ms", &|row| ms(row.load_ms));
    column("file MB", &|row| megabytes(row.file_bytes));
    column("device MB", &|row| megabytes(row.device_bytes));
    column("peak MB", &|row| megabytes(row.peak_host_bytes));
    columns.retain(|(_, values)| values.iter().any(|value| !value.is_empty()));
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(columns.iter().map(|(name, _)| *name));
    for place in 0..rows.len() {
        table.add_row(columns.iter().map(|(_, values)| values[place].as_str()));
    }
    for place in 0..columns.len() {
        if let Some(column) = table.column_mut(place) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let scene = first.scene.split(':').next().unwrap_or_default();
    format!("{scene}: {}\n{}", first.study.name(), table.trim_fmt())
}

/// What the rows say of growth, a line a fit.
pub fn fits(fits: &[Fit]) -> String {
    let mut text = String::from("Growth, with 95% intervals:");
    for fit in fits {
        let of = |estimate: Estimate, unit: f64| {
            let Estimate { value, ci95: [low, high] } = estimate;
            format!("{} ({}..{})", digits(value * unit), digits(low * unit), digits(high * unit))
        };
        let told = match fit.study {
            Study::Triangles => {
                format!("{} ns more per ray with each doubling of the triangles", of(fit.slope, 1e6))
            }
            Study::Samples => {
                format!("{} ms a sample and {} ms beside them", of(fit.slope, 1.0), of(fit.intercept, 1.0))
            }
            Study::Size => {
                format!(
                    "{} ms a million pixels and {} ms beside them",
                    of(fit.slope, 1e6),
                    of(fit.intercept, 1.0)
                )
            }
            Study::Build | Study::Load => format!("ms grow as triangles to the power {}", of(fit.slope, 1.0)),
        };
        let far = format!("farthest from it {:+.1}% at {}", fit.worst_residual * 100.0, digits(fit.worst_at));
        text += &format!("\n  {}, {}: {told}; {far}", fit.study.name(), fit.of);
        if let Some(ms) = fit.per_dispatch_ms {
            text += &format!("; a dispatch more: {} ms", of(ms, 1.0));
        }
        if let Some((step, at)) = fit.largest_step {
            text += &format!("; largest step where dispatches end: {:+.1}% at {at}", step * 100.0);
        }
    }
    text
}

/// What the columns mean.
pub const LEGEND: &str = "\
ms: kernel time of a frame, median and its 95% interval, camera rays included; least, ns/ray: the fastest frame's, which the\nfits take; differ: pixels unlike the first method's; build: \
the tree alone; load: the OBJ file, from the system's cache; peak: most memory of the process at once, all scenes so far included; \
device: the row's own buffers.";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scenes::scene_of;
    use crate::scene::Mesh;

    #[test]
    fn every_line_has_every_column() {
        let scene = scene_of("a,b", Mesh { positions: Vec::new(), triangles: vec![[0; 3]; 8] });
        let row = Row { spp: Some(4), size: Some([3, 2]), ..Row::new(Study::Samples, "a,b", &scene) };
        let mut out = Vec::new();
        write_csv(std::slice::from_ref(&row), &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let commas = |line: &str| line.matches(',').count();
        assert_eq!(commas(lines[0]) + 1, commas(lines[1]), "one comma is quoted: {text}");
        assert!(lines[1].starts_with("samples,\"a,b\",8,3,"), "{text}");
        let shown = table(&[row]);
        assert!(shown.contains("3x2") && !shown.contains("build"), "{shown}");
    }
}
