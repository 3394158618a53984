"""Flotor for Python: force models on NumPy arrays, runs of scenes, live or in virtual time, recordings as tables.

Everything is SI: metres, radians, seconds, newtons, newton metres, joules; time in integer nanoseconds. Poses are
given in the model frame: right-handed, z up, origin at the handle's home.

    >>> import flotor, numpy as np
    >>> spring = flotor.Model("spring", preset="thesis-1")
    >>> result = spring.evaluate(np.array([[0, 0, -0.005, 0, 0, 0]]))
    >>> result.force_n.shape
    (1, 3)
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from . import _command, _flotor, _scene
from ._flotor import EVENTS, FlotorError, Parameter, SavedState, State, __version__
from ._run import JoinedRun, Run, RunFailed, join, open, told  # noqa: A004
from ._scene import folders as _folders
from ._scene import text as _text

__all__ = [
    "DEMAND_ALL",
    "DEMAND_ENERGY",
    "DEMAND_FORCE",
    "DEMAND_TORQUE",
    "EVENTS",
    "INPUT",
    "OUTPUT",
    "STATUS",
    "Evaluation",
    "FlotorError",
    "JoinedRun",
    "Model",
    "Parameter",
    "PluginInfo",
    "Recording",
    "Run",
    "RunFailed",
    "SavedState",
    "State",
    "__version__",
    "join",
    "open",
    "plugins",
    "read_recording",
    "run",
    "sweep",
]

_flotor.enter_program(_command.program())

#: NumPy record of one model input, 136 bytes: pose, twist, time, buttons, demand.
INPUT = _flotor.input_dtype()
#: NumPy record of one model output, 64 bytes: force, torque, energy, status.
OUTPUT = _flotor.output_dtype()
#: Names of the status codes in an output, by code.
STATUS = ("ok", "clamped", "out_of_domain", "not_converged", "invalid_input")
#: Bits of an input's ``demand``: a model need not compute other outputs.
DEMAND_FORCE, DEMAND_TORQUE, DEMAND_ENERGY, DEMAND_ALL = 1, 2, 4, 7


class PluginInfo(NamedTuple):
    """Plugin in a searched folder; its code has not been loaded."""

    id: str
    kind: str  #: "model" or "device"
    version: str
    path: Path


class Evaluation(NamedTuple):
    """Wrenches, energies and statuses of a model at ``n`` poses."""

    force_n: np.ndarray  #: force on the hand, (n, 3), N
    torque_nm: np.ndarray  #: torque on the hand, (n, 3), N m
    energy_j: np.ndarray  #: stored energy, (n,), J; NaN where the model has none
    status: list[str]  #: n words of :data:`STATUS`

    def to_pandas(self):
        """Returns a ``pandas.DataFrame`` with the columns of ``flotor eval``, one row per pose."""
        import pandas

        forces = dict(zip(("fx_n", "fy_n", "fz_n"), self.force_n.T))
        torques = dict(zip(("tx_nm", "ty_nm", "tz_nm"), self.torque_nm.T))
        return pandas.DataFrame({**forces, **torques, "energy_j": self.energy_j, "status": self.status})


class Model:
    """Force model, loaded from a plugin.

    ``id`` is the id in a scene ("spring") or the path of a plugin file; keyword arguments are parameters, by their ids
    in the schema (:attr:`parameters`). May be shared between threads; calls are serialised.

    Raises :class:`FlotorError` for an unknown id, a rejected plugin, an unknown or invalid parameter.
    """

    def __init__(self, id: str, **parameters: object) -> None:
        self._model = _flotor.Model(id, [(key, _text(value)) for key, value in parameters.items()], _folders())

    @property
    def id(self) -> str:
        """Id of the plugin, as in a scene."""
        return self._model.id

    @property
    def version(self) -> str:
        """Version of the plugin."""
        return self._model.version

    @property
    def path(self) -> Path:
        """Path of the plugin file."""
        return Path(self._model.path)

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Schema: id, unit, range, default, choices and description of every parameter."""
        return {parameter.id: parameter for parameter in self._model.parameters}

    def __getitem__(self, id: str) -> float:
        """Returns the current value of a parameter, presets resolved (for a choice, its index)."""
        return self._model.parameter(id)

    def __setitem__(self, id: str, value: object) -> None:
        """Changes a live parameter of the instance that :meth:`step_batch` steps."""
        self._model.set_parameter(id, _text(value))

    def reset(self) -> None:
        """Resets the model to home; clears the history of a model with memory."""
        self._model.reset()

    def inputs(self, poses: np.ndarray, demand: int = DEMAND_ALL) -> np.ndarray:
        """Returns inputs at rest for :meth:`step_batch` from poses (n, 6): position, m, and rotation vector, rad."""
        poses = _poses(poses)
        rows = np.zeros(len(poses), INPUT)
        rows["position_m"] = poses[:, :3]
        angle = np.linalg.norm(poses[:, 3:], axis=1)
        with np.errstate(invalid="ignore"):
            scale = 0.5 * np.sinc(angle / (2.0 * np.pi))
        rows["orientation_xyzw"][:, :3] = poses[:, 3:] * scale[:, None]
        rows["orientation_xyzw"][:, 3] = np.cos(0.5 * angle)
        rows["demand"] = demand
        return rows

    def step_batch(self, inputs: np.ndarray, outputs: np.ndarray | None = None) -> np.ndarray:
        """Steps through ``inputs`` (n,) of :data:`INPUT`, in order, into ``outputs`` (n,) of :data:`OUTPUT`; returns ``outputs``.

        Both arrays are used in place, without copies; pass ``outputs`` to reuse its memory. The arrays must not share
        memory, and must not be resized during the call: ``ndarray.resize(..., refcheck=False)`` in another thread frees
        the memory that the call writes to. A child of ``os.fork()`` has to create its own models.
        """
        if isinstance(inputs, np.ma.MaskedArray) or isinstance(outputs, np.ma.MaskedArray):
            raise FlotorError("inputs and outputs have no masks; pass unmasked rows (`inputs.compressed()`)")
        if outputs is None:
            outputs = np.empty(len(inputs), OUTPUT)
        self._model.step_batch(inputs, outputs)
        return outputs

    def evaluate(self, poses: np.ndarray, *, path: bool = False) -> Evaluation:
        """Evaluates the model at poses (n, 6) in m and rad (rotation vector), bit for bit as ``flotor eval``.

        Columns of a data frame, an Arrow table, a record array or a mapping are selected by name; the names must be
        those of ``flotor eval``. A masked number is NaN. Each pose is reached from home and held until the model has
        converged; with ``path`` the rows are successive poses of one handle. NaN and infinity are valid, and give zero
        force with a status.
        """
        force_n, torque_nm, energy_j, status = self._model.evaluate(_poses(poses), path)
        return Evaluation(force_n, torque_nm, energy_j, status)

    def __repr__(self) -> str:
        return repr(self._model)


