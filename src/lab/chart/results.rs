//! What a chart holds: points, curves, and what follows from them.

use serde::{Deserialize, Serialize};

use super::accuracy::Errors;
use super::curves::{BASE, Choices, Varies};
use super::front::{self, How, Place};
use crate::lab::statistics::Median;
use crate::render::choices::Accumulator;

/// A picture: what it took and how far it is from the truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    pub spp: u32,
    /// Summed kernel time, the median of the runs and its 95% interval.
    pub gpu_ms: f64,
    pub gpu_ms_ci95: [f64; 2],
    pub runs: u32,
    /// Root mean square error; `None` where the references do not resolve it.
    pub rmse: Option<f64>,
    /// Where it is not resolved: it is below this.
    pub rmse_below: Option<f64>,
    pub mse: f64,
    /// Standard error of `mse`.
    pub mse_error: f64,
    /// Mean error, signed.
    pub bias: f64,
    pub bias_error: f64,
    /// Pixels without a number, left out of the errors.
    pub not_finite: usize,
    pub overflowed_rays: u64,
    /// No other point of the scene is as fast and as accurate.
    pub pareto: bool,
}

/// Errors smaller than this are as good as none: 32-bit floats end there.
const NO_ERROR: f64 = 1e-9;

impl Point {
    pub fn new(spp: u32, times: &[f64], errors: &Errors, overflowed_rays: u64) -> Self {
        let Median { median, ci95 } = Median::of(times).unwrap_or(Median { median: 0.0, ci95: [0.0; 2] });
        let Errors { mse, mse_error, bias, bias_error, not_finite } = *errors;
        let resolved = mse >= mse_error;
        Self {
            spp,
            gpu_ms: median,
            gpu_ms_ci95: ci95,
            runs: times.len() as u32,
            rmse: resolved.then(|| mse.sqrt()),
            rmse_below: (!resolved).then(|| (mse.max(0.0) + mse_error).sqrt()),
            mse,
            mse_error,
            bias,
            bias_error,
            not_finite,
            overflowed_rays,
            pareto: false,
        }
    }

    /// Time and error, as far as that is known.
    pub fn place(&self) -> Place {
        (self.gpu_ms, self.rmse.or(self.rmse_below).unwrap_or(0.0).max(NO_ERROR))
    }
}

/// What a picture of a curve is worth for its time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Efficiency {
    /// The point it is told for: the one whose error is nearest to [`EFFICIENCY_AT`].
    pub spp: u32,
    pub rmse: f64,
    /// 1 / (mean squared error x seconds).
    pub per_s: f64,
    /// Over that of the original made unbiased.
    pub factor: Option<f64>,
}

#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    pub scene: String,
    pub label: String,
    pub varies: Varies,
    /// The curve that made the same choices, whose points these are.
    pub same_as: Option<String>,
    pub choices: Choices,
    /// In the order of their samples.
    pub points: Vec<Point>,
    /// Of log error over log samples: -1/2 with independent samples, 0 where the error is a bias.
    pub slope: Option<f64>,
    pub efficiency: Option<Efficiency>,
}

/// Time to an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeTo {
    pub scene: String,
    pub label: String,
    pub rmse: f64,
    /// `None` where the curve does not get there.
    pub gpu_ms: Option<f64>,
    pub spp: Option<f64>,
    /// The curve was carried on by its slope.
    pub extrapolated: bool,
    /// Its first point is that accurate already.
    pub at_most: bool,
    /// Time of the original made unbiased over this.
    pub factor: Option<f64>,
}

/// Errors whose times are told.
pub const TARGETS: [f64; 3] = [0.01, 0.003, 0.001];
/// Where efficiencies are told.
pub const EFFICIENCY_AT: f64 = 0.01;

