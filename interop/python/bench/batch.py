"""What the way through Python costs: a million poses in one batch, against the same call from Rust.

    cargo build --release --example batch_seconds && python bench/batch.py
"""

import os
import subprocess
import time
from pathlib import Path

import numpy as np

import flotor

POSES, ROUNDS, ALTERNATIONS = 1_000_000, 5, 4


def main():
    model = flotor.Model("spring")
    phase = np.arange(POSES) * 1e-3
    poses = np.zeros((POSES, 6))
    poses[:, 0] = 1e-3 * np.cos(phase)
    poses[:, 2] = -5e-3 + 5e-3 * np.sin(phase)
    poses[:, 4] = 0.01 * np.sin(phase)
    inputs = model.inputs(poses)
    outputs = np.empty(POSES, flotor.OUTPUT)

    target = Path(os.environ.get("CARGO_TARGET_DIR", Path(__file__).parent.parent / "target"))
    program = target / "release/examples/batch_seconds"
    if not program.is_file():
        raise SystemExit(f"there is no {program}; in interop/python, `cargo build --release --example batch_seconds` builds it")
    yardstick = [program, model.path, str(POSES), str(ROUNDS)]
    rust_s, python_s = np.inf, np.inf
    for _ in range(ALTERNATIONS):  # alternating, so that a slow spell of the machine hits both
        rust_s = min(rust_s, float(subprocess.run(yardstick, check=True, capture_output=True, text=True).stdout))
        for _ in range(ROUNDS):
            started = time.perf_counter()
            model.step_batch(inputs, outputs)
            python_s = min(python_s, time.perf_counter() - started)
    print(f"{POSES} poses: Rust {rust_s * 1e3:.1f} ms, Python {python_s * 1e3:.1f} ms, ratio {python_s / rust_s:.3f}")


if __name__ == "__main__":
    main()
