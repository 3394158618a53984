"""Sweeps: the same bytes from every executor, and nothing lost with a killed worker or driver."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import flotor

PLAN = """
title = "test"
block = 64
[ask]
kind = "eval"
model = "spring"
[[axis]]
key = "variant"
words = ["energy", "closed-form"]
[[axis]]
key = "z_m"
from = -0.012
to = 0.004
steps = 512
"""

RUNS = (Path(__file__).parent / "runs.plan").read_text()


@pytest.fixture
def plan(tmp_path):
    file = tmp_path / "plan.toml"
    file.write_text(PLAN)
    return file


def test_every_executor_leaves_the_same_bytes(plan, tmp_path):
    here = flotor.sweep.run(plan, tmp_path / "threads").read_bytes()
    command = os.environ.get("FLOTOR_SWEEP") or shutil.which("flotor-sweep")
    if command:
        environment = {**os.environ, "FLOTOR_PLUGIN_PATH": os.path.dirname(flotor.Model("spring").path)}
        subprocess.run([command, plan, "--out", tmp_path / "command"], check=True, env=environment)
        assert (tmp_path / "command" / "results.parquet").read_bytes() == here
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            there = flotor.sweep.run(plan, tmp_path / "dask", flotor.sweep.dask(client)).read_bytes()
    assert there == here


def test_rows_are_what_the_model_answers(plan, tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    table = pandas.read_parquet(flotor.sweep.run(plan, tmp_path / "out"))
    assert len(table) == 1024 and set(table.variant) == {"energy", "closed-form"}
    energy = table[table.variant == "energy"]
    poses = [[0, 0, z, 0, 0, 0] for z in energy.z_m]
    assert flotor.Model("spring").evaluate(poses).force_n[:, 2].tolist() == energy.fz_n.tolist()


def test_a_killed_worker_loses_nothing(tmp_path):
    distributed = pytest.importorskip("distributed")
    plan = tmp_path / "plan.toml"
    plan.write_text(RUNS.format(seeds=[1, 2], duration_s=20, steps=20))
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            pids = client.run(os.getpid)
            killed = []

            def kill_once(do, numbers):
                futures = client.map(do, list(numbers), pure=False)
                distributed.wait(futures[:3])
                killed.append(list(pids.values())[0])
                os.kill(killed[0], signal.SIGKILL)
                client.gather(futures)

            survived = flotor.sweep.run(plan, tmp_path / "killed", kill_once).read_bytes()
    assert killed
    assert flotor.sweep.run(plan, tmp_path / "whole").read_bytes() == survived


def test_a_killed_driver_goes_on_where_it_was(tmp_path):
    plan, out = tmp_path / "plan.toml", tmp_path / "out"
    plan.write_text(RUNS.format(seeds=[1, 2], duration_s=20, steps=40))
    script = f"import flotor; flotor.sweep.run({str(plan)!r}, {str(out)!r}, flotor.sweep.threads(1))"
    driver = subprocess.Popen([sys.executable, "-c", script])
    deadline = time.monotonic() + 60
    while len(list(out.glob("tasks/*.json"))) < 5 and driver.poll() is None and time.monotonic() < deadline:
        time.sleep(0.002)
    driver.kill()
    driver.wait()
    finished = {file: file.stat().st_mtime_ns for file in out.glob("tasks/*.json")}
    assert 5 <= len(finished) < 80
    resumed = flotor.sweep.run(plan, out).read_bytes()
    assert all(file.stat().st_mtime_ns == before for file, before in finished.items()), "done again"
    assert flotor.sweep.run(plan, tmp_path / "whole").read_bytes() == resumed


def test_a_damaged_task_is_done_again(plan, tmp_path):
    whole = flotor.sweep.run(plan, tmp_path / "out").read_bytes()
    victim = sorted((tmp_path / "out" / "tasks").glob("*.json"))[0]
    victim.write_bytes(victim.read_bytes()[:-7])
    assert flotor.sweep.run(plan, tmp_path / "out").read_bytes() == whole


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"z_m"', '"gama_n"', "did you mean"),
        ('model = "spring"', 'model = "sprung"', "did you mean `spring`"),
        ("steps = 512", "step = 512", "unknown field"),
        ("from = -0.012", "from = 1", "`from` below `to`"),
        ("block = 64", "block = 0", "write 1 or more"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(plan, tmp_path, old, new, words):
    plan.write_text(PLAN.replace(old, new))
    with pytest.raises(flotor.FlotorError, match=words):
        flotor.sweep.run(plan, tmp_path / "out")
    assert not (tmp_path / "out" / "results.parquet").exists()
