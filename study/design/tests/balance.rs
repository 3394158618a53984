//! Balance of orders and of the assignment of levels.

use super::support::{delay, design, session, sit};
use flotor_study_design::course::Step;
use flotor_study_design::observer::Population;
use flotor_study_design::order::Order;
use proptest::prelude::*;
use serde_json::json;
use std::collections::BTreeMap;

/// Returns all rows of an order.
fn rows(order: Order, count: usize, seed: u64) -> Vec<Vec<usize>> {
    let rows = order.rows(count).expect("an order with rows");
    (0..rows).map(|row| order.row(count, row, seed, (1, 1))).collect()
}

/// Counts what occurs how often; returns the smallest and the largest count.
fn spread<T: Ord>(items: impl Iterator<Item = T>) -> (usize, usize, usize) {
    let mut counts = BTreeMap::new();
    items.for_each(|item| *counts.entry(item).or_insert(0) += 1);
    let least = counts.values().copied().min().unwrap_or(0);
    (counts.len(), least, counts.values().copied().max().unwrap_or(0))
}

proptest! {
    /// Every row of every order is a permutation.
    #[test]
    fn rows_are_permutations(count in 1_usize..=12, row in 0_usize..300, seed in any::<u64>()) {
        for order in [Order::Fixed, Order::Latin, Order::Williams, Order::Random] {
            let mut found = order.row(count, row, seed, (3, 7));
            found.sort_unstable();
            prop_assert_eq!(&found, &(0..count).collect::<Vec<_>>(), "{:?}", order);
        }
    }

    /// In a Latin square and in a Williams square each condition is at each place equally often.
    #[test]
    fn each_condition_is_at_each_place_equally_often(count in 1_usize..=10, seed in any::<u64>()) {
        for order in [Order::Latin, Order::Williams] {
            let rows = rows(order, count, seed);
            let places = rows.iter().flat_map(|row| row.iter().copied().enumerate());
            let (cells, least, most) = spread(places);
            prop_assert_eq!((cells, least), (count * count, most), "{:?}", order);
        }
    }

    /// In a Williams square each condition follows each other one equally often.
    #[test]
    fn each_condition_follows_each_other_one_equally_often(count in 2_usize..=10, seed in any::<u64>()) {
        let rows = rows(Order::Williams, count, seed);
        let pairs = rows.iter().flat_map(|row| row.windows(2).map(|two| (two[0], two[1])).collect::<Vec<_>>());
        let (cells, least, most) = spread(pairs);
        prop_assert_eq!((cells, least), (count * (count - 1), most));
    }
}

/// All permutations occur once.
#[test]
fn permutations_are_all_there() {
    for count in 1..=Order::MOST_PERMUTED {
        let (cells, least, most) = spread(rows(Order::Balanced, count, 5).into_iter());
        assert_eq!((cells, least, most), ((1..=count).product(), 1, 1));
    }
}

/// In a whole study blocks are balanced within each group of subjects, whatever the number of groups, and each group has as many people.
#[test]
fn groups_of_subjects_are_balanced_each() {
    let mut table = delay();
    table["factor"].as_array_mut().expect("factors").extend([
        json!({ "name": "hand", "setting": "device.hand", "values": ["left", "right"], "vary": "between" }),
        json!({ "name": "tool", "setting": "device.tool", "values": ["pen", "ball", "ring"], "vary": "between" }),
    ]);
    let design = design(table);
    let mut places = Vec::new();
    for subject in 1..=24 {
        let (steps, _) = sit(&design, &Population::default(), session(3, subject, 1));
        let blocks: BTreeMap<u32, _> = steps
            .iter()
            .filter_map(|(step, _)| match step {
                Step::Trial(trial) => Some((trial.block, trial.condition.clone())),
                _ => None,
            })
            .collect();
        for (block, condition) in blocks {
            let [hand, tool, delay] = ["hand", "tool", "delay"].map(|name| condition[name].to_string());
            places.push((hand, tool, block, delay));
        }
    }
    // 6 groups, 4 places, 4 delays, and 4 people in each group: once each.
    let (cells, least, most) = spread(places.into_iter());
    assert_eq!((cells, least, most), (6 * 4 * 4, 1, 1));
}

/// Levels drawn from the seed: the same for a subject in each session, and about as many of each.
#[test]
fn drawn_levels_are_even() {
    let mut table = delay();
    table["factor"][0]["vary"] = json!("between-random");
    table["blocks"]["by"] = json!([]);
    table["blocks"]["sessions"] = json!(2);
    let design = design(table);
    let level = |subject, number| {
        let course = flotor_study_design::course::Course::new(&design, session(8, subject, number));
        match course.next() {
            Some(Step::Trial(trial)) => trial.condition["delay"].to_string(),
            other => panic!("{other:?}"),
        }
    };
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for subject in 1..=400 {
        assert_eq!(level(subject, 1), level(subject, 2));
        *counts.entry(level(subject, 1)).or_default() += 1;
    }
    // Four standard deviations of a binomial count of mean 100.
    assert!(counts.len() == 4 && counts.values().all(|count| count.abs_diff(100) < 35), "{counts:?}");
}
