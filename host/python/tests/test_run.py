"""Virtual runs and recordings."""

import numpy as np
import pytest

import flotor


def test_equal_arguments_equal_runs():
    first, second = (flotor.run(duration_s=0.5, seed=3) for _ in range(2))
    assert first["trace_digest"] == second["trace_digest"]
    other = flotor.run(duration_s=0.5, seed=3, settings={"spring.variant": "closed-form"})
    assert other["trace_digest"] != first["trace_digest"]


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
