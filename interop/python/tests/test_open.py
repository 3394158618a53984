"""Runs that a program is part of: live, in lockstep, saved and restored, and their ends."""

import gc
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import flotor

PRESS = {
    "device": {"plugin": "simulated", "parameters": {"hand": "press", "hand_depth_mm": 4}},
    "model": [{"name": "coil", "plugin": "spring"}],
}


def pressed(plugin, device=None, **parameters):
    """A scene whose hand presses into a model, and slides."""
    return {
        "device": {"plugin": "simulated", "parameters": {"hand": "press", "hand_depth_mm": 5, "hand_rise_s": 0.3, **(device or {})}},
        "model": [{"name": "it", "plugin": plugin, "parameters": parameters}],
    }


def trace(run, ticks):
    """Position, force and events of each tick, as bytes."""
    rows = []
    for _ in range(ticks):
        state = run.step()
        rows.append((state.tick, state.position_m.tobytes(), state.commanded_force_n.tobytes(), state.events))
    return rows


def test_a_live_loop_keeps_its_rate_while_python_is_busy():
    with flotor.open(PRESS) as run:
        assert run.devices == ["device"] and run.models == ["coil"] and run.period_s == 1e-3
        first, end = run.state.tick, time.monotonic() + 0.6
        while time.monotonic() < end:
            sum(range(2_000_000))  # holds the interpreter's lock
            gc.collect()
        state = run.state
        assert state.tick - first > 100 and run.running
        assert state.time_ns % 1_000_000 == 0 and state.position_m.shape == (3,)
        assert "State(tick " in repr(state) and "running" in repr(run)
    assert not run.running
    assert run.summary["end"] == "stopped" and run.summary["ticks"] > 100
    assert run.close() is run.summary, "a second close changes nothing"


def test_the_times_of_a_run_are_those_of_the_clock():
    with flotor.open(PRESS) as run:
        offsets_ns = [run.clock_offset_ns() for _ in range(5)]
        now_ns = time.monotonic_ns() - min(offsets_ns) - run.state.time_ns
        print(f"offsets of the clock within {(max(offsets_ns) - min(offsets_ns)) * 1e-3:.0f} us")
        assert -1_000_000 < now_ns < 200_000_000, "the newest tick is of now, on a machine that may be busy"
        assert sorted(offsets_ns)[2] - min(offsets_ns) < 1_000_000, "most of them agree within a tick"


def test_parameters_weights_and_models_change_while_the_loop_runs():
    with flotor.open(PRESS, clock="virtual") as run:
        before = run.step(500).commanded_force_n[2]
        run.set({"coil.gamma_n": 40.0}, at_once=True)
        assert run.step(300).commanded_force_n[2] > before
        run.set(coil={"gamma_n": 20})
        run.set_weight("coil", 0)
        assert run.step(300).commanded_force_n[2] == 0
        run.set_weight("coil", 1)
        run.swap("coil", "wall", stiffness_n_per_m=500)
        assert run.step(300).commanded_force_n[2] > 0
        for call, words in [
            (lambda: run.set({"coil.gamma": 3}), "`coil` has no|unknown|no parameter"),
            (lambda: run.set(gamma_n=3), "names no parameter"),
            (lambda: run.set_weight("foil", 1), "no plugin `foil`; did you mean `coil`"),
            (lambda: run.swap("coil", "wal"), "model unchanged"),
            (lambda: run.state_of("left"), "the devices are device"),
        ]:
            with pytest.raises(flotor.FlotorError, match=words):
                call()


def test_equal_calls_give_equal_bits_and_the_whole_run_those_of_run():
    with flotor.open(PRESS, clock="virtual", duration_s=0.5, seed=3) as run:
        run.step(500)
    assert run.summary["trace_digest"] == flotor.run(PRESS, duration_s=0.5, seed=3)["trace_digest"]


MODELS = [
    ("spring", {"preset": "thesis-1"}),
    ("spring", {"variant": "thesis"}),
    ("spring", {"seat": "free", "seat_friction": 0.2}),
    ("wall", {"friction": 0.5}),
    ("load", {"kind": "exerted"}),
    ("measured", {}),
    ("membrane", {}),
    ("solid", {"friction": 0.4, "body": "half-space"}),
    ("surface", {"static_friction": 0.5, "kinetic_friction": 0.4}),
]


