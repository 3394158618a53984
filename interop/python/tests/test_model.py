"""The wheel against the command: same bits; and what a user gets wrong."""

import csv
import io
import os
import shutil
import signal
import subprocess
import threading
import time

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


def columns(rows):
    return {name: rows[:, index] for index, name in enumerate(["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"])}


def test_columns_with_names_go_by_name():
    rows = poses(20)
    expected = flotor.Model("spring").evaluate(rows).force_n
    other_order = dict(reversed(columns(rows).items()))
    records = np.rec.fromarrays(list(other_order.values()), names=list(other_order))
    tables = [other_order, other_order | {"id": np.arange(20)}, records]
    for module in ["pandas", "polars"]:
        try:
            tables.append(__import__(module).DataFrame(other_order))
        except ImportError:
            print(f"skipped: {module}")
    for table in tables:
        assert flotor.Model("spring").evaluate(table).force_n.tolist() == expected.tolist()


def test_other_column_names_are_refused():
    rows = poses(20)
    millimetres = {name.replace("z_m", "z_mm"): column for name, column in columns(rows).items()}
    for table in [millimetres, columns(rows) | {"w": rows[:, 0]}, {"x_m": rows[:, 0]}]:
        with pytest.raises(flotor.FlotorError, match="they must be x_m, y_m, z_m, rx_rad, ry_rad, rz_rad"):
            flotor.Model("spring").evaluate(table)


def test_a_masked_number_is_no_number():
    rows = poses(4)
    masked = np.ma.array(rows, mask=np.zeros_like(rows, bool))
    masked[1] = np.ma.masked
    masked[2, 3] = np.ma.masked
    expected = np.where(masked.mask, np.nan, rows)
    result = flotor.Model("spring").evaluate(masked)
    assert result.status[1] == result.status[2] == "invalid_input"
    assert result.force_n.tolist() == flotor.Model("spring").evaluate(expected).force_n.tolist()
    assert flotor.Model("spring").evaluate(list(masked)).status == result.status
    inputs = np.ma.array(flotor.Model("spring").inputs(rows), mask=False)
    with pytest.raises(flotor.FlotorError, match="no masks"):
        flotor.Model("spring").step_batch(inputs)


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


def test_answers_are_a_table_with_the_columns_of_the_command():
    pytest.importorskip("pandas")
    result = flotor.Model("spring").evaluate(poses())
    table = result.to_pandas()
    assert list(table.columns) == ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm", "energy_j", "status"]
    assert table["fz_n"].tolist() == result.force_n[:, 2].tolist()


def test_a_parameter_says_what_it_is():
    parameters = flotor.Model("spring").parameters
    gamma, variant = parameters["gamma_n"], parameters["variant"]
    assert repr(gamma) == f"Parameter(gamma_n, {gamma.min:g} to {gamma.max:g} N, default {gamma.default})"
    assert repr(variant).startswith(f"Parameter(variant, one of {variant.choices[0]}, ")


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
    with pytest.raises(flotor.FlotorError, match="rows for outputs"):
        model.step_batch(inputs, outputs[:-1])
    with pytest.raises(TypeError):
        model.step_batch(np.zeros(3), outputs[:3])


def test_an_array_that_is_not_aligned_is_refused():
    model = flotor.Model("spring")
    inputs = model.inputs(poses())
    memory = bytearray(inputs.nbytes + 1)
    odd = np.frombuffer(memory, flotor.INPUT, offset=1)
    odd[:] = inputs
    with pytest.raises(flotor.FlotorError, match="aligned to 8 bytes"):
        model.step_batch(odd, np.empty(len(odd), flotor.OUTPUT))
    odd = np.frombuffer(bytearray(len(inputs) * 64 + 1), flotor.OUTPUT, offset=1)
    with pytest.raises(flotor.FlotorError, match="aligned to 8 bytes"):
        model.step_batch(inputs, odd)


@pytest.mark.parametrize("first", [0, 64, 130, 136 * 9])
def test_arrays_that_share_memory_are_refused(first):
    model = flotor.Model("spring")
    memory = bytearray(136 * 20)
    inputs = np.frombuffer(memory, flotor.INPUT, count=10)
    inputs[:] = model.inputs(poses(10))
    outputs = np.frombuffer(memory, flotor.OUTPUT, count=10, offset=first - first % 8)
    with pytest.raises(flotor.FlotorError, match="share memory"):
        model.step_batch(inputs, outputs)
    apart = np.frombuffer(memory, flotor.OUTPUT, count=10, offset=136 * 10)
    assert np.isfinite(model.step_batch(inputs, apart)["force_n"]).all()


