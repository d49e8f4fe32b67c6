//! How often the pick is right, on scenes the model knows and on scenes it does not.

use super::choice::{Goal, SHORT_LIST};
use super::data::{Data, Line};
use super::model::Model;
use crate::bench::front::Time;

/// A pick is right if it is within this factor of the best measured choice, in time and in error.
const WITHIN: f64 = 1.5;

/// What is asked of every scene.
const GOALS: [Goal; 11] = [
    Goal::MaxError(0.01),
    Goal::MaxError(0.02),
    Goal::MaxError(0.05),
    Goal::MaxError(0.1),
    Goal::MaxError(0.2),
    Goal::MaxMs(5.0),
    Goal::MaxMs(10.0),
    Goal::MaxMs(20.0),
    Goal::MaxMs(50.0),
    Goal::MaxMs(100.0),
    Goal::MaxMs(200.0),
];

/// Shares of right picks, in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Check {
    /// With every scene known to the model.
    pub(crate) held_in: f64,
    /// With the scene in question left out.
    pub(crate) held_out: f64,
    pub(crate) scenes: usize,
}

/// Asks for a pick on every scene of the data.
pub(crate) fn check(data: &Data, time: Time) -> Check {
    let all = Model::new(data, time, None);
    let (mut held_in, mut held_out, mut asked) = (0, 0, 0);
    for (scene, lines) in &data.scenes {
        let without = Model::new(data, time, Some(scene));
        for goal in GOALS {
            asked += 1;
            held_in += usize::from(is_right(&all, goal, lines, time));
            held_out += usize::from(is_right(&without, goal, lines, time));
        }
    }
    let share = |right: usize| right as f64 / asked.max(1) as f64;
    Check { held_in: share(held_in), held_out: share(held_out), scenes: data.scenes.len() }
}

/// Whether the model's pick is one of the best on a scene.
fn is_right(model: &Model, goal: Goal, lines: &[Line], time: Time) -> bool {
    let Some(features) = lines.first().map(Line::features) else { return false };
    let short_list = goal.short_list(model.at_sight(&features)).into_iter();
    let measured = short_list.filter_map(|label| lines.iter().find(|line| line.label() == label));
    let tried = measured
        .take(SHORT_LIST)
        .filter_map(|line| Some((line, model.after_trial(&line.label(), &features, &line.tried()?, time)?)));
    let ranked = goal.ranked(tried.collect());
    let Some((pick, _)) = ranked.first() else { return false };
    let best = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    match goal {
        Goal::MaxError(limit) => {
            let keep = |line: &&Line| line.rmse <= limit;
            let ms = best(&mut lines.iter().filter(keep).map(|line| line.ms(time)));
            // Where nothing keeps the limit, the nearest to it is the best.
            let rmse = best(&mut lines.iter().map(|line| line.rmse)).max(limit);
            pick.rmse <= WITHIN * rmse && (ms.is_infinite() || pick.ms(time) <= WITHIN * ms)
        }
        Goal::MaxMs(limit) => {
            let keep = |line: &&Line| line.ms(time) <= limit;
            let rmse = best(&mut lines.iter().filter(keep).map(|line| line.rmse));
            let ms = best(&mut lines.iter().map(|line| line.ms(time))).max(limit);
            pick.ms(time) <= WITHIN * ms && (rmse.is_infinite() || pick.rmse <= WITHIN * rmse)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The command prints the shares; here they must not fall.
    #[test]
    fn most_picks_are_right_on_scenes_it_does_not_know() {
        let data = Data::load(None).unwrap();
        for time in [Time::Whole, Time::Frame] {
            let check = check(&data, time);
            assert!(check.scenes >= 20, "{check:?}");
            eprintln!("{time:?}: {check:?}");
            assert!(check.held_in >= 0.8 && check.held_out >= 0.8, "{time:?}: {check:?}");
        }
    }
}
