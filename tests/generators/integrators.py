"""Attitude errors of three integrators of a body that tumbles freely, by an implementation of its own (NumPy).

    python3 tests/generators/integrators.py > tests/data/cases/integrators.csv

Two seconds from a spin about the middle axis; the reference is the classical Runge-Kutta method with 31 250 and with 62 500 steps,
extrapolated.
"""

import numpy as np

INERTIA, SPIN, DURATION = np.array([3.2e-3, 3.9e-3, 5.1e-3]), np.array([4.0, 39.5, 2.5]), 2.0
STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)


def product(p, q):
    """Quaternions x, y, z, w."""
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(vector, p[3] * q[3] - p[:3] @ q[:3])


def rate(state):
    attitude, spin = state[:4], state[4:]
    return np.concatenate([product(attitude, np.append(spin, 0)) / 2, np.cross(INERTIA * spin, spin) / INERTIA])


def normalised(state):
    return np.concatenate([state[:4] / np.linalg.norm(state[:4]), state[4:]])


def euler(state, h):
    return normalised(state + h * rate(state))


def runge_kutta(state, h):
    a = rate(state)
    b = rate(state + h / 2 * a)
    c = rate(state + h / 2 * b)
    d = rate(state + h * c)
    return normalised(state + h / 6 * (a + 2 * b + 2 * c + d))


def midpoint(state, h):
    """Implicit for the momentum, and Cayley's map of the middle spin for the attitude."""
    before = INERTIA * state[4:]
    after = before
    for _ in range(60):
        middle = (before + after) / 2
        after = before + h * np.cross(middle, middle / INERTIA)
    turn = np.append((before + after) / 2 / INERTIA * h / 2, 1)
    return np.concatenate([product(state[:4], turn / np.linalg.norm(turn)), after / INERTIA])


def run(method, h):
    state = np.concatenate([[0, 0, 0, 1], SPIN])
    for _ in range(round(DURATION / h)):
        state = method(state, h)
    return state[:4]


coarse, fine = run(runge_kutta, DURATION / 31_250), run(runge_kutta, DURATION / 62_500)
exact = fine + (fine - coarse) / 15
exact /= np.linalg.norm(exact)
print("method,step_s,error_rad")
for name, method in (("explicit Euler", euler), ("implicit midpoint (geometric)", midpoint), ("classical Runge-Kutta", runge_kutta)):
    for h in STEPS:
        error = 2 * np.linalg.norm(product(run(method, h) * [-1, -1, -1, 1], exact)[:3])
        print(f"{name},{h:g},{error:.4e}", flush=True)
