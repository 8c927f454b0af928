//! Medians and how sure they are.

use serde::Serialize;

/// A median with its 95% interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Median {
    pub median: f64,
    /// Lower and upper end.
    pub ci95: [f64; 2],
}

impl Median {
    /// Median of at least one value. The interval lies between two of the values in order: with n values the
    /// number of those below the true median is binomial(n, 1/2), whose middle 95% are n/2 +- 0.98 sqrt(n)
    /// (Conover 1999, section 3.2). It holds for any distribution; few values give the widest interval
    /// that they can, their range.
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (first, last) = (*sorted.first()?, *sorted.last()?);
        let n = sorted.len();
        let median = if n % 2 == 1 { sorted[n / 2] } else { (sorted[n / 2 - 1] + sorted[n / 2]) * 0.5 };
        let half_width = 0.98 * (n as f64).sqrt();
        let below = (n as f64 * 0.5 - half_width).floor();
        let above = (n as f64 * 0.5 + half_width).ceil();
        let low = if below >= 1.0 { sorted[below as usize - 1] } else { first };
        let high = if above < n as f64 { sorted[above as usize] } else { last };
        Some(Self { median, ci95: [low, high] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::seeds::hash;

    #[test]
    fn few_values_give_their_range_and_many_narrow_it() {
        assert_eq!(Median::of(&[]), None);
        assert_eq!(Median::of(&[3.0]), Some(Median { median: 3.0, ci95: [3.0, 3.0] }));
        assert_eq!(Median::of(&[4.0, 1.0, 2.0]), Some(Median { median: 2.0, ci95: [1.0, 4.0] }));
        let many: Vec<f64> = (0..1000).map(f64::from).collect();
        let Median { median, ci95: [low, high] } = Median::of(&many).unwrap();
        assert_eq!(median, 499.5);
        assert!(low > 460.0 && high < 540.0, "{low} {high}");
    }

    /// Of 2,000 samples of 31 skewed values, the interval must hold the true median in at least 95%.
    #[test]
    fn the_interval_covers_the_true_median() {
        let (mut held, rounds) = (0, 2000u32);
        for round in 0..rounds {
            let values: Vec<f64> = (0..31)
                .map(|i| -(f64::from(hash(31 * round + i, 5)) / 4294967296.0).max(1e-12).ln())
                .collect();
            let Median { ci95: [low, high], .. } = Median::of(&values).unwrap();
            held += u32::from(low <= 2f64.ln() && 2f64.ln() <= high);
        }
        let share = f64::from(held) / f64::from(rounds);
        assert!((0.94..=1.0).contains(&share), "{share}");
    }
}
