//! What rows say of growth: lines through the times of their fastest frames.

use serde::Serialize;

use super::fit::{Estimate, Line, line};
use super::rows::{Row, Study};

/// A straight line through the rows of one curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fit {
    pub study: Study,
    /// The curve: a method or a builder.
    pub of: String,
    /// What was fitted.
    pub model: &'static str,
    pub points: usize,
    pub intercept: Estimate,
    pub slope: Estimate,
    /// Samples alone: ms that a further dispatch of each kernel takes beyond what its samples do, from a fit of its own.
    pub per_dispatch_ms: Option<Estimate>,
    /// The largest distance of a point from the line, as a part of its value, and where.
    pub worst_residual: f64,
    pub worst_at: f64,
    /// Samples alone: the largest rise over the line between two neighbours of which the second has more dispatches, as a
    /// part of its time, and the second one's samples.
    pub largest_step: Option<(f64, f64)>,
}

/// A curve's name and its rows.
type Curve<'a> = (String, Vec<&'a Row>);

/// All fits that the rows allow.
pub fn fits(rows: &[Row]) -> Vec<Fit> {
    let mut fits = Vec::new();
    for study in Study::ALL {
        for (of, rows) in curves(rows, study) {
            fits.extend(match study {
                Study::Triangles => {
                    fitted(study, &of, "ms_per_ray = intercept + slope * log2(triangles)", &rows, |row| {
                        Some((row.log2_triangles, row.ms_per_ray?))
                    })
                }
                Study::Samples => fitted(study, &of, "gpu_ms_min = intercept + slope * spp", &rows, |row| {
                    Some((f64::from(row.spp?), row.gpu_ms_min?))
                })
                .map(|fit| with_steps(fit, &rows)),
                Study::Size => fitted(study, &of, "gpu_ms_min = intercept + slope * pixels", &rows, |row| {
                    let [width, height] = row.size?;
                    Some((f64::from(width) * f64::from(height), row.gpu_ms_min?))
                }),
                Study::Build => fitted(study, &of, EXPONENT, &rows, |row| exponent(row, row.build_ms?)),
                Study::Load => fitted(study, &of, EXPONENT, &rows, |row| exponent(row, row.load_ms?)),
            });
        }
    }
    fits
}

/// Microseconds, so that logarithms are positive.
const EXPONENT: &str = "log2(microseconds) = intercept + slope * log2(triangles)";

fn exponent(row: &Row, ms: f64) -> Option<(f64, f64)> {
    Some((row.log2_triangles, (ms * 1e3).log2()))
}

/// The rows of a study, curve by curve, in their order.
pub fn curves(rows: &[Row], study: Study) -> Vec<Curve<'_>> {
    let mut curves: Vec<Curve<'_>> = Vec::new();
    for row in rows.iter().filter(|row| row.study == study) {
        match curves.iter_mut().find(|(label, _)| label == row.label()) {
            Some((_, rows)) => rows.push(row),
            None => curves.push((row.label().into(), vec![row])),
        }
    }
    curves
}

fn fitted(
    study: Study,
    of: &str,
    model: &'static str,
    rows: &[&Row],
    place: impl Fn(&Row) -> Option<(f64, f64)>,
) -> Option<Fit> {
    let points: Vec<(f64, f64)> = rows.iter().filter_map(|row| place(row)).collect();
    let Line { coefficients, residuals } =
        line(&points.iter().map(|&(x, y)| ([1.0, x], y)).collect::<Vec<_>>())?;
    let worst = (0..residuals.len()).max_by(|&a, &b| residuals[a].abs().total_cmp(&residuals[b].abs()))?;
    Some(Fit {
        study,
        of: of.into(),
        model,
        points: points.len(),
        intercept: coefficients[0],
        slope: coefficients[1],
        per_dispatch_ms: None,
        worst_residual: residuals[worst],
        worst_at: points[worst].0,
        largest_step: None,
    })
}

/// What the ends of dispatches cost.
fn with_steps(fit: Fit, rows: &[&Row]) -> Fit {
    let point = |row: &&Row| {
        Some((f64::from(row.spp?), row.dispatches? as f64, row.gpu_ms_min?)).filter(|point| point.2 > 0.0)
    };
    let points: Vec<(f64, f64, f64)> = rows.iter().filter_map(point).collect();
    let several: Vec<([f64; 3], f64)> = points.iter().map(|&(spp, n, ms)| ([1.0, spp, n], ms)).collect();
    let rise = |pair: &[(f64, f64, f64)]| {
        let line = |spp: f64| fit.intercept.value + fit.slope.value * spp;
        let above = |(spp, _, ms): (f64, f64, f64)| ms - line(spp);
        (pair[1].1 > pair[0].1).then(|| ((above(pair[1]) - above(pair[0])) / pair[1].2, pair[1].0))
    };
    let largest_step = points.windows(2).filter_map(rise).max_by(|a, b| a.0.total_cmp(&b.0));
    Fit { per_dispatch_ms: line(&several).map(|line| line.coefficients[2]), largest_step, ..fit }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::scenes::scene_of;
    use crate::scene::Mesh;

    fn row(study: Study, triangles: usize) -> Row {
        let mesh = Mesh { positions: Vec::new(), triangles: vec![[0; 3]; triangles] };
        Row { method: Some("wide".into()), ..Row::new(study, "synthetic", &scene_of("synthetic", mesh)) }
    }

    #[test]
    fn synthetic_rows_give_their_slopes() {
        let mut rows = Vec::new();
        for power in [8, 10, 13, 16] {
            let ms_per_ray = Some(1e-4 + 2e-5 * f64::from(power));
            let build_ms = Some(2f64.powi(power) / 500.0);
            rows.push(Row { ms_per_ray, ..row(Study::Triangles, 1 << power) });
            rows.push(Row { method: None, builder: Some("sah"), build_ms, ..row(Study::Build, 1 << power) });
        }
        let found = fits(&rows);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].of.as_str(), found[0].points), ("wide", 4));
        assert!((found[0].slope.value / 2e-5 - 1.0).abs() < 1e-6, "{:?}", found[0]);
        assert_eq!(found[1].of, "sah");
        assert!((found[1].slope.value - 1.0).abs() < 1e-6, "{:?}", found[1]);
        assert!(fits(&rows[..4]).is_empty(), "two points have no interval");
    }

    #[test]
    fn a_step_at_a_dispatch_s_end_is_seen_and_none_is_not() {
        let study = |step: f64| {
            let counts = [1, 2, 4, 8, 16, 17, 24, 32, 33, 48, 64];
            let place = |&spp: &u32| {
                let dispatches = u64::from(spp.div_ceil(16));
                let ms = 0.5 + 0.25 * f64::from(spp) + step * (dispatches - 1) as f64;
                Row {
                    spp: Some(spp),
                    dispatches: Some(dispatches),
                    gpu_ms_min: Some(ms),
                    ..row(Study::Samples, 1)
                }
            };
            fits(&counts.iter().map(place).collect::<Vec<_>>()).remove(0)
        };
        let smooth = study(0.0);
        assert!(smooth.per_dispatch_ms.unwrap().value.abs() < 1e-6, "{smooth:?}");
        assert!(smooth.largest_step.unwrap().0.abs() < 1e-6 && smooth.worst_residual.abs() < 1e-6);
        let steps = study(1.0);
        assert!((steps.per_dispatch_ms.unwrap().value - 1.0).abs() < 1e-6, "{steps:?}");
        let (step, at) = steps.largest_step.unwrap();
        assert!(step > 0.05 && (at == 17.0 || at == 33.0), "{steps:?}");
    }
}
