"""Kernels of a program on a device, shared by the threads of a process."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np

_NUMBERS = {
    "char": np.int8, "uchar": np.uint8, "short": np.int16, "ushort": np.uint16, "int": np.int32,
    "uint": np.uint32, "long": np.int64, "ulong": np.uint64, "float": np.float32,
    "double": np.float64,
}  # fmt: skip
"""Types of the numbers that kernels take as arguments."""


def _made(program: Any, name: str) -> Any:
    """A kernel of a built program. pyopencl keeps the code that sets its arguments in a database;
    if that is damaged, it is dropped and not used."""
    import pyopencl as cl

    try:
        return _typed(cl.Kernel(program, name))
    except (cl.Error, MemoryError):
        raise
    except Exception:
        if cl._PYOPENCL_NO_CACHE:
            raise
        cl._PYOPENCL_NO_CACHE = True
        for file in Path(os.environ["XDG_CACHE_HOME"]).glob("pytools/*pyopencl-invoker*"):
            file.unlink(missing_ok=True)
        return _typed(cl.Kernel(program, name))


def _typed(kernel: Any) -> Any:
    """The kernel, with its numbers declared to pyopencl, which otherwise asks each number for its
    type at each launch: 7 us a number. Unchanged if the driver does not tell the types."""
    import pyopencl as cl

    info = cl.kernel_arg_info
    try:
        types = [
            str(kernel.get_arg_info(n, info.TYPE_NAME))
            if kernel.get_arg_info(n, info.ADDRESS_QUALIFIER)
            == cl.kernel_arg_address_qualifier.PRIVATE
            else None
            for n in range(kernel.num_args)
        ]
    except cl.Error:
        return kernel
    if all(name is None or name in _NUMBERS for name in types):
        kernel.set_scalar_arg_dtypes([None if name is None else _NUMBERS[name] for name in types])
    return kernel


class SharedKernel:
    """A kernel that any thread may call: each has its own, as a kernel holds its arguments."""

    def __init__(self, program: Any, name: str) -> None:
        self._program, self._name, self._own = program, name, threading.local()

    def __call__(self, *arguments: Any) -> Any:
        try:
            kernel = self._own.kernel
        except AttributeError:
            kernel = self._own.kernel = _made(self._program, self._name)
        return kernel(*arguments)
