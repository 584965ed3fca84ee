"""A process that is forked from one that has computed: what it may do, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit, prange

from cosim.compute.cores import all_cores, by_rows
from cosim.compute.opencl import Device, open_device
from display.render.context import open_context
from tests.survival.forked import copied

REFUSED = (
    "InputError: a process that simulates must be one that was spawned, not forked from one that "
    "has used {}, whose threads a fork does not copy; start it by "
    'multiprocessing.get_context("spawn"), that of a DataLoader by multiprocessing_context="spawn"'
)


@all_cores
@njit(parallel=True)
def doubled(values):  # type: ignore[no-untyped-def]
    out = np.empty_like(values)
    for n in prange(values.size):
        out[n] = 2 * values[n]
    return out


def test_opencl_is_refused(device: Device) -> None:
    buffer = device.upload(np.arange(4))
    for work in (
        open_device,
        lambda: device.queue,
        lambda: device.download(buffer, np.empty(4, np.int64)),
        lambda: device.upload(np.arange(4)),
        device.finish,
    ):
        assert copied(work) == REFUSED.format("OpenCL")
    # The process itself goes on.
    assert device.download(buffer, np.empty(4, np.int64)).tolist() == [0, 1, 2, 3]


def test_the_threads_of_numba_are_refused() -> None:
    assert doubled(np.arange(3)).tolist() == [0, 2, 4]
    assert copied(lambda: doubled(np.arange(3))) == REFUSED.format("numba")


def test_opengl_is_refused() -> None:
    open_context().release()
    assert copied(open_context) == REFUSED.format("OpenGL")


def test_threads_of_rows_are_made_anew() -> None:
    def rows() -> list[int]:
        found = np.zeros(5, np.int64)
        fill: Callable[[int, int], None] = lambda first, stop: found.__setitem__(  # noqa: E731
            slice(first, stop), range(first, stop)
        )
        by_rows(fill, 5)
        return found.tolist()

    assert copied(rows) == str(rows())
