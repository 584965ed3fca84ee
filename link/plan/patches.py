"""A link on a few patches of the camera, for the check of its plan.

Patches are squares of camera pixels with the cells imaged in them: in the panel's middle, where it
is brightest; along its edges and near its corners, where registration and timing are worst; and
some at random. Light is computed only for them, with the same bits as on the whole plane. Pixels
keep their numbers, so that all cameras draw the same random numbers. The spikes of each camera go
through a detector of their own, which learns from the training, with the true registration and
timing. The decisions on the same bits are compared.
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
from cosim.plan.tiles import BoxGrid, PatchPlane
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
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.tiers import Tier

SIDE: Final = 48, 104
"""Smallest and largest side of a patch, camera pixels; between them a tenth of the sensor's shorter
side, and at least four cells."""
MARGIN: Final = 5
"""Distance of a cell's edge from the patch's edge, camera pixels."""
RANDOM: Final = 2, 8
"""Smallest and largest number of random patches."""
_SHARE: Final = 0.1
"""Part of the run's pixel-cycles in patches, beyond which no more random ones are taken."""
CYCLES: Final = 256
"""Largest number of camera cycles, unless the training takes longer."""
FEWEST: Final = 24
"""Smallest number of symbols after the training."""
_BLOCK: Final = 2 * WORD


@dataclass(frozen=True)
class Variant:
    """A way to simulate the link.

    Attributes:
        tier: tier of the camera's pixels.
        camera: camera with the effects to simulate.
        air: names of the effects of the air, None for all.
    """

    tier: Tier
    camera: CameraSetting
    air: frozenset[str] | None = None


@dataclass(frozen=True, eq=False)
class Decided:
    """Decisions of a variant.

    Attributes:
        wrong: (symbols, cells) bool, wrong decisions.
        lead: (symbols, cells) float32, soft value in favour of the sent bit.
        air_ns, camera_ns: run time of light and pixels for a pixel-cycle, without the first block,
            ns.
    """

    wrong: npt.NDArray[np.bool_]
    lead: npt.NDArray[np.float32]
    air_ns: float
    camera_ns: float

    @property
    def rate(self) -> float:
        """Bit error rate."""
        return float(self.wrong.mean())


class _PanelPixels:
    """The panel's pixels, computed once for several airs that run in step."""

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
    """A layout with only some of its data cells.

    Attributes:
        chosen: (cells,) data cells, as in `Layout.data`, in order.
    """

    chosen: npt.NDArray[np.intp]

    @cached_property
    def data(self) -> npt.NDArray[np.intp]:
        return self.chosen


