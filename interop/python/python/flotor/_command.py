"""The `flotor` command that the wheel contains."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path


def program() -> Path | None:
    """Returns the path of the packed command; None in a package that was built without it."""
    file = Path(__file__).parent / "plugins" / "flotor"
    return file if file.exists() else None


def main() -> None:
    """Replaces this process by the command."""
    file = program()
    if file is None:
        sys.exit("flotor: this package was built without the command; install the wheel")
    if not os.access(file, os.X_OK):
        # Some installers drop the mode of a file.
        file.chmod(file.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    os.execv(file, [str(file), *sys.argv[1:]])
