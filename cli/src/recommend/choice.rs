//! From what is expected of contenders to a pick.

use super::model::Expected;

/// Contenders tried on the preview.
pub(crate) const SHORT_LIST: usize = 10;

/// Deviations by which the limit has to be kept: as many picks should miss it narrowly as pay for more than it takes.
const MARGIN: f64 = 0.5;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Goal {
    /// The fastest with an rmse of at most this.
    MaxError(f64),
    /// The one nearest to the truth within so many milliseconds.
    MaxMs(f64),
}

impl Goal {
    /// What is limited, with `deviations` of its uncertainty added, over the limit.
    fn share_of_limit(self, expected: &Expected, deviations: f64) -> f64 {
        match self {
            Self::MaxError(limit) => expected.rmse * expected.rmse_factor.powf(deviations) / limit,
            Self::MaxMs(limit) => expected.ms * expected.ms_factor.powf(deviations) / limit,
        }
    }

    /// What is to be as small as possible.
    fn cost(self, expected: &Expected) -> f64 {
        match self {
            Self::MaxError(_) => expected.ms,
            Self::MaxMs(_) => expected.rmse,
        }
    }

    /// Those that keep the limit, the cheapest first; then the others, the nearest to the limit first.
    fn order<T>(self, all: &mut [(T, Expected)], deviations: f64) {
        let key = |expected: &Expected| {
            let share = self.share_of_limit(expected, deviations);
            if share <= 1.0 { (false, self.cost(expected)) } else { (true, share) }
        };
        all.sort_by(|(_, a), (_, b)| {
            let (a, b) = (key(a), key(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
    }

    /// Labels worth trying, from what is expected at sight, the most promising first: those that may keep the limit if they do
    /// one deviation better than expected.
    pub(crate) fn short_list(self, mut at_sight: Vec<(&str, Expected)>) -> Vec<&str> {
        self.order(&mut at_sight, -1.0);
        at_sight.into_iter().map(|(label, _)| label).collect()
    }

    /// The pick first, then what else was thought of.
    pub(crate) fn ranked<T>(self, mut tried: Vec<(T, Expected)>) -> Vec<(T, Expected)> {
        self.order(&mut tried, MARGIN);
        tried
    }

    /// Whether this is expected to keep the limit.
    pub(crate) fn is_kept_by(self, expected: &Expected) -> bool {
        self.share_of_limit(expected, 0.0) <= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expected(ms: f64, rmse: f64) -> Expected {
        Expected { ms, rmse, ms_factor: 1.2, rmse_factor: 1.2 }
    }

    #[test]
    fn the_cheapest_that_keeps_the_limit_or_else_the_nearest() {
        let all = || {
            vec![("slow", expected(9.0, 0.01)), ("fast", expected(1.0, 0.1)), ("middle", expected(3.0, 0.04))]
        };
        let first = |goal: Goal| goal.ranked(all())[0].0;
        assert_eq!(first(Goal::MaxError(0.05)), "middle");
        assert_eq!(first(Goal::MaxError(0.5)), "fast");
        assert_eq!(first(Goal::MaxError(0.001)), "slow");
        assert_eq!(first(Goal::MaxMs(20.0)), "slow");
        assert_eq!(first(Goal::MaxMs(0.1)), "fast");
        // A limit just kept is not kept for sure.
        assert_eq!(first(Goal::MaxError(0.041)), "slow");
        assert_eq!(Goal::MaxError(0.041).short_list(all())[0], "middle");
    }
}
