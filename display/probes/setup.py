"""What probes look at, and with what: test light, and the protocol of their camera."""

from __future__ import annotations

import math
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Piece, Viform
from display.panels.panel import SpikePanel

Places = npt.NDArray[np.int64]
MOST: Final = 5 * 10**7
"""Maximum number of samples of light that a probe keeps in memory. One that needs more, of a clock
above some 1 MHz or of a slow panel, has no figure."""
MOST_SPIKES: Final = 16 * 10**6
"""Maximum number of spikes of asynchronous pixels that a probe simulates, at some microsecond of a
core each. One that needs more has no figure: with much dark current, or of grey at a clock above
some 300 kHz."""


class ProbeCamera(Protocol):
    """A camera that records test light with arrays of any size.

    Attributes:
        clock: latch clock.
        height: number of rows of the whole sensor.
        seed: seed of the camera's noise.
        identity: all on which its streams depend, see `described`; an object that is none if that
            is not known.
    """

    @property
    def clock(self) -> Clock: ...
    @property
    def height(self) -> int: ...
    @property
    def seed(self) -> int: ...
    @property
    def identity(self) -> Any: ...

    def lux(self, rate: float) -> float:
        """Illuminance for `rate` thresholds a cycle, lux; above 1 the pixel saturates."""
        ...

    def spikes(self, rate: float) -> float:
        """Mean number of firings a second that are simulated one by one for a pixel at this light,
        thresholds a cycle, at most: with those of its dark current and of its longest width; 0 for
        pixels that are simulated cycle by cycle."""
        ...

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        """Delay from a clock edge to the latch of each row for a sensor with `rows` rows, ps,
        (rows,)."""
        ...

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        """Records `cycles` cycles.

        Args:
            light: test light, lux; it must extend one cycle beyond the end.
            cycles: number of cycles from the instant 0.
            shape: (height, width) of the array, pixels.
            seed: seed of the noise.
            rows: first row and end of the recorded rows, None for all.
        """
        ...


def _plane(shape: tuple[int, int], lux: float) -> npt.NDArray[np.float32]:
    return np.full(shape, lux, np.float32)


def steady_light(shape: tuple[int, int], lux: float, stop: int) -> Light:
    """Uniform light from 0 to `stop`, ps."""
    plane = _plane(shape, lux)
    return Light((Piece(0, stop, plane, plane),))


def phased_light(
    shape: tuple[int, int], before: float, after: float, at: Places, stop: int
) -> Light:
    """Light that steps from `before` to `after`, lux, in each column at another instant.

    Args:
        shape: (height, width), pixels.
        before, after: light before and after the step, lux.
        at: instant of the step in each column, ps, (width,), increasing.
        stop: end of the light, ps.
    """
    height, width = shape
    marks = [0, *(int(t) for t in at), stop]
    pieces = []
    for column in range(width + 1):
        plane = _plane((height, width), before)
        plane[:, :column] = after
        pieces.append(Piece(marks[column], marks[column + 1], plane, plane))
    return Light(tuple(pieces))


def edge_light(
    shape: tuple[int, int], ahead: float, behind: float, speed: float, clock: Clock, cycles: int
) -> Light:
    """An edge that enters at the left at the instant 0 and moves to the right. A pixel integrates
    over its whole area, so its light is linear in time while the edge crosses it: the light is
    exact at every instant.

    Args:
        shape: (height, width), pixels.
        ahead, behind: light in front of the edge and behind it, lux.
        speed: speed of the edge, pixels/s.
        clock, cycles: clock and length of the light.
    """
    stop = clock.edge(cycles)
    height, width = shape
    ps = 10**12 / speed  # to cross a pixel

    def plane(column: int) -> npt.NDArray[np.float32]:
        values = _plane((height, width), ahead)
        values[:, :column] = behind
        return values

    pieces, now, column = [], plane(0), 0
    while round(column * ps) < stop and column < width:
        later = plane(column + 1)
        box = (0, height, column, column + 1)
        pieces.append(Piece(round(column * ps), round((column + 1) * ps), now, later, box))
        now, column = later, column + 1
    if pieces[-1].stop < stop:
        pieces.append(Piece(pieces[-1].stop, stop, now, now))
    return Light(tuple(pieces))


def settling_cycles(panel: SpikePanel) -> int:
    """Number of cycles after which the light of the emitter equals its drive within 5e-5."""
    return math.ceil(10 * max(panel.rise, panel.decay) * panel.clock.hz)


def too_much(
    camera: ProbeCamera, rate: float, cycles: int, pixels: int, samples: int | None = None
) -> bool:
    """Whether a probe is left out, as it has more light than MOST or more spikes than MOST_SPIKES.

    Args:
        camera: camera of the probe.
        rate: its brightest light, thresholds a cycle.
        cycles: length of the recording, cycles of the camera.
        pixels: number of pixels.
        samples: samples of the light that a cycle keeps in memory; those of the pixels if None.
    """
    kept = pixels if samples is None else samples
    spikes = camera.spikes(rate) * cycles / camera.clock.hz * pixels
    return cycles * kept > MOST or spikes > MOST_SPIKES
