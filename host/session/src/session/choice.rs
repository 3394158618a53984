//! Choice between alternatives of a run, decided by its seed alone.
//!
//! Permuted blocks, as trials are randomised: of `n` alternatives, any `n` seeds from a multiple of `n` on get each exactly once,
//! in an order that looks random. So sixteen subjects with the seeds 0 to 15 are eight and eight, and the seed does not reveal the
//! alternative to a subject. Source: M. Zelen, "The randomization and stratification of patients to clinical trials", J. Chronic
//! Diseases 27, 1974, section 4 (blocks).

use flotor_core::Random;

/// Returns the alternative of a seed; `draw` distinguishes several choices of one run. Not real-time.
pub(super) fn chosen(seed: u64, draw: u64, alternatives: usize) -> usize {
    let count = alternatives.max(1) as u64;
    let (block, place) = (seed / count, seed % count);
    let mut order: Vec<usize> = (0..alternatives.max(1)).collect();
    let mut random = Random::new(block, draw);
    // Fisher and Yates: all orders are equally likely.
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
