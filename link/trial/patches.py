"""A link on a few patches of the camera: what a plan of it is checked with.

Patches are squares of camera pixels with the cells whose images lie in them: in the panel's middle,
where it is brightest, along its edges and near its corners, where registration and timing are at
their worst, and some by chance. Light is made for them alone, the same bits as on the whole plane;
the pixels are filmed with their own numbers, so that all cameras see the same chance. Every
camera's spikes go through a detector of their own that learns from the training, with the true
registration and timing: what is compared are the decisions on the same bits.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Light
from cosim.compute.opencl import Device
from cosim.plan.patches import PatchPlane
from cosim.run.progress import Progress
from cosim.spikes.viform import WORD
from link.air import Air, image_of
from link.detect.catalogue import make_detector
from link.layout import TRAINING, Layout
from link.sending import Transmission
from link.setting import LinkSetting
from link.setup.truth import true_timing
from link.timing import Registration, Timing
from sensor import CameraSetting
from sensor.latched.patches import PatchCamera
from sensor.latched.tiers import Tier

__all__ = ["Decided", "LinkPatches", "Variant"]

SIDE: Final = 48, 104
"""Camera pixels of a patch, at least, and at most: a tenth of the sensor's shorter side between
them. Not less than four cells."""
MARGIN: Final = 5
"""Camera pixels between a cell's middle and the patch's edge, beside half the cell."""
RANDOM: Final = 8
"""Patches by chance."""
CYCLES: Final = 256
"""Of the camera, that are filmed at most, unless the training takes longer."""
FEWEST: Final = 24
"""Symbols after the training, at least."""
_BLOCK: Final = 2 * WORD


@dataclass(frozen=True)
class Variant:
    """A way to simulate the link. air: names of the air's effects, None for all. camera: as it is
    run."""

    tier: Tier
    camera: CameraSetting
    air: frozenset[str] | None = None


@dataclass(frozen=True, eq=False)
class Decided:
    """wrong: (symbols, cells) bool, decisions that are not what was sent. lead: (symbols, cells) by
    how much the soft value is for what was sent. air_ns, camera_ns: what a pixel-cycle of the
    patches' light and pixels took, the first block aside."""

    wrong: npt.NDArray[np.bool_]
    lead: npt.NDArray[np.float32]
    air_ns: float
    camera_ns: float

    @property
    def rate(self) -> float:
        """Bit error rate."""
        return float(self.wrong.mean())


@dataclass(frozen=True)
class _Squares:
    """Boxes of a plane."""

    height: int
    width: int
    boxes: tuple[tuple[int, int, int, int], ...]

    def box(self, tile: int) -> tuple[int, int, int, int]:
        return self.boxes[tile]


class _PanelPixels:
    """What the panel shows, made once for all airs that follow each other closely."""

    def __init__(self, sent: Transmission) -> None:
        self._sent, self.ticks = sent, sent.ticks
        self._cache: dict[int, npt.NDArray[np.bool_]] = {}

    def pixels(self, symbol: int) -> npt.NDArray[np.bool_]:
        if symbol not in self._cache:
            self._cache = {
                n: detector for n, detector in self._cache.items() if n > symbol - _BLOCK
            }
            self._cache[symbol] = self._sent.pixels(symbol)
        return self._cache[symbol]


@dataclass(frozen=True, eq=False)
class _PartLayout(Layout):
    """A layout of which only some data cells are looked at. chosen: as `data`, in order."""

    chosen: npt.NDArray[np.intp]

    @cached_property
    def data(self) -> npt.NDArray[np.intp]:
        return self.chosen


