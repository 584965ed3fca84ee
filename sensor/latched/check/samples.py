"""Samples: a few pixels in every tile of the chip, exposed to the reference and as planned.

The patches of the check are whole tiles, but few. The samples are few pixels, but in all tiles
that the run does not simulate with the reference itself. If the RMS error of a whole tile is at
most E, that of m of its n pixels is at most E sqrt(n / m), whichever they are. So a sample proves
that a bound is exceeded, without an assumption on how errors are distributed within the tile.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.plan.paired import Paired, Values
from cosim.plan.tiles import TILE, BoxGrid, PatchPlane, TileGrid
from sensor.latched.effects.effect import REFERENCE_CIRCUIT, reference_cost
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.planning import CameraPlan

_BOXES: Final = ((2, 8), (1, 8), (1, 4), (1, 2), (1, 1))
"""Rows and columns of a sample, by falling cost."""
_LEAST_S: Final = 0.15
"""Time that samples may take in any case, seconds."""
_SHARE: Final = 0.1
"""Part of the predicted time of the chip that they may take."""
_REFERENCE, _RUN = "reference", "run"


def _sample_grid(grid: TileGrid, rows: int, columns: int, seed: int) -> BoxGrid:
    """Boxes of rows x columns within the tiles; a tile that is smaller has a box of its size."""
    rng = np.random.default_rng([seed, 2])
    boxes = []
    for tile in range(len(grid)):
        y0, y1, x0, x1 = grid.box(tile)
        y = y0 + int(rng.integers(max(y1 - y0 - rows, 0) + 1))
        x = x0 + int(rng.integers(max(x1 - x0 - columns, 0) + 1))
        boxes.append((y, min(y + rows, y1), x, min(x + columns, x1)))
    return BoxGrid(grid.height, grid.width, np.array(boxes, np.int64).reshape(-1, 4))


def _affordable(run: CameraPlan, tiles: int) -> tuple[tuple[int, int], int]:
    """The largest box for which the samples of all tiles take the time that they may, and the
    number of tiles: fewer than all if even one pixel a tile takes longer."""
    scene, grid = run.survey.scene, run.survey.grid
    cost = REFERENCE_CIRCUIT if run.full.circuit else float(np.mean(reference_cost(scene)))
    pixel = cost * scene.cycles * 1e-9
    chip = run.plan.cost_ns * grid.height * grid.width * scene.cycles * 1e-9
    most = int(max(_LEAST_S, _SHARE * chip) / pixel)
    for rows, columns in _BOXES:
        if rows * columns * tiles <= most:
            return (rows, columns), tiles
    return _BOXES[-1], max(most, 1)


class TileSamples(Paired):
    """The stage that exposes the samples.

    Attributes:
        tiles: (n,) numbers of the sampled tiles.
    """

    def __init__(self, run: CameraPlan, plane: PatchPlane, device: Device | None) -> None:
        self.tiles = np.array(plane.tiles)
        self._floor = run.survey.scene.floor
        cameras = {
            _REFERENCE: PatchCamera(run.full, plane, "reference"),
            _RUN: run.on_patches(plane, device),
        }
        super().__init__(plane, cameras, run.spans)

    def least_errors(self) -> Values:
        """Least RMS error that each tile can have after these samples, in its worst window,
        relative to max(mean rate, floor), (n,)."""
        truth, rates = self.rates(_REFERENCE), self.rates(_RUN)
        square = ((rates - truth) ** 2).sum(axis=-1) / TILE**2
        base = np.maximum(truth.mean(axis=-1), max(self._floor, 1e-300))
        return np.asarray((np.sqrt(square) / base).max(axis=0))

    @property
    def pixels(self) -> int:
        """Pixels of a sample."""
        return self.plane.rows * self.plane.columns


def sample_tiles(
    run: CameraPlan, checked: list[int], device: Device | None, seed: int
) -> TileSamples | None:
    """Samples of the tiles that are neither `checked` as a whole nor simulated by a better tier;
    None if there is no such tile.

    Tiles at the right and bottom edges that are smaller than a sample are left out.
    """
    grid = run.survey.grid
    rest = ~run.fine
    rest[checked] = False
    tiles = np.flatnonzero(rest)
    if not tiles.size:
        return None
    (rows, columns), number = _affordable(run, tiles.size)
    boxes = _sample_grid(grid, rows, columns, seed)
    size = (boxes.boxes[tiles][:, [1, 3]] - boxes.boxes[tiles][:, [0, 2]]) == (rows, columns)
    tiles = tiles[size.all(axis=1)]
    if not tiles.size:
        return None
    if number < tiles.size:
        chosen = np.random.default_rng([seed, 3]).permutation(tiles.size)[:number]
        tiles = np.sort(tiles[chosen])
    return TileSamples(run, PatchPlane(boxes, tiles.tolist()), device)
