"""The paired check: several cameras on the same patches, with the same light and random counters.

Rates are taken over windows of cycles and include fractions of spikes. The error of one camera
against another is the RMS over the pixels of a patch, for each patch and window. The largest
counts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim.light.light import Light, PlaneMap
from cosim.plan.error import Measured, deviations
from cosim.plan.tiles import PatchPlane
from cosim.stage import Block

Words = npt.NDArray[np.uint32]
Values = npt.NDArray[np.float64]
Span = tuple[int, int]
"""First cycle of a window, and the cycle after its last."""


def windows(
    instants: Sequence[int], window: int, cycles: int, *, preceding: bool = False
) -> list[tuple[int, int]]:
    """The span of `window` cycles around each cycle in `instants`, or up to it, moved to lie within
    the run."""
    before = window - 1 if preceding else window // 2
    starts = [min(max(at - before, 0), cycles - window) for at in instants]
    return [(s, s + window) for s in starts]


class CheckCamera(Protocol):
    """A camera on patches.

    Attributes:
        bits: (pixels,) int64, spikes latched so far.
    """

    bits: npt.NDArray[np.int64]

    def step(self, light: Light, start: int, cycles: int) -> Words:
        """Words of the next cycles, (ceil(cycles / 32), pixels). light: cut by `PatchPlane.cut`."""
        ...

    def phase(self) -> Values:
        """Spikes so far, including the fraction of the current interval, (pixels,)."""
        ...

    def state(self) -> dict[str, npt.NDArray[Any]]: ...
    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None: ...


def compare(rates: Values, truth: Values, floor: float) -> tuple[Values, Values, Values]:
    """RMS over pixels of (rates - truth), relative to max(mean truth, floor).

    Args:
        rates, truth: (..., pixels) spikes a cycle.
        floor: spikes a cycle.

    Returns:
        The RMS and its 99.9 % limits, low and high, (...) each. The limits hold for all entries
        together and assume a normal mean square.
    """
    square = (rates - truth) ** 2
    n = square.shape[-1]
    base = np.maximum(truth.mean(axis=-1), max(floor, 1e-300))
    many = max(int(np.prod(square.shape[:-1])), 1)
    width = deviations(many) / np.sqrt(n)
    mean, spread = square.mean(axis=-1), square.std(axis=-1) * width
    low, high = np.sqrt(np.maximum(mean - spread, 0)) / base, np.sqrt(mean + spread) / base
    return np.sqrt(mean) / base, low, high


def worst(rates: Values, truth: Values, floor: float) -> Measured:
    """The largest difference of `compare`."""
    value, low, high = compare(rates, truth, floor)
    at = np.unravel_index(int(np.argmax(value)), value.shape)
    return Measured(float(value[at]), float(low[at]), float(high.max()))


class _Recorder:
    """A camera on the patches, with its phases at the edges of the windows."""

    def __init__(self, camera: CheckCamera, edges: int, pixels: int) -> None:
        self.camera = camera
        self.phases = np.zeros((edges, pixels))
        self.bits = np.zeros((edges, pixels), np.int64)
        self.seconds, self.cycles = 0.0, 0
        self.first: tuple[float, int] | None = None

    def step(self, light: Light, start: int, cycles: int) -> Words:
        """Words of a step. The step is timed, except for the first, which may compile."""
        begin = time.perf_counter()
        words = self.camera.step(light, start, cycles)
        spent = time.perf_counter() - begin
        if self.first is None:
            self.first = spent, cycles
        else:
            self.seconds, self.cycles = self.seconds + spent, self.cycles + cycles
        return words

    def per_cycle(self) -> float:
        """Seconds a cycle, from the first call only if there was no other; NaN if there was
        none."""
        seconds, cycles = (self.seconds, self.cycles) if self.cycles else self.first or (0.0, 0)
        return seconds / cycles if cycles else math.nan

    def mark(self, edge: int) -> None:
        """Stores the phases at the edge of a window."""
        self.phases[edge], self.bits[edge] = self.camera.phase(), self.camera.bits

    def rate(self, start: int, stop: int, cycles: int) -> Values:
        """Spikes a cycle between two edges, (pixels,). A pixel that fires in every cycle has rate
        1, because the latch does not register its excess charge."""
        full = self.bits[stop] - self.bits[start] == cycles
        return np.where(full, 1.0, (self.phases[stop] - self.phases[start]) / cycles)


class Paired:
    """A stage that exposes several cameras to light and returns the light.

    Args:
        plane: the patches.
        cameras: cameras by name.
        spans: windows over which rates are taken.
        also: further spans that `rates` may be asked for.
    """

    def __init__(
        self, plane: PatchPlane, cameras: Mapping[str, CheckCamera], spans: Sequence[Span],
        *, also: Sequence[Span] = (),
    ) -> None:  # fmt: skip
        self.plane, self.spans = plane, list(spans)
        self._cut = PlaneMap(plane.cut, None)
        self._edges = sorted({e for span in (*spans, *also) for e in span})
        n = plane.numbers.size
        self._recorders = {
            name: _Recorder(camera, len(self._edges), n) for name, camera in cameras.items()
        }

    def step(self, light: Light, block: Block) -> Light:
        """Exposes the patches to a block of light, and returns the light unchanged."""
        cut = self._cut(light)
        at = block.start
        if at == 0:
            self._mark(0)
        for until in [*(e for e in self._edges if at < e < block.stop), block.stop]:
            for name, recorder in self._recorders.items():
                self.filmed(name, recorder.step(cut, at, until - at), at, until - at)
            at = until
            self._mark(at)
        return light

    def _mark(self, cycle: int) -> None:
        if cycle in self._edges:
            for recorder in self._recorders.values():
                recorder.mark(self._edges.index(cycle))
            self.reached(cycle)

    def filmed(self, name: str, words: Words, start: int, cycles: int) -> None:
        """Called with the words of each camera and step, (words, pixels), from cycle `start` on."""

    def reached(self, cycle: int) -> None:
        """Called at each edge of a window."""

    def rates(self, name: str, spans: Sequence[Span] | None = None) -> Values:
        """Spikes a cycle of one camera, (windows, patches, pixels)."""
        recorder, edges = self._recorders[name], self._edges
        rates = [
            recorder.rate(edges.index(a), edges.index(b), b - a) for a, b in spans or self.spans
        ]
        return self.plane.split(np.stack(rates))

    def ns(self, name: str) -> float:
        """Run time of a camera on the patches, ns per pixel-cycle, without the first call if there
        was another; NaN before the first call."""
        return self._recorders[name].per_cycle() * 1e9 / self.plane.numbers.size

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next block depends on."""
        arrays: dict[str, npt.NDArray[Any]] = {}
        for name, recorder in self._recorders.items():
            arrays |= {f"{name}:{k}": v for k, v in recorder.camera.state().items()}
            arrays |= {f"{name}:marks": recorder.phases, f"{name}:counts": recorder.bits}
            arrays |= {f"{name}:took": np.array([recorder.seconds, recorder.cycles])}
        return arrays

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        for name, recorder in self._recorders.items():
            arrays = {
                k.removeprefix(f"{name}:"): v for k, v in state.items() if k.startswith(f"{name}:")
            }
            recorder.phases, recorder.bits = arrays.pop("marks"), arrays.pop("counts")
            seconds, cycles = arrays.pop("took").tolist()
            recorder.seconds, recorder.cycles = seconds, int(cycles)
            recorder.camera.restore(arrays)
