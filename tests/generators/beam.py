"""Errors of the bench's laws of a plate on a beam against its finest one, by finite elements of its own (NumPy, SciPy).

    python3 tests/generators/beam.py > tests/data/cases/solid/bench_beam.csv

A beam of 200 x 40 x 40 mm, clamped at one end, with a rigid plate on the other that moves along the path of `flotor bench`. Bricks are
Lagrange elements of order 2, 3 and 4 on one grid, finer towards both ends and all edges; tetrahedra are linear, six to a cube of 20 mm. The
reactions of the plate are linear in its displacement and in the nine entries of its rotation less the identity.
"""

import itertools

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

YOUNG, POISSON = 1e4, 0.3
LAMBDA, MU = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
SIZE, PATH_TICKS = (0.2, 0.04, 0.04), 30_000


def graded(near, far, elements):
    """Borders of elements that grow by a half from both ends to the middle."""
    steps = np.cumsum([0, *(1.5**k for k in range(elements))])
    half = (far - near) / 2 * steps / steps[-1]
    return np.concatenate([near + half, (far - half)[::-1][1:]])


def lagrange(order):
    """Nodes, and values and slopes of the shape functions at Gauss points with their weights."""
    nodes = np.linspace(-1, 1, order + 1)
    points, weights = np.polynomial.legendre.leggauss(order + 1)
    polynomials = [np.poly1d(np.poly(np.delete(nodes, k)) / np.prod(nodes[k] - np.delete(nodes, k))) for k in range(order + 1)]
    values = np.array([polynomial(points) for polynomial in polynomials])
    slopes = np.array([polynomial.deriv()(points) for polynomial in polynomials])
    return nodes, values, slopes, weights


def stiffness_of(gradients, weights):
    """Stiffness of an element from gradients (node, axis, point) and weights of its points; three rows to a node."""
    both = np.einsum("aip,bjp,p->aibj", gradients, gradients, weights)
    identity = np.eye(3)
    shear = np.einsum("akbk->ab", both)
    count = len(gradients)
    matrix = LAMBDA * both + MU * both.transpose(0, 3, 2, 1) + MU * np.einsum("ab,ij->aibj", shear, identity)
    return matrix.reshape(3 * count, 3 * count)


def bricks(order):
    borders = graded(-SIZE[0], 0, 4), graded(-SIZE[1] / 2, SIZE[1] / 2, 2), graded(-SIZE[2] / 2, SIZE[2] / 2, 2)
    nodes, values, slopes, weights = lagrange(order)
    axes = [np.concatenate([[b[0]], *(low + (nodes[1:] + 1) / 2 * (high - low) for low, high in zip(b, b[1:]))]) for b in borders]
    sizes = [len(axis) for axis in axes]
    number = np.arange(np.prod(sizes)).reshape(sizes)
    elements = []
    for cell in itertools.product(*(range(len(b) - 1) for b in borders)):
        half = [(b[i + 1] - b[i]) / 2 for b, i in zip(borders, cell)]
        volume = np.einsum("p,q,r->pqr", weights, weights, weights).ravel() * np.prod(half)
        gradients = []
        for axis in range(3):
            factors = [slopes / half[k] if k == axis else values for k in range(3)]
            gradients.append(np.einsum("ap,bq,cr->abcpqr", *factors).reshape((order + 1) ** 3, -1))
        places = [slice(order * i, order * i + order + 1) for i in cell]
        elements.append((number[tuple(places)].ravel(), stiffness_of(np.stack(gradients, 1), volume)))
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3), elements


def tetrahedra():
    counts = 10, 2, 2
    axes = [np.linspace(*ends, count + 1) for ends, count in zip(((-0.2, 0), (-0.02, 0.02), (-0.02, 0.02)), counts)]
    sizes = [len(axis) for axis in axes]
    number = np.arange(np.prod(sizes)).reshape(sizes)
    positions = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    elements = []
    for cell in itertools.product(*map(range, counts)):
        for order in itertools.permutations(range(3)):
            corners = [np.array(cell)]
            for axis in order:
                corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
            nodes = np.array([number[tuple(corner)] for corner in corners])
            edges = positions[nodes[1:]] - positions[nodes[0]]
            gradients = np.linalg.inv(edges).T
            gradients = np.vstack([-gradients.sum(0), gradients])[:, :, None]
            elements.append((nodes, stiffness_of(gradients, np.array([abs(np.linalg.det(edges)) / 6]))))
    return positions, elements


def plate(positions, elements):
    """Stiffness of the plate in its twelve numbers."""
    count = len(positions)
    rows, columns, entries = [], [], []
    for nodes, matrix in elements:
        places = (3 * nodes[:, None] + np.arange(3)).ravel()
        rows.append(np.repeat(places, len(places)))
        columns.append(np.tile(places, len(places)))
        entries.append(matrix.ravel())
    whole = coo_matrix((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), shape=(3 * count,) * 2).tocsr()
    at_plate, at_clamp = (np.abs(positions[:, 0] - x) < 1e-9 for x in (0, -SIZE[0]))
    modes = np.zeros((3 * count, 12))
    for node in np.flatnonzero(at_plate):
        for i in range(3):
            modes[3 * node + i, i] = 1
            modes[3 * node + i, 3 + 3 * i : 6 + 3 * i] = positions[node]
    free = np.repeat(~(at_plate | at_clamp), 3)
    inner = whole[free][:, free].tocsc()
    moved = modes.copy()
    moved[free] = -splu(inner).solve((whole[free] @ modes))
    return modes.T @ (whole @ moved)


def rotation(vector):
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle if angle > 0 else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def path():
    """The hand of the bench, 4 mm below home, tick by tick: position and rotation."""
    for tick in range(PATH_TICKS):
        turn = 2 * np.pi * tick * 1e-3
        position = np.array([1.5e-3, 1.2e-3, 3.0e-3]) * np.sin(turn * np.array([1.37, 2.11, 1.03])) - [0, 0, 4e-3]
        yield position, rotation(np.array([0.030, 0.025, 0.035]) * np.sin(turn * np.array([1.71, 2.53, 2.97])))


def wrench(stiffness, position, turn):
    slope = stiffness @ np.concatenate([position, (turn - np.eye(3)).ravel()])
    moments = slope[3:].reshape(3, 3)
    return -slope[:3], -np.cross(turn.T, moments.T).sum(0)


fine = plate(*bricks(4))
print("case,force_max_n,force_rms_n,torque_max_nm,torque_rms_nm")
for case, body in (("standard", bricks(3)), ("quick", bricks(2)), ("linear-tetrahedra", tetrahedra())):
    error = plate(*body) - fine
    off = np.array([[np.linalg.norm(part) for part in wrench(error, *pose)] for pose in path()])
    largest, rms = off.max(0), np.sqrt((off**2).mean(0))
    print(case, *(f"{number:.4e}" for number in (largest[0], rms[0], largest[1], rms[1])), sep=",", flush=True)
