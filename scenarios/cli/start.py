"""The start of the command, before other modules are imported: its time, for `run_time_s`, and
settings of the interpreter, of libraries and of the C library. They are those of this process and
its children; from Python, a user's own settings stay.

Then its second start, by the launcher: a command raises `MissingPackages` if OpenCL, OpenGL or the
tools for Verilog are missing. If the launcher `viform` has started the command, the launcher
replaces this process, with the names of the packages in VIFORM_INSTALL. It installs them and runs
the same command line again.
"""

import ctypes
import gc
import os
import sys
import time
import warnings
from collections.abc import MutableMapping, Sequence
from contextlib import suppress

BEGAN = time.perf_counter()
"""time.perf_counter() at the start of the command."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""Parameters of mallopt(3)."""

# By default, Python looks for dead cycles of objects after each 700 new ones. Imports make a
# million, almost none of them dead, and take an eighth longer for it.
gc.set_threshold(50_000)

# By default, the memory of an array of 4 MB goes back to the system when it is freed, and the next
# array takes it page by page: 2.6 ms, several times as long as the arithmetic on it.
with suppress(AttributeError, OSError):  # not the GNU C library
    _mallopt = ctypes.CDLL(None).mallopt
    _mallopt(_M_MMAP_THRESHOLD, 1 << 25)  # the largest that it takes
    _mallopt(_M_TRIM_THRESHOLD, 1 << 28)
    # By default, threads have pools of 64 MB, between which freed memory does not pass.
    _mallopt(_M_ARENA_MAX, 1)

# OpenBLAS reads this when numpy is imported. Its products here are small, and its threads wait for
# the next one in a busy loop, on the cores that kernels and compiled loops use.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def isolate(environ: MutableMapping[str, str]) -> None:
    """Takes settings out of an environment that a user has made for programs of his own, and that
    would end a run or change what it writes."""
    # An application's back end, and files of settings for somebody's own figures. `figures.py` in
    # cosim/report knows this process by the last.
    environ["MPLBACKEND"], environ["MATPLOTLIBRC"] = "agg", os.devnull
    # A thread pool that is not there, an interpreter in place of the compiler, dumps on standard
    # output: only what numba must know of a machine stays.
    known = {"NUMBA_CACHE_DIR"}
    if (threads := environ.get("NUMBA_NUM_THREADS", "")).isdecimal() and int(threads):
        known.add("NUMBA_NUM_THREADS")
    for name in [name for name in environ if name.startswith("NUMBA_") and name not in known]:
        del environ[name]
    environ.pop("PYTHONWARNINGS", None)


isolate(os.environ)
if sys.warnoptions:  # a warning of a library, made an error, would end the command
    sys.warnoptions.clear()
    warnings.resetwarnings()
    for kind in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", kind)

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