#: Columns of a pose, in order.
_POSE = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")


def _column_names(table: object) -> list | None:
    """Returns the column names of a data frame, an Arrow table, a record array or a mapping; None for any other object."""
    if isinstance(table, Mapping):
        return list(table)
    names = getattr(table, "column_names", None)
    if names is None:
        names = getattr(getattr(table, "dtype", None), "names", None)
    if names is None:
        names = getattr(table, "columns", None)
    names = None if names is None else list(names)
    # pandas numbers the columns of an array that had no names.
    return None if names == list(range(len(names or ()))) else names


def _numbers(values: object) -> np.ndarray:
    """Converts values to an array of floats; masked values become NaN."""
    if isinstance(values, list | tuple) and any(isinstance(row, np.ma.MaskedArray) for row in values):
        values = np.ma.array(values)
    if isinstance(values, np.ma.MaskedArray):
        values = values.astype(np.float64).filled(np.nan)
    return np.asarray(values, np.float64)


def _poses(poses: object) -> np.ndarray:
    names = _column_names(poses)
    if names is not None:
        if sorted(map(str, names)) not in (sorted(_POSE), sorted([*_POSE, "id"])):
            raise FlotorError(f"the columns are {', '.join(map(str, names))}; they must be {', '.join(_POSE)}, and may have an id")
        poses = np.column_stack([_numbers(poses[name]) for name in _POSE])
    poses = np.require(_numbers(poses), np.float64, ["C_CONTIGUOUS", "ALIGNED"])
    if poses.ndim != 2 or poses.shape[1] != 6:
        raise FlotorError(f"poses have shape {poses.shape}; pass the shape (n, 6): x_m, y_m, z_m, rx_rad, ry_rad, rz_rad")
    return poses


