"""Arguments of runs as the native module takes them: scenes, settings, values."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ._flotor import FlotorError


def folders() -> list[Path]:
    """Plugin folders in search order: the folders in ``FLOTOR_PLUGIN_PATH``, then the folder of this package."""
    listed = os.environ.get("FLOTOR_PLUGIN_PATH", "").split(os.pathsep)
    return [Path(folder) for folder in listed if folder] + [Path(__file__).parent / "plugins"]


def text(value: object) -> str:
    """Formats a parameter's value as in a scene; floats are exact."""
    if isinstance(value, bool):
        raise FlotorError(f"{value!r} is not a value of a parameter; write a choice as a word, like 'on' or 'off'")
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    return repr(float(value))


def given(
    scene: str | os.PathLike[str] | Mapping[str, object] | None,
    *,
    duration_s: float | None,
    rate_hz: float | None,
    seed: int,
    settings: Mapping[str, object] | None,
) -> dict[str, object]:
    """Returns the arguments of a run as the native module reads them."""
    # The interpreter of models in Python is this one, with its packages.
    os.environ.setdefault("FLOTOR_PYTHON", sys.executable)
    scene_text = None
    if isinstance(scene, Mapping):
        scene_text = _scene_text(scene)
    elif isinstance(scene, str) and "\n" in scene:
        scene_text = scene
    return {
        "scene": None if scene is None or scene_text is not None else Path(scene),
        "text": scene_text,
        "folders": folders(),
        "duration_s": duration_s,
        "rate_hz": rate_hz,
        "seed": seed,
        "settings": [f"{key}={text(value)}" for key, value in by_plugin_and_id(settings or {})],
    }


def by_plugin_and_id(settings: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Yields each setting as ``plugin.id`` and its value; settings may be grouped by plugin."""
    for key, value in settings.items():
        if isinstance(value, Mapping):
            yield from ((f"{key}.{id}", each) for id, each in value.items())
        else:
            yield key, value


def _scene_text(scene: Mapping[str, object]) -> str:
    """Formats a scene as TOML, one line for each key of the scene."""
    return "".join(f"{_quoted(key)} = {_toml(value)}\n" for key, value in scene.items())


def _toml(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_quoted(key)} = {_toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str | os.PathLike):
        return _quoted(os.fspath(value))
    if isinstance(value, bool | int | float | np.number | np.bool_):
        value = value.item() if isinstance(value, np.generic) else value
        return repr(value).lower()
    raise FlotorError(f"{value!r} has no place in a scene; write numbers, texts, lists and mappings")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
