//! Search for the largest stable stiffness, by doubling and bisection.

/// Start of the search, N/m: softer than any useful stiffness. A loop that is unstable even here has no limit.
const SOFTEST_N_PER_M: f64 = 1.0;
/// End of the search, N/m: forty times the stiffest wall of any commercial haptic device, and a power of two, which doubling meets.
const STIFFEST_N_PER_M: f64 = 1_048_576.0;

/// Returns true if the search ended without a limit: the loop is stable at this stiffness, N/m, and above. Not
/// real-time.
#[must_use]
pub fn is_search_end(limit_n_per_m: f64) -> bool {
    limit_n_per_m >= STIFFEST_N_PER_M
}

/// Searches for the stiffness, N/m, up to which `is_stable` is true, within a relative `tolerance`; returns 0 if the loop is
/// unstable even at the start of the search, and the [end of the search](is_search_end) if it is stable up to there.
///
/// Assumes that one interval of stiffness from the softest on is stable, as it is for a spring on a sampled
/// mass. Not real-time.
///
/// # Errors
/// Errors of `is_stable`.
pub(super) fn largest_stable<E>(
    tolerance: f64,
    mut is_stable: impl FnMut(f64) -> Result<bool, E>,
) -> Result<f64, E> {
    if !is_stable(SOFTEST_N_PER_M)? {
        return Ok(0.0);
    }
    let mut stable = SOFTEST_N_PER_M;
    let mut unstable = 2.0 * stable;
    while is_stable(unstable)? {
        if unstable >= STIFFEST_N_PER_M {
            return Ok(unstable);
        }
        (stable, unstable) = (unstable, 2.0 * unstable);
    }
    while unstable - stable > tolerance * stable {
        let between = 0.5 * (stable + unstable);
        if is_stable(between)? {
            stable = between;
        } else {
            unstable = between;
        }
    }
    Ok(0.5 * (stable + unstable))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn the_limit_is_found_within_the_tolerance_wherever_it_lies() {
        for limit in [1.5, 333.4, 398.0e3] {
            let Ok(found) = largest_stable(1.0e-6, |k| Ok::<_, Infallible>(k < limit));
            assert!((found / limit - 1.0).abs() < 1.0e-6, "{found} {limit}");
        }
    }

    #[test]
    fn a_loop_without_limit_ends_and_a_hopeless_one_is_zero() {
        let Ok(endless) = largest_stable(1.0e-6, |_| Ok::<_, Infallible>(true));
        assert_eq!((endless, is_search_end(endless)), (STIFFEST_N_PER_M, true));
        let Ok(nearly) = largest_stable(1.0e-6, |k| Ok::<_, Infallible>(k < 0.999 * STIFFEST_N_PER_M));
        assert!(!is_search_end(nearly), "{nearly}");
        let Ok(hopeless) = largest_stable(1.0e-6, |_| Ok::<_, Infallible>(false));
        assert_eq!(hopeless, 0.0);
    }
}
