//! Scheduled changes of a scene, checked, with the models that replace others.

use super::controls::{ChosenBy, PluginTable, understands};
use super::{ControlError, NewValue, PluginReport, RunError, prepare_model};
use crate::registry::Registry;
use crate::scene::{Alternative, ChangeUse, ChangeWhat, ParameterText, Scene};
use flotor_core::{Random, to_ns};
use flotor_hal::LoopConfig;
use flotor_servo::{Clock, Replacement, ScheduledChange};

/// Scheduled changes and replacements of a scene, checked and created.
pub(super) struct Scheduled {
    pub(super) changes: Vec<ScheduledChange>,
    pub(super) replacements: Vec<(u64, Replacement)>,
}

/// Checks the scheduled changes of a scene and creates the models for replacements; errors name file and line.
pub(super) fn schedule(
    scene: &Scene,
    plugins: &PluginTable,
    registry: &Registry,
    config: &LoopConfig,
    clock: Clock,
) -> Result<Scheduled, RunError> {
    let mut in_time: Vec<&ChangeUse> = scene.changes.iter().collect();
    in_time.sort_by(|a, b| a.at_s.total_cmp(&b.at_s)); // stable: a change is checked against the plugins of its time
    let mut scheduled = Scheduled { changes: Vec::new(), replacements: Vec::new() };
    // Alternatives not drawn by this seed, per model.
    let mut passed_over: Vec<Vec<PluginReport>> = vec![Vec::new(); scene.models.len()];
    for (draw, change) in (0..).zip(in_time) {
        let time_ns = to_ns(change.at_s);
        let wrong = |key: &str, error: ControlError| change.location.problem(format!("`{key}`: {error}"));
        let checked = match &change.what {
            ChangeWhat::Set { plugin, parameter: ParameterText { key, value, .. } } => {
                let new = NewValue { plugin, parameter: key, value };
                match plugins.check(&new) {
                    Ok(checked) => checked,
                    // The change is for an alternative of another seed.
                    Err(_) if passed_over.iter().flatten().any(|part| understands(part, &new)) => continue,
                    Err(error) => return Err(wrong("change.set", error).into()),
                }
            }
            ChangeWhat::Weight { model, weight } => {
                plugins.check_weight(model, *weight).map_err(|error| wrong("change.weight", error))?
            }
            ChangeWhat::Swap { model, by } => {
                let choice = chosen(config.seed, draw, by.len());
                let chosen_by = if by.len() > 1 { ChosenBy::Seed } else { ChosenBy::Name };
                for number in plugins.models(model).map_err(|error| wrong("change.swap", error))? {
                    let (Some(place), Some(others)) = (scene.models.get(number), passed_over.get_mut(number))
                    else {
                        continue;
                    };
                    let make = |Alternative { plugin, parameters }: &Alternative| {
                        let mut other = place.replaced_by(plugin.as_deref(), &[]);
                        other.plugin.location = change.location.clone();
                        other.plugin.parameters.extend(parameters.iter().cloned());
                        prepare_model(registry, &other, config, clock)
                    };
                    // All alternatives: an error in one is found with any seed.
                    let mut made = by.iter().map(make).collect::<Result<Vec<_>, _>>()?;
                    if choice >= made.len() {
                        continue;
                    }
                    let (layer, report) = made.swap_remove(choice);
                    *others = made.into_iter().map(|(_, report)| report).collect();
                    let generation = plugins.add(number, report, chosen_by);
                    let replacement = Replacement { model: number, generation, layer };
                    scheduled.replacements.push((time_ns, replacement));
                }
                continue;
            }
        };
        scheduled.changes.extend(checked.into_iter().map(|change| ScheduledChange { time_ns, change }));
    }
    plugins.start_with_the_first();
    Ok(scheduled)
}

/// Returns the index of the alternative for a seed; `draw` distinguishes several choices of one run. Not real-time.
///
/// Permuted blocks, as in randomised trials: of `n` alternatives, `n` successive seeds from a multiple of `n` on select each exactly
/// once, in pseudorandom order. So of sixteen subjects with the seeds 0 to 15 eight get each of two alternatives, and the seed does
/// not reveal the alternative to a subject. Source: M. Zelen, "The randomization and stratification of patients to clinical trials",
/// J. Chronic Diseases 27, 1974, section 4 (blocks).
fn chosen(seed: u64, draw: u64, alternatives: usize) -> usize {
    let count = alternatives.max(1) as u64;
    let (block, place) = (seed / count, seed % count);
    let mut order: Vec<usize> = (0..alternatives.max(1)).collect();
    let mut random = Random::new(block, draw);
    // Fisher-Yates shuffle: all orders are equally likely.
    for last in (1..order.len()).rev() {
        #[allow(clippy::cast_possible_truncation)] // below the number of alternatives
        let other = (random.bits() % (last as u64 + 1)) as usize;
        order.swap(last, other);
    }
    #[allow(clippy::cast_possible_truncation)] // below the number of alternatives
    order.get(place as usize).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_of_seeds_gets_each_alternative_once() {
        for count in 1..=5 {
            for block in 0..200_u64 {
                let first = block * count as u64;
                let mut got: Vec<usize> =
                    (first..first + count as u64).map(|seed| chosen(seed, 0, count)).collect();
                got.sort_unstable();
                assert_eq!(got, (0..count).collect::<Vec<_>>(), "block {block} of {count}");
            }
        }
    }

    #[test]
    fn neither_order_nor_another_choice_can_be_guessed() {
        let pairs = |draw| (0..1000_u64).map(move |block| chosen(2 * block, draw, 2));
        let (first, second): (Vec<usize>, Vec<usize>) = (pairs(0).collect(), pairs(1).collect());
        let heads: usize = first.iter().sum();
        let alike = first.iter().zip(&second).filter(|(a, b)| a == b).count();
        // Four standard deviations of a thousand tosses are 63.
        assert!((437..=563).contains(&heads) && (437..=563).contains(&alike), "{heads} and {alike}");
    }
}
