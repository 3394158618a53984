"""Environment steps per second, on all cores: `python bench/environments.py [ENVIRONMENTS] [SECONDS]`.

Prints the best of five parts of the time, and the steps per second of processor time: on a busy machine other programs have the rest.
"""

import itertools
import os
import sys
import time

import gymnasium

import flotor.environments

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 64
SECONDS = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
PARTS = 5


def per_second(step, worth, seconds):
    """Calls `step` for a time; returns what it is worth per second, of the best part, and per second of processor time."""
    best, calls_in_all, used_s = 0.0, 0, time.process_time()
    for _ in range(PARTS):
        calls, started = 0, time.perf_counter()
        while (elapsed := time.perf_counter() - started) < seconds / PARTS:
            step()
            calls += 1
        best, calls_in_all = max(best, calls * worth / elapsed), calls_in_all + calls
    return best, calls_in_all * worth / (time.process_time() - used_s)


envs = gymnasium.make_vec("flotor/Spring-v0", num_envs=COUNT, vectorization_mode="vector_entry_point")
envs.reset(seed=1)
actions = itertools.cycle([envs.action_space.sample() for _ in range(50)])
steps, of_processor = per_second(lambda: envs.step(next(actions)), COUNT, SECONDS)
cores = len(os.sched_getaffinity(0))
print(
    f"{COUNT} environments, {flotor.environments.TICKS} ticks a step, {cores} cores, load {os.getloadavg()[0]:.1f}: {steps:.0f} steps/s, "
    f"{of_processor:.0f} per second of processor time"
)
