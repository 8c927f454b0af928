//! Curves of error over time: the Pareto front, the time to an error, slopes. Pure.

/// A picture's time and error, or any two quantities of which less is better.
pub type Place = (f64, f64);

/// Time to an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    pub at: f64,
    pub how: How,
}

/// How a time to an error is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// From the points on either side.
    Between,
    /// The curve begins below the error.
    AtMost,
    /// The curve ends above it and is carried on by its slope.
    Beyond,
}

/// A curve is carried on at most by this factor of its time.
const FARTHEST: f64 = 16.0;
/// Slope (of log error over log time) at the end of a curve that still falls: independent samples have -1/2, and an
/// error that does not vanish bends a curve towards 0.
const STILL_FALLING: f64 = -0.4;
/// Points at the end of a curve that its slope is taken from.
const END: usize = 3;

/// Which places no other beats: none is as fast and as accurate, and better in one of them.
pub fn pareto(places: &[Place]) -> Vec<bool> {
    let beats = |a: &Place, b: &Place| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    places.iter().map(|place| !places.iter().any(|other| beats(other, place))).collect()
}

/// The places of a curve that are more accurate than all faster ones, by time.
pub fn envelope(places: &[Place]) -> Vec<Place> {
    let mut sorted: Vec<Place> = places.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut kept: Vec<Place> = Vec::new();
    for place in sorted {
        if kept.last().is_none_or(|last| place.1 < last.1) {
            kept.push(place);
        }
    }
    kept
}

/// When a curve reaches an error, by its lower envelope in logarithms. An error at or below `floor` is never reached
/// beyond the curve's end (its bias stays).
pub fn reach(places: &[Place], error: f64, floor: f64) -> Option<Reached> {
    let kept = envelope(places);
    let (first, last) = (kept.first()?, kept.last()?);
    if first.1 <= error {
        return Some(Reached { at: first.0, how: How::AtMost });
    }
    if let Some(pair) = kept.windows(2).find(|pair| pair[1].1 <= error) {
        let ((t0, e0), (t1, e1)) = (pair[0], pair[1]);
        let part = (e0.ln() - error.ln()) / (e0.ln() - e1.ln());
        let at = (t0.ln() + part * (t1.ln() - t0.ln())).exp();
        return Some(Reached { at, how: How::Between });
    }
    let longest = places.iter().map(|place| place.0).fold(0.0, f64::max);
    if error <= floor || last.0 < longest {
        return None; // It fell no more at its end.
    }
    let end = &kept[kept.len().saturating_sub(END)..];
    let falls = |places: &[Place]| slope(places).filter(|slope| *slope <= STILL_FALLING);
    let whole = falls(end)?;
    // Steep before and flat at last: the flat end counts.
    let steepness = whole.max(falls(&end[end.len() - 2..])?);
    let at = last.0 * (error / last.1).powf(1.0 / steepness);
    (at <= FARTHEST * last.0).then_some(Reached { at, how: How::Beyond })
}

/// The least-squares slope of log error over log time; `None` of fewer than two places.
pub fn slope(places: &[Place]) -> Option<f64> {
    let n = places.len() as f64;
    let logs = || places.iter().map(|(x, y)| (x.ln(), y.ln()));
    let (sx, sy) = logs().fold((0.0, 0.0), |(sx, sy), (x, y)| (sx + x, sy + y));
    let (sxx, sxy) = logs().fold((0.0, 0.0), |(sxx, sxy), (x, y)| {
        (sxx + (x - sx / n).powi(2), sxy + (x - sx / n) * (y - sy / n))
    });
    (places.len() >= 2 && sxx > 0.0).then(|| sxy / sxx).filter(|slope| slope.is_finite())
}

