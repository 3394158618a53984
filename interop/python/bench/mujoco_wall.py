"""A wall of a MuJoCo scene beside the wall of the loop: `python bench/mujoco_wall.py [SECONDS] [PICTURE.svg]`.

Needs `pip install mujoco`. Virtual time, hand and loop at 1 kHz, MuJoCo at 200 Hz (`examples/mujoco/wall.py`). Prints
- the pull, N, and the energy out of the port, mJ, over the time, with a hand that moves in and out of the wall;
- the largest stiffness at which the handle comes to rest: with its contacts, and with its force sent directly, one period late.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import flotor

FILE = Path(__file__).parents[3] / "examples" / "mujoco" / "wall.py"
STIFFNESS_N_PER_M, DAMPING_NS_PER_M, RATE_HZ = 2000.0, 4.0, 200
#: A hand that presses and moves out again, twice in three seconds.
TAPS = {"hand": "oscillate", "hand_amplitude_mm": 3, "hand_frequency_hz": 0.7, "hand_centre_mm": 0}
#: A handle that nobody holds and that rests on the wall with 1 N, and one in a relaxed hand.
LOADS = {
    "open": {"hand": "open", "start_z_mm": 1, "feedforward_n": 580e-3 * 9.81 - 1},
    "relaxed": {"hand": "press", "hand_grip": "relaxed", "hand_depth_mm": 4},
}
#: Largest stiffness to try, N/m.
MOST_N_PER_M = 10_000.0
#: RMS of the velocity at rest, m/s.
AT_REST = 2e-3
#: The force of the wall, as a field without a stiffness: held until the next answer.
DIRECT = """
from flotor_model import Field

def contacts(handle):
    depth_m, speed = -handle.position_m[2], handle.linear_m_per_s[2]
    return Field((0, 0, max(handle.values[0] * depth_m - handle.values[1] * speed, 0) if depth_m > 0 else 0))
"""


def scene(model, device, stiffness, damping):
    if model == "loop":
        use = {"plugin": "wall", "parameters": {"stiffness_n_per_m": stiffness, "damping_ns_per_m": damping}}
    else:
        use = {"plugin": "python", "parameters": {"file": model, "value_1": stiffness, "value_2": damping}, "field": {"rate_hz": RATE_HZ}}
    return {"device": {"plugin": "simulated", "parameters": device}, "model": [{"name": "wall", **use}]}


def recorded(model, device, stiffness, damping, seconds):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.mcap"
        try:
            summary = flotor.run(scene(model, device, stiffness, damping), duration_s=seconds, record=file)
        except flotor.RunFailed as failed:
            if failed.summary is None or failed.summary["end"] not in ("oscillation", "device_fault"):
                raise  # the others are no instability
            summary = failed.summary
        return summary, flotor.read_recording(file)


def largest(model, device):
    """Returns the largest stiffness at which the handle comes to rest, and the smallest above it at which it does not, N/m."""
    rests, stiffness = None, 200.0
    while stiffness <= MOST_N_PER_M:
        # With the damping for which the loop renders this stiffness without reducing it.
        summary, recording = recorded(model, device, stiffness, 2.1e-3 * stiffness, 4.0)
        speed = recording["linear_m_per_s"][-1000:, 2]
        if summary["end"] != "finished" or np.sqrt(np.mean(speed**2)) > AT_REST:
            return rests, stiffness
        rests, stiffness = stiffness, stiffness * 1.25
    return rests, None


def told(stable, unstable):
    upper = "not tried above" if unstable is None else f"not at {unstable:.0f} N/m"
    return f"{'never' if stable is None else f'up to {stable:.0f} N/m'}, {upper}"


def main(seconds, picture):
    columns = {}
    for name, model in (("wall in the loop", "loop"), ("wall in MuJoCo", FILE)):
        summary, columns[name] = recorded(model, TAPS, STIFFNESS_N_PER_M, DAMPING_NS_PER_M, seconds)
        force_n = columns[name]["commanded_force_n"][:, 2]
        energy = summary["energy"]
        print(
            f"{name}: peak {force_n.max():.2f} N, pull {0 - min(force_n.min(), 0):.3g} N, energy out {(0 - energy['port_lowest_j']) * 1e3:.4f} mJ at most, "
            f"taken in {energy['port_end_j'] * 1e3:.2f} mJ in {seconds:.0f} s"
        )
    with tempfile.TemporaryDirectory() as folder:
        direct = Path(folder) / "direct.py"
        direct.write_text(DIRECT)
        for hand, device in LOADS.items():
            print(f"{hand} hand, at rest by contacts: {told(*largest(FILE, device))}; by force: {told(*largest(direct, device))}")
    if picture:
        draw(columns, picture)


def draw(columns, picture):
    """Force over position of both walls, as SVG."""
    width, height, margin = 640, 400, 50
    bodies, most_n = [], max(column["commanded_force_n"][:, 2].max() for column in columns.values())
    for (name, column), colour, y in zip(columns.items(), ("#2166ac", "#b2182b"), (20, 38)):
        z_mm, force_n = column["position_m"][:6000, 2] * 1e3, column["commanded_force_n"][:6000, 2]
        x = margin + (z_mm - z_mm.min()) / (z_mm.max() - z_mm.min()) * (width - 2 * margin)
        points = " ".join(f"{a:.1f},{height - margin - b / most_n * (height - 2 * margin):.1f}" for a, b in zip(x, force_n))
        bodies.append(f'<polyline points="{points}" fill="none" stroke="{colour}"/><text x="{margin}" y="{y}" fill="{colour}">{name}</text>')
    axis = f'<text x="{width / 2}" y="{height - 12}">height, mm</text><text x="8" y="{height / 2}">N</text>'
    Path(picture).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="14">'
        f'<rect width="{width}" height="{height}" fill="white"/>{"".join(bodies)}{axis}</svg>'
    )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0, sys.argv[2] if len(sys.argv) > 2 else None)
