"""Throughput of the display's renderer, against a GL renderer with one draw call for each plane.

The stream has the rates of the picture in the sensor benchmark. The observer is a fixed eye (a
pursuing eye in display.pursuit). Every timed call includes the transfer of its image to the host.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.opencl import Device
from cosim.run.timing import BRIGHT, DARK, REAL_TIME, REPEATS, Row, least_of
from cosim.spikes.viform import WORD
from display import FixedEye, PlaneByPlane, PursuingEye, SpikePanel, make_renderer, panel_views
from sensor import CHIPS

CYCLES = 512
"""Number of planes in a timed call."""
PLAIN_CYCLES = 16
"""Number of planes in a timed call of the plain renderer."""
BATCH = 64
"""Number of planes in a span for the still eye."""
PURSUED = 8
"""Number of planes in a span for the pursuing eye, which moves 0.8 pixels in this time."""
SPEED = 4000.0
"""Speed of the pursuing eye, pixels/s."""
Kind = Literal["impulse", "hold", "causal", "pursuit"]
KINDS: tuple[Kind, ...] = ("impulse", "hold", "causal", "pursuit")


def _words(cycles: int, shape: tuple[int, int]) -> npt.NDArray[np.uint32]:
    """Words of a picture without edges; every pixel fires regularly at its rate."""
    rate = np.linspace(DARK, BRIGHT, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    phase = np.random.default_rng(1).random(shape, dtype=np.float32)
    words = np.zeros((-(-cycles // WORD), *shape), np.uint32)
    for cycle in range(cycles):
        phase += rate
        fired = phase >= 1
        phase -= fired
        words[cycle // WORD] |= fired.astype(np.uint32) << np.uint32(cycle % WORD)
    return words


def _planes_a_second(
    kind: Kind, words: npt.NDArray[np.uint32], shape: tuple[int, int]
) -> tuple[float, float]:
    """Throughput of our renderer and of the plain one, planes/s."""
    clock, moves = Clock.from_hz(REAL_TIME), kind == "pursuit"
    panel = SpikePanel(shape, clock, BRIGHT, "impulse" if kind == "pursuit" else kind)
    batch, end = PURSUED if moves else BATCH, clock.edge(CYCLES)
    eye = FixedEye((end // 2,), panel.luminance, 0, end)
    observer = PursuingEye(eye, (0.0, SPEED)) if moves else eye
    views = panel_views(observer, panel, 0, CYCLES, batch)
    bits = [(words[0] >> np.uint32(n)) & np.uint32(1) for n in range(PLAIN_CYCLES)]
    planes = np.stack(bits).astype(np.uint8)
    ours, plain = make_renderer("auto", panel, batch, 1), PlaneByPlane(kind, shape)

    def show() -> npt.NDArray[np.float64]:
        ours.step(words, CYCLES, views)
        return ours.take(0)

    try:
        spent = least_of([show, lambda: plain.show(planes, SPEED / REAL_TIME)], REPEATS)
    finally:
        ours.close()
        plain.close()
    return CYCLES / spent[0], PLAIN_CYCLES / spent[1]


def display_rows(device: Device | None, ceiling: float | None) -> list[Row]:
    """The rows `display.*`, at the size of SpikeTwo.

    Args:
        device: OpenCL device; not used.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    shape = CHIPS["spiketwo"].height, CHIPS["spiketwo"].width
    words, rows = _words(CYCLES, shape), []
    for kind in KINDS:
        value, plain = _planes_a_second(kind, words, shape)
        share = value * shape[0] * shape[1] / ceiling if ceiling else None
        rows.append(
            Row(f"display.{kind}", "exact", value, "planes/s", value / REAL_TIME, share,
                value / plain)
        )  # fmt: skip
    return rows
