"""Peak forces of scenes, and errors of a membrane computed asynchronously, by a simulation of its own (NumPy).

    python3 tests/generators/scenes.py tests/data/cases

A handle of 0.58 kg with a drag of 2 N s/m moves along z only, in a hand that is a spring, a damper and a mass about an intended
position. The force is constant from tick to tick, at 1 kHz; motion in between is integrated with the classical Runge-Kutta method.
Every law is written anew from its formula in the book.
"""

import math
import sys

import numpy as np

TICK_S, TICKS, SUBSTEPS = 1e-3, 2000, 8
HANDLE_KG, DRAG_NS_PER_M = 0.58, 2.0
FIRM = (0.5, 70.0, 2000.0)  # kg, N s/m, N/m
RELAXED = (0.554, 6.45, 135.0)
RAMP_S = 0.2


def minimum_jerk(u):
    u = min(max(u, 0.0), 1.0)
    return u**3 * (10 - 15 * u + 6 * u * u)


def minimum_jerk_slope(u):
    return 30 * u * u * (1 - u) ** 2 if 0 < u < 1 else 0.0


def oscillation(centre, amplitude, frequency):
    """Intended position and velocity: a sine that begins over one second."""

    def aim(t):
        phase = 2 * math.pi * frequency * t
        full, rate = centre - amplitude * math.sin(phase), -amplitude * 2 * math.pi * frequency * math.cos(phase)
        return minimum_jerk(t) * full, minimum_jerk_slope(t) * full + minimum_jerk(t) * rate

    return aim


def ramp(tick):
    u = min(tick * TICK_S / RAMP_S, 1.0)
    return u * u * (3 - 2 * u)


class Handle:
    def __init__(self, grip, aim):
        self.grip, self.aim, self.x, self.v = grip, aim, 0.0, 0.0

    def move(self, tick, force):
        mass, damping, stiffness = self.grip

        def slope(t, x, v):
            aim, rate = self.aim(t)
            hand = stiffness * (aim - x) + damping * (rate - v)
            return v, (force - DRAG_NS_PER_M * v + hand) / (HANDLE_KG + mass)

        h = TICK_S / SUBSTEPS
        for step in range(SUBSTEPS):
            t = tick * TICK_S + step * h
            x, v = self.x, self.v
            a = slope(t, x, v)
            b = slope(t + h / 2, x + h / 2 * a[0], v + h / 2 * a[1])
            c = slope(t + h / 2, x + h / 2 * b[0], v + h / 2 * b[1])
            d = slope(t + h, x + h * c[0], v + h * c[1])
            self.x, self.v = (y + h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]) for i, y in enumerate((x, v)))


def run(aim, law):
    """Positions, forces of the law, and forces on the hand of a run with one handle."""
    handle, rows = Handle(FIRM, aim), []
    for tick in range(TICKS):
        force = law(tick, handle.x, handle.v)
        rows.append((handle.x, force, force * ramp(tick)))
        handle.move(tick, rows[-1][2])
    return np.array(rows).T


def spring(_tick, x, _v):
    """Spring 1 of the thesis, straight: 16.97 N over 25 mm; 15 mm of the handle are 25 mm of the spring."""
    return -16.97 / 0.025 * (25 / 15) * x


def wall(_tick, x, v):
    return max(-2000 * x - 2 * v, 0.0) if x < 0 else 0.0


def solid(table):
    """Hertz's law times a correction for depth and for the radius of the contact, through three finite-element solutions."""
    with open(table) as file:
        names, *rows = (line.strip().split(",") for line in file)
    rows = [dict(zip(names, row)) for row in rows]
    columns = ("E_pa", "nu", "radius_m", "depth_m", "fz_n")
    solved = [[float(row[name]) for name in columns] for row in rows if row["id"] in ("b001", "b003", "b012")]

    def hertz(young, ratio, radius, depth):
        return 4 / 3 * young / (1 - ratio**2) * math.sqrt(radius) * depth**1.5

    def terms(radius, depth):
        return np.array([1.0, depth / radius, math.sqrt(radius * depth)])

    ratios = [force / hertz(*case) for *case, force in solved]
    correction = np.linalg.solve([terms(radius, depth) for _, _, radius, depth, _ in solved], ratios)

    def law(_tick, x, _v):
        depth = max(-x, 0.0)
        return hertz(1e5, 0.3, 12.7e-3, depth) * float(terms(12.7e-3, depth) @ correction)

    return law


