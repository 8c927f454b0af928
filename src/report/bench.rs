//! A benchmark's rows as a table for a person and as CSV.

use std::io::{self, Write};

use comfy_table::{CellAlignment, Table, presets};

use crate::lab::bench::rows::{Row, method_label};
use crate::lab::bench::table1::TableRow;
use crate::render::work::RayWork;

/// Columns of the CSV, in the order of the values of [`write_csv`].
const COLUMNS: &str = "scene,scene_hash,triangles,view,preset,method,builder,passes,query,api,accessor,spp,frames,\
                       rays_per_frame,subset,gpu_ms_median,gpu_ms_low,gpu_ms_high,first_frame_ms,traversal_ms,\
                       mrays_per_s,max_stack,overflowed_rays,mismatched_pixels,build_ms,sah_cost,duplicates,bvh_bytes,registers,stack_bytes,\
                       closest_visits,closest_tests,closest_lanes,any_visits,any_tests,any_lanes";

/// Writes a line of names and a line a row; what a row does not have is empty.
pub fn write_csv(rows: &[Row], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "{COLUMNS}")?;
    for row in rows {
        let [low, high] = row.gpu_ms_ci95;
        let work = |work: &Option<RayWork>| match work {
            Some(RayWork { visits, tests, lanes }) => format!("{visits},{tests},{lanes}"),
            None => ",,".into(),
        };
        let values = [
            quoted(&row.scene),
            row.scene_hash.clone(),
            row.triangles.to_string(),
            quoted(&row.view),
            row.preset.into(),
            row.method.clone(),
            row.builder.into(),
            row.passes.into(),
            row.query.unwrap_or("").into(),
            row.api.into(),
            row.accessor.into(),
            row.spp.to_string(),
            row.frames.to_string(),
            row.rays_per_frame.to_string(),
            shown(row.subset),
            row.gpu_ms_median.to_string(),
            low.to_string(),
            high.to_string(),
            shown(row.first_frame_ms),
            shown(row.traversal_ms),
            row.mrays_per_s.to_string(),
            row.max_stack.to_string(),
            row.overflowed_rays.to_string(),
            shown(row.mismatched_pixels),
            row.build_ms.to_string(),
            row.tree.sah_cost.to_string(),
            row.tree.duplicates.to_string(),
            row.bvh_bytes.to_string(),
            shown(row.registers),
            shown(row.stack_bytes),
            work(&row.closest),
            work(&row.any),
        ];
        writeln!(out, "{}", values.join(","))?;
    }
    Ok(())
}

/// A field that may hold commas (RFC 4180).
pub(super) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.into()
    }
}

