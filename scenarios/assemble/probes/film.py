"""Small test light filmed by the camera of a scenario, with all that it does to light."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light, Piece, Viform
from cosim.compute.opencl import Device
from display import SpikePanel
from sensor import CameraSetting, SpikeCamera

__all__ = ["Probe", "edge_light", "lux_of", "phased_light", "settling_cycles", "steady_light"]

Places = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Probe:
    """A small piece of a scenario's chip. setting: the scenario's. device: OpenCL, or None.

    The exact tier films it: bits that no device or split changes. The pixel's circuit is taken in
    its lumped form, as every tier but the reference does.
    """

    setting: CameraSetting
    device: Device | None

    def sized(self, height: int, width: int, seed: int) -> CameraSetting:
        """The setting on a chip of another size; its noise is of `seed`."""
        chip = replace(self.setting.chip, height=height, width=width)
        return replace(self.setting, chip=chip, seed=seed)

    def film(
        self, light: Light, cycles: int, setting: CameraSetting, rows: tuple[int, int] | None = None
    ) -> Viform:
        """`cycles` cycles of `light`, which must reach a cycle further, on a `sized` chip. rows: of
        it that are filmed, all unless given."""
        camera = SpikeCamera(setting, self.device, rows)
        return camera.step(light, Block(0, cycles))


def lux_of(setting: CameraSetting, rate: float) -> float:
    """Lux on a pixel for so many thresholds a cycle (more than 1 overfills)."""
    return rate / setting.rate(1.0)


def _plane(shape: tuple[int, int], lux: float) -> npt.NDArray[np.float32]:
    return np.full(shape, lux, np.float32)


def steady_light(shape: tuple[int, int], lux: float, stop: int) -> Light:
    """The same light everywhere, to `stop` (ps)."""
    plane = _plane(shape, lux)
    return Light((Piece(0, stop, plane, plane),))


def phased_light(
    shape: tuple[int, int], before: float, after: float, at: Places, stop: int
) -> Light:
    """Light (lux) that jumps in each column at its own instant `at`, (width,) ps rising."""
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
    """An edge that enters at the left at instant 0 and moves right at `speed` pixels a second, for
    `cycles` cycles: `behind` it one light, `ahead` the other (lux).

    A pixel gathers over its whole area, so while the edge crosses it its light runs linearly: what
    falls on the pixels is exact at every instant.
    """
    stop = clock.edge(cycles)
    height, width = shape
    ps = 10**12 / speed  # to cross a pixel

    def plane(column: int) -> npt.NDArray[np.float32]:
        made = _plane((height, width), ahead)
        made[:, :column] = behind
        return made

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
    """Cycles after which an emitter's light is its drive's to 5e-5."""
    return math.ceil(10 * max(panel.rise, panel.decay) * panel.clock.hz)
