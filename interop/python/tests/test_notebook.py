"""The notebook runs as it is, cell after cell."""

import json
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "own_model.ipynb"


def test_every_cell_runs(tmp_path, monkeypatch):
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib").use("agg")
    monkeypatch.chdir(tmp_path)
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    slide = names["slide"]
    assert len(cells) > 10 and names["run"].summary["end"] == "stopped"
    beside, on = slide[slide.position_m_x < -0.007], slide[slide.position_m_x.abs() < 0.001]
    assert on.commanded_force_n_z.mean() > beside.commanded_force_n_z.mean() + 0.1, "the bump is felt"
    assert slide[slide.position_m_x.between(-0.006, -0.002)].commanded_force_n_x.mean() < 0, "uphill it pushes back"
    assert slide[slide.position_m_x.between(0.002, 0.006)].commanded_force_n_x.mean() > 0