class Sheet:
    """The default membrane: 17 x 17 masses, 40 mm, 10 g, springs of 200 N/m stretched to 1.25; a ball of 5 mm."""

    masses, side, mass, stiffness, stretch, drag, radius, contact = 17, 0.04, 0.01, 200.0, 1.25, 50.0, 5e-3, 400.0

    def __init__(self):
        places = np.linspace(-self.side / 2, self.side / 2, self.masses)
        self.spacing = self.side / (self.masses - 1)
        self.rest = self.spacing / self.stretch
        self.node = self.mass / (self.masses - 1) ** 2
        self.x = np.zeros((self.masses, self.masses, 3))
        self.x[..., 0], self.x[..., 1] = places[None, :], places[:, None]
        self.v = np.zeros_like(self.x)
        self.ball = np.array([0, 0, self.radius])
        self.longest = 0.8 * 2 / math.sqrt((2 * 4 * self.stiffness + self.contact) / self.node)

    def advance(self, handle, duration):
        """Moves the ball steadily to a position of the handle; the force on it at the end."""
        steps = max(math.ceil(duration / self.longest), 1)
        h, start, end = duration / steps, self.ball, handle + [0, 0, self.radius]
        for step in range(1, steps + 1):
            forces = np.zeros_like(self.x)
            for axis in (0, 1):
                along = np.diff(self.x, axis=axis)
                pull = self.stiffness * (1 - self.rest / np.linalg.norm(along, axis=-1, keepdims=True)) * along
                first, second = ([slice(None)] * 2 for _ in range(2))
                first[axis], second[axis] = slice(None, -1), slice(1, None)
                forces[tuple(first)] += pull
                forces[tuple(second)] -= pull
            out = self.x - (start + (end - start) * step / steps)
            distance = np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), 1e-150)
            push = self.contact * np.maximum(self.radius - distance, 0) / distance * out
            self.v = (self.v + h * (forces + push) / self.node) / (1 + h * self.drag)
            self.v[[0, -1]] = 0
            self.v[:, [0, -1]] = 0
            self.x = self.x + h * self.v
        self.ball = end
        return -push.sum((0, 1))

    def tick(self, tick, x, _v):
        return self.advance(np.array([0, 0, x]), TICK_S if tick else 0.0)[2]

    def plane(self, handle, duration):
        """Height and stiffness of the plane with the force at the handle: the same time simulated again, the ball an eighth of a spacing
        farther in the direction of motion, or, if it touches nothing, below the nearest mass."""
        before, way = (self.x, self.v, self.ball), handle[2] + self.radius - self.ball[2]
        force = self.advance(handle, duration)[2]
        after, clearance = (self.x, self.v, self.ball), 0.0
        probe = math.copysign(self.spacing / 8, way)
        if force == 0:
            clearance, probe = np.linalg.norm(self.ball - self.x, axis=-1).min() - self.radius, -self.spacing / 8
        self.x, self.v, self.ball = before
        stiffness = (force - self.advance(handle + [0, 0, probe - clearance], duration)[2]) / probe
        self.x, self.v, self.ball = after
        return handle[2] + (force / stiffness if force > 0 else -clearance), stiffness


