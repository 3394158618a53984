"""Errors of networks of masses and springs at rest against closed forms, by Newton's method (NumPy, SciPy).

    python3 tests/generators/statics.py > tests/data/cases/membrane_statics.csv

A chain against the elastic catenary (Irvine 1981), and a stretched square under its weight against the double sine series of Poisson's
equation.
"""

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve


def at_rest(places, links, stiffness, length, fixed, weight):
    """Places where every free node is in balance: links of a stiffness (N/m) and a length (m), a weight (N) on each node."""
    x = places.copy()
    free = np.flatnonzero(~fixed)
    number = np.full(len(x), -1)
    number[free] = np.arange(len(free))
    first, second = links.T
    for _ in range(100):
        along = x[second] - x[first]
        distance = np.linalg.norm(along, axis=1)
        pull = (stiffness * (1 - length / distance))[:, None] * along
        force = np.zeros_like(x)
        np.add.at(force, first, pull)
        np.add.at(force, second, -pull)
        force[:, 2] -= weight
        unit = along / distance[:, None]
        outer = unit[:, :, None] * unit[:, None, :]
        block = stiffness * (outer + (1 - length / distance)[:, None, None] * (np.eye(3) - outer))
        entries = []
        for a, b, sign in ((first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1)):
            inner = (number[a] >= 0) & (number[b] >= 0)
            for row in range(3):
                for column in range(3):
                    entries.append((sign * block[inner, row, column], 3 * number[a[inner]] + row, 3 * number[b[inner]] + column))
        values, rows, columns = (np.concatenate(part) for part in zip(*entries))
        matrix = coo_matrix((values, (rows, columns)), shape=(3 * len(free),) * 2).tocsc()
        step = spsolve(matrix, force[free].ravel()).reshape(-1, 3)
        # A long step would turn links over.
        x[free] += step * min(1.0, 0.3 * distance.min() / np.abs(step).max())
        if np.abs(step).max() < 1e-14:
            return x
    raise SystemExit("not at rest")


def catenary(span, length, weight, axial):
    """Depth of the middle below the ends: parametric solution for the horizontal pull that gives the span."""

    def parts(pull):
        ratio = weight / (2 * pull)
        return 2 * pull * length * (np.arcsinh(ratio) / weight + 1 / (2 * axial)), ratio

    pull = brentq(lambda pull: parts(pull)[0] - span, 1e-4, 1e3, xtol=1e-15, rtol=1e-15)
    _, ratio = parts(pull)
    return pull * length / weight * (np.hypot(1, ratio) - 1) + weight * length / (8 * axial)


def chain(count):
    span, length, mass, axial = 1.0, 1.2, 0.06, 100.0
    weight = mass * 9.80665
    across = np.linspace(-span / 2, span / 2, count + 1)
    places = np.stack([across, 0 * across, -0.3 * (1 - (2 * across / span) ** 2)], 1)
    links = np.stack([np.arange(count), np.arange(1, count + 1)], 1)
    fixed = np.zeros(count + 1, bool)
    fixed[[0, -1]] = True
    each = length / count
    sag = -at_rest(places, links, axial / each, each, fixed, weight / count)[count // 2, 2]
    return sag / catenary(span, length, weight, axial) - 1


def square_sag():
    """Depth of the middle of a membrane over a square, in units of load times side squared over tension."""
    odd = np.arange(1, 4001, 2)
    sign = np.where(odd // 2 % 2 == 0, 1.0, -1.0)
    return 16 / np.pi**4 * (np.outer(sign, sign) / (np.outer(odd, odd) * (odd[:, None] ** 2 + odd**2))).sum()


def square(side_nodes):
    side, stiffness, stretch = 0.1, 200.0, 1.25
    spacing = side / (side_nodes - 1)
    tension = stiffness * (1 - 1 / stretch)
    # A load under which the middle of the continuous membrane sags by a thousandth of the side.
    load = 1e-3 * side * tension / (square_sag() * side**2)
    grid = np.linspace(-side / 2, side / 2, side_nodes)
    places = np.array([[x, y, 0.0] for y in grid for x in grid])
    index = np.arange(side_nodes**2).reshape(side_nodes, side_nodes)
    pairs = (index[:, :-1], index[:, 1:]), (index[:-1], index[1:])
    links = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in pairs])
    fixed = np.zeros((side_nodes, side_nodes), bool)
    fixed[[0, -1]] = fixed[:, [0, -1]] = True
    rest = at_rest(places, links, stiffness, spacing / stretch, fixed.ravel(), load * spacing**2)
    return -rest[side_nodes**2 // 2, 2] / (1e-3 * side) - 1


print("case,size,error")
for name, solve, sizes in (("chain", chain, (16, 32, 64)), ("square", square, (9, 17, 33))):
    for size in sizes:
        print(f"{name},{size},{abs(solve(size)):.6e}")
