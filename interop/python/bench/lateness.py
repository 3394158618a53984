"""Lateness of a live loop beside a busy Python: `python bench/lateness.py [SECONDS_OF_A_PART] [PARTS]`.

The same load, in turns, in the process of the run and in one that does not know Flotor: the interpreter's lock held for 50 ms at a time,
the garbage collector, and 100 changes of a parameter a second. Prints the 99th percentile of the lateness for each, and their ratio:
at most 1.2 is the bound. The lateness of every tick comes from the recording.
"""

import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

SCENE = {
    "device": {"plugin": "simulated"},
    "model": [{"name": "coil", "plugin": "spring"}],
}
#: Additions that hold the interpreter's lock for about 50 ms; `calibrate` fits the number to the machine.
HELD_S = 0.05


def calibrate():
    """Returns a number of which `sum(range(number))`, one call in C, holds the lock for 50 ms."""
    number = 1_000_000
    started = time.perf_counter()
    sum(range(number))
    return int(number * HELD_S / (time.perf_counter() - started))


def load(until, set_parameter):
    """Holds the lock, collects garbage, and sets a parameter 100 times a second, in three threads."""
    import gc

    number = calibrate()

    def hold():
        while time.monotonic() < until:
            sum(range(number))

    def collect():
        while time.monotonic() < until:
            rings = [[] for _ in range(20_000)]
            for ring in rings:
                ring.append(ring)
            del rings
            gc.collect()

    def change():
        turn = 0
        while time.monotonic() < until:
            set_parameter(20.0 + turn % 2)
            turn += 1
            time.sleep(0.01)

    threads = [threading.Thread(target=each) for each in (hold, collect, change)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def inside(file, seconds):
    """The run and the load in one process."""
    import flotor

    with flotor.open(SCENE, record=file) as run:
        load(time.monotonic() + seconds, lambda value: run.set({"coil.gamma_n": value}))


def outside(file, seconds):
    """The run alone, its Python idle; the load in another process, whose changes go nowhere."""
    import flotor

    with flotor.open(SCENE, record=file):
        subprocess.run([sys.executable, __file__, "load", str(seconds)], check=True)


def main(seconds, parts):
    import numpy as np

    import flotor

    lateness_us = {"inside": [], "outside": []}
    with tempfile.TemporaryDirectory() as folder:
        for part in range(parts):
            for where in ("inside", "outside") if part % 2 == 0 else ("outside", "inside"):
                file = Path(folder) / f"{where}-{part}.mcap"
                subprocess.run([sys.executable, __file__, where, str(file), str(seconds)], check=True)
                lateness_us[where].append(flotor.read_recording(file)["lateness_ns"] * 1e-3)
    p99 = {}
    for where, each in lateness_us.items():
        every = np.concatenate(each)
        p99[where] = np.percentile(every, 99)
        parts_us = ", ".join(f"{np.percentile(one, 99):.0f}" for one in each)
        print(f"load {where} the process of the run: p99 {p99[where]:.1f} us of {len(every)} ticks (parts: {parts_us})")
    print(f"ratio {p99['inside'] / p99['outside']:.3f}, bound 1.2")


if sys.argv[1:2] == ["inside"]:
    inside(sys.argv[2], float(sys.argv[3]))
elif sys.argv[1:2] == ["outside"]:
    outside(sys.argv[2], float(sys.argv[3]))
elif sys.argv[1:2] == ["load"]:
    load(time.monotonic() + float(sys.argv[2]), lambda value: None)
else:
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0, int(sys.argv[2]) if len(sys.argv) > 2 else 6)
