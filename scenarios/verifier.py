"""The verifier: what a plan promised, measured on a few patches with the same random counters.

It stands in the chain between lens and chip and films the patches with several cameras at once: the
reference with every effect; the camera as planned; and, in the exact tier, everything but one
effect for each that was left out, beside everything. Rates are taken over the scenario's image
windows and count fractions of spikes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Light
from cosim.light import PlaneMap
from cosim.opencl import Device
from cosim.planner import Plan
from scenarios.result import Error
from sensor import CameraSetting
from sensor.patches import PatchCamera, PatchPlane
from sensor.tiers import Tier
from sensor.tiles import TileGrid

__all__ = ["CONFIDENCE", "BrokenPromise", "Finding", "Measured", "Verifier", "compare", "windows"]

CONFIDENCE = 0.999
Values = npt.NDArray[np.float64]


def windows(instants: Sequence[int], window: int, cycles: int) -> list[tuple[int, int]]:
    """First cycle and end of the window around each instant, moved to lie within the run."""
    starts = [min(max(at - window // 2, 0), cycles - window) for at in instants]
    return [(s, s + window) for s in starts]


@dataclass(frozen=True)
class Measured:
    """RMS difference of a tile's rates, relative: the worst tile and window. low, high: 99.9 %
    limits, `high` the largest of all, allowing for their number."""

    value: float
    low: float
    high: float


def compare(rates: Values, truth: Values, floor: float) -> tuple[Values, Values, Values]:
    """RMS over pixels of (rates - truth) over max(mean truth, floor), with 99.9 % limits that hold
    for all of them together: the mean square is taken as normal over pixels.

    rates, truth: (..., pixels). Gives three arrays of shape (...).
    """
    from scipy.special import ndtri

    square = (rates - truth) ** 2
    n = square.shape[-1]
    base = np.maximum(truth.mean(axis=-1), max(floor, 1e-300))
    many = max(int(np.prod(square.shape[:-1])), 1)
    width = -float(ndtri((1 - CONFIDENCE) / 2 / many)) / np.sqrt(n)
    mean, spread = square.mean(axis=-1), square.std(axis=-1) * width
    low, high = np.sqrt(np.maximum(mean - spread, 0)) / base, np.sqrt(mean + spread) / base
    return np.sqrt(mean) / base, low, high


def worst(rates: Values, truth: Values, floor: float) -> Measured:
    """The worst of `compare`."""
    value, low, high = compare(rates, truth, floor)
    at = np.unravel_index(int(np.argmax(value)), value.shape)
    return Measured(float(value[at]), float(low[at]), float(high.max()))


class _Recorder:
    """One camera on the patches with its phases at the windows' edges."""

    def __init__(self, camera: PatchCamera, edges: int, pixels: int) -> None:
        self.camera = camera
        self.phases = np.zeros((edges, pixels))
        self.bits = np.zeros((edges, pixels), np.int64)
        self.seconds = 0.0

    def mark(self, edge: int) -> None:
        self.phases[edge], self.bits[edge] = self.camera.phase(), self.camera.bits

    def rate(self, start: int, stop: int, cycles: int) -> Values:
        """Spikes a cycle between two edges; a pixel that fired in every cycle has 1, its charge
        beyond that being lost on the latch."""
        full = self.bits[stop] - self.bits[start] == cycles
        return np.where(full, 1.0, (self.phases[stop] - self.phases[start]) / cycles)


@dataclass(frozen=True)
class Finding:
    """A promise that was not kept. effect: its name. measured: the upper limit. tile: where, None
    where it is the sum of all that was more than the tolerance."""

    effect: str
    promised: float
    measured: float
    tile: int | None

    @property
    def told(self) -> str:
        """As a user is told."""
        where = "in all" if self.tile is None else f"on tile {self.tile}"
        return (
            f"{self.effect} was put back and the run done again: leaving it out changed up to "
            f"{self.measured:.2g} {where}, where {self.promised:.2g} was promised"
        )


class BrokenPromise(Exception):
    """Raised as soon as a window shows it."""

    def __init__(self, findings: list[Finding]) -> None:
        super().__init__(", ".join(f.effect for f in findings))
        self.findings = findings


