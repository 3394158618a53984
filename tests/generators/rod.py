"""Exact rods by an independent shooting method, for `bench.py` (NumPy, SciPy).

A rod of length L0 with rigidities alpha (bending), beta (shear), gamma (compression), tau (twist), clamped at its base. In the frame
of a section the strains are (Qx/beta, Qy/beta, 1 + N/gamma) and the rates of turn (Mx/alpha, My/alpha, Mz/tau); the force is constant
along the rod and the moment obeys m' = -r' x f. The unknowns are the force and the moment at the base. Fixed steps of DOP853, Newton
steps with derivatives by complex steps, from rest to the pose in a few parts.
"""

import numpy as np
from scipy.integrate import DOP853

YOUNG, SHEAR = 203395e6, 75842e6
# Free length, wire and coil diameter (m), coils, gamma (N): table 2 of the thesis; the slender spring's follows from its wire.
SPRINGS = {
    "thesis-1": (25e-3, 0.63e-3, 6.07e-3, 11.8, 16.97),
    "thesis-2": (37.49e-3, 0.84e-3, 11.6e-3, 9.0, 12.53),
    "thesis-3": (27e-3, 0.51e-3, 4.81e-3, 15.0, 10.32),
    "slender": (60e-3, 0.6e-3, 5e-3, 24.0, None),
}
STAGES, WEIGHTS = DOP853.A[: DOP853.n_stages, : DOP853.n_stages], DOP853.B


class Spring:
    def __init__(self, name):
        self.length, wire, coil, coils, self.gamma = SPRINGS[name]
        if self.gamma is None:
            self.gamma = SHEAR * wire**4 * self.length / (8 * coils * coil**3)
        # Ratios of the thesis's (7) to (9); the twist of a wire in torsion and bending is beta D^2 / 8.
        self.beta = self.gamma * YOUNG / SHEAR
        self.alpha = self.gamma * YOUNG * coil**2 / (2 * (2 * SHEAR + YOUNG))
        self.tau = self.beta * coil**2 / 8


def cross(a, b):
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def product(p, q):
    """Quaternions: vector, then scalar; a column for each pose."""
    vector = p[3] * q[:3] + q[3] * p[:3] + cross(p[:3], q[:3])
    return np.vstack([vector, p[3] * q[3] - (p[:3] * q[:3]).sum(0)])


def conjugate(q):
    return np.vstack([-q[:3], q[3:]])


def rotated(q, v):
    twice = 2 * cross(q[:3], v)
    return v + q[3] * twice + cross(q[:3], twice)


def quaternion(rotation):
    angle = np.sqrt((rotation**2).sum(0))
    return np.vstack([rotation * np.sinc(angle / (2 * np.pi)) / 2, np.cos(angle / 2)])


def tip(spring, unknown, steps):
    """Position from the base, attitude and moment at the upper end."""
    force, poses = unknown[:3], unknown.shape[1]
    state = np.vstack([np.zeros((6, poses)), np.ones((1, poses)), unknown[3:]])
    shear = np.array([spring.beta, spring.beta, spring.gamma])[:, None]
    bend = np.array([spring.alpha, spring.alpha, spring.tau])[:, None]

    def slope(state):
        attitude, moment = state[3:7], state[7:]
        back = conjugate(attitude)
        strain = rotated(back, force) / shear + np.array([[0.0], [0.0], [1.0]])
        turn = rotated(back, moment) / bend
        along = rotated(attitude, strain)
        spin = product(attitude, np.vstack([turn, np.zeros((1, poses))])) / 2
        return np.vstack([along, spin, -cross(along, force)])

    h = spring.length / steps
    for _ in range(steps):
        slopes = []
        for row in STAGES:
            slopes.append(slope(state + h * sum(a * k for a, k in zip(row, slopes) if a) if slopes else state))
        state = state + h * sum(b * k for b, k in zip(WEIGHTS, slopes))
    return state[:3], state[3:7], state[7:]


def defect(spring, unknown, position, attitude, steps):
    end, turned, moment = tip(spring, unknown, steps)
    return np.vstack([end - position, 2 * product(turned, conjugate(attitude))[:3]]), moment


def derivatives(spring, unknown, position, attitude, steps):
    """Of the defect and of the moment at the upper end by the unknowns: 6 x 6 and 3 x 6 for each pose."""
    tiny = 1e-30
    columns = []
    for index in range(6):
        varied = unknown.astype(complex)
        varied[index] += 1j * tiny
        columns.append([part.imag / tiny for part in defect(spring, varied, position, attitude, steps)])
    return tuple(np.stack([column[part] for column in columns], -1).transpose(1, 0, 2) for part in (0, 1))


def solve(spring, position, rotation, steps=16, parts=6):
    """Unknowns at poses of the upper plate (m from home, rotation vector in rad; a column each)."""
    unknown = np.zeros((6, position.shape[1]))
    for part in np.arange(1, parts + 1) / parts:
        goal = position * part + np.array([[0.0], [0.0], [spring.length]])
        attitude = quaternion(rotation * part)
        slopes, last = None, np.inf
        for _ in range(40):
            wrong, _ = defect(spring, unknown, goal, attitude, steps)
            size = np.abs(wrong).max()
            if size < (1e-12 if part == 1 else 1e-6):
                break
            if slopes is None or size > 0.1 * last:
                slopes, _ = derivatives(spring, unknown, goal, attitude, steps)
            unknown, last = unknown - np.linalg.solve(slopes, wrong.T[:, :, None])[:, :, 0].T, size
        else:
            raise SystemExit(f"not converged: {size}")
    return unknown


def wrenches(spring, position, rotation, **how):
    """Force (N) and torque (N m) on the hand."""
    unknown = solve(spring, position, rotation, **how)
    _, _, moment = tip(spring, unknown, how.get("steps", 16))
    return -np.vstack([unknown[:3], moment])


def gains(spring, position, rotation, lever, steps=32):
    """Derivative of the wrench by shifts and turns of the handle, torques and turns at a lever arm: 6 x 6 for each pose, N/m."""
    unknown = solve(spring, position, rotation, steps, parts=40)
    goal = position + np.array([[0.0], [0.0], [spring.length]])
    slopes, moment = derivatives(spring, unknown, goal, quaternion(rotation), steps)
    answers = np.linalg.inv(slopes)
    wrench = -np.concatenate([answers[:, :3], moment @ answers], 1)
    scale = np.array([1, 1, 1, lever, lever, lever])
    return wrench / scale[:, None] / scale
