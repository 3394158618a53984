"""Error against cost of a deformable body: Flotor's solid, MuJoCo's flex and PositionBasedDynamics on one beam, the first two
on one indentation too.

    cargo build --release && pip install numpy mujoco pyPBD && python interop/python/bench/solid.py [PICTURE.svg]

Beam: 200 x 40 x 40 mm, 0.1 MPa, Poisson's ratio 0.3, clamped, 0.05 N across its tip. Indentation: a sphere of 12.7 mm,
3 mm deep in the middle of a cube of 80 mm, 10 kPa. The truth is that of tests/data/cases/solid. Every peer rests before it
is measured; its step is the fastest of its last ones, Flotor's tick a median. Peers that cannot be imported are left out.
"""

import csv
import itertools
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
CASES = ROOT / "tests/data/cases/solid"
LENGTH_M, SIDE_M, FORCE_N, BEAM_PA = 0.2, 0.04, 0.05, 1e5
CUBE_M, RADIUS_M, DEPTH_M, CUBE_PA = 0.08, 0.0127, 0.003, 1e4
RATIO = 0.3
BEAMS = (11, 3, 3), (21, 5, 5)  # 99 and 525 nodes
STEP_S = 1e-3


def truth(file, row, column):
    with open(CASES / file, newline="") as text:
        return next(abs(float(r[column])) for r in csv.DictReader(text) if r["id"] == row)


def flotor():
    built = ROOT / "target/release/flotor"
    program = os.environ.get("FLOTOR") or (built if built.is_file() else shutil.which("flotor"))
    if not program:
        raise SystemExit("there is no flotor: `cargo build --release` builds it")
    return str(program)


def evaluate(poses, settings):
    with tempfile.TemporaryDirectory() as folder:
        poses_csv, out_csv = Path(folder) / "poses.csv", Path(folder) / "out.csv"
        np.savetxt(poses_csv, poses, delimiter=",", header="x_m,y_m,z_m,rx_rad,ry_rad,rz_rad", comments="")
        command = [flotor(), "eval", "--model", "solid", "--poses", poses_csv, "--out", out_csv, *settings]
        subprocess.run(command, check=True)
        with open(out_csv, newline="") as text:
            columns = "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"
            return np.array([[float(row[c]) for c in columns] for row in csv.DictReader(text)])


def tick_s(settings):
    command = [flotor(), "bench", "--model", "solid", "--depth-mm", "3", "--json", "-", *settings]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return statistics.median(t["warm_median_ns"] for t in report["rows"][0]["times"]) * 1e-9


def settings(**values):
    return [word for key, value in values.items() for word in ("--set", f"{key}={value}")]


def flotor_beam():
    own = settings(body="beam", tool="plate", youngs_modulus_pa=BEAM_PA, poisson_ratio=RATIO)
    step = 1e-5
    poses = np.array([[0, 0, step, 0, 0, 0], [0, 0, 0, 0, step, 0]])
    stiffness = -evaluate(poses, own)[:, [2, 4]] / step  # force and torque of a deflection, of a rotation
    return abs(np.linalg.solve(stiffness.T, [FORCE_N, 0.0])[0]), tick_s(own)


def flotor_cube():
    own = settings(tool_radius_mm=RADIUS_M * 1e3, youngs_modulus_pa=CUBE_PA, poisson_ratio=RATIO)
    return evaluate(np.array([[0, 0, -DEPTH_M, 0, 0, 0]]), own)[0, 2], tick_s(own)


def tip_weights(count, across):
    """Shares of an even load for the nodes of the tip, whose places across are given from -1 to 1."""
    border = np.where(np.abs(across) > 0.999, 0.5, 1.0)
    return border.prod(axis=1) / ((count[1] - 1) * (count[2] - 1))