class Verifier:
    """A stage that passes light on. setting: with every effect. run: the planned camera's setting,
    tier and flags on these patches. tiles: their numbers in the grid, of one size."""

    def __init__(
        self,
        setting: CameraSetting,
        plan: Plan,
        grid: TileGrid,
        tiles: list[int],
        run: tuple[Tier, CameraSetting, npt.NDArray[np.uint8] | None],
        spans: list[tuple[int, int]],
        floor: float,
        device: Device | None,
        stop_early: bool = True,
    ) -> None:
        self._plan, self._spans, self._floor = plan, spans, floor
        self._plane = PatchPlane(grid, tiles)
        self._cut = PlaneMap(self._plane.cut, None)
        self._edges = sorted({e for span in spans for e in span})
        self._stop_early = stop_early
        tier, kept, flags = run
        if flags is not None:
            group = grid.shape[1]
            column = [tile % group for tile in tiles]
            rows = self._plane.row.reshape(len(tiles), -1)
            flags = np.concatenate(
                [flags[r, c : c + 1] for r, c in zip(rows, column, strict=True)]
            ).astype(np.uint8)
        left = [name for name in plan.left_out if (~plan.kept[name][tiles]).any()]
        cameras = {
            "reference": PatchCamera(setting, self._plane, "reference"),
            "run": PatchCamera(kept, self._plane, tier, device if tier == "fast" else None, flags),
        }
        if left:
            cameras["all"] = PatchCamera(setting, self._plane, "exact")
        for name in left:
            cameras[f"without {name}"] = PatchCamera(setting.without([name]), self._plane, "exact")
        n = self._plane.numbers.size
        self._left = left
        self._recorders = {
            name: _Recorder(camera, len(self._edges), n) for name, camera in cameras.items()
        }

    @property
    def tiles(self) -> list[int]:
        """Numbers of the tiles that are looked at."""
        return self._plane.tiles

    @property
    def pixels(self) -> int:
        """Pixels that are looked at."""
        return int(self._plane.numbers.size)

    def step(self, light: Light, block: Block) -> Light:
        """Films the patches of a block; the light goes on as it came.

        Raises BrokenPromise at the end of a window that shows one."""
        cut = self._cut(light)
        at = block.start
        if at == 0:
            self._mark(0)
        for until in [e for e in self._edges if at < e < block.stop] + [block.stop]:
            for recorder in self._recorders.values():
                begin = time.perf_counter()
                recorder.camera.step(cut, at, until - at)
                recorder.seconds += time.perf_counter() - begin
            at = until
            if at in self._edges:
                self._mark(at)
        return light

    def _mark(self, cycle: int) -> None:
        if cycle not in self._edges:
            return
        for recorder in self._recorders.values():
            recorder.mark(self._edges.index(cycle))
        done = [span for span in self._spans if span[1] == cycle]
        if done and self._stop_early:
            found = self._broken(done)
            if found:
                raise BrokenPromise(found)

    def _rates(self, name: str, spans: list[tuple[int, int]]) -> Values:
        """(windows, patches, pixels)."""
        recorder, edges = self._recorders[name], self._edges
        rates = np.stack([recorder.rate(edges.index(a), edges.index(b), b - a) for a, b in spans])
        return self._plane.split(rates)

    def _broken(self, spans: list[tuple[int, int]]) -> list[Finding]:
        found = []
        tiles = np.array(self.tiles)
        for name in self._left:
            truth = self._rates("all", spans)
            _, _, high = compare(self._rates(f"without {name}", spans), truth, self._floor)
            promised, gone = self._plan.promise[name][tiles], ~self._plan.kept[name][tiles]
            over = np.where(gone & (high > promised), high / np.maximum(promised, 1e-300), 0)
            if over.any():
                at = np.unravel_index(int(np.argmax(over)), over.shape)
                patch = int(at[1])
                found.append(
                    Finding(name, float(promised[patch]), float(high[at]), int(tiles[patch]))
                )
        return found

    def broken(self) -> list[Finding]:
        """Promises that were not kept, over the whole run."""
        return self._broken(self._spans)

    def error(self) -> Measured:
        """The run against the reference."""
        return worst(
            self._rates("run", self._spans), self._rates("reference", self._spans), self._floor
        )

    def told(self) -> Error:
        """The error as the result has it."""
        found = self.error()
        kind = f"measured on {len(self.tiles)} patches of {self.pixels // len(self.tiles)} pixels"
        return Error(found.value, kind, (found.low, found.high))

    def measured(self) -> dict[str, float]:
        """Upper limit of what each left-out effect changed, where it was left out."""
        gone = {}
        for name in self._left:
            _, _, high = compare(
                self._rates(f"without {name}", self._spans), self._rates("all", self._spans),
                self._floor,
            )  # fmt: skip
            gone[name] = float(high[:, ~self._plan.kept[name][np.array(self.tiles)]].max())
        return gone

    def reference_ns(self, cycles: int) -> float:
        """Nanoseconds a pixel-cycle that the reference took, on this run's patches."""
        return self._recorders["reference"].seconds * 1e9 / (self.pixels * cycles)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next block depends on."""
        made: dict[str, npt.NDArray[Any]] = {}
        for name, recorder in self._recorders.items():
            made |= {f"{name}:{k}": v for k, v in recorder.camera.state().items()}
            made |= {f"{name}:marks": recorder.phases, f"{name}:counts": recorder.bits}
            made |= {f"{name}:seconds": np.array(recorder.seconds)}
        return made

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        for name, recorder in self._recorders.items():
            own = {
                k.removeprefix(f"{name}:"): v for k, v in state.items() if k.startswith(f"{name}:")
            }
            recorder.phases, recorder.bits = own.pop("marks"), own.pop("counts")
            recorder.seconds = float(own.pop("seconds"))
            recorder.camera.restore(own)
