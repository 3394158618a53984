"""What a second Dask worker brings: the same plan on one and on two workers.

    python bench/sweep.py [SECONDS]        (how long one worker takes, about; default 60)
"""

import sys
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster

import flotor

PLAN = (Path(__file__).parents[1] / "tests/runs.plan").read_text()


def wall_s(plan, out, workers):
    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            client.run(lambda: __import__("flotor") and None)  # importing is not what is measured
            started = time.perf_counter()
            table = flotor.sweep.run(plan, out, flotor.sweep.dask(client))
            return time.perf_counter() - started, table.read_bytes()


def main():
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    probe = flotor.run(duration_s=200.0)  # virtual seconds a real second
    duration_s = round(seconds / 40 * 200.0 / probe["wall_s"], 1)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        plan = folder / "plan.toml"
        plan.write_text(PLAN.format(seeds=[1], duration_s=duration_s, steps=40))
        one_s, one = wall_s(plan, folder / "one", 1)
        two_s, two = wall_s(plan, folder / "two", 2)
    print(f"40 runs of {duration_s} s: one worker {one_s:.1f} s, two {two_s:.1f} s, {one_s / two_s:.2f} times faster")
    print("tables", "identical" if one == two else "DIFFER")


if __name__ == "__main__":
    main()
