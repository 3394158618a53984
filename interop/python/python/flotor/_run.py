"""Runs that a program is part of: on the real clock, or in lockstep with the program."""

from __future__ import annotations

import atexit
import json
import os
import time
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path

from . import _flotor, _scene
from ._flotor import FlotorError, SavedState, State


class RunFailed(FlotorError):
    """Error of a run that ended early, or in which a model failed: the sentence of ``flotor run``, with its exit code."""

    def __init__(self, problem: str, summary: dict[str, object] | None, exit_code: int = 1) -> None:
        super().__init__(problem)
        #: Summary of the run, with the keys of the result of :func:`flotor.run`; None if the loop did not return.
        self.summary = summary
        #: Exit code of ``flotor run``: 3 for a model that failed, 4 for a device, 1 for any other end.
        self.exit_code = exit_code


def told(summary: str | None, problem: tuple[str, int] | None) -> dict[str, object]:
    """Returns the summary of a run that has ended in order; raises RunFailed for any other."""
    summary = None if summary is None else json.loads(summary)
    if problem is not None:
        raise RunFailed(problem[0], summary, problem[1])
    return summary


def _changes(values: Mapping[str, object] | None, parameters: Mapping[str, object]) -> list[tuple[str, str, str]]:
    """Returns plugin, id and value of each change."""
    changes = []
    for key, value in _scene.by_plugin_and_id({**(values or {}), **parameters}):
        plugin, dot, id = key.rpartition(".")
        if not dot:
            raise FlotorError(f"`{key}` names no parameter; write \"PLUGIN.{key}\", with the name of the device or model")
        changes.append((plugin, id, _scene.text(value)))
    return changes