class LinkPatches:
    """The patches of one transmission. seed: of those that lie by chance. detector: its name."""

    def __init__(
        self, setting: LinkSetting, sent: Transmission, seed: int, detector: str = "joint"
    ) -> None:
        self._setting, self._sent, self._detector = setting, sent, detector
        chip, layout = setting.camera.chip, sent.layout
        self._homography = image_of(
            setting.optics, setting.aim, setting.air, (chip.height, chip.width)
        )
        side = sent.mode.cell * setting.scale
        tenth = min(max(min(chip.height, chip.width) // 10, SIDE[0]), SIDE[1])
        size = min(max(tenth, round(4 * side) + 2 * MARGIN), chip.height, chip.width)
        x, y = self._centres(layout)
        in_view = (x > 0) & (x < chip.width - 1) & (y > 0) & (y < chip.height - 1)
        boxes = self._boxes(x[in_view], y[in_view], size, seed)
        inside = np.zeros(len(x), np.bool_)
        reach = side / 2 + MARGIN
        for y0, y1, x0, x1 in boxes:
            inside |= (
                (x >= x0 + reach) & (x <= x1 - 1 - reach)
                & (y >= y0 + reach) & (y <= y1 - 1 - reach)
            )  # fmt: skip
        self.cells = np.flatnonzero(inside)
        """Which data cells are looked at, (n,), as places in `Layout.data`."""
        self._part = _PartLayout(sent.mode, layout.data[self.cells])
        self.plane = None
        if boxes:
            grid = _Squares(chip.height, chip.width, tuple(boxes))
            self.plane = PatchPlane(grid, list(range(len(boxes))))
        ticks = sent.mode.ticks
        most = max(CYCLES // ticks - TRAINING, FEWEST)
        self.symbols = max(min(most, sent.data_end - TRAINING), 0)
        """After the training."""

    @property
    def bits(self) -> int:
        """That are compared."""
        return self.symbols * len(self.cells)

    def _centres(self, layout: Layout) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Camera (x, y) of the data cells' middles."""
        row, column = np.divmod(layout.data, layout.shape[1])
        side = layout.mode.cell
        where = Registration(self._homography, np.zeros((0, 3)))
        return where.camera((column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5)

    def _boxes(
        self, x: npt.NDArray[Any], y: npt.NDArray[Any], size: int, seed: int
    ) -> list[tuple[int, int, int, int]]:
        """Around cells in view: the middle, the ends along both axes and both diagonals, chance."""
        if not len(x):
            return []
        chip, half = self._setting.camera.chip, size // 2
        dx, dy = x - x.mean(), y - y.mean()
        chosen = [int(np.argmin(dx**2 + dy**2))]
        for along in (dx, dy, dx + dy, dx - dy):
            chosen += [int(np.argmin(along)), int(np.argmax(along))]
        chosen += np.random.default_rng(seed).permutation(len(x))[:RANDOM].tolist()
        boxes: list[tuple[int, int, int, int]] = []
        for n in chosen:
            # Drawn in towards the middle, so that a cell at the panel's end lies well within.
            left = round(float(x[n] - np.sign(dx[n]) * min(half * 0.6, abs(dx[n])))) - half
            top = round(float(y[n] - np.sign(dy[n]) * min(half * 0.6, abs(dy[n])))) - half
            left, top = (
                min(max(left, 0), chip.width - size), min(max(top, 0), chip.height - size),
            )  # fmt: skip
            boxes.append((top, top + size, left, left + size))
        return list(dict.fromkeys(boxes))

    def _air(self, source: _PanelPixels, kept: frozenset[str] | None) -> Air:
        assert self.plane is not None
        return self._setting.make_air(source, self._sent.planes, kept, self.plane.places)

    def film(
        self, variants: Mapping[str, Variant], device: Device | None, progress: Progress
    ) -> dict[str, Decided]:
        """Decisions of every variant on the same bits. Raises ValueError where no cell with data is
        in view, or the transmission ends with its training."""
        if self.plane is None or not self.bits:
            raise ValueError("at least one data cell must be in view and sent")
        source, kinds = _PanelPixels(self._sent), dict.fromkeys(v.air for v in variants.values())
        airs = {kept: self._air(source, kept) for kept in kinds}
        cameras = {
            name: PatchCamera(v.camera, self.plane, v.tier, device, row_delay=airs[v.air].late)
            for name, v in variants.items()
        }
        clock = self._setting.camera.clock
        end = self._setting.first_light + self._setting.panel.clock.edge(
            (TRAINING + self.symbols) * self._sent.ticks
        )
        cycles = -(-(clock.cycle_at(end) + 3) // WORD) * WORD
        words: dict[str, list[npt.NDArray[np.uint32]]] = {name: [] for name in variants}
        spent: dict[Any, list[float]] = {key: [] for key in (*airs, *variants)}
        progress.start(f"{len(variants)} ways on {len(self.plane.tiles)} patches", cycles)
        for start in range(0, cycles, _BLOCK):
            block = Block(start, min(_BLOCK, cycles - start))
            lights: dict[frozenset[str] | None, Light] = {}
            for kept, air in airs.items():
                begin = time.perf_counter()
                lights[kept] = air.step(None, block)
                spent[kept].append(time.perf_counter() - begin)
            for name, camera in cameras.items():
                begin = time.perf_counter()
                latched = camera.step(lights[variants[name].air], start, block.cycles)
                spent[name].append(time.perf_counter() - begin)
                words[name].append(latched)
            progress.advance(block.stop)
        size = self.plane.numbers.size
        decided: dict[str, Decided] = {}
        for name, v in variants.items():
            lead, wrong = self._decide(np.concatenate(words[name]), airs[v.air])
            decided[name] = Decided(
                wrong, lead, _ns(spent[v.air], size, cycles), _ns(spent[name], size, cycles)
            )
        return decided

    def _decide(
        self, words: npt.NDArray[np.uint32], air: Air
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
        """A detector's soft values for what was sent, and whether they are wrong. words: (n,
        pixels) of the patches."""
        assert self.plane is not None
        chip = self._setting.camera.chip
        whole = np.zeros((len(words), chip.height * chip.width), np.uint32)
        whole[:, self.plane.numbers.astype(np.intp)] = words
        timing = true_timing(self._setting, air.late, self._sent.ticks)
        detector = make_detector(
            self._detector, self._part, self._registration(air, timing), timing
        )
        planes, sent = whole.reshape(-1, chip.height, chip.width), self._sent
        detector.learn(planes, 0, sent.bits(0, TRAINING)[:, self.cells], 0)
        soft = detector.soft(planes, 0, TRAINING, self.symbols)
        on = sent.bits(TRAINING, self.symbols)[:, self.cells]
        return np.where(on, soft, -soft), np.asarray((soft > 0) != on)

    def _registration(self, air: Air, timing: Timing) -> Registration:
        """Where the panel's pixels are imaged, with what vibration does to it."""
        truth, count = air.truth, TRAINING + self.symbols
        middle = timing.start(np.arange(count) + 0.5, timing.rows / 2)
        drift = np.column_stack([middle, air.shifts[:count]])
        return Registration(truth.homography, drift, truth.blur)


def _ns(seconds: list[float], pixels: int, cycles: int) -> float:
    """Nanoseconds a pixel-cycle; the first block, which may compile, aside where there are more."""
    some = seconds[1:] or seconds
    each = min(_BLOCK, cycles)
    return float(np.mean(some)) * 1e9 / (pixels * each)