/// Fills in what follows from the points of a scene's curves; gives their times to the errors.
pub fn evaluate(curves: &mut [Curve]) -> Vec<TimeTo> {
    mark_front(curves);
    for curve in &mut *curves {
        let resolved = curve.points.iter().filter_map(|point| Some((f64::from(point.spp), point.rmse?)));
        curve.slope = front::slope(&resolved.filter(|place| place.1 > NO_ERROR).collect::<Vec<_>>());
        curve.efficiency = efficiency(&curve.points);
    }
    let base = curves.iter().find(|curve| curve.label == BASE);
    let of_base = base.and_then(|curve| curve.efficiency).map(|efficiency| efficiency.per_s);
    let base_times = base.map(|curve| TARGETS.map(|error| time_to(curve, error, None).gpu_ms));
    for efficiency in curves.iter_mut().filter_map(|curve| curve.efficiency.as_mut()) {
        efficiency.factor = of_base.map(|base| efficiency.per_s / base);
    }
    let each = |curve: &Curve| -> Vec<TimeTo> {
        let base = base_times.unwrap_or_default();
        TARGETS.iter().zip(base).map(|(&error, base)| time_to(curve, error, base)).collect()
    };
    curves.iter().flat_map(each).collect()
}

/// Points that are measured once stand in several curves.
fn mark_front(curves: &mut [Curve]) {
    let resolved = |point: &&mut Point| point.rmse.is_some();
    let mut points: Vec<&mut Point> =
        curves.iter_mut().flat_map(|curve| curve.points.iter_mut()).filter(resolved).collect();
    let places: Vec<Place> = points.iter().map(|point| point.place()).collect();
    for (point, kept) in points.iter_mut().zip(front::pareto(&places)) {
        point.pareto = kept;
    }
}

fn efficiency(points: &[Point]) -> Option<Efficiency> {
    let away = |point: &&Point| (point.place().1 / EFFICIENCY_AT).ln().abs();
    let nearest =
        points.iter().filter(|point| point.rmse.is_some()).min_by(|a, b| away(a).total_cmp(&away(b)))?;
    let per_s = front::efficiency(nearest.place())?;
    Some(Efficiency { spp: nearest.spp, rmse: nearest.rmse?, per_s, factor: None })
}

fn time_to(curve: &Curve, error: f64, base_ms: Option<f64>) -> TimeTo {
    // No picture's root mean square error is below the size of its mean error; where an error is not resolved, a slope is
    // not known; and every mean in 8 bits stalls, however well it falls before.
    let stalls = curve.choices.accumulator == Accumulator::Rgba8.name();
    let floor = curve.points.last().map_or(0.0, |last| match stalls {
        true => f64::INFINITY,
        false => last.rmse_below.unwrap_or(0.0).max(last.bias.abs() - 2.0 * last.bias_error),
    });
    // Over samples, which have no noise as times have.
    let over_samples = |point: &Point| (f64::from(point.spp), point.place().1);
    let places: Vec<Place> = curve.points.iter().map(over_samples).collect();
    let reached = front::reach(&places, error, floor);
    let how = |how| reached.is_some_and(|reached| reached.how == how);
    let spp = reached.map(|reached| reached.at);
    let gpu_ms = spp.and_then(|spp| time_at(&curve.points, spp));
    TimeTo {
        scene: curve.scene.clone(),
        label: curve.label.clone(),
        rmse: error,
        gpu_ms,
        spp,
        extrapolated: how(How::Beyond),
        at_most: how(How::AtMost),
        factor: base_ms.zip(gpu_ms).map(|(base, ms)| base / ms).filter(|factor| factor.is_finite()),
    }
}