class Run:
    """Run that this program is part of; :func:`flotor.open` opens it, ``with`` closes it.

    On the real clock the loop runs in threads of its own, which never wait for Python: :attr:`state` reads the newest tick, changes
    take effect between two ticks. In virtual time the loop stands still between two calls of :meth:`step`. All methods may be called
    from any thread.
    """

    def __init__(self, run: _flotor.OpenRun, clock: str) -> None:
        self._run = run
        self._clock = clock
        #: Names of the devices, in the scene's order.
        self.devices: list[str] = run.devices
        #: Names of the models, in the scene's order.
        self.models: list[str] = run.models
        #: Nominal time between two ticks, s.
        self.period_s: float = run.period_s
        #: Summary of the run, with the keys of ``flotor run --json``; None until the run is closed.
        self.summary: dict[str, object] | None = None
        _open_runs.add(self)

    @property
    def state(self) -> State:
        """Newest state of the first device: pose, twist, forces, events. Waits for nothing."""
        return self._run.state(0)

    def state_of(self, device: int | str) -> State:
        """Returns the newest state of a device, by its number or its name in the scene."""
        return self._run.state(device)

    def clock_offset_ns(self, ticks: int = 50) -> int:
        """Returns ``time.monotonic_ns()`` at time 0 of the run, to compare the times of its states with those of cameras and robots.

        Observes the arrival of some ticks; the smallest difference counts, which is late by the time that a tick takes to compute and
        Python to look: tens of microseconds. For a run on the real clock, while it runs.
        """
        if self._clock == "virtual":
            raise FlotorError("a run in virtual time has no time of a clock")
        least, tick = None, self.state.tick
        for _ in range(ticks):
            while (state := self.state).tick == tick and self.running:
                pass
            now_ns = time.monotonic_ns()
            tick, difference = state.tick, now_ns - state.time_ns - state.lateness_ns
            least = difference if least is None else min(least, difference)
        return least

    @property
    def running(self) -> bool:
        """False once the run has ended: closed, its duration over, or by a fault."""
        return self._run.is_running()

    def set(self, values: Mapping[str, object] | None = None, /, *, at_once: bool = False, **parameters: object) -> None:
        """Changes live parameters, all before the same tick: ``run.set({"spring.gamma_n": 20})``.

        Keys are ``plugin.id``, or values grouped by plugin, also as keyword arguments: ``run.set(spring={"gamma_n": 20})``. A number
        moves to its value at a rate that a hand can bear; ``at_once`` sets it before the next tick, for changes that no hand feels.

        Raises :class:`FlotorError`; then nothing changes.
        """
        self._run.set(_changes(values, parameters), not at_once)

    def push(
        self,
        force_n: Sequence[float],
        torque_nm: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        device: int | str = 0,
        effort: float = 0.0,
    ) -> None:
        """Commands a force (3,), N, and torque (3,), N m, on the hand, and an effort at its grip (N or N m), from the next tick on.

        It passes the limits of the scene as the force of a model does, and fades after 50 ms without another one: a program that hangs
        does not push on. The run is to be opened with ``program=True``.
        """
        number = self.devices.index(device) if isinstance(device, str) else device
        self._run.push(number, tuple(map(float, force_n)), tuple(map(float, torque_nm)), float(effort))

    def set_weight(self, model: str, weight: float) -> None:
        """Sets the weight of a model, 0 to 1, to which the loop fades; a model with weight 0 is not stepped."""
        self._run.set_weight(model, weight)

    def swap(self, model: str, plugin: str | os.PathLike[str] | None = None, **parameters: object) -> None:
        """Replaces a model while the loop runs; the new one fades in. Without ``plugin`` the same model is created again.

        Raises :class:`FlotorError` if the new model refuses; then the old one stays.
        """
        settings = [(id, _scene.text(value)) for id, value in parameters.items()]
        self._run.swap(model, None if plugin is None else os.fspath(plugin), settings)

    def step(self, ticks: int = 1) -> State:
        """Runs ticks of a run in virtual time; returns the state of the first device after them.

        Raises :class:`RunFailed` if a fault has ended the run, and :class:`FlotorError` if it had ended before the last tick.
        """
        if not self._run.step(ticks):
            self._finish()
            raise FlotorError("the run has ended before the last of these ticks; open it with a longer duration_s, or reset it")
        return self.state

    def save(self) -> SavedState:
        """Saves the state of a run in virtual time before its next tick: devices, models and loop (``flotor.snapshot/1``)."""
        return self._run.save()

    def restore(self, saved: SavedState) -> None:
        """Restores a state that this run has saved; the same calls then give the same bits. A recorded run cannot go back."""
        self._run.restore(saved)

    def reset(self) -> State:
        """Restores the state before the first tick; returns it."""
        self._run.reset()
        return self.state

    def stop(self) -> None:
        """Requests an end in order: the force fades out. Does not wait; :meth:`close` does."""
        self._run.stop()

    def emergency_stop(self) -> None:
        """Presses the emergency stop: no force from the next tick on, and :meth:`close` raises :class:`RunFailed`."""
        self._run.emergency_stop()

    def wait(self, timeout_s: float | None = None) -> dict[str, object] | None:
        """Waits until a run on the real clock ends by itself; returns its summary, None after the timeout.

        Raises :class:`RunFailed` if it did not end in order. Ctrl-C ends the waiting, and with it the ``with`` block.
        """
        if self._clock == "virtual":
            raise FlotorError("a run in virtual time ends by `step` and `close`; open it with clock=\"real\" to wait for its end")
        if self.summary is None:
            ended = self._run.wait(1e9 if timeout_s is None else timeout_s)
            if ended is None:
                return None
            self._told(ended)
        return self.summary

    def close(self) -> dict[str, object]:
        """Ends the run in order and returns its summary; finishes the recording. May be called again.

        Raises :class:`RunFailed` if the run ended early, or a model failed.
        """
        if self.summary is None:
            self._run.close()
            self._told(self._run.wait(1e9))
        return self.summary

    def _told(self, ended: tuple[str | None, tuple[str, int] | None]) -> None:
        _open_runs.discard(self)
        try:
            self.summary = told(*ended)
        except RunFailed as failed:
            self.summary = failed.summary
            raise

    def _finish(self) -> None:
        """Raises RunFailed for a run in virtual time that a fault has ended; one whose duration is over can be reset."""
        if not self._run.can_go_on():
            self.close()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, kind, error, traceback) -> None:
        try:
            self.close()
        except RunFailed as failed:
            if error is None:
                raise
            # The first error counts.
            error.add_note(f"and the run failed: {failed}") if hasattr(error, "add_note") else None

    def __repr__(self) -> str:
        return f"Run({self._clock} clock, {'running' if self.running else 'ended'}, models {', '.join(self.models) or 'none'})"


#: Runs that are to be ended in order with the interpreter.
_open_runs: weakref.WeakSet[Run] = weakref.WeakSet()


@atexit.register
def _end_open_runs() -> None:
    for run in list(_open_runs):
        try:
            run.close()
        except FlotorError:
            pass  # nobody is left to tell


