//! Rendering in rounds until a goal is reached: how many samples come next. Pure: it sees errors and times only.

use std::time::Duration;

use super::choices::Sampler;

/// When a render ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// With the last sample.
    Samples,
    /// When the estimated root mean square error is so small.
    Rmse(f64),
    /// When so much time is up.
    Time(Duration),
}

/// Samples of a pixel in the first round: enough for both halves to tell of the error.
pub const FIRST_ROUND: u32 = 16;
/// Most samples of a camera ray: a render whose goal is out of reach ends there.
pub const MOST_SAMPLES: u32 = 1 << 24;
/// Standard errors by which the mean square error must lie below the goal's.
const CONFIDENCE: f64 = 2.0;
/// The number of samples grows by this factor at most from round to round.
const MOST_GROWTH: f64 = 4.0;
/// A goal that is thought to be reached is overshot by so much, since another round costs more.
const OVERSHOOT: f64 = 1.02;

/// What is known after a round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// Samples of a camera ray so far.
    pub samples: u32,
    /// Estimated error and the part of its square that chance may have added or taken (one standard error).
    pub rmse: f64,
    pub uncertainty: f64,
    /// Mean square error that no ray may have told of.
    pub unseen: f64,
    /// Since the render began.
    pub elapsed: Duration,
}

impl Round {
    /// The error that is hardly ever exceeded.
    fn upper(&self) -> f64 {
        (self.rmse * self.rmse * (1.0 + CONFIDENCE * self.uncertainty) + self.unseen).sqrt()
    }
}

/// The rounds of a render.
#[derive(Clone, Debug)]
pub struct Rounds {
    goal: Goal,
    first: u32,
    most: u32,
    /// The error is expected to fall with this power of the number of samples.
    power: f64,
    /// Only powers of two: a sequence in base 2 that ends between two of them is no better than at the lower one.
    powers_of_two: bool,
    done: Vec<Round>,
}

impl Rounds {
    /// At most `most` samples of each of a pixel's `jitters` camera rays.
    pub fn new(goal: Goal, sampler: Sampler, most: u32, jitters: u32) -> Self {
        let power = match sampler {
            Sampler::Lcg | Sampler::Pcg | Sampler::Philox => 0.5,
            Sampler::Sobol | Sampler::Strata => 0.7,
        };
        let first = (FIRST_ROUND / jitters.max(1)).next_multiple_of(2).max(2);
        Self { goal, first, most, power, powers_of_two: sampler == Sampler::Sobol, done: Vec::new() }
    }

    pub fn finished(&mut self, round: Round) {
        self.done.push(round);
    }

    /// Rounds done.
    pub fn count(&self) -> usize {
        self.done.len()
    }

    /// The round before the one at hand.
    pub fn last(&self) -> Option<&Round> {
        self.done.last()
    }

    /// Samples after the next round; `None` at the end.
    pub fn next(&self) -> Option<u32> {
        let Some(last) = self.done.last() else {
            return Some(if self.goal == Goal::Samples { self.most } else { self.first.min(self.most) });
        };
        let wanted = match self.goal {
            Goal::Samples => None,
            Goal::Rmse(goal) => (last.upper() > goal).then(|| self.predicted(last, goal)),
            Goal::Time(limit) => affordable(last, limit),
        }?;
        let (so_far, wanted) = (f64::from(last.samples), wanted.min(f64::from(last.samples) * MOST_GROWTH));
        let end = match (self.goal, self.powers_of_two) {
            // Late is worse than early, and what is left of the time is used up.
            (Goal::Time(_), _) => (wanted * 0.5).floor() * 2.0,
            (_, true) => wanted.max(so_far * 2.0).log2().ceil().exp2(),
            // A step that shows in the error.
            (_, false) => {
                let step = f64::from((last.samples / 4).next_multiple_of(2).max(2));
                (wanted / step).ceil().max((so_far / step).floor() + 1.0) * step
            }
        };
        let end = end.min(f64::from(self.most)) as u32;
        (end > last.samples).then_some(end)
    }

    /// Samples before a round that ends with `next`, and those with which everything is expected to be done.
    pub fn way(&self, next: u32) -> (f64, f64) {
        let next = f64::from(next);
        let Some(last) = self.done.last() else {
            // Nothing is known yet: a tenth, say.
            return (0.0, if self.goal == Goal::Samples { next } else { next * 10.0 });
        };
        let samples = f64::from(last.samples);
        let all = match self.goal {
            Goal::Samples => next,
            Goal::Rmse(goal) => self.predicted(last, goal),
            Goal::Time(limit) => samples * limit.as_secs_f64() / last.elapsed.as_secs_f64().max(1e-9),
        };
        (samples, all.max(next).min(f64::from(self.most)))
    }

