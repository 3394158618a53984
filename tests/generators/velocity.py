"""Noise at rest and lag of the velocity estimates of the simulated flotor, from their transfer functions (NumPy, SciPy).

    python3 tests/generators/velocity.py > tests/data/cases/velocity_estimates.csv

Each of the three cells has 1 um of noise and steps of 2 um, evenly distributed; the height is the mean of the three, so its noise is
white. A linear filter x <- A x + b z, v = c x has the noise c X c' with X = A X A' + b b' times that of the height.
"""

import math

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

TICK_S = 1e-3
CELL_M = math.hypot(1e-6, 2e-6 / math.sqrt(12))
HEIGHT_M = CELL_M / math.sqrt(3)


def noise(transition, gain, output, direct):
    """Deviation of the estimate for white noise of one metre; the output takes the input directly as well."""
    covariance = solve_discrete_lyapunov(transition, np.outer(gain, gain))
    return math.sqrt(output @ covariance @ output + direct**2)


def lag(transition, gain, output, direct):
    """How late the estimate is behind a steady acceleration of 1 m/s^2, s."""
    state, ticks = np.zeros(len(gain)), 40_000
    for tick in range(ticks):
        position = (tick * TICK_S) ** 2 / 2
        velocity = output @ state + direct * position
        state = transition @ state + gain * position
    return (ticks - 1) * TICK_S - velocity


def filtered_difference(share):
    """Takes a share of the difference quotient. State: last position, last estimate."""
    part = share / TICK_S
    last = np.array([[0, 0], [-part, 1 - share]])
    return last, np.array([1, part]), np.array([-part, 1 - share]), part


def kalman(acceleration):
    """Steady filter of position and velocity for an acceleration that is white from tick to tick. State: the estimate."""
    motion = np.array([[1, TICK_S], [0, 1]])
    change = acceleration * np.array([TICK_S**2 / 2, TICK_S])
    seen = np.array([[1.0, 0.0]])
    # In units of the cell's noise: numbers near one.
    before = solve_discrete_are(motion.T, seen.T, np.outer(change, change) / CELL_M**2, np.eye(1))
    gain = before[:, 0] / (before[0, 0] + 1)
    transition = (np.eye(2) - np.outer(gain, seen)) @ motion
    return transition, gain, transition[1], gain[1]


print("estimate,setting,noise_mm_per_s,lag_ms")
rows = [("difference", "", filtered_difference(1.0))]
rows += [("low-pass", f, filtered_difference(1 - math.exp(-2 * math.pi * f * TICK_S))) for f in (500, 200, 100, 50, 20, 10, 5)]
rows += [("kalman", a, kalman(a)) for a in (200, 50, 20, 5, 2, 0.5, 0.2)]
for name, setting, estimate in rows:
    print(f"{name},{setting},{1e3 * HEIGHT_M * noise(*estimate):.6f},{1e3 * lag(*estimate):.6f}")
