"""Native part of the package; use the public names of `flotor` instead."""

from pathlib import Path

import numpy as np

__version__: str
EVENTS: tuple[str, ...]

class FlotorError(Exception): ...

class Parameter:
    """Parameter of a plugin's schema."""

    id: str
    unit: str
    doc: str
    min: float | None
    max: float | None
    default: str
    choices: list[str]

class Model:
    def __init__(self, id: str, settings: list[tuple[str, str]], folders: list[Path]) -> None: ...
    id: str
    version: str
    path: str
    parameters: list[Parameter]
    def parameter(self, id: str) -> float: ...
    def set_parameter(self, id: str, value: str) -> None: ...
    def reset(self) -> None: ...
    def step_batch(self, inputs: np.ndarray, outputs: np.ndarray) -> None: ...
    def evaluate(
        self, poses: np.ndarray, successive: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]: ...

class Sweep:
    def __init__(self, plan: Path, out: Path, folders: list[Path]) -> None: ...
    keys: list[str]
    def open_tasks(self) -> list[int]: ...
    def do_task(self, number: int) -> None: ...
    def write_table(self) -> str: ...

def input_dtype() -> np.dtype[np.void]: ...
def output_dtype() -> np.dtype[np.void]: ...
def plugins(folders: list[Path]) -> list[tuple[str, str, str, str]]: ...
def run_scene(
    scene: Path | None,
    *,
    text: str | None,
    folders: list[Path],
    duration_s: float | None,
    rate_hz: float | None,
    seed: int,
    settings: list[str],
    recording: Path | None,
) -> str: ...
def read_recording(path: Path) -> tuple[dict[str, np.ndarray], bool]: ...