class Contact:
    """A sheet at a lower rate: each plane is available one period later. A spring behind it keeps its energy when the plane is replaced;
    what the new plane is deeper is withheld, and falls as far as the hand has paid for it, over half a period (`host/contact/src`)."""

    largest_balance, drift, longest = 0.01, 0.1e-3 / 60, 0.02  # J, W, s

    def __init__(self, rate):
        self.period, self.sheet = 1000 // rate, Sheet()
        self.computed, self.pending, self.height = None, None, None
        self.stiffness = self.depth = self.withheld = self.rate = self.balance = self.stored = 0.0
        self.since = math.inf

    def replace(self, height, stiffness):
        if self.height is not None:
            ratio = self.stiffness / stiffness
            self.depth *= ratio if ratio < 1 else math.sqrt(ratio)
        self.height, self.stiffness = height, stiffness
        self.withheld = height - self.last - self.depth
        if self.depth == 0:
            self.withheld = max(self.withheld, 0.0)
        self.rate = abs(self.withheld) / max(min(self.since / 2, self.longest) / TICK_S, 1.0)
        self.since = 0.0

    def relax(self, whole, available):
        if self.withheld <= 0:
            self.withheld = min(self.withheld + self.rate, 0.0)
            return
        depth = max(whole - self.withheld, 0.0)
        force = self.stiffness * (max(depth, self.depth) + abs(depth - self.depth))
        fall = min(self.rate, self.withheld)
        if (force + self.stiffness * fall / 2) * fall > available:
            root = math.sqrt(force**2 + 2 * self.stiffness * max(available, 0.0))
            fall = 2 * max(available, 0.0) / (force + root) if root > 0 else 0.0
        self.withheld -= fall

    def force(self, x, arrived):
        """The balance is what the hand has put in less what the spring stores; a sampled spring is credited half its stiffness times the
        squared motion of a tick."""
        available, moved = self.balance, x - self.last
        self.since += TICK_S
        work = -self.stiffness * self.depth * moved + self.drift * TICK_S
        if arrived:
            self.replace(*arrived)
        whole, touched = self.height - x, self.depth > 0
        self.relax(whole, available)
        depth = whole - self.withheld
        self.depth = max(depth, 0.0)
        if depth < 0 < self.withheld:
            self.withheld = max(self.withheld + depth, 0.0)
        if touched or self.depth > 0:
            work += self.stiffness * moved**2 / 2
        stored = self.stiffness * self.depth**2 / 2
        self.balance, self.stored = min(self.balance + work + self.stored - stored, self.largest_balance), stored
        return self.stiffness * self.depth

    def tick(self, tick, x, _v):
        arrived = None
        if self.pending and tick >= self.pending[0]:
            arrived, self.pending = self.pending[1], None
        if tick % self.period == 0:
            duration = 0.0 if self.computed is None else (tick - self.computed) * TICK_S
            plane = self.sheet.plane(np.array([0, 0, x]), duration)
            self.computed, self.pending = tick, (tick + self.period, plane)
        if self.height is None and not arrived:
            return 0.0
        if self.height is None:
            self.last = x
        force, self.last = self.force(x, arrived), x
        return force


