"""An imager without registers: a pixel clock, one exposure for every frame, and row after row out
of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, InputError
from cosim.config.amounts import at_most
from cosim.frames import Frame
from imagers.common.scenery import Scenery
from imagers.common.trace import Signal, write_trace
from sensor.frame_pixels import Exposed, PixelModel

_TRACED: Final = 3
"""Number of frames in a trace."""
_SIGNALS: Final = (Signal("exposing"), Signal("frame_valid"), Signal("line_valid"))
Instants = npt.NDArray[np.int64]


@dataclass(frozen=True)
class FixedTiming:
    """Times of the frames, in cycles of the pixel clock.

    Attributes:
        clock: pixel clock.
        rows, columns: pixels.
        line: time from the readout of a row to that of the next.
        exposure: exposure of every row.
        frame: time from frame to frame.
        rolling: whether each row is read at the end of its own exposure; else all rows are exposed
            together and wait for their readout.
    """

    clock: Clock
    rows: int
    columns: int
    line: int
    exposure: int
    frame: int
    rolling: bool

    @classmethod
    def of(
        cls, shape: tuple[int, int], hertz: float, exposure: float, frame_rate: float | None,
        *, blanking: int = 0, rolling: bool,
    ) -> FixedTiming:  # fmt: skip
        """The timing of a section, as fast as rows and exposure allow if it names no frame rate.

        Args:
            hertz: pixel clock.
            exposure: s.
            frame_rate: Hz, or None.
            blanking: cycles after the pixels of a row.

        Raises InputError for a frame rate that exposure or readout do not allow.
        """
        clock = Clock.from_hz(hertz)
        line = shape[1] + blanking
        exposed = max(round(Fraction(repr(exposure)) * clock.num / clock.den), 1)
        least = max(exposed, shape[0] * line)
        frame = least if frame_rate is None else round(hertz / frame_rate)
        if frame < least:
            raise InputError(
                "imager.frame_rate",
                f"at most {at_most(hertz / least)} Hz for this exposure and clock",
                f"{frame_rate:g} Hz", "lower it, or leave it out",
            )  # fmt: skip
        return cls(clock, *shape, line, exposed, frame, rolling)

    def first(self, number: int) -> int:
        """Cycle in which the readout of a frame begins."""
        return number * self.frame + self.exposure

    def span(self, number: int) -> tuple[Instants, Instants]:
        """Begin and end of each row's exposure in a frame, (rows,) ps each."""
        last = self.first(number)
        ends = [last + (row * self.line if self.rolling else 0) for row in range(self.rows)]
        edges = [[self.clock.edge(k - back) for k in ends] for back in (self.exposure, 0)]
        return np.array(edges[0], np.int64), np.array(edges[1], np.int64)

    def ready(self, number: int) -> int:
        """Instant at which the last row of a frame has left, ps."""
        return self.clock.edge(self.first(number) + self.rows * self.line)

    def frames(self, stop: int) -> int:
        """Number of frames that are ready by an instant, ps."""
        left = self.clock.cycle_at(stop) - self.first(0) - self.rows * self.line
        return 0 if left < 0 else left // self.frame + 1


class FixedExposure:
    """See `Imager`.

    A frame's state has the light of its exposure: `light_least`, `light_most`, lx s.

    Attributes:
        dark: values of the last frame without light; None before there is one.

    Args:
        name: name of its kind.
        pixels: physics of the pixels.
        timing: times of the frames.
        parts: number of equal parts of the exposure at whose ends `Exposed.lux_seconds` gives the
            light so far, (rows, W, parts); 1 for the light of the whole exposure, (rows, W).
    """

    def __init__(self, name: str, pixels: PixelModel, timing: FixedTiming, parts: int = 1) -> None:
        self.name, self.pixels, self.timing = name, pixels, timing
        self._parts = parts
        self.dark: npt.NDArray[np.uint16] | None = None

    def write(self, register: str, value: int, at: int | None = None) -> None:
        raise self._no_registers(register)

    def read(self, register: str) -> int:
        raise self._no_registers(register)

    def _no_registers(self, register: str) -> InputError:
        return InputError("an imager", "one with registers", repr(self.name), f"drop {register}")

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """See `Imager`."""
        if scene.shape != self.pixels.shape:
            raise ValueError(f"scene must be {self.pixels.shape}, not {scene.shape}")
        if trace is not None:
            self._trace(trace)
        number, timing = 0, self.timing
        while timing.ready(number) <= until:
            begin, end = timing.span(number)
            light = self._light(scene, begin, end)
            seconds, waiting = (end - begin) / PS, np.zeros(timing.rows)
            exposed = Exposed(light, seconds, waiting, 0, number)
            values = self.pixels.convert(exposed, seed, kept)
            whole = light if light.ndim == 2 else light[..., -1]
            state = {"light_least": float(whole.min()), "light_most": float(whole.max())}
            if state["light_most"] == 0:
                self.dark = values
            yield Frame(
                values, self.pixels.bits, number, begin, end, timing.ready(number), state
            )  # fmt: skip
            number += 1

    def _light(self, scene: Scenery, begin: Instants, end: Instants) -> npt.NDArray[np.float64]:
        if self._parts == 1:
            return scene.lux_seconds(0, begin, end)
        cuts = [begin + (end - begin) * n // self._parts for n in range(self._parts + 1)]
        pieces: list[Any] = [scene.lux_seconds(0, low, high) for low, high in pairwise(cuts)]
        return np.cumsum(np.stack(pieces, axis=-1), axis=-1)

    def _trace(self, path: Path) -> None:
        """Writes the signals of the first frames."""
        timing, edge = self.timing, self.timing.clock.edge
        changes: list[tuple[int, str, int]] = []
        for number in range(_TRACED):
            first = timing.first(number)
            exposed = first + timing.rolling * (timing.rows - 1) * timing.line
            changes.append((edge(number * timing.frame), "exposing", 1))
            changes.append((edge(exposed), "exposing", 0))
            last = first + timing.rows * timing.line
            changes += [(edge(first), "frame_valid", 1), (edge(last), "frame_valid", 0)]
            for row in range(timing.rows):
                at = first + row * timing.line
                changes.append((edge(at), "line_valid", 1))
                if timing.line > timing.columns:
                    changes.append((edge(at + timing.columns), "line_valid", 0))
        # A fall comes before a rise of the same instant: frames may follow without a gap.
        write_trace(path, _SIGNALS, sorted(changes, key=lambda change: (change[0], change[2])))
