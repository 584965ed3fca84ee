"""A slow drift of the gain that all pixels have in common.

The counts of a chip under still light vary more than those of independent pixels: supply, threshold
and lamp drift. The gain is 1 + size n(t), n linear between standard normal values `KNOT` cycles
apart, in steps of `STEP` cycles, so that constant light stays constant in between. A step begins
within a word of the output: the light of all pixels changes in that word alone.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final

import numpy as np
from pydantic import Field
from scipy.special import ndtri

from cosim.clock import Clock
from cosim.compute.cores import by_rows
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.light.light import Light, Piece, Plane, Scaled
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import Key, PixelEffect, Setting, Sized, crosstalk_cost
from sensor.latched.effects.windows import bound_of, shift_error

KNOT: Final = 512
"""Cycles between the values of the drift: those of the recording, about."""
STEP: Final = 128
"""Cycles of one gain."""
_BEGIN: Final = 16
"""Cycle at which the second step begins; the first one extends to before the run."""
_LARGE: Final = 1 << 18
"""Pixels from which a plane is computed on all cores."""
_SIGMAS: Final = 4.0
"""Deviations within which the drift of a run is taken to lie."""


@lru_cache(maxsize=8)
def _knots(seed: int, knot: int) -> tuple[float, float]:
    """Standard normal values of a knot and of the next."""
    words = philox4x32((0, np.arange(knot, knot + 2), 0, 0), (seed, Stream.DRIFT))[0]
    low, high = ndtri((words.astype(np.float64) + 0.5) / 2.0**32)
    return float(low), float(high)


class Drift:
    """The light times the gain of its instant.

    Args:
        clock: whose cycles are counted.
        size: RMS of the gain at a knot.
        seed: seed of the run.
    """

    def __init__(self, clock: Clock, size: float, seed: int) -> None:
        self._clock, self._size, self._seed = clock, size, seed
        self._parts: dict[tuple[int, int], tuple[Piece, Piece]] = {}
        self._planes: dict[tuple[int, int], tuple[Plane, Plane]] = {}

    def gain(self, step: int) -> float:
        """Gain of a step of `STEP` cycles."""
        knot, part = divmod(step * STEP, KNOT)
        low, high = _knots(self._seed, knot)
        return 1 + self._size * (low + (high - low) * part / KNOT)

    def step(self, cycle: int) -> int:
        """The step of a cycle, from 0 on."""
        return max((cycle - _BEGIN) // STEP + 1, 0)

    def _edge(self, step: int) -> int:
        """The instant at which a step begins, ps."""
        return self._clock.edge((step - 1) * STEP + _BEGIN)

    def on(
        self, light: Light, start: int, cycles: int, late: int = 0, *, products: bool = False
    ) -> Light:
        """The light of these cycles and of two before and after, as far as it is given.

        Args:
            light: lux on the pixels.
            start, cycles: cycles of the clock.
            late: most time, ps, by which it reaches a row later (`row_delay` of `SpikeCamera`). A
                row has the gain of the instant at which the light was given.
            products: whether the pixels multiply `Scaled` planes themselves, in all calls.
        """
        clock = self._clock
        begin = max(clock.edge(start - 2) - late, light.pieces[0].start)
        end = min(clock.edge(start + cycles + 2), light.pieces[-1].stop)
        made: list[Piece] = []
        for piece in light.pieces:
            if piece.stop <= begin or piece.start >= end:
                continue
            first = self.step(clock.cycle_at(max(piece.start, begin)))
            last = self.step(clock.cycle_at(min(piece.stop, end) - 1))
            made += [self._part(piece, step, products) for step in range(first, last + 1)]
        self._parts = {k: v for k, v in self._parts.items() if any(v[1] is p for p in made)}
        return Light(tuple(made), light.unit)

    def _part(self, piece: Piece, step: int, products: bool) -> Piece:
        """The part of a piece within a step: one object, however often it is asked for."""
        known = self._parts.get((id(piece), step))
        if known is not None and known[0] is piece:
            return known[1]
        start = piece.start if step == 0 else max(piece.start, self._edge(step))
        stop = min(piece.stop, self._edge(step + 1))
        first, last = (self._level(piece, at, step, products) for at in (start, stop))
        joins = step == 0 or self._edge(step) < piece.start  # the part before has the same gain
        part = Piece(start, stop, first, last, piece.changed if joins else None)
        self._parts[id(piece), step] = piece, part
        return part

    def _level(self, piece: Piece, at: int, step: int, products: bool) -> Plane:
        """Level of a piece at an instant, ps, at least 0, times the gain of a step."""
        if piece.constant or at == piece.start:
            return self._scaled(piece.first, step, products)
        if at == piece.stop:  # the first plane of the next piece
            return self._scaled(piece.last, step, products)
        # numba, which other starts need not load
        from sensor.latched.effects.gained import gained

        first, last = (np.ascontiguousarray(end, np.float32) for end in (piece.first, piece.last))
        level, gain = np.empty(first.shape, np.float32), np.float32(self.gain(step))
        planes = first.reshape(-1), last.reshape(-1), piece.part(at), gain, level.reshape(-1)
        by_rows(gained, level.size, *planes, least=_LARGE)
        return level

    def _scaled(self, plane: Plane, step: int, products: bool) -> Plane:
        """A plane times the gain of a step; the last few are kept."""
        known = self._planes.get((id(plane), step))
        if known is not None and known[0] is plane:
            return known[1]
        gain = np.float32(self.gain(step))
        made: Any = Scaled(plane, gain) if products else plane * gain
        self._planes = dict(list(self._planes.items())[-7:]) | {(id(plane), step): (plane, made)}
        return made


class _CommonDrift(PixelEffect):
    name = "common drift"
    source = "a recording of a 400 x 250 chip: 4.31 times the common noise of independent pixels"
    stream = Stream.DRIFT
    parameters: ClassVar = {"drift": 0.0}
    keys: ClassVar = {
        "drift": Key(
            Annotated[float, Field(ge=0, le=0.1)],
            Field(
                default=0.0,
                description="RMS change of the gain that all pixels have in common; it takes "
                f"{KNOT} cycles from one value to the next",
            ),
            silicon=Sized(
                4.5e-4,
                "assumed",
                "the recording's common noise, 4.31: with it that of runs is 4.8 in the mean, "
                "2.7 in the median",
            ),
        )
    }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        gained = _SIGMAS * setting.drift * scene.brightest
        moved = shift_error(scene, gained * scene.cycles / scene.threshold)
        return bound_of(scene, scene.relative(gained) + moved, True)

    def cost(self, scene: Summary) -> Any:
        return crosstalk_cost(scene)

    def common_gain(self, setting: Setting) -> Drift:
        return Drift(setting.clock, setting.drift, setting.seed)


COMMON_DRIFT = _CommonDrift()
