"""Models in Python (plugin `python`): in a run, and what may happen to them there."""

import os
import signal
import time

import pytest

import flotor

WALL = """
import os, time
from flotor_model import Contact

def contacts(handle):
    {before}
    return Contact((0, 0, 1), handle.position_m[2], 800, 2)
"""


def scene(tmp_path, before="pass", rate_hz=200):
    file = tmp_path / "model.py"
    file.write_text(WALL.format(before=before))
    return {
        "device": {"plugin": "simulated", "parameters": {"hand": "press", "hand_depth_mm": 4, "hand_rise_s": 0.3}},
        "model": [{"name": "it", "plugin": "python", "parameters": {"file": file}, "field": {"rate_hz": rate_hz}}],
    }


def test_a_function_in_python_is_felt_as_the_wall_of_the_loop(tmp_path):
    summary = flotor.run(scene(tmp_path), duration_s=1)
    wall = scene(tmp_path)
    wall["model"] = [{"plugin": "wall", "parameters": {"stiffness_n_per_m": 800, "damping_ns_per_m": 2}}]
    assert summary["peak_force_n"] == pytest.approx(flotor.run(wall, duration_s=1)["peak_force_n"], rel=0.05)
    assert flotor.run(scene(tmp_path), duration_s=1)["trace_digest"] == summary["trace_digest"]
    assert summary["energy"]["port_lowest_j"] > -1e-4


def test_it_runs_beside_a_live_loop(tmp_path):
    with flotor.open(scene(tmp_path)) as run:
        time.sleep(0.8)
        assert run.state.commanded_force_n[2] > 0.5
        run.set({"it.value_1": 3})


@pytest.mark.parametrize(
    "before",
    [
        "assert handle.time_s < 0.3, 'not any more'",
        "handle.time_s < 0.3 or os.kill(os.getpid(), 9)",
        "handle.time_s < 0.3 or time.sleep(60)",
        "handle.time_s < 0.3 or os._exit(0)",
    ],
)
@pytest.mark.parametrize("clock", ["real", "virtual"])
def test_a_model_that_fails_loses_its_force_and_the_run_ends_in_order(tmp_path, before, clock):
    file = tmp_path / "run.mcap"
    with pytest.raises(flotor.RunFailed, match="`it` ") as failed:
        with flotor.open(scene(tmp_path, before), clock=clock, duration_s=1.2, record=file) as run:
            run.step(1200) if clock == "virtual" else run.wait()
    assert failed.value.exit_code == 3 and failed.value.summary["end"] in ("finished", "stopped")
    recording = flotor.read_recording(file)
    force_n, times_s = recording["commanded_force_n"][:, 2], recording["time_ns"] * 1e-9
    assert recording.finished and force_n.max() > 0.1, "it was felt before"
    assert abs(force_n[times_s > 1.1]).max() < 1e-3, "its force has faded"
    steps_n = abs(force_n[1:] - force_n[:-1])
    assert steps_n.max() < 0.5, "without a jump"


def test_a_slow_collection_of_garbage_is_not_felt(tmp_path):
    with flotor.open(scene(tmp_path, "time.sleep(0.02) if handle.time_s % 0.2 < 0.006 else None"), duration_s=1.0) as run:
        run.wait()
    assert run.summary["end"] == "finished"


def test_a_file_that_does_not_load_is_refused_with_its_exception(tmp_path):
    with pytest.raises(flotor.FlotorError, match="not today") as refused:
        flotor.run(scene(tmp_path, "pass\nraise ValueError('not today')\ndef other():\n    pass"))
    assert refused.value.exit_code == 3
    missing = scene(tmp_path)
    missing["model"][0]["parameters"]["file"] = tmp_path / "none.py"
    with pytest.raises(flotor.FlotorError, match="none.py"):
        flotor.run(missing)


def test_the_built_in_floor_needs_no_interpreter(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOTOR_PYTHON", str(tmp_path / "no-python"))
    floor = scene(tmp_path)
    floor["model"][0]["parameters"] = {"file": "floor"}
    assert flotor.run(floor, duration_s=1)["peak_force_n"] > 1


def test_no_interpreter_is_left_behind(tmp_path):
    before = "open(os.path.join(os.path.dirname(__file__), 'process'), 'w').write(str(os.getpid()))"
    with flotor.open(scene(tmp_path, before)) as run:
        time.sleep(0.4)
        process = int((tmp_path / "process").read_text())
        os.kill(process, 0)
        # Ctrl-C in a terminal reaches the interpreter, too; the host ends it.
        os.kill(process, signal.SIGINT)
        time.sleep(0.2)
        os.kill(process, 0)
        assert run.running
    until = time.monotonic() + 5
    while time.monotonic() < until and os.path.exists(f"/proc/{process}"):
        time.sleep(0.02)
    assert not os.path.exists(f"/proc/{process}")