class LinkPatches:
    """The patches of one transmission.

    Args:
        setting: the link.
        sent: the transmission.
        seed: seed of the random patches.
        detector: name of the detector.
        most_symbols: number of symbols after the training, at most; None for those of CYCLES.

    Attributes:
        cells: (n,) places in `Layout.data` of the data cells in the patches.
        plane: the patches; None if no data cell is in view.
        symbols: number of symbols after the training that are compared.
    """

    def __init__(
        self, setting: LinkSetting, sent: Transmission, seed: int, detector: str = "packed",
        most_symbols: int | None = None,
    ) -> None:  # fmt: skip
        self._setting, self._sent, self._detector = setting, sent, detector
        chip, layout = setting.camera.chip, sent.layout
        self._homography = image_of(
            setting.optics, setting.aim, setting.air, (chip.height, chip.width)
        )
        ticks = sent.mode.ticks
        most = max(CYCLES // ticks - TRAINING, FEWEST) if most_symbols is None else most_symbols
        self.symbols = max(min(most, sent.data_end - TRAINING), 0)
        side = sent.mode.cell * setting.scale
        tenth = min(max(min(chip.height, chip.width) // 10, SIDE[0]), SIDE[1])
        size = min(max(tenth, round(4 * side) + 2 * MARGIN), chip.height, chip.width)
        x, y = self._centres(layout)
        in_view = (x > 0) & (x < chip.width - 1) & (y > 0) & (y < chip.height - 1)
        part = (TRAINING + self.symbols) * ticks / max(sent.planes, 1)
        patches = int(_SHARE * chip.height * chip.width / (size**2 * part))
        boxes = self._boxes(x[in_view], y[in_view], size, seed, patches)
        inside = np.zeros(len(x), np.bool_)
        reach = side / 2 + MARGIN
        for y0, y1, x0, x1 in boxes:
            inside |= (
                (x >= x0 + reach) & (x <= x1 - 1 - reach)
                & (y >= y0 + reach) & (y <= y1 - 1 - reach)
            )  # fmt: skip
        self.cells = np.flatnonzero(inside)
        self._part = _PartLayout(sent.mode, layout.data[self.cells])
        self.plane = None
        if boxes:
            grid = BoxGrid(chip.height, chip.width, np.array(boxes))
            self.plane = PatchPlane(grid, list(range(len(boxes))))

    @property
    def bits(self) -> int:
        """Number of bits that are compared."""
        return self.symbols * len(self.cells)

    @property
    def cycles(self) -> int:
        """Camera cycles that are simulated."""
        clock = self._setting.camera.clock
        end = self._setting.first_light + self._setting.panel.clock.edge(
            (TRAINING + self.symbols) * self._sent.ticks
        )
        return -(-(clock.cycle_at(end) + 3) // WORD) * WORD

    def _centres(self, layout: Layout) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Camera (x, y) of the data cells' centres."""
        row, column = np.divmod(layout.data, layout.shape[1])
        side = layout.mode.cell
        where = Registration(self._homography, np.zeros((0, 3)))
        return where.camera((column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5)

    def _boxes(
        self, x: npt.NDArray[Any], y: npt.NDArray[Any], size: int, seed: int, most: int
    ) -> list[tuple[int, int, int, int]]:
        """Boxes: around the middle, the ends along both axes and diagonals, and around random
        cells, so that there are about `most` boxes in all."""
        if not len(x):
            return []
        chip, half = self._setting.camera.chip, size // 2
        dx, dy = x - x.mean(), y - y.mean()
        chosen = [int(np.argmin(dx**2 + dy**2))]
        for along in (dx, dy, dx + dy, dx - dy):
            chosen += [int(np.argmin(along)), int(np.argmax(along))]
        random = min(max(most - len(chosen), RANDOM[0]), RANDOM[1])
        chosen += np.random.default_rng(seed).permutation(len(x))[:random].tolist()
        boxes: list[tuple[int, int, int, int]] = []
        for n in chosen:
            # Shifted towards the middle, so that a cell at the panel's end lies well inside.
            left = round(float(x[n] - np.sign(dx[n]) * min(half * 0.6, abs(dx[n])))) - half
            top = round(float(y[n] - np.sign(dy[n]) * min(half * 0.6, abs(dy[n])))) - half
            left, top = (
                min(max(left, 0), chip.width - size), min(max(top, 0), chip.height - size),
            )  # fmt: skip
            boxes.append((top, top + size, left, left + size))
        return list(dict.fromkeys(boxes))

    def _air(self, source: _PanelPixels, effects: frozenset[str] | None) -> Air:
        assert self.plane is not None
        return self._setting.make_air(source, self._sent.planes, effects, self.plane.places)

    def film(
        self, variants: Mapping[str, Variant], device: Device | None, progress: Progress
    ) -> dict[str, Decided]:
        """Decisions of every variant on the same bits.

        Raises:
            ValueError: if no data cell is in view, or the transmission ends with its training.
        """
        if self.plane is None or not self.bits:
            raise ValueError("at least one data cell must be in view and sent")
        source, kinds = _PanelPixels(self._sent), dict.fromkeys(v.air for v in variants.values())
        airs = {effects: self._air(source, effects) for effects in kinds}
        cameras = {
            name: PatchCamera(v.camera, self.plane, v.tier, device, row_delay=airs[v.air].row_delay)
            for name, v in variants.items()
        }
        cycles = self.cycles
        words: dict[str, list[npt.NDArray[np.uint32]]] = {name: [] for name in variants}
        spent: dict[Any, list[float]] = {key: [] for key in (*airs, *variants)}
        progress.start(f"{len(variants)} ways on {len(self.plane.tiles)} patches", cycles)
        for start in range(0, cycles, _BLOCK):
            block = Block(start, min(_BLOCK, cycles - start))
            lights: dict[frozenset[str] | None, Light] = {}
            for effects, air in airs.items():
                begin = time.perf_counter()
                lights[effects] = air.step(None, block)
                spent[effects].append(time.perf_counter() - begin)
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
        """Soft values in favour of the sent bits, and whether they are wrong.

        Args:
            words: (n, pixels) uint32 of the patches.
            air: light of the variant.
        """
        assert self.plane is not None
        chip = self._setting.camera.chip
        whole = np.zeros((len(words), chip.height * chip.width), np.uint32)
        whole[:, self.plane.numbers.astype(np.intp)] = words
        timing = true_timing(self._setting, air.row_delay, self._sent.ticks)
        detector = make_detector(
            self._detector, self._part, self._registration(air, timing), timing
        )
        planes, sent = whole.reshape(-1, chip.height, chip.width), self._sent
        detector.learn(planes, 0, sent.bits(0, TRAINING)[:, self.cells], 0)
        soft = detector.soft(planes, 0, TRAINING, self.symbols)
        on = sent.bits(TRAINING, self.symbols)[:, self.cells]
        return np.where(on, soft, -soft), np.asarray((soft > 0) != on)

    def _registration(self, air: Air, timing: Timing) -> Registration:
        """Place of the panel's pixels in the image, with vibration."""
        truth, count = air.truth, TRAINING + self.symbols
        middle = timing.start(np.arange(count) + 0.5, timing.rows / 2)
        drift = np.column_stack([middle, air.shifts[:count]])
        return Registration(truth.homography, drift, truth.blur)


def _ns(seconds: list[float], pixels: int, cycles: int) -> float:
    """Nanoseconds for a pixel-cycle, without the first block if there are more.

    The first block may include compilation.
    """
    some = seconds[1:] or seconds
    each = min(_BLOCK, cycles)
    return float(np.mean(some)) * 1e9 / (pixels * each)