@pytest.mark.parametrize(("model", "parameters"), MODELS)
@pytest.mark.parametrize("preset", ["plain", "full"])
def test_a_restored_run_has_the_bits_of_the_run_that_went_on(model, parameters, preset):
    with flotor.open(pressed(model, {"preset": preset}, **parameters), clock="virtual", seed=2) as run:
        start = trace(run, 60)
        run.step(220)
        saved = run.save()
        went_on = trace(run, 150)
        for _ in range(2):
            run.restore(saved)
            assert trace(run, 150) == went_on
        assert run.reset().tick == saved_tick(went_on) + 150 - 1, "the state is of the last tick until the next step"
        assert trace(run, 60) == start
        assert any(force != bytes(24) for _, _, force, _ in went_on), "the hand touches it"


def saved_tick(rows):
    return rows[0][0]


def test_a_restore_takes_back_parameters_and_their_movement():
    with flotor.open(PRESS, clock="virtual") as run:
        run.step(300)
        run.set({"coil.gamma_n": 30.0})
        run.step(5)
        saved = run.save()
        went_on = trace(run, 100)
        run.set({"coil.gamma_n": 12.0}, at_once=True)
        run.set_weight("coil", 0.2)
        run.step(50)
        run.restore(saved)
        assert trace(run, 100) == went_on


def test_what_cannot_be_saved_says_why(tmp_path):
    with flotor.open(PRESS, clock="virtual") as run, flotor.open(PRESS, clock="virtual") as other:
        with pytest.raises(flotor.FlotorError, match="another run has saved it"):
            other.restore(run.save())
        run.swap("coil")
        run.step(5)
        with pytest.raises(flotor.FlotorError, match="a replacement of `coil` is fading in"):
            run.save()
    with flotor.open(PRESS, clock="virtual", record=tmp_path / "run.mcap") as run:
        run.step(5)
        with pytest.raises(flotor.FlotorError, match="a recording cannot go back"):
            run.restore(run.save())
    with flotor.open(PRESS) as run:
        for call in (run.save, run.reset, run.step):
            with pytest.raises(flotor.FlotorError, match="real clock"):
                call()


def test_a_run_ends_with_its_duration_and_goes_on_after_a_reset():
    with flotor.open(PRESS, clock="virtual", duration_s=0.2) as run:
        assert run.step(200).tick == 199
        with pytest.raises(flotor.FlotorError, match="has ended"):
            run.step()
        run.reset()
        assert run.step(10).tick == 9
        with pytest.raises(flotor.FlotorError, match="virtual time"):
            run.wait()
    with flotor.open(PRESS, duration_s=0.3) as run:
        assert run.wait(0.01) is None
        assert run.wait()["end"] == "finished"


def model_that(tmp_path, habit):
    """A model in C that does something else in a step."""
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    root, library = Path(__file__).parents[3], tmp_path / "libhabit.so"
    source, include = root / "tests" / "c" / "model_that.c", root / "hal" / "include"
    subprocess.run([compiler, "-shared", "-fPIC", "-I", include, f"-DIN_STEP={habit}", source, "-o", library], check=True)
    return {"device": {"plugin": "simulated"}, "model": [{"name": "jelly", "plugin": library, "isolation": "none"}]}


@pytest.mark.parametrize("clock", ["real", "virtual"])
def test_a_model_that_answers_nan_fails_the_run_with_the_sentence_of_the_command(tmp_path, clock):
    habit = "if (input->tick >= 70) { output->wrench.force_n[0] = NAN; return FlotorCallStatus_Ok; }"
    with pytest.raises(flotor.RunFailed, match=r"libhabit\.so: `jelly` .* not finite") as failed:
        with flotor.open(model_that(tmp_path, habit), clock=clock, duration_s=0.2) as run:
            run.step(200) if clock == "virtual" else run.wait()
    assert failed.value.exit_code == 3 and run.summary == failed.value.summary == run.close()
    assert failed.value.summary["plugins"][1]["health"] != "ok"
    assert failed.value.summary["end"] in ("finished", "stopped")


def test_a_device_that_fails_ends_the_run_with_its_sentence_and_code():
    faulty = pressed("spring", {"preset": "full", "fault": "over-temperature", "fault_time_s": 0.05})
    with pytest.raises(flotor.RunFailed, match="device fault: ") as failed:
        with flotor.open(faulty, clock="virtual") as run:
            run.step(500)
    assert failed.value.exit_code == 4 and failed.value.summary["ticks"] < 100


def test_an_emergency_stop_is_an_error_with_its_code(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))  # the latch of the machine is not this test's
    with pytest.raises(flotor.RunFailed, match="emergency stop") as failed:
        with flotor.open(PRESS, clock="virtual") as run:
            run.step(20)
            run.emergency_stop()
            run.step(20)
    assert failed.value.exit_code == 4 and failed.value.summary["end"] == "emergency_stop"


