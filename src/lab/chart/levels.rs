//! Which sample counts a curve is measured at, and when it ends. Pure.

use super::results::Point;

/// What ends a curve.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// GPU time of all its points together, ms.
    pub budget_ms: f64,
    /// Most samples of a pixel.
    pub most_spp: u32,
}

/// The original's frame.
const FIRST: u32 = 4;
/// Between two levels; the last one may be nearer.
const STEP: u32 = 4;
/// Most samples of a pixel in any curve: errors below [`DONE`] need no more, and counts stay exact in 32-bit floats.
pub const MOST_SPP: u32 = 1 << 22;
/// A curve that is this accurate ends: a time to an error of 0.001 can be read from it.
pub const DONE: f64 = 0.0009;

/// The level to measure next, given the points so far in the order of their samples; `None` at the curve's end. Levels
/// that are missing between points come first.
pub fn next(points: &[Point], rule: &Rule) -> Option<u32> {
    let Some(last) = points.last() else { return Some(FIRST) };
    let missing = levels().take_while(|level| *level < last.spp);
    if let Some(level) = missing.into_iter().find(|level| points.iter().all(|point| point.spp != *level)) {
        return Some(level);
    }
    if last.rmse.is_none_or(|rmse| rmse <= DONE) {
        return None; // What is not resolved will not be with more samples.
    }
    let spent: f64 = points.iter().map(|point| point.gpu_ms).sum();
    let fits = |level: &u32| {
        let ms = last.gpu_ms * f64::from(*level) / f64::from(last.spp);
        *level <= rule.most_spp.min(MOST_SPP) && spent + ms <= rule.budget_ms
    };
    let whole = levels().find(|level| *level > last.spp)?;
    // A nearer one, so that the budget is not left half unused.
    let candidates = [whole, last.spp.saturating_mul(2)];
    candidates.into_iter().find(fits)
}

fn levels() -> impl Iterator<Item = u32> {
    std::iter::successors(Some(FIRST), |level| level.checked_mul(STEP))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: Rule = Rule { budget_ms: 1000.0, most_spp: MOST_SPP };

    /// Points of a curve whose picture takes `ms` a sample and has this error with one sample.
    fn grow(ms: f64, error: f64, rule: &Rule) -> Vec<u32> {
        let mut points: Vec<Point> = Vec::new();
        while let Some(spp) = next(&points, rule) {
            points.push(point(spp, ms, error));
            points.sort_by_key(|point| point.spp);
        }
        points.iter().map(|point| point.spp).collect()
    }

    fn point(spp: u32, ms: f64, error: f64) -> Point {
        let n = f64::from(spp);
        Point { spp, gpu_ms: n * ms, rmse: Some(error / n.sqrt()), ..Point::default() }
    }

    #[test]
    fn levels_grow_until_budget_samples_or_error_end_them() {
        assert_eq!(grow(1.0, 0.4, &RULE), [4, 16, 64, 256, 512], "1024 would exceed the budget");
        assert_eq!(grow(3.0, 0.4, &RULE), [4, 16, 64, 128]);
        assert_eq!(grow(1e5, 0.4, &RULE), [4], "the first one is measured whatever it takes");
        assert_eq!(grow(1e-6, 0.01, &RULE), [4, 16, 64, 256], "0.01 / 16 is accurate enough");
        assert_eq!(grow(1e-6, 0.4, &Rule { most_spp: 100, ..RULE }), [4, 16, 64]);
        assert_eq!(grow(1e-6, 0.4, &Rule { most_spp: 1, ..RULE }), [4]);
        assert_eq!(grow(1e-9, 1e3, &RULE).last(), Some(&MOST_SPP));
    }

    #[test]
    fn what_is_missing_comes_first_and_nothing_follows_the_unresolved() {
        let without = |missing: u32| -> Vec<Point> {
            [4, 16, 64, 256]
                .into_iter()
                .filter(|spp| *spp != missing)
                .map(|spp| point(spp, 1.0, 0.4))
                .collect()
        };
        assert_eq!(next(&without(16), &RULE), Some(16));
        assert_eq!(next(&without(4), &RULE), Some(4));
        assert_eq!(next(&without(256), &RULE), Some(256));
        let mut points = without(0);
        points[3].rmse = None;
        assert_eq!(next(&points, &RULE), None);
        // A run with a larger budget goes on after a nearer last level.
        let mut points = without(0);
        points.push(point(512, 1.0, 0.4));
        assert_eq!(next(&points, &RULE), None);
        assert_eq!(next(&points, &Rule { budget_ms: 1e4, ..RULE }), Some(1024));
    }
}
