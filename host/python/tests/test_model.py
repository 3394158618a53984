"""The wheel against the command: same bits; and what a user gets wrong."""

import csv
import io
import os
import shutil
import subprocess

import numpy as np
import pytest

import flotor


def poses(count=200, seed=1):
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, (count, 6)) * [4e-3, 4e-3, 6e-3, 0.05, 0.05, 0.05]


def test_a_pressed_spring_pushes_back_along_its_axis():
    up = flotor.Model("spring").evaluate([[0, 0, -0.005, 0, 0, 0]])
    assert up.force_n[0, 2] > 0 and up.force_n[0, :2].tolist() == [0, 0]
    assert up.status == ["ok"]


@pytest.mark.parametrize("variant", ["thesis", "closed-form", "current-length", "energy"])
def test_same_bits_as_the_command(variant, tmp_path):
    command = os.environ.get("FLOTOR") or shutil.which("flotor")
    if command is None:
        pytest.skip("no `flotor` on the PATH and FLOTOR is not set")
    rows = poses()
    rows[3, 1] = np.nan
    header = "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad"
    file = tmp_path / "poses.csv"
    file.write_text("\n".join([header] + [",".join(map(repr, map(float, row))) for row in rows]) + "\n")
    arguments = [command, "eval", "--model", "spring", "--set", f"variant={variant}", "--poses", file, "--out", "-"]
    printed = subprocess.run(arguments, check=True, capture_output=True, text=True).stdout
    result = flotor.Model("spring", variant=variant).evaluate(rows)
    for line, force, torque, status in zip(
        csv.DictReader(io.StringIO(printed)), result.force_n, result.torque_nm, result.status, strict=True
    ):
        assert [float(line[f"f{axis}_n"]) for axis in "xyz"] == force.tolist()
        assert [float(line[f"t{axis}_nm"]) for axis in "xyz"] == torque.tolist()
        assert line["status"] == status


def test_a_batch_is_stepped_where_it_lies():
    model = flotor.Model("spring")
    inputs = model.inputs(poses())
    outputs = np.empty(len(inputs), flotor.OUTPUT)
    returned = model.step_batch(inputs, outputs)
    assert returned is outputs
    single = model.step_batch(inputs[7:8])
    assert single["force_n"][0].tolist() == outputs["force_n"][7].tolist()
    every_other = inputs[::2]
    with pytest.raises((flotor.FlotorError, ValueError, TypeError)):
        model.step_batch(every_other, np.empty(len(every_other), flotor.OUTPUT))
    with pytest.raises(flotor.FlotorError, match="inputs and room"):
        model.step_batch(inputs, outputs[:-1])
    with pytest.raises(TypeError):
        model.step_batch(np.zeros(3), outputs[:3])


def test_an_array_that_is_not_aligned_is_refused():
    model = flotor.Model("spring")
    inputs = model.inputs(poses())
    memory = bytearray(inputs.nbytes + 1)
    odd = np.frombuffer(memory, flotor.INPUT, offset=1)
    odd[:] = inputs
    with pytest.raises(flotor.FlotorError, match="multiple of 8 bytes"):
        model.step_batch(odd, np.empty(len(odd), flotor.OUTPUT))
    odd = np.frombuffer(bytearray(len(inputs) * 64 + 1), flotor.OUTPUT, offset=1)
    with pytest.raises(flotor.FlotorError, match="multiple of 8 bytes"):
        model.step_batch(inputs, odd)


def test_records_have_the_contract_s_size():
    assert flotor.INPUT.itemsize == 136
    assert flotor.OUTPUT.itemsize == 64


def test_a_live_parameter_changes_the_force():
    model = flotor.Model("spring", preset="thesis-1")
    inputs = model.inputs([[0, 0, -0.005, 0, 0, 0]])
    soft = model.step_batch(inputs)["force_n"][0, 2]
    model["gamma_n"] = 2 * model["gamma_n"]
    assert model.step_batch(inputs)["force_n"][0, 2] == pytest.approx(2 * soft, rel=1e-12)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (dict(id="sprung"), "did you mean `spring`"),
        (dict(id="spring", gama_n=3), "did you mean `gamma_n`"),
        (dict(id="spring", gamma_n=-1), "legal is"),
        (dict(id="spring", variant="exact"), "legal is"),
        (dict(id="simulated"), "device"),
        (dict(id="spring", variant=True), "no value of a parameter"),
    ],
)
def test_what_is_wrong_is_said(arguments, words):
    with pytest.raises(flotor.FlotorError, match=words):
        flotor.Model(**arguments)


def test_poses_of_another_shape_are_refused():
    with pytest.raises(flotor.FlotorError, match=r"\(n, 6\)"):
        flotor.Model("spring").evaluate(np.zeros((4, 3)))