@pytest.mark.parametrize(
    ("scene", "code", "words"),
    [
        ({"title": "x", "devize": 1}, 2, "scene:2: unknown key"),
        ("[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"sprung\"\n", 2, "no model plugin `sprung`"),
        (pressed("spring", gamma_n="NaN"), 2, "gamma_n"),
    ],
)
def test_a_refusal_has_the_code_of_the_command(scene, code, words):
    for call in (flotor.run, flotor.open):
        with pytest.raises(flotor.FlotorError, match=words) as refused:
            call(scene)
        assert refused.value.exit_code == code


def test_an_exception_in_the_block_ends_the_run_in_order_and_the_recording_is_whole(tmp_path):
    file = tmp_path / "run.mcap"
    with pytest.raises(ZeroDivisionError):
        with flotor.open(PRESS, record=file) as run:
            time.sleep(0.3)
            1 / 0
    assert run.summary["end"] == "stopped"
    recording = flotor.read_recording(file)
    assert recording.finished and len(recording) == run.summary["ticks"] > 50
    assert recording.event("releasing").any() and np.allclose(recording["commanded_force_n"][-1], 0, atol=0.05)


@pytest.mark.parametrize("program", ["run.wait()", "import time; time.sleep(60)", "while True: run.state"])
def test_ctrl_c_ends_the_run_in_order(tmp_path, program):
    file = tmp_path / "run.mcap"
    source = (
        "import sys, flotor\n"
        f"with flotor.open(sys.argv[1], record=sys.argv[2]) as run:\n    print('on', flush=True)\n    {program}\n"
    )
    scene = tmp_path / "scene.toml"
    scene.write_text('[device]\nplugin = "simulated"\n[[model]]\nplugin = "spring"\n')
    process = subprocess.Popen([sys.executable, "-c", source, scene, file], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "on\n"
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert errors.rstrip().endswith("KeyboardInterrupt"), errors
    recording = flotor.read_recording(file)
    assert recording.finished and recording.event("releasing").any()


def test_a_run_that_nobody_closes_ends_in_order_with_the_interpreter(tmp_path):
    file = tmp_path / "run.mcap"
    source = "import sys, time, flotor\nrun = flotor.open(record=sys.argv[1])\ntime.sleep(0.3)\n"
    subprocess.run([sys.executable, "-c", source, file], check=True, timeout=60)
    recording = flotor.read_recording(file)
    assert recording.finished and recording.event("releasing").any()


def test_any_thread_may_use_a_run():
    with flotor.open(PRESS, clock="virtual") as run:
        errors = []

        def work():
            try:
                for _ in range(50):
                    run.step(3)
                    run.set({"coil.gamma_n": 20.0}, at_once=True)
                    run.state
            except Exception as error:  # noqa: BLE001  (told below)
                errors.append(error)

        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not errors and run.state.tick == 4 * 50 * 3 - 1


def test_the_command_of_the_wheel_is_the_whole_program(tmp_path):
    command = Path(sys.executable).with_name("flotor")
    if not command.exists():
        pytest.skip("the wheel is not installed")
    out = tmp_path / "run.json"
    bare = {"PATH": "/usr/bin", "HOME": str(tmp_path)}
    subprocess.run([command, "run", "wall", "--clock", "virtual", "--json", out], check=True, env=bare, timeout=60)
    assert __import__("json").loads(out.read_text())["peak_force_n"] > 0
    listed = subprocess.run([command, "plugins"], check=True, env=bare, capture_output=True, text=True).stdout
    assert all(id in listed for id in ("spring", "solid", "simulated", "maglev"))


def test_a_program_pushes_through_the_limits_and_its_force_fades_when_it_hangs():
    scene = {"device": {"plugin": "simulated", "parameters": {"hand": "hold"}}, "limits": {"force_n": 2}}
    with flotor.open(scene, clock="virtual", program=True) as run:
        run.step(300)
        for _ in range(40):
            run.push((0, 0, 5))
            state = run.step(10)
        assert 1.9 < state.commanded_force_n[2] <= 2 and "force_limited" in state.events
        force_n = [run.step().commanded_force_n[2] for _ in range(300)]
        assert abs(force_n[-1]) < 1e-9 and max(abs(np.diff(force_n))) < 0.3, "it fades"
        with pytest.raises(flotor.FlotorError, match="NaN|finite"):
            run.push((0, 0, float("nan")))
    with flotor.open(scene, clock="virtual") as run:
        with pytest.raises(flotor.FlotorError, match="program=True"):
            run.push((0, 0, 1))
