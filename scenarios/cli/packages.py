"""Missing system packages: the launcher installs them and runs the command again.

A command raises `MissingPackages` if OpenCL, OpenGL or the tools for Verilog are missing. If the
launcher `viform` has started the command, the launcher replaces this process, with the names of the
packages in VIFORM_INSTALL. It installs them and runs the same command line again.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress

_VARIABLES = ("VIFORM_LAUNCHER", "VIFORM_ASKED")
_launcher = dict.fromkeys(_VARIABLES, "")
"""Path of the launcher, "" without one, and the packages that were requested before."""
_environment: dict[str, str] = {}
"""The environment before this process changes it for its libraries."""


def read_launcher() -> None:
    """Moves the variables of the launcher out of the environment, so that child processes do not
    inherit them."""
    for name in _VARIABLES:
        _launcher[name] = os.environ.pop(name, "")
    _environment.update(os.environ)


def has_launcher() -> bool:
    """Whether the launcher has started this command, and may install packages."""
    return bool(_launcher["VIFORM_LAUNCHER"])


def install_and_restart(packages: Sequence[str]) -> None:
    """Replaces this process by the launcher, which installs the packages and runs the command line
    again. Returns if there is no launcher, or if all these packages were requested before."""
    path, requested = (_launcher[name] for name in _VARIABLES)
    if not path or set(packages) <= set(requested.split()):
        return
    environment = {**_environment, "VIFORM_ASKED": requested, "VIFORM_INSTALL": " ".join(packages)}
    sys.stdout.flush()
    sys.stderr.flush()
    with suppress(OSError):  # the launcher was moved
        os.execve(path, [path, *sys.argv[1:]], environment)
