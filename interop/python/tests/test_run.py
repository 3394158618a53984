"""Virtual runs and recordings."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flotor


def test_equal_arguments_equal_runs():
    first, second = (flotor.run(duration_s=0.5, seed=3) for _ in range(2))
    assert first["trace_digest"] == second["trace_digest"]
    other = flotor.run(duration_s=0.5, seed=3, settings={"spring.variant": "closed-form"})
    assert other["trace_digest"] != first["trace_digest"]


def test_settings_may_be_grouped_by_plugin():
    flat = flotor.run(duration_s=0.5, settings={"spring.gamma_n": 20, "device.preset": "full"})
    grouped = flotor.run(duration_s=0.5, settings={"spring": {"gamma_n": 20}, "device": {"preset": "full"}})
    assert grouped["trace_digest"] == flat["trace_digest"]


def test_a_scene_may_be_a_mapping(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(
        'title = "a \\"b\\""\n[device]\nplugin = "simulated"\n[device.parameters]\nhand = "press"\n'
        '[[model]]\nplugin = "wall"\n[model.parameters]\nstiffness_n_per_m = 1500\n[limits]\nforce_n = [2.5, 2.5, 2]\n'
    )
    scene = {
        "title": 'a "b"',
        "device": {"plugin": "simulated", "parameters": {"hand": "press"}},
        "model": [{"plugin": "wall", "parameters": {"stiffness_n_per_m": np.float64(1500)}}],
        "limits": {"force_n": (2.5, 2.5, 2)},
    }
    of_file, of_mapping = (flotor.run(each, duration_s=0.5) for each in (file, scene))
    assert of_mapping["trace_digest"] == of_file["trace_digest"] and of_mapping["peak_force_n"] == of_file["peak_force_n"]
    with pytest.raises(flotor.FlotorError, match="scene:2: unknown key"):
        flotor.run({"title": "x", "devize": 1})
    with pytest.raises(flotor.FlotorError, match="no place in a scene"):
        flotor.run({"title": None})


def scene_of(tmp_path, habit):
    """A scene with a model in C that does something else in a step."""
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    root, library, scene = Path(__file__).parents[3], tmp_path / "libhabit.so", tmp_path / "scene.toml"
    source = root / "tests" / "c" / "model_that.c"
    include = root / "hal" / "include"
    subprocess.run([compiler, "-shared", "-fPIC", "-I", include, f"-DIN_STEP={habit}", source, "-o", library], check=True)
    scene.write_text(
        f'duration_s = 0.2\n[device]\nplugin = "simulated"\n[[model]]\nname = "jelly"\nplugin = "{library}"\n'
    )
    return scene


def test_a_run_with_a_model_that_fails_is_an_error_with_the_summary(tmp_path):
    scene = scene_of(tmp_path, "if (input->tick >= 70) { output->wrench.force_n[0] = NAN; return FlotorCallStatus_Ok; }")
    with pytest.raises(flotor.RunFailed, match="`jelly` .* not finite") as failed:
        flotor.run(scene)
    assert failed.value.summary["ticks"] == 200
    assert failed.value.summary["plugins"][1]["health"] != "ok"


def test_events_have_names(tmp_path):
    file = tmp_path / "run.mcap"
    flotor.run(duration_s=0.5, record=file)
    recording = flotor.read_recording(file)
    ramping = recording.event("ramping")
    assert ramping[0] and not ramping[-1]
    with pytest.raises(flotor.FlotorError, match="unknown event 'ramp'; the events are stale_sample, "):
        recording.event("ramp")


def test_remedies_are_python(tmp_path):
    with pytest.raises(flotor.FlotorError, match=r"`flotor\.plugins\(\)` lists all"):
        flotor.Model("sprung-mattress")
    with pytest.raises(flotor.FlotorError, match=r"`flotor\.Model\(ID\)\.parameters` lists the parameters"):
        flotor.Model("spring", zzzzzz=3)


def test_a_recording_comes_back_as_a_table(tmp_path):
    file = tmp_path / "run.mcap"
    summary = flotor.run(duration_s=0.5, record=file)
    recording = flotor.read_recording(file)
    assert recording.finished and len(recording) == summary["ticks"] == 500
    assert np.array_equal(recording["time_ns"], np.arange(500) * 1_000_000)
    peak_n = np.linalg.norm(recording["commanded_force_n"], axis=1).max()
    assert peak_n == pytest.approx(summary["peak_force_n"], rel=1e-15)
    table = pytest.importorskip("pandas") and recording.to_pandas()
    assert table["position_m_z"].iloc[-1] == recording["position_m"][-1, 2]


def test_what_is_wrong_is_said(tmp_path):
    with pytest.raises(flotor.FlotorError, match="no plugin `sprung`"):
        flotor.run(settings={"sprung.gamma_n": 3})
    with pytest.raises(flotor.FlotorError, match="rate_hz"):
        flotor.run(rate_hz=5)
    with pytest.raises(flotor.FlotorError, match="cannot open"):
        flotor.read_recording(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("no recording at all")
    with pytest.raises(flotor.FlotorError, match="not an MCAP file"):
        flotor.read_recording(tmp_path / "text.mcap")


def test_a_step_that_does_not_return_is_an_error_with_its_plugin_and_tick(tmp_path):
    scene = scene_of(tmp_path, "if (input->tick == 70) for (;;) {}")
    # In a process of its own: its thread is left behind.
    program = [sys.executable, "-c", "import flotor, sys; flotor.run(sys.argv[1])", scene]
    ran = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert ran.returncode == 1, ran
    assert "RunFailed: `jelly` did not return from `step` in tick 70 within 1 s of processor time" in ran.stderr