    fn predicted(&self, last: &Round, goal: f64) -> f64 {
        let before = self.done.len().checked_sub(2).and_then(|place| self.done.get(place));
        let measured = before.filter(|before| before.rmse > last.rmse && last.rmse > 0.0).map(|before| {
            (before.rmse / last.rmse).ln() / (f64::from(last.samples) / f64::from(before.samples)).ln()
        });
        // Between two rounds chance has its part in it.
        let power = measured.map_or(self.power, |power| power.clamp(0.4, 1.0));
        f64::from(last.samples) * (last.upper() / goal * OVERSHOOT).powf(1.0 / power)
    }
}

/// Samples for which there is time, if there is any left for two more.
fn affordable(last: &Round, limit: Duration) -> Option<f64> {
    let left = limit.checked_sub(last.elapsed)?.as_secs_f64();
    let each = last.elapsed.as_secs_f64() / f64::from(last.samples);
    // Half of what would fit, while much is left: the rate so far holds what is done only once.
    let more = left / each;
    let so_far = f64::from(last.samples);
    let step = if more > so_far { more * 0.5 } else { more };
    (more >= 2.0).then_some(so_far + step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounds until the end for a render whose error is constant * samples^-power and which takes `each` seconds a
    /// sample.
    fn all(mut rounds: Rounds, constant: f64, power: f64, each: f64) -> Vec<Round> {
        while let Some(samples) = rounds.next() {
            rounds.finished(Round {
                samples,
                rmse: constant * f64::from(samples).powf(-power),
                uncertainty: 0.0,
                unseen: 0.0,
                elapsed: Duration::from_secs_f64(f64::from(samples) * each),
            });
        }
        rounds.done
    }

    #[test]
    fn a_fixed_number_of_samples_is_one_round() {
        let rounds = all(Rounds::new(Goal::Samples, Sampler::Pcg, 77, 1), 1.0, 0.5, 1.0);
        assert_eq!(rounds.iter().map(|round| round.samples).collect::<Vec<_>>(), [77]);
    }

    #[test]
    fn an_error_is_reached_in_few_rounds_and_hardly_overshot() {
        for (sampler, power) in [(Sampler::Pcg, 0.5), (Sampler::Sobol, 0.5), (Sampler::Sobol, 0.8)] {
            for goal in [0.05, 0.01, 0.003] {
                let rounds = all(Rounds::new(Goal::Rmse(goal), sampler, MOST_SAMPLES, 1), 0.4, power, 1.0);
                let last = rounds[rounds.len() - 1];
                let needed = (0.4f64 / goal).powf(1.0 / power).max(16.0);
                assert!(last.rmse <= goal, "{sampler:?} {power} {goal}: {last:?}");
                // From one power of two to the next.
                let overshoot = if sampler == Sampler::Sobol { 2.1 } else { 1.6 };
                assert!(
                    f64::from(last.samples) < overshoot * needed + 8.0,
                    "{sampler:?} {power}: {last:?} {needed}"
                );
                assert!(rounds.len() <= 10, "{sampler:?} {power}: {rounds:?}");
            }
        }
    }

    #[test]
    fn chance_must_not_end_a_render() {
        let mut rounds = Rounds::new(Goal::Rmse(0.1), Sampler::Pcg, MOST_SAMPLES, 1);
        let round = Round { samples: 16, rmse: 0.09, uncertainty: 0.5, unseen: 0.0, elapsed: Duration::ZERO };
        rounds.finished(round);
        assert!(rounds.next().is_some());
        let mut rounds = Rounds::new(Goal::Rmse(0.1), Sampler::Pcg, MOST_SAMPLES, 1);
        rounds.finished(Round { uncertainty: 0.01, ..round });
        assert_eq!(rounds.next(), None);
    }

    #[test]
    fn what_is_out_of_reach_ends_with_the_last_sample() {
        let rounds = all(Rounds::new(Goal::Rmse(1e-9), Sampler::Pcg, 1000, 1), 0.4, 0.5, 1.0);
        assert_eq!(rounds[rounds.len() - 1].samples, 1000);
    }

    #[test]
    fn time_is_used_up_and_not_exceeded() {
        for each in [0.001, 0.01, 0.09] {
            let limit = Duration::from_secs(10);
            let rounds = all(Rounds::new(Goal::Time(limit), Sampler::Pcg, MOST_SAMPLES, 1), 0.4, 0.5, each);
            let last = rounds[rounds.len() - 1];
            assert!(last.elapsed <= limit && last.elapsed.as_secs_f64() > 10.0 - 3.0 * each, "{last:?}");
        }
        // The first round is due in any case.
        let rounds = Rounds::new(Goal::Time(Duration::from_secs(1)), Sampler::Pcg, MOST_SAMPLES, 1);
        assert_eq!(all(rounds, 0.4, 0.5, 1.0).len(), 1);
    }
}