def plugins() -> list[PluginInfo]:
    """Returns all plugins in the searched folders, without loading their code."""
    return [PluginInfo(id, kind, version, Path(path)) for id, kind, version, path in _flotor.plugins(_folders())]


def run(
    scene: str | os.PathLike[str] | Mapping[str, object] | None = None,
    *,
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int = 0,
    settings: dict[str, object] | None = None,
    record: str | os.PathLike[str] | None = None,
) -> dict[str, object]:
    """Runs a scene in virtual time; returns the summary, with the keys of ``flotor run --json``.

    ``scene`` is a scene file (TOML), the name of one of Flotor's own scenes, the text of a scene (of more than one line), or a
    mapping with the keys of a scene file, such as ``tomllib.loads`` returns; None runs the demo.

    ``settings`` are parameters by plugin and id: ``{"spring.variant": "closed-form", "device.preset": "full"}``, or
    ``{"spring": {"variant": "closed-form"}}``. Equal arguments give an equal ``trace_digest``.

    Raises :class:`FlotorError` for an invalid scene or argument, and :class:`RunFailed`, which has the summary, if a model failed
    or the run ended early.
    """
    given = _scene.given(scene, duration_s=duration_s, rate_hz=rate_hz, seed=seed, settings=settings)
    return told(*_flotor.run_scene(given, None if record is None else Path(record)))


class Recording:
    """Recording as columns, one row per tick: ``recording["position_m"]`` is an array (n, 3)."""

    def __init__(self, columns: dict[str, np.ndarray], finished: bool) -> None:
        self.columns = columns
        #: False if the file is truncated (a killed process, a full disk).
        self.finished = finished

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["tick"])

    def event(self, name: str) -> np.ndarray:
        """Returns the presence of an event in each tick, booleans (n,): ``recording.event("force_limited")``.

        The names are :data:`EVENTS`.
        """
        if name not in EVENTS:
            raise FlotorError(f"unknown event {name!r}; the events are {', '.join(EVENTS)}")
        return self.columns["events"] & np.uint32(1 << EVENTS.index(name)) != 0

    def flat(self) -> dict[str, np.ndarray]:
        """Returns the columns split into scalar columns: ``position_m`` becomes ``position_m_x``, ``_y``, ``_z``."""
        flat = {}
        for name, column in self.columns.items():
            if column.ndim == 1:
                flat[name] = column
                continue
            for index, axis in enumerate("xyzw"[: column.shape[1]]):
                flat[f"{name.removesuffix('_xyzw')}_{axis}"] = column[:, index]
        return flat

    def to_pandas(self):
        """Returns the scalar columns as a ``pandas.DataFrame``, indexed by tick."""
        import pandas

        return pandas.DataFrame(self.flat()).set_index("tick")

    def to_polars(self):
        """Returns the scalar columns as a ``polars.DataFrame``."""
        import polars

        return polars.DataFrame(self.flat())


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Reads a recording made with ``flotor run --record`` or :func:`run`."""
    return Recording(*_flotor.read_recording(Path(path)))


from . import sweep  # noqa: E402  (needs the names above)
