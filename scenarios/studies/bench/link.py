"""Throughput of the link's modem: bytes to panel words, and spikes to verified bytes.

The spikes are those of a noiseless panel in front of the camera; the timing does not depend on
them. A call sends one group and receives one: codewords, line code and panel words at the sender;
detection, line code, codewords and frame checks at the receiver. The plain implementation has the
same coding and detects in numpy. The detectors alone are in `detector`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.run.timing import REAL_TIME, Row, least_of
from cosim.spikes.viform import WORD, words_for
from link.coding import Blocks, Inbox
from link.detect.catalogue import make_detector
from link.detect.joint import Joint
from link.detect.joint_numpy import soft_by_numpy
from link.layout import TRAINING, Layout
from link.mode import Mode
from link.sending import FileTransmission
from link.timing import Registration, Timing
from scenarios.studies.bench.detector import DETECTORS, information_rows, time_rows
from scenarios.studies.bench.ldpc import ldpc_rows

__all__ = ["link_rows"]

SIZES: Final = (256, 480, 960)
"""Side of the panel, pixels; a cell has 2 x 2 pixels and a symbol two ticks."""
TURNS: Final = 3
_CELL, _TICKS = 2, 2
_SCALE, _MARGIN = 0.995, 45
"""Camera pixels per panel pixel, and margin around the image of the panel, camera pixels."""
_FIRST: Final = 8
"""Tick of the first light."""
_GROUPS: Final = 4
"""Minimum number of groups in the file, so that consecutive calls send different groups."""

Words = npt.NDArray[np.uint32]


def _spikes(
    pixels: Callable[[int], npt.NDArray[np.bool_]], symbols: int, place: npt.NDArray[np.float64],
    shape: tuple[int, int],
) -> Words:  # fmt: skip
    """Words with a spike in every tick in which the nearest panel pixel is on."""
    y, x = np.indices(shape)
    back = np.linalg.inv(place)
    u, v, w = np.tensordot(back, np.stack([x, y, np.ones(shape)]), 1)
    column, row = np.rint(u / w).astype(np.intp), np.rint(v / w).astype(np.intp)
    words = np.zeros((words_for(_FIRST + symbols * _TICKS + 1), *shape), np.uint32)
    for n in range(symbols):
        panel = pixels(n)
        inside = (row >= 0) & (row < panel.shape[0]) & (column >= 0) & (column < panel.shape[1])
        lit = np.where(inside, panel[row * inside, column * inside], False)
        for tick in range(_FIRST + n * _TICKS, _FIRST + (n + 1) * _TICKS):
            words[tick // WORD] |= lit.astype(np.uint32) << np.uint32(tick % WORD)
    return words


def _place(place: npt.NDArray[np.float64], side: int) -> tuple[Registration, Timing]:
    """Returns registration and timing of the panel at `place` before a camera of `side` rows."""
    timing = Timing(float(_FIRST), float(_TICKS), 0.0, side)
    return Registration(place, np.zeros((0, 3)), 0.3), timing


def _detectors(size: int) -> list[Row]:
    """The rows of the detectors' processor time, on random data of a panel of `size` pixels."""
    mode = Mode(size, size, _CELL, _TICKS, "none", 32)
    data = np.random.Generator(np.random.Philox(key=1))
    symbols = TRAINING + 5 * mode.code.symbols
    one = Layout(mode).group_bytes(symbols // mode.code.symbols)
    sent = FileTransmission(mode, data.bytes(one), "bench", most_symbols=symbols)
    side = round(size * _SCALE) + _MARGIN
    off = (side - size * _SCALE) / 2
    place = np.array([[_SCALE, 0, off], [0, _SCALE, off], [0, 0, 1.0]])
    words = _spikes(sent.pixels, symbols, place, (side, side))
    detectors = {name: make_detector(name, sent.layout, *_place(place, side)) for name in DETECTORS}
    for detector in detectors.values():
        detector.learn(words, 0, sent.bits(0, TRAINING), 0)
    count = symbols - TRAINING
    return time_rows(detectors, (words, 0, TRAINING, count), count * sent.layout.cells)


def _modem(size: int) -> tuple[int, int, float, list[Callable[[], int]], int]:
    """A modem for the benchmark.

    Returns:
        The number of cells; the file bits of a group; its simulated time, s; the calls of our
        implementation and of the plain one, which return the number of correct frames; and the
        camera pixel-cycles of a group.
    """
    mode = Mode(size, size, _CELL, _TICKS, "8b10b", 32)
    data = np.random.Generator(np.random.Philox(key=1))
    empty = FileTransmission(mode, b"", "bench")
    form, group = Blocks(empty.layout), empty.layout.group
    whole = form.frames * form.symbol_bytes
    sent = FileTransmission(mode, data.bytes(_GROUPS * whole), "bench")
    side = round(size * _SCALE) + _MARGIN
    off = (side - size * _SCALE) / 2
    place = np.array([[_SCALE, 0, off], [0, _SCALE, off], [0, 0, 1.0]])
    symbols = TRAINING + form.groups * group
    words = _spikes(sent.pixels, symbols + 2, place, (side, side))
    detector = Joint(sent.layout, *_place(place, side))
    detector.learn(words, 0, sent.bits(0, TRAINING), 0)
    turn = 0

    def call(plain: bool) -> int:
        nonlocal turn
        turn = (turn + 1) % (sent.groups // form.groups)
        first = (TRAINING + turn * form.groups * group) * _TICKS
        sent.words(first, form.groups * group * _TICKS)
        part = words, 0, TRAINING, form.groups * group
        soft = soft_by_numpy(detector, *part) if plain else detector.soft(*part)
        inbox = Inbox(sent.layout)
        return sum(inbox.put(n, soft[n * group : (n + 1) * group]) for n in range(form.groups))

    ticks = form.groups * group * _TICKS
    calls = [lambda: call(False), lambda: call(True)]
    return sent.layout.cells, 8 * whole, ticks / REAL_TIME, calls, side * side * ticks


def link_rows(device: Device | None, ceiling: float | None) -> list[Row]:
    """The rows `link.modem`, by the number of cells, `link.detector` and `link.ldpc`.

    Args:
        device: OpenCL device of the code; the modem does not use it.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    rows = []
    for size in SIZES:
        cells, bits, seconds, calls, pixels = _modem(size)
        ours, plain = least_of(list(calls), TURNS)
        rows.append(
            Row(
                "link.modem", f"joint, {cells} cells", bits / ours, "bit/s", seconds / ours,
                pixels / ours / ceiling if ceiling else None, plain / ours,
            )
        )  # fmt: skip
    return [*rows, *_detectors(SIZES[-1]), *information_rows(), *ldpc_rows(device)]
