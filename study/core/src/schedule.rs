//! Orders of blocks, demonstrations, stimuli and checks, determined by the subject's number and the seed.

use crate::protocol::{JndProtocol, MagnitudeProtocol};
use crate::trial::{Modality, Phase};
use flotor_study_design::random::{Draws, Purpose};

/// Returns the order of the bases in each replication, as indices: rows of Latin squares, without repetition of a row before
/// all rows were used.
///
/// The rows of a cyclic Latin square (each base once in each position) follow in random order, with the bases permuted and the
/// square mirrored at random; after the last row the mirrored square follows. For the three bases of the thesis these two
/// squares contain all six orders, so the orders of four replications all differ.
pub(crate) fn base_orders(protocol: &JndProtocol, draws: Draws) -> Vec<Vec<usize>> {
    let count = protocol.bases.len();
    let mut stream = draws.stream(Purpose::Schedule, 0);
    let mut labels: Vec<usize> = (0..count).collect();
    stream.shuffle(&mut labels);
    let mut mirrored = stream.coin();
    let mut orders = Vec::new();
    let replications = protocol.replications as usize;
    while orders.len() < replications {
        let mut rows: Vec<usize> = (0..count).collect();
        stream.shuffle(&mut rows);
        for row in rows {
            let place =
                |place: usize| if mirrored { (row + count - place) % count } else { (row + place) % count };
            let label = |index: usize| labels.get(index).copied().unwrap_or(0);
            orders.push((0..count).map(|index| label(place(index))).collect());
        }
        mirrored = !mirrored;
    }
    orders.truncate(replications);
    orders
}

/// Returns the modality of a replication, counted from 0; modalities alternate.
pub(crate) fn alternating(first: Modality, replication: usize) -> Modality {
    if replication.is_multiple_of(2) { first } else { first.other() }
}

/// Returns the demonstration of a difference experiment: three pairs in each modality, in random order; empty if it is not
/// shown.
///
/// The differences of the three pairs are obvious, close, and nearly zero ([`JndProtocol::demo_values`]).
pub(crate) fn jnd_demo(protocol: &JndProtocol, draws: Draws) -> Vec<(Modality, [f64; 2])> {
    if !protocol.demo.shown {
        return Vec::new();
    }
    let [lowest, highest, close, nearly] = protocol.demo_values();
    let pairs = [[lowest, highest], [highest, close], [close, nearly]];
    let each = |modality: Modality| pairs.iter().map(move |pair| (modality, *pair));
    let mut demo: Vec<_> = Modality::ALL.into_iter().flat_map(each).collect();
    draws.stream(Purpose::Schedule, 1).shuffle(&mut demo);
    demo
}

/// Returns the stimuli of one replication of a magnitude experiment, in random order.
pub(crate) fn magnitude_order(protocol: &MagnitudeProtocol, draws: Draws, replication: u32) -> Vec<f64> {
    let mut values = protocol.values.clone();
    draws.stream(Purpose::Schedule, 10 + replication).shuffle(&mut values);
    values
}

/// Returns the checks of a track in order, each with the number of counted trials of the track before it. The positions are
/// random, after the first trial and before the earliest end of the track.
///
/// As far as the track has enough positions, a repeat check does not directly follow the pair that it repeats, and a counted
/// trial separates any two repeat checks.
pub(crate) fn track_checks(protocol: &JndProtocol, draws: Draws, track: u32) -> Vec<(u32, Phase)> {
    let mut stream = draws.stream(Purpose::CheckPlace, track);
    let checks = protocol.checks;
    let obvious = checks.obvious.map_or(0, |pairs| pairs.count);
    // Obvious pairs are drawn last, so that the positions of the other checks do not depend on them.
    let kinds =
        [(Phase::Catch, checks.catch), (Phase::RepeatCheck, checks.repeats), (Phase::Obvious, obvious)];
    let kinds = kinds.into_iter().flat_map(|(kind, count)| std::iter::repeat_n(kind, count as usize));
    let places = (1..protocol.procedure.trials_least()).collect::<Vec<_>>();
    let mut of_repeats: Vec<u32> = places.iter().copied().skip(1).collect();
    let mut checks: Vec<(u32, Phase)> = Vec::new();
    for kind in kinds {
        let drawn = places.get(stream.below(places.len())).copied().unwrap_or(1);
        let place = if kind == Phase::RepeatCheck { taken(&mut of_repeats, &drawn) } else { None };
        checks.push((place.unwrap_or(drawn), kind));
    }
    checks.sort_by_key(|(place, _)| *place);
    checks
}

/// Removes and returns the drawn item of a sorted list, or if it is missing the next larger item, cyclically; `None` if the
/// list is empty.
fn taken<T: PartialOrd>(left: &mut Vec<T>, drawn: &T) -> Option<T> {
    let next = left.iter().position(|one| one >= drawn).unwrap_or(0);
    (!left.is_empty()).then(|| left.remove(next))
}