/// 1 / (mean squared error x seconds): twice as much for a picture that takes half as long or has half the variance.
/// `ms` and root mean square error.
pub fn efficiency((ms, rmse): Place) -> Option<f64> {
    Some(1.0 / (rmse * rmse * ms * 1e-3)).filter(|efficiency| efficiency.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// c t^p + b for t = 1, 4, 16, ...
    fn curve(c: f64, p: f64, b: f64, points: i32) -> Vec<Place> {
        (0..points).map(|i| (4f64.powi(i), c * 4f64.powi(i).powf(p) + b)).collect()
    }

    fn near(reached: Option<Reached>, at: f64, how: How) -> bool {
        reached.is_some_and(|reached| reached.how == how && (reached.at / at - 1.0).abs() < 1e-9)
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let places = [(1.0, 0.5), (2.0, 0.3), (2.0, 0.4), (3.0, 0.3), (4.0, 0.1), (0.5, 0.9), (4.0, 0.1)];
        assert_eq!(pareto(&places), [true, true, false, false, true, true, true]);
        assert_eq!(envelope(&places), [(0.5, 0.9), (1.0, 0.5), (2.0, 0.3), (4.0, 0.1)]);
        assert!(pareto(&[]).is_empty() && envelope(&[]).is_empty());
    }

    #[test]
    fn between_two_points_the_power_law_is_met_exactly() {
        for p in [-0.5, -0.75, -1.0] {
            let places = curve(0.2, p, 0.0, 8);
            for error in [0.1, 0.0123] {
                let exact = (error / 0.2f64).powf(1.0 / p);
                assert!(near(reach(&places, error, 0.0), exact, How::Between), "{p} {error}");
            }
            assert!((slope(&places).unwrap() - p).abs() < 1e-12);
        }
        assert!(near(reach(&curve(0.2, -0.5, 0.0, 4), 0.3, 0.0), 1.0, How::AtMost));
        assert!(near(reach(&curve(0.2, -0.5, 0.0, 4), 0.1, 0.0), 4.0, How::Between), "at a point");
    }

    #[test]
    fn a_bump_does_not_count() {
        let places = [(1.0, 0.4), (2.0, 0.2), (4.0, 0.3), (8.0, 0.1)];
        assert!(near(reach(&places, 0.2, 0.0), 2.0, How::Between));
        assert!(near(reach(&places, 0.2f64.sqrt() * 0.1f64.sqrt(), 0.0), 4.0, How::Between));
    }

    #[test]
    fn a_curve_that_falls_is_carried_on_and_not_too_far() {
        let places = curve(0.2, -0.5, 0.0, 5); // The last one: 256, 0.0125.
        assert!(near(reach(&places, 0.01, 0.0), 400.0, How::Beyond));
        assert!(near(reach(&places, 0.00313, 0.0), (0.2f64 / 0.00313).powi(2), How::Beyond));
        assert_eq!(reach(&places, 0.003, 0.0), None, "more than 16 times as long");
        assert_eq!(reach(&places, 0.01, 0.011), None, "its bias is larger");
    }

    #[test]
    fn a_curve_that_stalls_is_not_carried_on() {
        assert_eq!(reach(&curve(0.2, -0.5, 0.03, 5), 0.02, 0.0), None);
        assert_eq!(reach(&[(1.0, 0.2), (4.0, 0.1), (16.0, 0.101)], 0.09, 0.0), None, "its end rises");
        assert_eq!(reach(&[(1.0, 0.2), (4.0, 0.19), (16.0, 0.18)], 0.17, 0.0), None);
        assert_eq!(reach(&[(1.0, 0.2)], 0.1, 0.0), None);
        assert_eq!(reach(&[], 0.1, 0.0), None);
    }

    #[test]
    fn half_the_variance_is_worth_half_the_time() {
        let base = efficiency((100.0, 0.01)).unwrap();
        assert!((base - 1e5).abs() < 1e-6);
        assert!((efficiency((50.0, 0.01)).unwrap() / base - 2.0).abs() < 1e-12);
        assert!((efficiency((100.0, 0.01 / 2f64.sqrt())).unwrap() / base - 2.0).abs() < 1e-12);
        assert_eq!(efficiency((100.0, 0.0)), None);
    }
}
