//! A study of scaling as SVG: a plot a study, a curve a method or builder, with its fit.

use std::io;

use plotters::prelude::{DrawingBackend, RGBColor};

use super::plot::{self, Anchor, At, Canvas, LogAxis, Marker, Stroke};
use crate::lab::scaling::{Fit, Row, Study, curves};

/// Size of the picture in units, and the edges of its panel.
const SIZE: (u32, u32) = (900, 560);
const LEFT: f64 = 96.0;
const RIGHT: f64 = 690.0;
const TOP: f64 = 58.0;
const BOTTOM: f64 = 486.0;
/// Where the legend begins.
const LEGEND: f64 = 712.0;

const INK: RGBColor = RGBColor(30, 30, 34);
const GRID: RGBColor = RGBColor(208, 210, 216);
const COLOURS: [RGBColor; 8] = [
    RGBColor(16, 92, 215),
    RGBColor(226, 38, 38),
    RGBColor(26, 148, 80),
    RGBColor(255, 128, 14),
    RGBColor(148, 80, 190),
    RGBColor(23, 165, 188),
    RGBColor(140, 86, 75),
    RGBColor(130, 140, 20),
];
const MARKERS: [Marker; 5] = [Marker::Circle, Marker::Square, Marker::Up, Marker::Diamond, Marker::Down];

/// Studies that have a plot, and its name without ending.
pub const PLOTS: [(Study, &str); 5] = [
    (Study::Triangles, "scaling-triangles"),
    (Study::Samples, "scaling-samples"),
    (Study::Size, "scaling-size"),
    (Study::Build, "scaling-build"),
    (Study::Load, "scaling-load"),
];

/// What a study's plot shows of a row: its place along x and its value; `None` where there is none.
fn place(study: Study, row: &Row) -> Option<At> {
    let value = match study {
        Study::Triangles => (row.log2_triangles, row.ms_per_ray?),
        Study::Samples => (f64::from(row.spp?), row.gpu_ms_min?),
        Study::Size => (row.size.map(|[w, h]| f64::from(w) * f64::from(h))?, row.gpu_ms_min?),
        Study::Build => (row.triangles as f64, row.build_ms?),
        Study::Load => (row.triangles as f64, row.load_ms?),
    };
    (value.1 > 0.0 && value.1.is_finite()).then_some(value)
}

fn titles(study: Study) -> (&'static str, &'static str) {
    match study {
        Study::Triangles => ("log2(triangles)", "ms per ray (fastest frame)"),
        Study::Samples => ("samples of a pixel", "ms of kernel time (fastest frame)"),
        Study::Size => ("pixels", "ms of kernel time (fastest frame)"),
        Study::Build => ("triangles", "ms to build the tree"),
        Study::Load => ("triangles", "ms to load the OBJ file"),
    }
}

/// The fit's value there, in the plot's units.
fn fitted(study: Study, fit: &Fit, x: f64) -> f64 {
    let line = |x: f64| fit.intercept.value + fit.slope.value * x;
    match study {
        Study::Build | Study::Load => line(x.log2()).exp2() * 1e-3,
        _ => line(x),
    }
}

/// Along x: logarithms of triangles, from zero up; or anything by its logarithm.
enum Across {
    Linear { low: f64, high: f64 },
    Log(LogAxis),
}

impl Across {
    fn of(study: Study, places: &[At]) -> Self {
        let values = || places.iter().map(|place| place.0);
        match study {
            Study::Triangles => Self::Linear {
                low: (values().fold(f64::INFINITY, f64::min) - 1.0).floor(),
                high: (values().fold(0.0, f64::max) + 1.0).ceil(),
            },
            _ => Self::Log(LogAxis::holding(values(), 1.5, (LEFT, RIGHT))),
        }
    }

    fn at(&self, value: f64) -> f64 {
        match self {
            Self::Linear { low, high } => LEFT + (value - low) / (high - low) * (RIGHT - LEFT),
            Self::Log(axis) => axis.at(value),
        }
    }

    /// Places with a line, and their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        match self {
            Self::Linear { low, high } => {
                (*low as i64..=*high as i64).map(|tick| (tick as f64, tick.to_string())).collect()
            }
            Self::Log(axis) => {
                axis.ticks().into_iter().filter(|tick| tick.0).map(|tick| (tick.1, power(tick.1))).collect()
            }
        }
    }
}

/// Values up the side: from zero where a straight line is what one expects, by the logarithm elsewhere.
enum Upwards {
    Linear { high: f64 },
    Log(LogAxis),
}

impl Upwards {
    fn of(study: Study, places: &[At]) -> Self {
        let values = || places.iter().map(|place| place.1);
        match study {
            Study::Triangles => Self::Linear { high: values().fold(0.0, f64::max) * 1.12 },
            _ => Self::Log(LogAxis::holding(values(), 1.5, (BOTTOM, TOP))),
        }
    }

    fn at(&self, value: f64) -> f64 {
        match self {
            Self::Linear { high } => BOTTOM + value / high * (TOP - BOTTOM),
            Self::Log(axis) => axis.at(value),
        }
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        match self {
            Self::Linear { high } => {
                let step = 10f64.powf(high.log10().floor());
                let step = if high / step < 2.5 { step / 4.0 } else { step };
                let count = (high / step).floor() as u32;
                (0..=count).map(|k| f64::from(k) * step).map(|tick| (tick, format!("{tick:.3e}"))).collect()
            }
            Self::Log(axis) => {
                axis.ticks().into_iter().filter(|tick| tick.0).map(|tick| (tick.1, power(tick.1))).collect()
            }
        }
    }
}

