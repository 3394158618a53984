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
STIFFNESS_N_PER_M, DAMPING_NS_PER_M, RATE_HZ = 2000.0, 2.0, 200
#: A hand that presses and moves out again, twice in three seconds.
TAPS = {"hand": "oscillate", "hand_amplitude_mm": 3, "hand_frequency_hz": 0.7, "hand_centre_mm": 0}
#: A handle that nobody holds and that rests on the wall with 1 N, and one in a relaxed hand.
LOADS = {
    "open": {"hand": "open", "start_z_mm": 1, "feedforward_n": 580e-3 * 9.81 - 1},
    "relaxed": {"hand": "press", "hand_grip": "relaxed", "hand_depth_mm": 4},
}
#: RMS of the velocity at rest, m/s.
AT_REST = 2e-3
#: The force of the wall, as a field without a stiffness: held until the next answer.
DIRECT = "from flotor_model import Field\n\ndef contacts(handle):\n    return Field((0, 0, handle.values[0] * max(-handle.position_m[2], 0)))\n"


def scene(model, device, stiffness):
    if model == "loop":
        use = {"plugin": "wall", "parameters": {"stiffness_n_per_m": stiffness, "damping_ns_per_m": DAMPING_NS_PER_M}}
    else:
        use = {"plugin": "python", "parameters": {"file": model, "value_1": stiffness}, "field": {"rate_hz": RATE_HZ}}
    return {"device": {"plugin": "simulated", "parameters": device}, "model": [{"name": "wall", **use}]}


def recorded(model, device, stiffness, seconds):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.mcap"
        try:
            summary = flotor.run(scene(model, device, stiffness), duration_s=seconds, record=file)
        except flotor.RunFailed as failed:
            if failed.summary is None or failed.summary["end"] != "oscillation":
                raise
            summary = failed.summary
        return summary, flotor.read_recording(file)


def is_at_rest(model, device, stiffness):
    summary, recording = recorded(model, device, stiffness, 4.0)
    speed = recording["linear_m_per_s"][-1000:, 2]
    return summary["end"] == "finished" and np.sqrt(np.mean(speed**2)) < AT_REST


def largest(model, device):
    """Largest stiffness of a sequence with steps of a quarter, up to which the handle comes to rest."""
    stiffness = 20.0
    while stiffness < 60_000 and is_at_rest(model, device, stiffness * 1.25):
        stiffness *= 1.25
    return stiffness


def main(seconds, picture):
    columns = {}
    for name, model in (("wall in the loop", "loop"), ("wall in MuJoCo", FILE)):
        summary, columns[name] = recorded(model, TAPS, STIFFNESS_N_PER_M, seconds)
        force_n = columns[name]["commanded_force_n"][:, 2]
        energy = summary["energy"]
        print(
            f"{name}: peak {force_n.max():.2f} N, pull {max(-force_n.min(), 0):.3g} N, energy out {max(-energy['port_lowest_j'], 0) * 1e3:.4f} mJ "
            f"at most and {max(-energy['port_end_j'], 0) * 1e3:.4f} mJ in {seconds:.0f} s"
        )
    with tempfile.TemporaryDirectory() as folder:
        direct = Path(folder) / "direct.py"
        direct.write_text(DIRECT)
        for hand, device in LOADS.items():
            by_contacts, by_force = largest(FILE, device), largest(direct, device)
            print(f"{hand} hand: at rest up to {by_contacts:.0f} N/m by contacts, {by_force:.0f} N/m by force: {by_contacts / by_force:.1f} times")
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
