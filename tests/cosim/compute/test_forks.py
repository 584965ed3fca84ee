"""A process that is forked from one that has computed: what it may do, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cosim.compute.cores import by_rows
from cosim.compute.opencl import Device, open_device
from display.render.context import open_context
from tests.survival.forked import copied

REFUSED = (
    "InputError: a process that simulates must be one that was spawned, not forked from one that "
    "has used {}, whose threads a fork does not copy; start it by "
    'multiprocessing.get_context("spawn"), that of a DataLoader by multiprocessing_context="spawn"'
)


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
