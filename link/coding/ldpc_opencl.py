"""Decoding of low-density parity-check words on an OpenCL device.

A work-group has one word in local memory. On a processor it is one work-item with vectors of 64
bytes; on a GPU it has a work-item for every four checks of a row.
"""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device, wide_cl
from cosim.errors import InputError
from link.coding.ldpc_decoding import MESSAGE, OFFSET, SOFT, SUM

if TYPE_CHECKING:
    from link.coding.ldpc import Ldpc

_ON_PROCESSOR = (64, 16)
"""Lanes of a vector on a processor, best first; they must divide the lifting size."""
_ON_GPU = 4
_WORDS = 512
"""Words decoded at a time if their messages are in global memory: about 100 kB each."""


def decode_on_device(
    device: Device, code: Ldpc, soft: npt.NDArray[np.int8], rounds: int,
    data: npt.NDArray[np.uint8], ok: npt.NDArray[np.bool_], spent: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    """Decodes words as `link.coding.ldpc_decoding.decode_words` does.

    Raises:
        ValueError: if the lifting size is no multiple of 16.
        InputError: if the device has too little local memory.
    """
    lifting = code.lifting
    if lifting % _ON_PROCESSOR[-1]:
        raise ValueError(f"lifting must be a multiple of 16 on a device, not {lifting}")
    if not len(soft):
        return
    lanes = _ON_GPU if device.gpu else next(n for n in _ON_PROCESSOR if lifting % n == 0)
    items = lifting // lanes if device.gpu else 1
    starts, columns, shifts = code.schedule
    needed, messages = code.columns * (lifting + 3 * lanes) + 4, len(columns) * lifting
    far = device.gpu and device.handle.local_mem_size < needed + messages
    needed += 0 if far else messages
    if device.handle.local_mem_size < needed:
        raise InputError(
            "the OpenCL device", f"one with {needed} bytes of local memory", device.name,
            "choose another or pass --device numba",
        )  # fmt: skip
    sizes = {
        "ITEMS": items, "LANES": lanes, "Z": lifting, "ROWS": len(starts) - 1,
        "COLUMNS": code.columns, "FIRST": code.data_columns, "EDGES": len(columns),
        "DEGREE": int(np.diff(starts).max()), "DATA_BITS": code.data_bits,
        "WORD_BITS": code.word_bits, "MESSAGE": MESSAGE, "OFFSET": OFFSET, "SOFT": SOFT,
        "SUM": SUM,
    }  # fmt: skip
    source = wide_cl() + (files("link.coding") / "ldpc.cl").read_text(encoding="utf-8")
    options = [f"-D{k}={v}" for k, v in sizes.items()]
    kernel = device.kernel(source, "decode", (*options, *(["-DFAR"] if far else [])))
    order = device.upload(starts), device.upload(np.stack([columns, shifts], axis=1))
    most = _WORDS if far else len(soft)
    room = device.room(min(most, len(soft)) * messages if far else 1)
    for some in (slice(n, n + most) for n in range(0, len(soft), most)):
        given = soft[some]
        answers: tuple[npt.NDArray[Any], ...] = data[some], ok[some], spent[some]
        buffers = [device.target(array) for array in answers]
        kernel(
            device.queue, (len(given) * items,), (items,), device.share(given), *order,
            np.int32(rounds), *buffers, room,
        )  # fmt: skip
        for array, buffer in zip(answers, buffers, strict=True):
            device.settle(buffer, array)
