"""Runs that somebody else has started."""

import subprocess
import sys
import time

import pytest

import flotor

HOST = """
import sys, flotor
scene = {"title": "of somebody else", "device": {"plugin": "simulated", "parameters": {"hand": "press"}},
         "model": [{"name": "coil", "plugin": "spring"}]}
with flotor.open(scene) as run:
    print(run.state.tick, flush=True)
    run.wait()
print(run.summary["end"])
"""


@pytest.fixture
def host(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    process = subprocess.Popen([sys.executable, "-c", HOST], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline()
    yield process
    process.kill()
    process.wait()


def test_a_run_of_another_program_is_read_changed_and_ended(host):
    with flotor.join() as run:
        assert run.title == "of somebody else" and run.process == host.pid and run.running
        assert run.devices == ["device"] and run.models == ["coil"] and "of somebody else" in repr(run)
        first = run.state.tick
        time.sleep(0.3)
        assert run.state.tick > first + 50 and run.state_of("device").position_m.shape == (3,)
        run.set({"coil.gamma_n": 20})
        run.set_weight("coil", 0.5)
        run.swap("coil", "wall", stiffness_n_per_m=500)
        for call, words in [
            (lambda: run.set({"coil.gamma": 3}), "gamma"),
            (lambda: run.swap("coil", "wal"), "no model plugin `wal`|pending"),
            (lambda: run.state_of("left"), "the devices are device"),
        ]:
            with pytest.raises(flotor.FlotorError, match=words):
                call()
        assert run.wait(0.01) is None
        run.stop()
        assert run.wait(10) is not None and not run.running
        with pytest.raises(flotor.FlotorError):
            run.set({"coil.gamma_n": 20})
    out, errors = host.communicate(timeout=20)
    assert out == "stopped\n", errors


def test_who_leaves_leaves_the_run_as_it_is(host):
    with flotor.join(host.pid, every=10) as run:
        assert run.state.tick % 10 == 0
    with flotor.join() as again:
        assert again.running


def test_without_a_run_there_is_nothing_to_join(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(flotor.FlotorError, match="no running session"):
        flotor.join()