def errors_of_the_contact(rate):
    """Root mean squares over the largest force, and largest steps in N: contact, sheet at 1 kHz, zero-order hold of its force."""
    positions, contact, _ = run(oscillation(-1e-3, 1.5e-3, 3.0), Contact(rate).tick)
    sheet = Sheet()
    direct = np.array([sheet.tick(tick, x, 0.0) for tick, x in enumerate(positions)])
    period = 1000 // rate
    ticks = np.arange(2 * period, TICKS)
    held = direct[(ticks // period - 1) * period]
    rms = [math.sqrt(np.mean((forces - direct[ticks]) ** 2)) / np.abs(direct).max() for forces in (contact[ticks], held)]
    steps = np.abs(np.diff(contact)).max(), np.abs(np.diff(direct)).max(), np.abs(direct[period:] - direct[:-period]).max()
    return *rms, *steps


class End:
    """One end of the default coupling: 600 N/m, 6 N s/m, an energy tank, and the controller that keeps the tank from running dry."""

    stiffness, damping, reserve, surprise = 600.0, 6.0, 0.01, 2e-5
    lightest, calmest, memory, fade = 0.1, 0.8, 0.05, 0.1

    def __init__(self):
        self.position = self.velocity = self.peer = None
        self.tank = self.passed = self.received = self.in_walls = self.asked = 0.0
        self.part, self.acceleration = 1.0, self.calmest

    def observe(self, x, v, held):
        moved = 0.0 if self.position is None else x - self.position
        self.tank -= held * moved
        beyond = held - self.asked
        self.in_walls = max(self.in_walls - beyond * moved, 0.0) if abs(beyond) >= 1e-9 else 0.0
        if self.velocity is not None:
            recent = 2 * abs(v - self.velocity) / TICK_S
            self.acceleration = max(self.acceleration * (1 - TICK_S / self.memory), recent, self.calmest)
        self.position, self.velocity = x, v

    def state(self):
        share = 0.1 * max(self.tank - self.in_walls, 0.0)
        self.tank -= share
        self.passed += share
        return self.position, self.velocity, self.passed

    def receive(self, peer):
        self.peer = peer
        if peer[2] > self.received:
            self.tank += peer[2] - self.received
            self.received = peer[2]

    def force(self):
        if self.peer is None:
            return 0.0
        away = self.peer[0] - self.position
        whole = self.stiffness * away + self.damping * (self.peer[1] - self.velocity)
        self.tank = min(self.tank, self.stiffness * away * away / 2 + self.reserve + self.in_walls)
        self.asked = self.affordable(whole)
        return self.asked

    def cost(self, force):
        """The most energy that the port may give until the next tick."""
        along = force * self.velocity * TICK_S
        cost = along + abs(force) * self.acceleration * TICK_S**2 / 2
        return cost if along < 0 else cost + max((force - self.asked) * force, 0.0) * TICK_S**2 / 2 / self.lightest

    def affordable(self, whole):
        part = min(self.part + TICK_S / self.fade, 1.0)
        wanted, available = whole * part, max(0.1 * (self.tank - self.surprise), 0.0)
        floor = -self.damping * self.velocity
        floor = floor if self.cost(floor) < 0 else 0.0
        given = wanted
        if self.cost(wanted) > available:
            low, high = 0.0, 1.0
            for _ in range(40):
                middle = (low + high) / 2
                inside = self.cost(floor + (wanted - floor) * middle) <= available
                low, high = (middle, high) if inside else (low, middle)
            given = floor + (wanted - floor) * low
            part *= min(max(given / wanted, 0.0), 1.0)
        self.part = part
        return given


def teleoperation():
    """Largest force on either hand: one moves, one rests 4 mm below home; a peer state is one tick old."""
    handles = Handle(FIRM, oscillation(-4e-3, 6e-3, 1.5)), Handle(RELAXED, lambda _t: (-4e-3, 0.0))
    ends, sent, held, peak = (End(), End()), [None, None], [0.0, 0.0], 0.0
    for tick in range(TICKS):
        for end, handle, force in zip(ends, handles, held):
            end.observe(handle.x, handle.v, force)
        for here, there in ((0, 1), (1, 0)):
            arriving, sent[here] = sent[here], ends[here].state()
            if arriving:
                ends[there].receive(arriving)
        held = [end.force() * ramp(tick) for end in ends]
        peak = max(peak, *map(abs, held))
        for handle, force in zip(handles, held):
            handle.move(tick, force)
    return peak


def main(folder):
    explore, press = oscillation(-4e-3, 6e-3, 1.5), oscillation(-1e-3, 1.5e-3, 1.0)
    laws = {
        "demo": (explore, spring),
        "study": (explore, spring),
        "wall": (explore, wall),
        "membrane": (press, Sheet().tick),
        "membrane-200hz": (press, Contact(200).tick),
        "solid": (press, solid(f"{folder}/solid/b_block_sphere.csv")),
    }
    peaks = {scene: np.abs(run(aim, law)[2]).max() for scene, (aim, law) in laws.items()}
    with open(f"{folder}/scenes.csv", "w") as file:
        print("scene,peak_n", file=file)
        for scene, peak in {**peaks, "teleoperation": teleoperation()}.items():
            print(f"{scene},{peak:.8f}", file=file)
    with open(f"{folder}/asynchronous_membrane.csv", "w") as file:
        print("rate_hz,contact_rms,held_rms,contact_step_n,sheet_step_n,held_step_n", file=file)
        for rate in (50, 100, 200):
            print(rate, *(f"{number:.8f}" for number in errors_of_the_contact(rate)), sep=",", file=file)


main(sys.argv[1])