/// Returns one replication of a magnitude experiment with its checks. Each check repeats a stimulus after at least one other
/// stimulus; checks are all different in stimulus or position unless there are more checks than such combinations.
pub(crate) fn with_repeat_checks(
    protocol: &MagnitudeProtocol,
    draws: Draws,
    replication: u32,
    order: &[f64],
) -> Vec<(Phase, f64)> {
    let mut stream = draws.stream(Purpose::CheckPlace, replication);
    let count = order.len();
    // Pairs of a stimulus index and the position of its check, with at least one other stimulus in between.
    let mut left: Vec<(usize, usize)> = (0..count.saturating_sub(2))
        .flat_map(|which| (which + 2..=count).map(move |place| (which, place)))
        .collect();
    let mut checks: Vec<(usize, f64)> = Vec::new();
    for _ in 0..protocol.repeat_checks {
        let which = stream.below(count.saturating_sub(2));
        let drawn = (which, which + 2 + stream.below(count.saturating_sub(which + 1)));
        let (which, place) = taken(&mut left, &drawn).unwrap_or(drawn);
        checks.extend(order.get(which).map(|value| (place, *value)));
    }
    let before = |place: usize| {
        let here = checks.iter().filter(move |(at, _)| *at == place);
        here.map(|(_, value)| (Phase::RepeatCheck, *value))
    };
    let mut all: Vec<(Phase, f64)> = Vec::new();
    for (place, value) in order.iter().enumerate() {
        all.extend(before(place));
        all.push((Phase::Main, *value));
    }
    all.extend(before(count));
    all
}

/// Returns the demonstration before a modality of a magnitude experiment: at most `protocol.demo` stimuli (the smallest, the
/// largest, and random others) in random order.
pub(crate) fn magnitude_demo(protocol: &MagnitudeProtocol, draws: Draws, modality: Modality) -> Vec<f64> {
    let mut sorted = protocol.values.clone();
    sorted.sort_by(f64::total_cmp);
    let mut stream = draws.stream(Purpose::Schedule, 2 + modality as u32);
    let (Some(least), Some(most)) = (sorted.first().copied(), sorted.last().copied()) else {
        return Vec::new();
    };
    let mut between: Vec<f64> = sorted.iter().copied().skip(1).take(sorted.len().saturating_sub(2)).collect();
    stream.shuffle(&mut between);
    let mut demo: Vec<f64> = [least, most].into_iter().chain(between).take(protocol.demo as usize).collect();
    stream.shuffle(&mut demo);
    demo
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Checks, SubjectNumber};

    fn subjects() -> impl Iterator<Item = SubjectNumber> {
        (1..=60).filter_map(SubjectNumber::new)
    }

    fn draws(subject: SubjectNumber) -> Draws {
        Draws { seed: 7, subject }
    }

    /// Four replications of three bases: no order twice, and each base at each place once in the first three.
    #[test]
    fn base_orders_are_a_latin_square_that_does_not_repeat() {
        let protocol = JndProtocol::default();
        let mut first_orders = std::collections::BTreeSet::new();
        for subject in subjects() {
            let orders = base_orders(&protocol, draws(subject));
            assert_eq!(orders.len(), 4);
            for place in 0..3 {
                let mut column: Vec<usize> = orders.iter().take(3).map(|order| order[place]).collect();
                column.sort_unstable();
                assert_eq!(column, [0, 1, 2]);
            }
            let distinct: std::collections::BTreeSet<_> = orders.iter().collect();
            assert_eq!(distinct.len(), 4);
            first_orders.insert(orders[0].clone());
        }
        assert_eq!(first_orders.len(), 6, "all six permutations occur");
    }

    /// Nothing is presented twice in a row, with as many checks as there are stimuli.
    #[test]
    fn checks_never_follow_what_they_repeat() {
        for repeat_checks in 1..=12 {
            let protocol = MagnitudeProtocol { repeat_checks, ..MagnitudeProtocol::default() };
            for (subject, replication) in subjects().zip((1..=6).cycle()) {
                let order = magnitude_order(&protocol, draws(subject), replication);
                let all = with_repeat_checks(&protocol, draws(subject), replication, &order);
                assert_eq!(all.len(), 12 + repeat_checks as usize);
                assert!(all.windows(2).all(|two| two[0].1 != two[1].1), "{all:?}");
            }
        }
        for repeats in 1..=6 {
            let checks = Checks { catch: 1, repeats, obvious: None };
            let protocol = JndProtocol { checks, ..JndProtocol::default() };
            for (subject, track) in subjects().zip((1..=12).cycle()) {
                let checks = track_checks(&protocol, draws(subject), track);
                let mut places: Vec<u32> = checks
                    .iter()
                    .filter(|check| check.1 == Phase::RepeatCheck)
                    .map(|check| check.0)
                    .collect();
                assert!(places[0] > 1 && places.len() == repeats as usize, "{checks:?}");
                places.dedup();
                assert_eq!(places.len(), repeats as usize, "{checks:?}");
            }
        }
    }

    #[test]
    fn the_magnitude_demo_has_the_extremes() {
        let protocol = MagnitudeProtocol::default();
        for subject in subjects() {
            let demo = magnitude_demo(&protocol, draws(subject), Modality::H);
            assert_eq!(demo.len(), 5);
            assert!(demo.contains(&12.0) && demo.contains(&48.0));
            let mut distinct = demo.clone();
            distinct.sort_by(f64::total_cmp);
            distinct.dedup();
            assert_eq!(distinct.len(), 5);
        }
    }
}
