"""Case 20: the same bits however a run is cut."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Checkpoint, Light, Piece, Viform, run_blocks
from cosim.compute.opencl import Device
from cosim.run.case import Case
from cosim.spikes.viform import unpack_planes
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.numpy_form import NumpyPixels
from sensor.latched.sampling import row_offsets
from sensor.stability.gathering import CLOCK

SMALL: Final = CameraSetting(
    replace(CHIPS["spiketwo"], name="stability", width=20, height=24),
    CLOCK,
    threshold=300.0,
    seed=5,
    threshold_noise=3.0,
    row_skew=0.5,
)
CYCLES: Final = 400
_BLOCK: Final = 64
Bits = npt.NDArray[np.uint8]
"""(cycles, height, width) of 0 and 1."""


@dataclass(frozen=True)
class Cut:
    """How a run is cut.

    Attributes:
        block: cycles in one.
        rows: the first row of each tile, in the order in which they are run.
        stopped: cycle after which it is taken up from its checkpoint, or None.
    """

    block: int = 64
    rows: tuple[int, ...] = (0,)
    stopped: int | None = None


CUTS: Final = (
    Cut(),
    Cut(block=1),
    Cut(block=37),
    Cut(rows=(17, 0, 23, 5, 6)),
    Cut(block=50, stopped=150),
    Cut(block=33, rows=(11, 2, 0), stopped=99),
)
Film = Callable[[Cut], Bits]


def _light(first: int, stop: int) -> Light:
    """Light on rows `first` to `stop`: a level, then a jump and a ramp, from inside a cycle on."""
    height, width = SMALL.chip.height, SMALL.chip.width
    one, two = (
        (np.random.default_rng(n).random((height, width), np.float32) * 40)[first:stop]
        for n in (1, 2)
    )
    begin, end = 1_234_567_890, 2 * CLOCK.edge(CYCLES)
    return Light((Piece(0, begin, two, two), Piece(begin, end, one, two)))


class _Scene:
    """The light as a stage."""

    def __init__(self, first: int, stop: int) -> None:
        self._light = _light(first, stop)

    def step(self, data: None, block: Block) -> Light:
        return self._light


class _Keep:
    """Keeps the planes of every block."""

    def __init__(self) -> None:
        self.planes: list[Bits] = []

    def step(self, data: Viform, block: Block) -> Viform:
        self.planes.append(unpack_planes(data.words, 0, data.cycles))
        return data


def filming(device: Device | None) -> Film:
    """The camera that ships, in the loop that ships."""

    def tile(cut: Cut, first: int, stop: int) -> Bits:
        keep = _Keep()

        def stages() -> dict[str, Any]:
            camera = SpikeCamera(SMALL, device, (first, stop))
            return {"scene": _Scene(first, stop), "camera": camera, "keep": keep}

        if cut.stopped is None:
            run_blocks(stages(), CYCLES, size=cut.block)
        else:
            with tempfile.TemporaryDirectory() as folder:
                checkpoint = Checkpoint(Path(folder) / "checkpoint.npz", "stability")
                begun = stages()
                run_blocks(begun, cut.stopped, size=cut.block)
                checkpoint.save(cut.stopped, begun)
                gone_on = stages()
                run_blocks(gone_on, CYCLES, size=cut.block, begin=checkpoint.load(gone_on))
        return np.concatenate(keep.planes)

    def film(cut: Cut) -> Bits:
        edges = [*sorted(cut.rows), SMALL.chip.height]
        ends = dict(pairwise(edges))
        made = {first: tile(cut, first, ends[first]) for first in cut.rows}
        return np.concatenate([made[first] for first in sorted(made)], axis=1)

    return film


@cache
def plain_bits() -> Bits:
    """The same run in plain numpy, in one piece."""
    chip = SMALL.chip
    offsets = row_offsets(CLOCK, chip.height, SMALL.row_skew, 0.0, (0, chip.height))
    exposure = Exposure(CLOCK, SMALL.electrons_per_lux, None, offsets)
    numbers = np.arange(chip.height * chip.width, dtype=np.uint32)
    pixels = NumpyPixels(SMALL.model, numbers)
    words = pixels.expose(exposure.spans(_light(0, chip.height), 0, CYCLES), CYCLES)
    bits = unpack_planes(words.reshape(-1, chip.height, chip.width), 0, CYCLES)
    bits.setflags(write=False)
    return bits


def cutting(film: Film) -> float:
    """Bits that differ from plain numpy's, over all cuts."""
    whole = plain_bits()
    if not 0.02 < whole.mean() < 0.9:
        return float("inf")
    return float(sum(int((film(cut) != whole).sum()) for cut in CUTS))


SAMENESS: Final = (
    Case(
        20,
        "tiles, splits, checkpoints",
        "every bit the same in any tiling, any block length and after a restart",
        "plain numpy in one piece",
        "random numbers drawn in the order of a tile",
        "bits",
        0.0,
        cutting,
        filming,
    ),
)
