//! A chart's curves as a table for a person.

use comfy_table::{CellAlignment, Table, presets};

use super::bench::digits;
use super::chart::Record;
use crate::lab::chart::SceneFacts;
use crate::lab::chart::results::{Curve, Point, TARGETS, TimeTo};

/// What the columns mean.
pub const LEGEND: &str = "\
spp, RMSE, bias: of the curve's last point, (bias) where it is below two standard errors; then for each error the samples and
the GPU time that it takes, ~ carried on by the curve's slope, < the first point is that accurate already, and x: how much
faster than the original made unbiased; gain: 1 / (MSE x time) near RMSE 0.01 over the original's made unbiased; slope: of
log RMSE over log spp.";

/// The curves of a scene.
pub fn table(record: &Record, facts: &SceneFacts) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    let mut header: Vec<String> = ["curve", "spp", "RMSE", "bias"].map(String::from).into();
    for error in TARGETS {
        header.extend([format!("to {error}: spp"), "time".into(), "x".into()]);
    }
    header.extend(["gain".into(), "slope".into()]);
    let columns = header.len();
    table.set_header(header);
    for curve in record.curves_of(&facts.scene) {
        table.add_row(row(record, curve));
    }
    for place in 1..columns {
        if let Some(column) = table.column_mut(place) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let resolution = facts.resolution.map_or(String::new(), |resolution| {
        format!(", errors below {} are not resolved", digits(resolution))
    });
    format!(
        "{}: {} triangles, {}x{}, {} pixels compared{resolution}\n{}",
        facts.scene,
        facts.triangles,
        record.size[0],
        record.size[1],
        facts.pixels,
        table.trim_fmt()
    )
}

fn row(record: &Record, curve: &Curve) -> Vec<String> {
    let label = match &curve.same_as {
        Some(other) => format!("{} = {other}", curve.label),
        None => curve.label.clone(),
    };
    let mut cells = vec![label];
    match curve.points.last() {
        Some(last) => cells.extend([last.spp.to_string(), rmse(last), bias(last)]),
        None => cells.extend(["", "", ""].map(String::from)),
    }
    for time in record.times_of(curve) {
        cells.extend(reached(time));
    }
    let factor = curve.efficiency.and_then(|efficiency| efficiency.factor);
    cells.push(factor.map(of_factor).unwrap_or_default());
    cells.push(curve.slope.map(|slope| format!("{slope:.2}")).unwrap_or_default());
    cells
}

fn rmse(point: &Point) -> String {
    match (point.rmse, point.rmse_below) {
        (Some(rmse), _) => significant(rmse),
        (None, Some(bound)) => format!("<{}", significant(bound)),
        (None, None) => String::new(),
    }
}

fn bias(point: &Point) -> String {
    let text = format!("{:+.5}", point.bias);
    if point.bias.abs() < 2.0 * point.bias_error { format!("({text})") } else { text }
}

fn reached(time: &TimeTo) -> [String; 3] {
    let Some(ms) = time.gpu_ms else { return ["-".into(), "-".into(), String::new()] };
    let mark = match (time.extrapolated, time.at_most) {
        (true, _) => "~",
        (_, true) => "<",
        _ => "",
    };
    let spp = time.spp.map(|spp| format!("{mark}{spp:.0}")).unwrap_or_default();
    [spp, format!("{mark}{}", duration(ms)), time.factor.map(of_factor).unwrap_or_default()]
}

/// Two digits, no fewer before the point.
fn of_factor(factor: f64) -> String {
    let places = if factor >= 9.95 {
        0
    } else if factor >= 0.995 {
        1
    } else {
        2
    };
    format!("{factor:.places$}")
}

/// Three significant digits.
fn significant(value: f64) -> String {
    let places = if value > 0.0 { (2.0 - value.log10().floor()).clamp(0.0, 9.0) as usize } else { 0 };
    format!("{value:.places$}")
}

/// A time in the unit that suits it.
pub fn duration(ms: f64) -> String {
    match ms {
        ms if ms < 1.0 => format!("{:.3} ms", ms),
        ms if ms < 1e3 => format!("{} ms", digits(ms)),
        ms if ms < 120e3 => format!("{} s", digits(ms * 1e-3)),
        ms => format!("{} min", digits(ms / 60e3)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_long_as_they_mean_something() {
        let factors = [0.123, 0.999, 1.24, 9.96, 123.4].map(of_factor);
        assert_eq!(factors, ["0.12", "1.0", "1.2", "10", "123"]);
        assert_eq!([0.0, 0.001234, 0.0999, 0.2345, 12.3].map(significant)[..3], ["0", "0.00123", "0.0999"]);
        let times = [0.5, 12.34, 1500.0, 100e3, 600e3].map(duration);
        assert_eq!(times, ["0.500 ms", "12.3 ms", "1.50 s", "100 s", "10.0 min"]);
    }
}