def open(  # noqa: A001  (as `io.open`)
    scene: str | os.PathLike[str] | Mapping[str, object] | None = None,
    *,
    clock: str = "real",
    duration_s: float | None = None,
    rate_hz: float | None = None,
    seed: int = 0,
    settings: Mapping[str, object] | None = None,
    record: str | os.PathLike[str] | None = None,
    watched: bool | None = None,
    program: bool = False,
) -> Run:
    """Opens a run that this program is part of: ``with flotor.open("scene.toml") as run:``.

    ``scene`` and ``settings`` are those of :func:`flotor.run`. The run lasts until it is closed, or ``duration_s``. With ``clock``
    "real" the loop keeps its rate in threads of its own, whatever Python does; with "virtual" it advances by :meth:`Run.step`, as
    fast as possible and with the same bits each time. ``record`` records every tick. Other programs (the viewer, ``flotor watch``)
    can watch the run if ``watched``, by default on the real clock. With ``program`` this program is a source of force beside the
    models of the scene: :meth:`Run.push`.

    Raises :class:`FlotorError` for a scene, plugin or argument that is refused, with the sentence and ``exit_code`` of ``flotor run``.
    """
    given = _scene.given(
        scene,
        duration_s=float("inf") if duration_s is None else duration_s,
        rate_hz=rate_hz,
        seed=seed,
        settings=settings,
    )
    options = {
        "clock": clock,
        "recording": None if record is None else Path(record),
        "watched": clock == "real" if watched is None else watched,
        "program": program,
    }
    run = Run(_flotor.OpenRun(given, options), clock)
    if not run.running:
        run.close()  # raises the reason
    return run


class JoinedRun:
    """Run that another program has started; :func:`flotor.join` finds it. Leaving the ``with`` block leaves the run as it is."""

    def __init__(self, run: _flotor.JoinedRun) -> None:
        self._run = run
        #: Title of the scene.
        self.title: str = run.title
        #: Process of the host.
        self.process: int = run.process
        #: Names of the devices, in the scene's order.
        self.devices: list[str] = run.devices
        #: Names of the models, in the scene's order.
        self.models: list[str] = run.models

    @property
    def state(self) -> State:
        """Newest state of the first device that has arrived; waits for the first."""
        return self._run.state(0)

    def state_of(self, device: int | str) -> State:
        """Returns the newest state of a device, by its number or its name in the scene."""
        if isinstance(device, str):
            if device not in self.devices:
                raise FlotorError(f"no device {device}; the devices are {', '.join(self.devices)}")
            device = self.devices.index(device)
        return self._run.state(device)

    @property
    def running(self) -> bool:
        """False once the run has ended, or was left."""
        return self._run.end(0.0) is None

    def set(self, values: Mapping[str, object] | None = None, /, **parameters: object) -> None:
        """Changes live parameters, all before the same tick, as :meth:`Run.set` does."""
        self._run.set(_changes(values, parameters))

    def set_weight(self, model: str, weight: float) -> None:
        """Sets the weight of a model, 0 to 1, to which the loop fades."""
        self._run.set_weight(model, weight)

    def swap(self, model: str, plugin: str | os.PathLike[str] | None = None, **parameters: object) -> None:
        """Replaces a model while the loop runs, as :meth:`Run.swap` does."""
        settings = [(id, _scene.text(value)) for id, value in parameters.items()]
        self._run.swap(model, None if plugin is None else os.fspath(plugin), settings)

    def stop(self) -> None:
        """Requests an end in order: the force fades out."""
        self._run.stop()

    def emergency_stop(self) -> None:
        """Presses the emergency stop of the machine: no force, until ``flotor release``."""
        self._run.emergency_stop()

    def wait(self, timeout_s: float | None = None) -> str | None:
        """Waits until the run ends; returns the sentence of its end, None after the timeout. Raises RunFailed if it failed."""
        end = self._run.end(1e9 if timeout_s is None else timeout_s)
        if end is None:
            return None
        words, is_in_order = end
        if not is_in_order:
            raise RunFailed(words, None)
        return words

    def leave(self) -> None:
        """Closes the connection; the run continues."""
        self._run.leave()

    def __enter__(self) -> JoinedRun:
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.leave()

    def __repr__(self) -> str:
        return f"JoinedRun({self.title!r}, process {self.process}, {'running' if self.running else 'ended'})"


def join(process: int | None = None, *, every: int = 1) -> JoinedRun:
    """Joins the newest run of this user, or the one of a process: reads its states, and changes it as the viewer can.

    ``every``: only the ticks whose number is a multiple of it arrive. Raises :class:`FlotorError` if there is no such run.
    """
    return JoinedRun(_flotor.JoinedRun(process, every))
