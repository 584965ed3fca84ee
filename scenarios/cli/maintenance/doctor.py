"""`viform doctor`: checks this computer for the requirements of a run, and prints an instruction
for each problem.

The functions import what they need: the start of other commands must not wait for it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from cosim.run.called import as_called
from scenarios.cli.output import Json, print_document, tell

_GIB = 2**30
_MEMORY_GIB = 4
"""Memory of a megapixel run with its report, GiB."""
_DISK_GIB = 1
"""Disk space of several runs, GiB."""
_RENAMED = {
    "opencv-python-headless": "cv2",
    "pyserial": "serial",
    "scikit-sundae": "sksundae",
    "pyyaml": "yaml",
    "scikit-image": "skimage",
    "tomli-w": "tomli_w",
}
"""Modules of packages whose module has another name."""


@dataclass(frozen=True)
class Check:
    """The result of one check.

    Attributes:
        name: name of the check.
        ok: whether the requirement is met.
        state: description of this computer's state.
        remedy: instruction for a requirement that is not met.
        needed: whether `viform run film` depends on it.
    """

    name: str
    ok: bool
    state: str
    remedy: str = ""
    needed: bool = True

    def row(self) -> dict[str, Any]:
        """The check as an object of the JSON document."""
        return {
            "name": self.name, "ok": self.ok, "found": self.state, "mend": self.remedy,
            "needed": self.needed,
        }  # fmt: skip


def _python() -> Check:
    import platform

    fine = (3, 11) <= sys.version_info[:2] < (3, 14)
    state = f"{platform.python_version()} ({sys.executable})"
    return Check("python", fine, state, "install python 3.11, 3.12 or 3.13")


def _packages() -> Check:
    """Checks that every required package is installed and can be imported."""
    import importlib
    from importlib.metadata import PackageNotFoundError, requires, version

    missing, there = [], 0
    for requirement in requires("viform") or []:
        if "extra ==" in requirement:
            continue
        name = requirement.split(";")[0].split(">")[0].split("=")[0].split("<")[0].strip()
        try:
            version(name)
            importlib.import_module(_RENAMED.get(name, name))
            there += 1
        except (PackageNotFoundError, ImportError, OSError) as exc:
            missing.append(f"{name} ({exc})")
    state = f"{there} packages" if not missing else f"not usable: {', '.join(missing)}"
    return Check("packages", not missing, state, "rm -rf .venv and start ./viform again")


def _opencl() -> Check:
    from cosim.compute.opencl import INSTALL, probe

    devices = probe()
    names = "; ".join(
        f"{number}: {d['platform']}: {d['device']} ({d['units']} units)"
        for number, d in enumerate(devices)
    )
    remedy = f"{INSTALL} (or use --device numba, slower)"
    if not os.path.isdir("/sys/devices/system/cpu") and not devices:
        remedy = "mount /sys, which PoCL needs"
    return Check("opencl", bool(devices), names or "no device", remedy)


def _gl() -> Check:
    from display import GL_INSTALL, probe_gl

    works, description = probe_gl()
    remedy = f"{GL_INSTALL} (or --set display.renderer=opencl, or display.renderer=numpy, slower)"
    return Check("gl", works, description, remedy, needed=False)


def _kernel() -> Check:
    """Checks in a child process that the OpenCL kernel of the pixels can be built and agrees with
    its compiled form."""
    from cosim.compute.forks import python_child

    call = "from scenarios.cli.maintenance.doctor import print_kernel; print_kernel()"
    child = subprocess.run(
        python_child(call), capture_output=True, encoding="utf-8", errors="replace"
    )
    if child.stdout.strip() == "agree":
        return Check("kernel", True, "built, and agrees with the compiled form on every bit")
    last = (child.stderr.strip().splitlines() or ["ended without a message"])[-1]
    last = re.sub(r"^cosim\.errors\.\w+: ", "", last)
    return Check(
        "kernel", False, child.stdout.strip() or last, "repair opencl first, else report this"
    )


def print_kernel() -> None:
    """Prints whether the pixels' OpenCL kernel agrees on every bit with its compiled form, for all
    effects at 100 e. It runs in a child process, because a driver may abort the process. Raises
    InputError without a device."""
    import numpy as np

    from cosim.compute.opencl import open_device
    from sensor import EFFECTS, make_pixels
    from sensor.latched.pixel.charge import Span
    from sensor.latched.pixel.model import ExactModel

    pixels = cycles = 64
    model = ExactModel(100.0, 1, tuple(EFFECTS.values()))
    numbers = np.arange(pixels, dtype=np.uint32)
    spans = [Span(0, cycles, np.arange(pixels) * 2**40)]
    compiled, kernel = (make_pixels(model, numbers, device) for device in (None, open_device()))
    agree = (compiled.expose(spans, cycles) == kernel.expose(spans, cycles)).all()
    print("agree" if agree else "differ")


def _cache() -> Check:
    """Checks the cache, and drops what is damaged in it."""
    from cosim.compute.cache_folder import cache_folder
    from cosim.compute.pocl_files import drop_damaged

    folder = cache_folder()
    if not os.access(folder, os.W_OK):
        return Check("cache", False, str(folder), "set VIFORM_CACHE to a folder you own")
    damaged = drop_damaged(Path(os.environ.get("POCL_CACHE_DIR") or folder / "pocl"))
    state = f"{folder}; {damaged} damaged files of PoCL were in it" if damaged else str(folder)
    remedy = "none is needed: they are dropped, and compiled again by the next run"
    return Check("cache", not damaged, state, remedy, needed=not damaged)


def _memory() -> Check:
    import psutil

    from cosim.compute.cores import cores

    memory = psutil.virtual_memory()
    free, total = memory.available / _GIB, memory.total / _GIB
    state = f"{free:.1f} of {total:.1f} GiB free, {cores()} core{'s' * (cores() > 1)}"
    remedy = f"free some memory: a megapixel run needs {_MEMORY_GIB} GiB"
    return Check("memory", memory.available >= _MEMORY_GIB * _GIB, state, remedy, needed=False)


def _disk() -> Check:
    free = shutil.disk_usage(".").free
    remedy = (
        f"free some disk space: 64 ms of light take about 0.2 GiB, several runs {_DISK_GIB} GiB"
    )
    return Check(
        "disk", free >= _DISK_GIB * _GIB, f"{free / _GIB:.1f} GiB free here", remedy, needed=False
    )


def _folder() -> Check:
    fine = os.access(".", os.W_OK)
    remedy = "change to a folder you can write to, or give --out"
    return Check("folder", fine, os.getcwd(), remedy, needed=False)


def _clips() -> Check:
    try:
        import av
    except ImportError as exc:
        return Check("clips", False, str(exc), "rm -rf .venv and start ./viform again")
    codecs = [c for c in ("h264", "hevc", "vp9", "av1", "mjpeg", "png") if c in av.codecs_available]
    fine = {"h264", "libx264"} <= av.codecs_available
    return Check("clips", fine, f"PyAV {av.__version__}: {', '.join(codecs)}", "pip install av")


CHECKS: tuple[Callable[[], Check], ...] = (
    _python, _packages, _opencl, _kernel, _gl, _clips, _cache, _memory, _disk, _folder,
)  # fmt: skip


def run_checks() -> list[Check]:
    """Runs all checks in parallel, after that of the cache, which the others use; most of them
    wait for a child process."""
    from cosim.compute.stopping import threads

    cache = _cache()
    with threads() as pool:
        return list(pool.map(lambda check: cache if check is _cache else check(), CHECKS))


def doctor(json: Json = False) -> None:
    """Check this machine; exit 0 if `viform run film` can work."""
    checks = run_checks()
    ready = all(check.ok for check in checks if check.needed)
    if json:
        print_document({"ok": ready, "checks": [check.row() for check in checks]})
    else:
        for check in checks:
            mark = "ok" if check.ok else ("MISSING" if check.needed else "note")
            tell(f"{mark:<8} {check.name:<12} {check.state}")
            if not check.ok:
                tell(f"{'':<8} {'':<12} remedy: {check.remedy}")
        tell(as_called(f"`viform run film` {'can work' if ready else 'cannot work yet'}"))
    if not ready:
        raise typer.Exit(1)