def timed(step, steps):
    """The fastest of the last tenth of some steps."""
    times = []
    for _ in range(steps):
        started = time.perf_counter()
        step()
        times.append(time.perf_counter() - started)
    return min(times[-max(1, steps // 10):])


def mujoco_flex(count, spacing, origin, elasticity, pin, geometry="", contact=""):
    import mujoco

    text = f"""<mujoco><option timestep="{STEP_S}" gravity="0 0 0" integrator="discrete"/><size memory="1G"/><worldbody>{geometry}
      <flexcomp name="body" type="grid" dim="3" count="{count}" spacing="{spacing}" pos="{origin}" mass="0.05" radius="1e-5">
      <contact selfcollide="none" {contact}/><elasticity {elasticity}/><pin gridrange="{pin}"/></flexcomp></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return mujoco, model, data


def mujoco_beam(count, steps):
    nx, ny, nz = count
    spacing = f"{LENGTH_M / (nx - 1)} {SIDE_M / (ny - 1)} {SIDE_M / (nz - 1)}"
    elasticity = f'young="{BEAM_PA}" poisson="{RATIO}" damping="0.05"'
    mujoco, model, data = mujoco_flex(
        f"{nx} {ny} {nz}", spacing, f"{-LENGTH_M / 2} 0 0", elasticity, f"0 0 0 0 {ny - 1} {nz - 1}",
        contact='contype="0" conaffinity="0"',
    )
    start = data.flexvert_xpos.reshape(-1, 3).copy()
    tip = np.flatnonzero(start[:, 0] > -1e-9)
    weights = tip_weights(count, start[tip, 1:] / (SIDE_M / 2))
    for body, weight in zip(model.flex_vertbodyid[tip], weights):
        data.xfrc_applied[body, 2] = -FORCE_N * weight
    step_s = timed(lambda: mujoco.mj_step(model, data), steps)
    moved = data.flexvert_xpos.reshape(-1, 3)[tip, 2] - start[tip, 2]
    return abs(weights @ moved), step_s


def mujoco_cube(n, steps):
    soft = 'solref="0.002 1" solimp="0.99 0.999 0.0001" condim="1"'
    sphere = f'<geom type="sphere" size="{RADIUS_M}" pos="0 0 {CUBE_M / 2 + RADIUS_M - DEPTH_M}" {soft}/>'
    spacing = " ".join([str(CUBE_M / (n - 1))] * 3)
    elasticity = f'young="{CUBE_PA}" poisson="{RATIO}" damping="0.02"'
    mujoco, model, data = mujoco_flex(
        f"{n} {n} {n}", spacing, "0 0 0", elasticity, f"0 0 0 {n - 1} {n - 1} 0", sphere, soft
    )
    step_s = timed(lambda: mujoco.mj_step(model, data), steps)
    total, one = np.zeros(3), np.zeros(6)
    for index in range(data.ncon):
        mujoco.mj_contactForce(model, data, index, one)
        total += one[0] * data.contact[index].frame[:3]
    return abs(total[2]), step_s


def tetrahedra(count):
    """Nodes of a beam's grid, and six tetrahedra to a cell."""
    nx, ny, nz = count
    places = [
        [-LENGTH_M + LENGTH_M * i / (nx - 1), SIDE_M * (j / (ny - 1) - 0.5), SIDE_M * (k / (nz - 1) - 0.5)]
        for k in range(nz) for j in range(ny) for i in range(nx)
    ]
    places, corners = np.array(places), []
    for cell in itertools.product(range(nx - 1), range(ny - 1), range(nz - 1)):
        for order in itertools.permutations(range(3)):
            at, path = list(cell), []
            for axis in (None, *order):
                if axis is not None:
                    at[axis] += 1
                path.append((at[2] * ny + at[1]) * nx + at[0])
            edges = places[path[1:]] - places[path[0]]
            corners += path if np.linalg.det(edges) > 0 else [path[0], path[2], path[1], path[3]]
    return places, corners


def position_based_beam(count, steps, iterations):
    import pypbd

    places, corners = tetrahedra(count)
    simulation = pypbd.Simulation.getCurrent()
    simulation.initDefault()
    model = pypbd.SimulationModel()
    model.init()
    simulation.setModel(model)
    model.addTetModel(list(places), corners)
    node_kg = 0.032 / len(places)
    held = places[:, 0] < -LENGTH_M + 1e-9
    particles = model.getParticles()
    for node, is_held in enumerate(held):
        particles.setMass(node, 0.0 if is_held else node_kg)
    model.addSolidConstraints(model.getTetModels()[0], 2, BEAM_PA, RATIO, BEAM_PA, False, False)  # 2: its finite elements
    pypbd.TimeManager.getCurrent().setTimeStepSize(STEP_S)
    stepper = simulation.getTimeStep()
    stepper.setValueUInt(pypbd.TimeStepController.NUM_SUB_STEPS, 1)
    stepper.setValueUInt(pypbd.TimeStepController.MAX_ITERATIONS, iterations)
    tip = np.flatnonzero(places[:, 0] > -1e-9)
    weights = tip_weights(count, places[tip, 1:] / (SIDE_M / 2))
    push = np.zeros((len(places), 3))
    push[tip, 2] -= FORCE_N * weights / node_kg * STEP_S
    push[~held, 1] += 9.81 * STEP_S  # against its gravity
    times = []
    for _ in range(steps):
        for node in np.flatnonzero(~held):
            particles.setVelocity(node, np.ravel(particles.getVelocity(node)) * 0.99 + push[node])
        started = time.perf_counter()
        stepper.step(model)
        times.append(time.perf_counter() - started)
    moved = np.array([np.ravel(particles.getPosition(node))[2] for node in tip]) - places[tip, 2]
    return abs(weights @ moved), min(times[-max(1, steps // 10):])


def measure():
    """Rows (task, who, signed relative error, seconds a step)."""
    rows = []

    def add(task, who, exact, run, stiffer_is):
        try:
            value, step_s = run()
        except ImportError as missing:
            print(f"skipped: {who}: {missing}", file=sys.stderr)
            return
        # Positive: too stiff.
        rows.append((task, who, stiffer_is * (value / exact - 1), step_s))

    tip_m, force_n = truth("a_cantilever_load.csv", "a003", "uz_m"), truth("b_block_sphere.csv", "b012", "fz_n")
    add("beam", "Flotor solid", tip_m, flotor_beam, -1)
    for count in BEAMS:
        nodes = math.prod(count)
        add("beam", f"MuJoCo flex, {nodes} nodes", tip_m, lambda: mujoco_beam(count, 150000 // nodes), -1)
        for iterations in (5, 50):
            run = lambda: position_based_beam(count, 1500, iterations)
            if nodes < 500:
                add("beam", f"PositionBasedDynamics, {nodes} nodes, {iterations} iterations", tip_m, run, -1)
    add("indentation", "Flotor solid", force_n, flotor_cube, 1)
    for n, steps in ((5, 300), (9, 120)):
        add("indentation", f"MuJoCo flex, {n**3} nodes", force_n, lambda: mujoco_cube(n, steps), 1)
    return rows


def picture(rows):
    """Error over time as SVG, both logarithmic."""
    width, height, left, top, inner_w, inner_h = 760, 420, 70, 30, 440, 320
    x = lambda s: left + inner_w * (math.log10(s) + 8) / 7  # 10 ns to 0.1 s
    y = lambda e: top + inner_h * (0.5 - math.log10(min(max(e, 3.2e-4), 3.1))) / 4  # 316 % to 0.03 %
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="DejaVu Sans, sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
    ]
    for power in range(-8, 0):
        label = {-8: "10 ns", -7: "100 ns", -6: "1 µs", -5: "10 µs", -4: "100 µs", -3: "1 ms", -2: "10 ms", -1: "100 ms"}[power]
        at = x(10.0**power)
        out.append(f'<path d="M{at:.1f} {top}V{top + inner_h}" stroke="#dddddd"/>')
        out.append(f'<text x="{at:.1f}" y="{top + inner_h + 18}" text-anchor="middle">{label}</text>')
    for power, label in ((0, "100 %"), (-1, "10 %"), (-2, "1 %"), (-3, "0.1 %")):
        at = y(10.0**power)
        out.append(f'<path d="M{left} {at:.1f}H{left + inner_w}" stroke="#dddddd"/>')
        out.append(f'<text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{label}</text>')
    out.append(f'<text x="{left + inner_w / 2}" y="{top + inner_h + 40}" text-anchor="middle">time of a step</text>')
    out.append(f'<text x="{left}" y="18">error of tip and force; circles: beam, squares: indentation</text>')
    colours = {"Flotor": "#0072b2", "MuJoCo": "#d55e00", "PositionBasedDynamics": "#009e73"}
    for index, (task, who, error, step_s) in enumerate(rows):
        colour = next(c for name, c in colours.items() if who.startswith(name))
        shape = (
            (lambda a, b: f'<circle cx="{a:.1f}" cy="{b:.1f}" r="5" fill="{colour}"/>') if task == "beam"
            else (lambda a, b: f'<rect x="{a - 5:.1f}" y="{b - 5:.1f}" width="10" height="10" fill="{colour}"/>')
        )
        a, b = x(step_s), y(abs(error))
        out += [shape(a, b), f'<text x="{a + 8:.1f}" y="{b + 4:.1f}">{index + 1}</text>']
        line = top + 14 + 34 * index
        out += [shape(left + inner_w + 20, line), f'<text x="{left + inner_w + 30}" y="{line + 4}">{index + 1} {who.split(",")[0]}</text>']
        rest = ",".join(who.split(",")[1:]).strip()
        out.append(f'<text x="{left + inner_w + 30}" y="{line + 18}" fill="#555555">{rest} {error:+.1%}</text>')
    return "\n".join([*out, "</svg>\n"])


def main():
    rows = measure()
    print(f"{'':12} {'':50} {'too stiff':>10} {'step':>10}")
    for task, who, error, step_s in rows:
        print(f"{task:12} {who:50} {error:+10.1%} {step_s * 1e6:8.2f} µs")
    for task in ("beam", "indentation"):
        own = [row for row in rows if row[0] == task and row[1].startswith("Flotor")]
        peers = [row for row in rows if row[0] == task and not row[1].startswith("Flotor")]
        if own and peers:
            best = min(peers, key=lambda row: row[3])
            nearest = min(peers, key=lambda row: abs(row[2]))
            print(
                f"{task}: a step costs {own[0][3] / best[3]:.5f} of the fastest peer's ({best[1]}, error {best[2]:+.0%}) and "
                f"{own[0][3] / nearest[3]:.6f} of the most accurate one's ({nearest[1]}, error {nearest[2]:+.0%})"
            )
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(picture(rows))


if __name__ == "__main__":
    main()
