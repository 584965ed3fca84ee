"""System packages that a command lacks: the launcher installs them and runs the command again.

A command without its OpenCL, its OpenGL or its tools for Verilog raises `MissingPackages`. If the
launcher `viform` has started it, the launcher takes the place of this process, with the names of
the packages in VIFORM_INSTALL, and runs the same command line once they are installed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress

__all__ = ["has_launcher", "install_and_restart", "read_launcher"]

_VARIABLES = ("VIFORM_LAUNCHER", "VIFORM_ASKED")
_launcher = dict.fromkeys(_VARIABLES, "")
"""Path of the launcher, "" without one, and the packages that it was asked for before."""


def read_launcher() -> None:
    """Takes what the launcher says out of the environment, so that no child process finds it."""
    for name in _VARIABLES:
        _launcher[name] = os.environ.pop(name, "")


def has_launcher() -> bool:
    """Whether the launcher has started this command, and may install packages."""
    return bool(_launcher["VIFORM_LAUNCHER"])


def install_and_restart(packages: Sequence[str]) -> None:
    """Starts the launcher in place of this process, to install packages and to run the command line
    again. Returns where there is no launcher, or it was asked for all of these packages before."""
    path, asked = (_launcher[name] for name in _VARIABLES)
    if not path or set(packages) <= set(asked.split()):
        return
    environment = {**os.environ, "VIFORM_ASKED": asked, "VIFORM_INSTALL": " ".join(packages)}
    sys.stdout.flush()
    sys.stderr.flush()
    with suppress(OSError):  # a launcher that was moved
        os.execve(path, [path, *sys.argv[1:]], environment)
