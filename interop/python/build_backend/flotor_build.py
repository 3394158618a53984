"""Build backend of the wheel: maturin's, after building plugins and command and laying them beside the module.

A wheel that had to look for its plugins elsewhere would not work on a bare machine. Cargo builds the libraries
anyway, because the host names their crates as dependencies; this finds them in Cargo's own report and copies them, and beside them the
command, which finds plugins in its own folder.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import maturin

PROJECT = Path(__file__).resolve().parent.parent
PLUGINS = PROJECT / "python" / "flotor" / "plugins"


def _pack_plugins():
    """Builds everything once; copies the command, and each shared library that is a plugin, by the name of its file."""
    report = subprocess.run(
        ["cargo", "build", "--release", "--message-format=json-render-diagnostics"],
        cwd=PROJECT,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout
    shutil.rmtree(PLUGINS, ignore_errors=True)
    PLUGINS.mkdir(parents=True)
    for line in report.splitlines():
        artifact = json.loads(line)
        if artifact.get("reason") != "compiler-artifact":
            continue
        if artifact["target"]["name"] == "flotor-wheel":
            shutil.copy(artifact["executable"], PLUGINS / "flotor")
        if "cdylib" not in artifact["target"]["kind"]:
            continue
        for name in artifact["filenames"]:
            if name.endswith(".so") and not os.path.basename(name).startswith("lib_flotor"):
                shutil.copy(name, PLUGINS / os.path.basename(name))


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _pack_plugins()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    _pack_plugins()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)


build_sdist = maturin.build_sdist
get_requires_for_build_wheel = maturin.get_requires_for_build_wheel
get_requires_for_build_sdist = maturin.get_requires_for_build_sdist
get_requires_for_build_editable = maturin.get_requires_for_build_editable
prepare_metadata_for_build_wheel = maturin.prepare_metadata_for_build_wheel
prepare_metadata_for_build_editable = maturin.prepare_metadata_for_build_editable
