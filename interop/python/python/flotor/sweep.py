"""Sweeps on any executor: threads here, Dask or Ray elsewhere; the same plan, the same bytes.

    >>> from dask.distributed import Client                       # doctest: +SKIP
    >>> flotor.sweep.run("plan.toml", "results", flotor.sweep.dask(Client()))  # doctest: +SKIP

A task is a pure function of its content and leaves one file, named by its key, in ``OUT/tasks``. Workers need the
plan and ``OUT`` on a file system they share. A killed sweep resumes with the next run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path

from . import _flotor, _folders

__all__ = ["Executor", "dask", "ray", "run", "threads"]

#: Calls a function on every number, in any order, anywhere, and returns when all are done; raises what one raised.
Executor = Callable[[Callable[[int], None], Iterable[int]], None]


class _DoTask:
    """Does task ``number`` of a plan. Travels to workers as two paths; each process prepares the sweep once."""

    def __init__(self, plan: str, out: str) -> None:
        self.plan, self.out = plan, out

    def __call__(self, number: int) -> None:
        _prepared(self.plan, self.out).do_task(number)


@lru_cache(maxsize=4)
def _prepared(plan: str, out: str) -> _flotor.Sweep:
    return _flotor.Sweep(Path(plan), Path(out), _folders())


def run(plan: str | os.PathLike[str], out: str | os.PathLike[str], executor: Executor | None = None) -> Path:
    """Does every task of ``plan`` that is not finished in ``out``; the path of ``results.parquet``.

    Raises :class:`flotor.FlotorError` if the plan is refused; what was finished before stays finished.
    """
    plan, out = os.path.abspath(plan), os.path.abspath(out)
    sweep = _flotor.Sweep(Path(plan), Path(out), _folders())
    (executor or threads())(_DoTask(plan, out), sweep.open_tasks())
    return Path(sweep.write_table())


def threads(workers: int | None = None) -> Executor:
    """Threads of this process: tasks run without the GIL."""

    def execute(do: Callable[[int], None], numbers: Iterable[int]) -> None:
        with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
            for _ in pool.map(do, numbers):
                pass

    return execute


def dask(client) -> Executor:
    """Workers of a ``dask.distributed.Client``; a task of a worker that dies is done by another."""

    def execute(do: Callable[[int], None], numbers: Iterable[int]) -> None:
        # Not pure: what a task leaves is its file, so Dask may not answer from its memory.
        client.gather(client.map(do, list(numbers), pure=False))

    return execute


def ray(ray) -> Executor:
    """Workers of an initialised ``ray`` (pass the module)."""

    def execute(do: Callable[[int], None], numbers: Iterable[int]) -> None:
        remote = ray.remote(do.__call__)
        ray.get([remote.remote(number) for number in numbers])

    return execute
