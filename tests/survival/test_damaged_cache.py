"""Caches whose files are damaged: what was compiled is dropped and compiled again."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import redirect_stderr
from functools import partial
from importlib import import_module
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from tests.survival.forked import call

DAMAGES: Final[dict[str, Callable[[bytes], bytes]]] = {
    "empty": lambda data: b"",
    "cut": lambda data: data[: len(data) // 2],
    "without its end": lambda data: data[:-40],
    "one bit": lambda data: data[:1000] + bytes([data[1000] ^ 1]) + data[1001:],
    "zeros": lambda data: bytes(len(data)),
}
"""What a file becomes."""
CASES: Final = list(product(("nbi", "nbc"), DAMAGES))
KERNELS: Final = 2
FUNCTION = """
@njit(cache=True)
def add{n}(a):
    return a + {n}

"""


def called(place: Path) -> list[int]:
    """Numbers of the functions whose compiled form is found on the disk."""
    os.environ["NUMBA_CACHE_DIR"] = str(place / "numba")
    sys.path.insert(0, str(place))
    module = import_module("functions")
    functions = [getattr(module, f"add{n}") for n in range(len(CASES) + 1)]
    assert [add(1) for add in functions] == [1 + n for n in range(len(functions))]
    return [n for n, add in enumerate(functions) if add.stats.cache_hits]


def launched(place: Path) -> dict[str, Any]:
    """Values of OpenCL kernels, and what is said."""
    for name in ("POCL_CACHE_DIR", "XDG_CACHE_HOME"):
        os.environ.pop(name, None)
    os.environ["VIFORM_CACHE"] = str(place / "cache")
    from cosim.compute.opencl import open_device

    device, values = open_device(), []
    buffer = device.room(4)
    with redirect_stderr(StringIO()) as said:
        for n in range(KERNELS):
            source = f"kernel void number(global int *a) {{ a[0] = {n}; }}"
            device.kernel(source, "number")(device.queue, (1,), None, buffer)
            values.append(int(device.download(buffer, np.zeros(1, np.int32))[0]))
    return {"values": values, "said": said.getvalue()}


@pytest.mark.slow
def test_damaged_files_of_opencl_are_compiled_again(tmp_path: Path) -> None:
    """Each of them ends the process where PoCL meets it."""
    assert call(partial(launched, tmp_path), tmp_path)["said"] == ""
    cache = tmp_path / "cache/pocl"
    kernels, programs = sorted(cache.rglob("*.so")), sorted(cache.rglob("*.bc"))
    for path, damage in ((kernels[0], "empty"), (programs[1], "cut")):
        path.write_bytes(DAMAGES[damage](path.read_bytes()))
    (launchers,) = cache.parent.glob("pytools/*.sqlite")
    launchers.write_bytes(DAMAGES["zeros"](launchers.read_bytes()))
    said = (
        f"viform: files of the cache {cache} were damaged (2); they are dropped and compiled "
        "again\n"
    )
    found = call(partial(launched, tmp_path), tmp_path)
    assert found == {"values": list(range(KERNELS)), "said": said}


def test_a_damaged_file_of_numba_is_compiled_again(tmp_path: Path) -> None:
    functions = [FUNCTION.format(n=n) for n in range(len(CASES) + 1)]
    (tmp_path / "functions.py").write_text(f"from numba import njit\n\n\n{''.join(functions)}")
    assert call(partial(called, tmp_path), tmp_path) == []
    for n, (end, damage) in enumerate(CASES):
        (file,) = tmp_path.rglob(f"functions.add{n}-*.{end}")
        file.write_bytes(DAMAGES[damage](file.read_bytes()))
    assert call(partial(called, tmp_path), tmp_path) == [len(CASES)]
    assert call(partial(called, tmp_path), tmp_path) == list(range(len(CASES) + 1))