def layout(random, rows, dtype):
    """The rows in memory of some layout: offset, stride, order, owner, type; and whether a model may take them."""
    kind = random.integers(8)
    if kind == 0:
        return rows.copy(), True
    if kind == 1:  # at any address
        offset = int(random.integers(17))
        memory = bytearray(rows.nbytes + 16)
        odd = np.frombuffer(memory, dtype, count=len(rows), offset=offset)
        odd[:] = rows
        return odd, odd.ctypes.data % 8 == 0
    if kind == 2:  # with a stride
        wide = np.zeros((len(rows), int(random.integers(2, 4))), dtype)
        wide[:, 0] = rows
        return wide[:, 0], len(rows) < 2
    if kind == 3:
        return rows[::-1].copy()[::-1], len(rows) < 2
    if kind == 4:
        return rows.astype(dtype.newbyteorder(">")), False
    if kind == 5:
        return rows.reshape(1, -1).copy(), False
    if kind == 6:
        return rows.view(np.uint8).copy(), False
    frozen = rows.copy()
    frozen.setflags(write=False)
    return frozen, None  # an input, no output


def test_whatever_lies_in_memory_is_stepped_right_or_refused():
    random = np.random.default_rng(30)
    model = flotor.Model("spring")
    for _ in range(10_000):
        count = int(random.integers(1, 9))
        rows = model.inputs(poses(count, int(random.integers(1000))))
        expected = model.step_batch(rows.copy())
        inputs, takes_inputs = layout(random, rows, flotor.INPUT)
        outputs, takes_outputs = layout(random, np.zeros(count, flotor.OUTPUT), flotor.OUTPUT)
        if random.integers(8) == 0:  # both in one buffer, at any distance
            memory = bytearray(count * 200)
            inputs, takes_inputs = np.frombuffer(memory, flotor.INPUT, count=count), True
            inputs[:] = rows
            offset = 8 * int(random.integers(count * 136 // 8 + 1))
            outputs = np.frombuffer(memory, flotor.OUTPUT, count=count, offset=offset)
            takes_outputs = offset >= count * 136
        before = outputs.tobytes()
        try:
            model.step_batch(inputs, outputs)
        except (flotor.FlotorError, TypeError, ValueError):
            assert takes_inputs is False or not takes_outputs
            assert outputs.tobytes() == before
        else:
            assert takes_inputs is not False and takes_outputs
            assert outputs.tobytes() == expected.tobytes()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_a_fork_while_a_thread_steps_hangs_nobody():
    model = flotor.Model("spring", variant="rod")
    inputs, stepping = model.inputs(poses(200_000)), threading.Event()

    def step():
        stepping.set()
        model.step_batch(inputs)

    thread = threading.Thread(target=step)
    thread.start()
    stepping.wait()
    time.sleep(0.05)
    child = os.fork()
    if child == 0:
        try:
            model.step_batch(inputs[:1])
        except flotor.FlotorError:
            os._exit(7)
        os._exit(0)
    for _ in range(1200):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        time.sleep(0.05)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        pytest.fail("the child hangs")
    assert os.waitstatus_to_exitcode(status) in (0, 7)
    thread.join()


def test_records_have_the_contract_s_layout():
    assert flotor.INPUT.itemsize == 136
    assert flotor.OUTPUT.itemsize == 64
    assert flotor.INPUT.alignment == flotor.OUTPUT.alignment == 8


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
        (dict(id="spring", gamma_n=-1), "must be"),
        (dict(id="spring", variant="exact"), "must be"),
        (dict(id="simulated"), "device"),
        (dict(id="spring", variant=True), "is not a value of a parameter"),
    ],
)
def test_what_is_wrong_is_said(arguments, words):
    with pytest.raises(flotor.FlotorError, match=words):
        flotor.Model(**arguments)


def test_poses_of_another_shape_are_refused():
    with pytest.raises(flotor.FlotorError, match=r"\(n, 6\)"):
        flotor.Model("spring").evaluate(np.zeros((4, 3)))