/// A power of ten, shortly.
fn power(value: f64) -> String {
    if (0.001..10_000.0).contains(&value) { format!("{value}") } else { format!("{value:.0e}") }
}

/// The plot of a study; `None` if no row has a place in it. `title`: scene and device.
pub fn svg(study: Study, rows: &[Row], fits: &[Fit], title: &str) -> io::Result<Option<String>> {
    if rows.iter().filter(|row| row.study == study).all(|row| place(study, row).is_none()) {
        return Ok(None);
    }
    plot::svg(SIZE, |canvas| draw(canvas, study, rows, fits, title)).map(Some)
}

fn draw<B: DrawingBackend>(
    canvas: &Canvas<B>,
    study: Study,
    rows: &[Row],
    fits: &[Fit],
    title: &str,
) -> io::Result<()> {
    let curves: Vec<(String, Vec<At>)> = curves(rows, study)
        .into_iter()
        .map(|(label, rows)| (label, rows.into_iter().filter_map(|row| place(study, row)).collect()))
        .collect();
    let all: Vec<At> = curves.iter().flat_map(|(_, places)| places.iter().copied()).collect();
    let (across, upwards) = (Across::of(study, &all), Upwards::of(study, &all));
    canvas.text(title, (LEFT, 26.0), 17.0, INK, Anchor::Left)?;
    for (value, label) in across.ticks() {
        let x = across.at(value);
        canvas.line(&[(x, TOP), (x, BOTTOM)], &Stroke::new(GRID, 1.0))?;
        canvas.text(&label, (x, BOTTOM + 16.0), 13.0, INK, Anchor::Middle)?;
    }
    for (value, label) in upwards.ticks() {
        let y = upwards.at(value);
        canvas.line(&[(LEFT, y), (RIGHT, y)], &Stroke::new(GRID, 1.0))?;
        canvas.text(&label, (LEFT - 8.0, y), 13.0, INK, Anchor::Right)?;
    }
    let frame = [(LEFT, TOP), (RIGHT, TOP), (RIGHT, BOTTOM), (LEFT, BOTTOM), (LEFT, TOP)];
    canvas.line(&frame, &Stroke::new(INK, 1.0))?;
    let (below, beside) = titles(study);
    canvas.text(below, ((LEFT + RIGHT) / 2.0, BOTTOM + 42.0), 15.0, INK, Anchor::Middle)?;
    canvas.text_turned(beside, (18.0, (TOP + BOTTOM) / 2.0), 15.0, INK, Anchor::Middle, true)?;
    for (number, (label, places)) in curves.iter().enumerate() {
        let (colour, marker) = (COLOURS[number % COLOURS.len()], MARKERS[number % MARKERS.len()]);
        let fit = fits.iter().find(|fit| fit.study == study && fit.of == *label);
        if let (Some(fit), Some(first), Some(last)) = (fit, places.first(), places.last()) {
            let along = |k: u32| {
                let part = f64::from(k) / 64.0;
                let x = match &across {
                    Across::Linear { .. } => first.0 + part * (last.0 - first.0),
                    Across::Log(_) => first.0 * (last.0 / first.0).powf(part),
                };
                (across.at(x), upwards.at(fitted(study, fit, x)))
            };
            let inside = |at: &At| at.1.is_finite() && (TOP..=BOTTOM).contains(&at.1);
            let path: Vec<At> = (0..=64).map(along).filter(inside).collect();
            canvas.line(&path, &Stroke::new(colour, 1.6).dashed(6.0, 4.0))?;
        }
        for &(x, y) in places {
            canvas.marker(marker, (across.at(x), upwards.at(y)), 4.5, colour, true)?;
        }
        let y = TOP + 12.0 + 22.0 * number as f64;
        canvas.marker(marker, (LEGEND + 8.0, y), 4.5, colour, true)?;
        canvas.text(label, (LEGEND + 24.0, y), 14.0, INK, Anchor::Left)?;
    }
    canvas.text("dashed: fits", (LEGEND, BOTTOM - 8.0), 13.0, INK, Anchor::Left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scaling::fits;
    use crate::lab::scenes::scene_of;
    use crate::scene::Mesh;

    #[test]
    fn a_plot_shows_its_curves_and_an_empty_study_has_none() {
        let row = |power: u32| {
            let mesh = Mesh { positions: Vec::new(), triangles: vec![[0; 3]; 1 << power] };
            let scene = scene_of("hills", mesh);
            Row {
                method: Some("wide".into()),
                ms_per_ray: Some(1e-4 * f64::from(power)),
                build_ms: Some(f64::from(1 << power)),
                ..Row::new(Study::Triangles, "hills", &scene)
            }
        };
        let mut rows: Vec<Row> = (4..9).map(row).collect();
        rows.push(Row { study: Study::Build, ..row(4) });
        let found = fits(&rows);
        let text = svg(Study::Triangles, &rows, &found, "hills").unwrap().unwrap();
        assert!(
            text.contains("wide") && text.contains("log2(triangles)") && text.contains("hills"),
            "{text}"
        );
        assert!(svg(Study::Build, &rows, &found, "").unwrap().is_some(), "a single place is a plot");
        assert!(svg(Study::Samples, &rows, &found, "").unwrap().is_none());
    }
}
