//! Straight lines through measured times, with how sure they are.

use serde::Serialize;

/// A number of a fit with its 95% interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    /// Lower and upper end.
    pub ci95: [f64; 2],
}

/// A fit of y = c0 x0 + c1 x1 + ... .
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub coefficients: Vec<Estimate>,
    /// (y - fitted) / y of each point, in their order.
    pub residuals: Vec<f64>,
}

/// Least squares of relative residuals: times of 0.1 ms and of 10 s, each with a noise of so many percent, weigh alike.
/// A point is its x0, x1, ... and its y, which must be positive. `None` if there are no more points than coefficients, or
/// if they do not determine them. Intervals are Student's, for independent residuals.
pub fn line<const K: usize>(points: &[([f64; K], f64)]) -> Option<Line> {
    let freedom = points.len().checked_sub(K).filter(|freedom| *freedom > 0)?;
    if points.iter().any(|(x, y)| !(*y > 0.0 && y.is_finite() && x.iter().all(|x| x.is_finite()))) {
        return None;
    }
    // Divided by y the right side is 1 everywhere; divided by its length each column has length 1.
    let rows: Vec<[f64; K]> = points.iter().map(|(x, y)| x.map(|x| x / y)).collect();
    let scale: [f64; K] = std::array::from_fn(|k| rows.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt());
    if scale.contains(&0.0) {
        return None;
    }
    let rows: Vec<[f64; K]> = rows.iter().map(|row| std::array::from_fn(|k| row[k] / scale[k])).collect();
    let sum = |f: &dyn Fn(&[f64; K]) -> f64| rows.iter().map(f).sum::<f64>();
    let normal: [[f64; K]; K] = std::array::from_fn(|i| std::array::from_fn(|j| sum(&|row| row[i] * row[j])));
    let inverse = inverse(normal)?;
    let right: [f64; K] = std::array::from_fn(|i| sum(&|row| row[i]));
    let solved: [f64; K] = std::array::from_fn(|i| (0..K).map(|j| inverse[i][j] * right[j]).sum());
    let residuals: Vec<f64> =
        rows.iter().map(|row| 1.0 - (0..K).map(|k| row[k] * solved[k]).sum::<f64>()).collect();
    let variance = residuals.iter().map(|residual| residual * residual).sum::<f64>() / freedom as f64;
    let coefficients = (0..K)
        .map(|k| {
            let value = solved[k] / scale[k];
            let half = student95(freedom) * (variance * inverse[k][k]).sqrt() / scale[k];
            Estimate { value, ci95: [value - half, value + half] }
        })
        .collect();
    Some(Line { coefficients, residuals })
}

/// Inverse of a symmetric matrix whose diagonal is 1, by Gauss and Jordan with pivots; `None` where it is next to singular.
fn inverse<const K: usize>(mut matrix: [[f64; K]; K]) -> Option<[[f64; K]; K]> {
    let mut inverse: [[f64; K]; K] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for column in 0..K {
        let size = |row: &usize| matrix[*row][column].abs();
        let pivot = (column..K).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        if matrix[pivot][column].abs() < 1e-12 {
            return None;
        }
        matrix.swap(column, pivot);
        inverse.swap(column, pivot);
        let by = matrix[column][column];
        matrix[column] = matrix[column].map(|value| value / by);
        inverse[column] = inverse[column].map(|value| value / by);
        let (unit, inverted) = (matrix[column], inverse[column]);
        for row in (0..K).filter(|row| *row != column) {
            let times = matrix[row][column];
            matrix[row] = std::array::from_fn(|k| matrix[row][k] - times * unit[k]);
            inverse[row] = std::array::from_fn(|k| inverse[row][k] - times * inverted[k]);
        }
    }
    Some(inverse)
}

/// Student's t within which 95% of the values lie, for so many degrees of freedom.
fn student95(freedom: usize) -> f64 {
    const TABLE: [f64; 30] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145,
        2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048,
        2.045, 2.042,
    ];
    // Beyond the table within 0.002 of it.
    TABLE.get(freedom - 1).copied().unwrap_or(1.960 + 2.46 / freedom as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::seeds::hash;

    fn noise(i: u32) -> f64 {
        f64::from(hash(i, 7)) / f64::from(u32::MAX) - 0.5
    }

    #[test]
    fn an_exact_line_is_found_exactly() {
        let points: Vec<_> = [1.0, 2.0, 5.0, 100.0, 4096.0].map(|x| ([1.0, x], 0.25 + 3.0 * x)).into();
        let Line { coefficients, residuals } = line(&points).unwrap();
        assert!((coefficients[0].value - 0.25).abs() < 1e-6 && (coefficients[1].value - 3.0).abs() < 1e-9);
        assert!(residuals.iter().all(|residual| residual.abs() < 1e-9), "{residuals:?}");
    }

    /// Of 400 noisy lines about 95% of the intervals must hold the true slope.
    #[test]
    fn the_interval_holds_the_slope() {
        let mut held = 0;
        for round in 0..400u32 {
            let point = |i: u32| {
                let x = f64::from(i + 1);
                ([1.0, x], (2.0 + 0.5 * x) * (1.0 + 0.1 * noise(round * 64 + i)))
            };
            let [low, high] = line(&(0..12).map(point).collect::<Vec<_>>()).unwrap().coefficients[1].ci95;
            held += u32::from(low <= 0.5 && 0.5 <= high);
        }
        assert!((360..=398).contains(&held), "{held}");
    }

    #[test]
    fn a_step_is_told_apart_from_the_slope() {
        let point = |i: u32| {
            let (x, pieces) = (f64::from(i), f64::from(i / 16));
            ([1.0, x, pieces], (1.0 + x + 5.0 * pieces) * (1.0 + 0.001 * noise(i)))
        };
        let fit = line(&(1..60).map(point).collect::<Vec<_>>()).unwrap();
        assert!((fit.coefficients[2].value - 5.0).abs() < 0.1, "{fit:?}");
    }

    #[test]
    fn what_cannot_be_fitted_is_not() {
        assert_eq!(line(&[([1.0, 1.0], 1.0), ([1.0, 2.0], 2.0)]), None, "no more points than coefficients");
        let same = [([1.0, 2.0], 1.0), ([1.0, 2.0], 1.1), ([1.0, 2.0], 0.9)];
        assert_eq!(line(&same), None, "one place alone");
        assert_eq!(line(&[([1.0], 0.0), ([1.0], 1.0)]), None, "a time of zero");
        assert_eq!(line(&[([0.0], 1.0), ([0.0], 1.0)]), None);
    }

    #[test]
    fn student_joins_its_table() {
        assert!((student95(31) - 2.040).abs() < 0.002 && (student95(1_000_000) - 1.96).abs() < 0.001);
    }
}
