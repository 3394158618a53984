"""Sweeps on any executor: threads of this process, Dask or Ray; one plan gives the same bytes with every executor.

    >>> from dask.distributed import Client                       # doctest: +SKIP
    >>> flotor.sweep.run("plan.toml", "results", flotor.sweep.dask(Client()))  # doctest: +SKIP

A task is a pure function of its content and writes one file, named by its key, to ``OUT/tasks``. Workers need the
plan and ``OUT`` on a shared file system. A killed sweep resumes with the next run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path

from . import _flotor, _folders

__all__ = ["Executor", "dask", "ray", "run", "threads"]

#: Function that calls a given function with every number, in any order and on any worker, and returns after the last
#: call; raises the exception of a failed call.
Executor = Callable[[Callable[[int], None], Iterable[int]], None]


class _DoTask:
    """Callable that executes a task of a plan by number. Sent to workers as two paths; each process prepares the sweep once."""

    def __init__(self, plan: str, out: str) -> None:
        self.plan, self.out = plan, out

    def __call__(self, number: int) -> None:
        _prepared(self.plan, self.out).do_task(number)


@lru_cache(maxsize=4)
def _prepared(plan: str, out: str) -> _flotor.Sweep:
    return _flotor.Sweep(Path(plan), Path(out), _folders())


def run(plan: str | os.PathLike[str], out: str | os.PathLike[str], executor: Executor | None = None) -> Path:
    """Executes every task of ``plan`` that is not finished in ``out``; returns the path of ``results.parquet``.

    Raises :class:`flotor.FlotorError` if the plan is rejected; finished tasks stay in ``out``.
    """
    plan, out = os.path.abspath(plan), os.path.abspath(out)
    sweep = _flotor.Sweep(Path(plan), Path(out), _folders())
    (executor or threads())(_DoTask(plan, out), sweep.open_tasks())
    return Path(sweep.write_table())


def threads(workers: int | None = None) -> Executor:
    """Returns an executor with threads of this process; tasks run without the GIL."""

    def execute(do: Callable[[int], None], numbers: Iterable[int]) -> None:
        with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
            for _ in pool.map(do, numbers):
                pass

    return execute


def dask(client) -> Executor:
    """Returns an executor with the workers of a ``dask.distributed.Client``; tasks of a dead worker are executed again."""

    def execute(do: Callable[[int], None], numbers: Iterable[int]) -> None:
        # Not pure: the result of a task is its file, so Dask must not return a cached result.
        client.gather(client.map(do, list(numbers), pure=False))

    return execute


def ray(ray) -> Executor:
    """Returns an executor with the workers of an initialised ``ray`` (pass the module)."""

    def execute(do: Callable[[int], None], numbers: Iterable[int]) -> None:
        remote = ray.remote(do.__call__)
        ray.get([remote.remote(number) for number in numbers])

    return execute