pub(super) fn shown<T: ToString>(value: Option<T>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

/// The rows of one view of one scene; columns that nothing fills are left out. Times are marked with ~ where they were
/// measured on a part of the rays.
pub fn table(rows: &[&Row]) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let fastest = rows.iter().map(|row| row.mrays_per_s).fold(0.0, f64::max);
    let mut columns: Vec<(&str, Vec<String>)> = Vec::new();
    let mut column = |name, value: &dyn Fn(&Row) -> String| {
        columns.push((name, rows.iter().map(|row| value(row)).collect()));
    };
    column("method", &|row| method_label(row.preset, &row.method));
    column("builder", &|row| row.builder.into());
    column("passes", &|row| row.query.unwrap_or(row.passes).into());
    column("ms", &|row| {
        format!("{}{}", if row.subset.is_some() { "~" } else { "" }, digits(row.gpu_ms_median))
    });
    column("95%", &|row| format!("{}..{}", digits(row.gpu_ms_ci95[0]), digits(row.gpu_ms_ci95[1])));
    column("first", &|row| row.first_frame_ms.map(digits).unwrap_or_default());
    column("hits", &|row| row.traversal_ms.map(digits).unwrap_or_default());
    column("Mrays/s", &|row| digits(row.mrays_per_s));
    column("of best", &|row| format!("{:.2}", row.mrays_per_s / fastest.max(1e-12)));
    column("stack", &|row| if row.max_stack > 0 { row.max_stack.to_string() } else { String::new() });
    column("overflow", &|row| {
        if row.overflowed_rays > 0 { row.overflowed_rays.to_string() } else { String::new() }
    });
    column("differ", &|row| shown(row.mismatched_pixels));
    column("build ms", &|row| digits(row.build_ms));
    column("SAH", &|row| digits(row.tree.sah_cost));
    column("nodes MB", &|row| digits(row.bvh_bytes as f64 * 1e-6));
    column("regs", &|row| shown(row.registers));
    let work = |work: &Option<RayWork>| {
        work.map(|work| format!("{:.1}+{:.1}", work.visits, work.tests)).unwrap_or_default()
    };
    column("closest", &|row| work(&row.closest));
    column("any", &|row| work(&row.any));
    columns.retain(|(_, values)| values.iter().any(|value| !value.is_empty()));

    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(columns.iter().map(|(name, _)| *name));
    for place in 0..rows.len() {
        table.add_row(columns.iter().map(|(_, values)| values[place].as_str()));
    }
    for place in 3..columns.len() {
        if let Some(column) = table.column_mut(place) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let what = match first.query {
        Some(_) => "rays of a list".to_string(),
        None => format!("view {}", first.view),
    };
    format!("{}: {} triangles, {what}\n{}", first.scene, first.triangles, table.trim_fmt())
}

/// Three significant digits, no fewer before the point.
pub(super) fn digits(value: f64) -> String {
    let places = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 => 2,
        v if v >= 0.1 => 3,
        _ => 4,
    };
    format!("{value:.places$}")
}

/// What the columns mean.
pub const LEGEND: &str = "\
ms: kernel time of a frame, median and its 95% interval (~ scaled from a part of the rays); first: with the camera rays that
split and staged keep; hits: the hit kernels alone, camera rays included; differ: pixels (or rays) unlike the reference's;
closest, any: nodes visited + triangles tested by a ray.";

/// Table 1 of the report, published / here.
pub fn table1(rows: &[TableRow], size: [u32; 2]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    let methods = rows.first().map(|row| &row.columns[..]).unwrap_or_default();
    let header = methods.iter().map(|column| column.method.clone());
    table.set_header(std::iter::once(String::new()).chain(header));
    let ms = |value: Option<f64>| value.map_or("-".into(), digits);
    for row in rows {
        let cells = row.columns.iter().map(|column| {
            let part = if column.subset.is_some() { "~" } else { "" };
            format!("{} / {part}{}", ms(column.published_ms), ms(column.measured_ms))
        });
        table.add_row(std::iter::once(row.title.to_string()).chain(cells));
    }
    let mut text = format!(
        "Table 1: ms of GPU time for 4 ambient rays a pixel, published / here ({}x{}, the original's choices)\n{}\n\
         The report does not name its device, and it prints the two rows' labels swapped; here they are set right.",
        size[0],
        size[1],
        table.trim_fmt()
    );
    for row in rows {
        for column in row.columns.iter().filter(|column| column.overflowed_rays > 0) {
            text += &format!(
                "\n{} overflows on {}: {} rays lost a part of the tree here, and the published figure lost some too.",
                column.method, row.scene, column.overflowed_rays
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        for (value, text) in [(0.01234, "0.0123"), (0.5, "0.500"), (7.126, "7.13"), (49_600.4, "49600")] {
            assert_eq!(digits(value), text);
        }
    }

    #[test]
    fn fields_with_commas_are_quoted() {
        assert_eq!(quoted("20,140"), "\"20,140\"");
        assert_eq!(quoted("a\"b,"), "\"a\"\"b,\"");
        assert_eq!(quoted("cornell"), "cornell");
    }
}
