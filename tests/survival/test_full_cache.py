"""A disk of the caches that is full, or becomes full during a run: compiled functions are not kept,
and what OpenCL cannot compile is one line."""

from __future__ import annotations

import ctypes
import errno
import os
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.survival import small_disk
from tests.survival.forked import call
from tests.survival.small_disk import mount_private, resize
from tests.survival.test_full_disk import refusal, viform

MIB = 1 << 20
RUN = (
    "run", "film", "--set", "sensor.width=64", "--set", "sensor.height=64",
    "--set", "duration=4 ms",
)  # fmt: skip


def mounted(place: Path, size: int) -> Path:
    """A folder for caches on a disk of `size` bytes, which this process uses from now on."""
    cache = place / "cache"
    cache.mkdir()
    mount_private(cache, size)
    cache.chmod(0o700)
    for name in ("POCL_CACHE_DIR", "XDG_CACHE_HOME", "MPLCONFIGDIR"):
        os.environ.pop(name, None)
    os.environ["VIFORM_CACHE"] = str(cache)
    os.environ["NUMBA_CACHE_DIR"] = str(cache / "numba")
    return cache


def not_permitted(number: int, place: Path) -> None:
    """A mount that the system refuses by a number of <errno.h>."""
    small_disk._libc = SimpleNamespace(unshare=lambda *_: ctypes.set_errno(number) is not None)
    mounted(place, 64 << 10)


def free(folder: Path) -> int:
    status = os.statvfs(folder)
    return status.f_bavail * status.f_frsize


def compiled(place: Path) -> dict[str, Any]:
    """A numba function of a full disk: its value, twice, and the files that are kept."""
    cache = mounted(place, 64 << 10)
    source = place / "function.py"
    source.write_text(
        "from numba import njit\n\n@njit(cache=True)\ndef add(a, b):\n    return a + b\n"
    )
    space: dict[str, Any] = {"__file__": str(source), "__name__": "function"}
    exec(compile(source.read_text(), source, "exec"), space)
    (cache / "ballast").write_bytes(bytes(free(cache)))
    values = [space["add"](1, 2), space["add"](1.5, 2.0)]
    return {"values": values, "kept": [path.name for path in cache.rglob("*.nbc")]}


def filled(place: Path) -> dict[str, Any]:
    """Kernels before and after the disk is filled, and with room again."""
    from cosim.compute.opencl import open_device
    from cosim.errors import InputError

    cache = mounted(place, 64 * MIB)
    device = open_device()

    def build(n: int) -> str:
        source = f"__kernel void k(__global int *a) {{ a[get_global_id(0)] = {n}; }}"
        try:
            kernel = device.kernel(source, "k")
        except InputError as exc:
            return str(exc)
        import numpy as np

        buffer = device.room(16)
        kernel(device.queue, (4,), None, buffer)
        return str(device.download(buffer, np.zeros(4, np.int32)).tolist())

    said = [build(1)]
    (cache / "ballast").write_bytes(bytes(free(cache) - 20 * MIB))
    said += [build(1), build(2)]
    resize(cache, 128 * MIB)
    return {"said": [*said, build(2)], "pocl": str(cache / "pocl")}


def run(place: Path, size: int, *options: str) -> dict[str, Any]:
    """A run with a cache of this size, and what is free there after it."""
    cache = mounted(place, size)
    code, errors = viform(*RUN, "--out", str(place / "run"), *options)
    line = refusal(code, errors) if code else ""
    return {"code": code, "line": line, "free": free(cache), "errors": errors}


@pytest.mark.parametrize("number", [errno.EPERM, errno.ENOSPC, errno.EINVAL])
def test_where_no_disk_may_be_mounted_its_tests_are_skipped(number: int, tmp_path: Path) -> None:
    with pytest.raises(pytest.skip.Exception, match="needs mounts: unshare: "):
        call(partial(not_permitted, number, tmp_path), tmp_path)


def test_a_function_that_cannot_be_kept_is_used(tmp_path: Path) -> None:
    assert call(partial(compiled, tmp_path), tmp_path) == {"values": [3, 3.5], "kept": []}


def test_kernels_are_refused_before_the_compiler_meets_a_full_disk(tmp_path: Path) -> None:
    got = call(partial(filled, tmp_path), tmp_path)
    first, kept, refused, again = got["said"]
    assert (first, kept, again) == ("[1, 1, 1, 1]", "[1, 1, 1, 1]", "[2, 2, 2, 2]")
    assert refused.startswith(
        "the cache of compiled kernels must be on a disk with 32 MiB of room, not "
    )
    assert f"{got['pocl']} (" in refused and "MiB free)" in refused


@pytest.mark.slow
def test_a_run_without_opencl_goes_on_without_its_cache(tmp_path: Path) -> None:
    got = call(partial(run, tmp_path, 200_000, "--device", "numba"), tmp_path)
    assert got["code"] == 0 and got["free"] < 100_000, got["errors"]


@pytest.mark.slow
def test_a_run_that_needs_the_compiler_is_one_line(tmp_path: Path) -> None:
    got = call(partial(run, tmp_path, 30 * MIB), tmp_path)
    assert got["code"] == 2 and "the cache of compiled kernels must be on a disk" in got["line"]