/// GPU time of a picture of so many samples: between points a power law, beyond the last one as much for each sample as
/// there.
fn time_at(points: &[Point], spp: f64) -> Option<f64> {
    let of = |point: &Point| (f64::from(point.spp), point.gpu_ms);
    let after = points.iter().position(|point| f64::from(point.spp) >= spp);
    Some(match after {
        None => {
            let (last, ms) = of(points.last()?);
            ms * spp / last
        }
        Some(0) => points[0].gpu_ms,
        Some(place) => {
            let ((s0, t0), (s1, t1)) = (of(&points[place - 1]), of(&points[place]));
            let part = (spp / s0).ln() / (s1 / s0).ln();
            t0 * (t1 / t0).powf(part)
        }
    })
    .filter(|ms| ms.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(label: &str, ms: f64, error: f64, power: f64, bias: f64) -> Curve {
        let points = (1..=6).map(|level| {
            let spp = 4u32.pow(level);
            let rmse = (error * f64::from(spp).powf(power)).hypot(bias);
            let errors = Errors { mse: rmse * rmse, mse_error: 1e-9, bias, bias_error: 1e-5, not_finite: 0 };
            Point::new(spp, &[ms * f64::from(spp)], &errors, 0)
        });
        let choices = Choices {
            preset: "",
            method: label.into(),
            builder: "",
            passes: "",
            sampler: "",
            accumulator: "",
            offset: "",
            intersector: "",
            slabs: "",
            accessor: "",
            adaptive: false,
            repeat: None,
        };
        Curve {
            scene: "s".into(),
            label: label.into(),
            varies: Varies::Nothing,
            same_as: None,
            choices,
            points: points.collect(),
            slope: None,
            efficiency: None,
        }
    }

    #[test]
    fn times_factors_and_the_front_follow_from_the_points() {
        let mut curves = [
            curve(BASE, 10.0, 0.4, -0.5, 0.0),
            curve("fast", 2.0, 0.4, -0.5, 0.0),
            curve("fine", 10.0, 0.4, -0.75, 0.0),
            curve("wrong", 1.0, 0.4, -0.5, 0.02),
        ];
        let times = evaluate(&mut curves);
        assert_eq!(times.len(), 4 * TARGETS.len());
        let of = |label: &str, error: f64| {
            times.iter().find(|time| time.label == label && time.rmse == error).unwrap()
        };
        let base = of(BASE, 0.01);
        assert!((base.gpu_ms.unwrap() / 16_000.0 - 1.0).abs() < 1e-9, "{base:?}");
        assert!((base.spp.unwrap() / 1600.0 - 1.0).abs() < 1e-9);
        assert!((of("fast", 0.01).factor.unwrap() - 5.0).abs() < 1e-9);
        assert!(of("fine", 0.01).factor.unwrap() > 5.0);
        assert!(of(BASE, 0.003).extrapolated && of(BASE, 0.003).gpu_ms.is_some());
        assert_eq!(of("wrong", 0.01).gpu_ms, None);
        assert_eq!(of("wrong", 0.01).factor, None);
        let mut eight_bit = [curve("8-bit", 10.0, 0.4, -0.5, 0.0)];
        eight_bit[0].choices.accumulator = "rgba8";
        assert_eq!(evaluate(&mut eight_bit)[1].gpu_ms, None, "it would stall");
        let [_, fast, fine, wrong] = &curves;
        assert!((fast.efficiency.unwrap().factor.unwrap() - 5.0).abs() < 1e-9);
        assert_eq!(fast.efficiency.unwrap().spp, 1024);
        assert!((fine.slope.unwrap() + 0.75).abs() < 1e-9);
        assert!(wrong.slope.unwrap() > -0.4);
        assert!(curves[0].points.iter().all(|point| !point.pareto), "all are beaten");
        assert!(fine.points.last().unwrap().pareto && wrong.points[0].pareto);
    }

    /// A device that others are at work on: what is told of errors does not depend on one odd time.
    #[test]
    fn times_that_go_up_and_down_do_not_hide_a_curve_that_falls() {
        let mut curves = [curve(BASE, 1.0, 0.4, -0.5, 0.0)];
        curves[0].points[5].gpu_ms *= 3.0;
        let times = evaluate(&mut curves);
        assert!(times[0].gpu_ms.is_some_and(|ms| (1600.0..4800.0).contains(&ms)), "{times:?}");
        assert!((times[1].spp.unwrap() / (0.4f64 / 0.003).powi(2) - 1.0).abs() < 1e-9);
        assert!((times[1].gpu_ms.unwrap() / times[1].spp.unwrap() - 3.0).abs() < 1e-9);
    }

    #[test]
    fn what_drowns_in_the_noise_has_no_rmse_but_a_bound() {
        let errors = Errors { mse: -1e-7, mse_error: 4e-6, bias: 0.0, bias_error: 1e-4, not_finite: 0 };
        let point = Point::new(64, &[1.0, 3.0, 2.0], &errors, 0);
        assert_eq!((point.rmse, point.rmse_below, point.gpu_ms), (None, Some(0.002), 2.0));
        let mut curves = [curve(BASE, 1.0, 0.4, -0.5, 0.0)];
        curves[0].points.truncate(2);
        curves[0].points.push(Point { gpu_ms: 64.0, ..point });
        let times = evaluate(&mut curves);
        assert!(times[0].gpu_ms.unwrap() < 64.0, "0.01 is reached before: {times:?}");
        assert_eq!(times[2].gpu_ms, None, "0.001 is not resolved");
        assert!(!curves[0].points[2].pareto);
    }
}
