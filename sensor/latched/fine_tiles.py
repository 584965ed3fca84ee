"""Tiles of a chip that the reference simulates, in place of the tier of the other tiles.

A plan gives a tile to the reference if the arithmetic of the cheaper tiers could change its rates
by more than the tolerance allows.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.light.light import Light, PlaneMap
from cosim.plan.patches import PatchPlane
from cosim.plan.tiles import TileGrid
from sensor.latched.patches import PatchCamera
from sensor.latched.setting import CameraSetting

__all__ = ["FineTiles", "MixedPatches"]

Words = npt.NDArray[np.uint32]
_TOGETHER: Final = 256
"""Tiles that are simulated at once, which limits the memory for their light."""


def _equal_boxes(grid: TileGrid, tiles: npt.NDArray[np.intp]) -> list[list[int]]:
    """The tiles in lists of one size each, of at most _TOGETHER tiles."""
    sizes: dict[tuple[int, int], list[int]] = {}
    for tile in tiles.tolist():
        y0, y1, x0, x1 = grid.box(tile)
        sizes.setdefault((y1 - y0, x1 - x0), []).append(tile)
    return [
        some[n : n + _TOGETHER] for some in sizes.values() for n in range(0, len(some), _TOGETHER)
    ]


class FineTiles:
    """Full physics on some tiles of a chip.

    Args:
        setting: the camera with every effect.
        grid: tiles of the chip.
        tiles: (n,) numbers of the tiles.
        row_delay: (height of the chip,) int64 ps; see `SpikeCamera`.

    Attributes:
        everywhere: whether these are all tiles of the chip.
    """

    def __init__(
        self,
        setting: CameraSetting,
        grid: TileGrid,
        tiles: npt.NDArray[np.intp],
        row_delay: npt.NDArray[np.int64] | None = None,
    ) -> None:
        self.everywhere = tiles.size == len(grid)
        self._parts = []
        for some in _equal_boxes(grid, tiles):
            plane = PatchPlane(grid, some)
            camera = PatchCamera(setting, plane, "reference", row_delay=row_delay)
            self._parts.append((plane.numbers, PlaneMap(plane.cut, None), camera))

    def step(self, light: Light, start: int, cycles: int, words: Words) -> None:
        """Writes the words of the tiles into those of the chip.

        Args:
            light: on the chip, before the map of the light (cross-talk).
            start, cycles: cycles to simulate.
            words: (ceil(cycles / 32), pixels of the chip); changed in place.
        """
        for numbers, cut, camera in self._parts:
            words[:, numbers] = camera.step(cut(light), start, cycles)

    def fraction(self, share: npt.NDArray[np.float64]) -> None:
        """Writes the stored charge of the tiles into that of the chip, which is changed in place;
        see `SpikeCamera.fraction`."""
        for numbers, _, camera in self._parts:
            share[numbers] = camera.phase() - camera.bits

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next step depends on."""
        return {
            f"fine{n}:{key}": value
            for n, (*_, camera) in enumerate(self._parts)
            for key, value in camera.state().items()
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`, which may hold other keys."""
        for n, (*_, camera) in enumerate(self._parts):
            own = f"fine{n}:"
            camera.restore({k.removeprefix(own): v for k, v in state.items() if k.startswith(own)})


class MixedPatches:
    """A camera on patches, some of which the reference simulates.

    Args:
        camera: camera on all patches of `plane`.
        setting: the camera with every effect.
        plane: the patches.
        fine: (patches,) bool, patches that the reference simulates; at least one.

    Attributes:
        bits: (pixels,) int64, latched spikes so far.
    """

    def __init__(
        self,
        camera: PatchCamera,
        setting: CameraSetting,
        plane: PatchPlane,
        fine: npt.NDArray[np.bool_],
    ) -> None:
        tiles = [tile for tile, each in zip(plane.tiles, fine, strict=True) if each]
        self._camera = camera
        self._fine = PatchCamera(setting, PatchPlane(plane.grid, tiles), "reference")
        self._inside = np.repeat(fine, plane.rows * plane.columns)
        size = plane.rows + 2, plane.columns + 2

        def select(cut: npt.NDArray[Any]) -> npt.NDArray[Any]:
            patches = cut.reshape(fine.size, *size)[fine]
            return np.ascontiguousarray(patches.reshape(-1, size[1]))

        self._cut = PlaneMap(select, None)
        self.bits = np.zeros(plane.numbers.size, np.int64)

    def step(self, light: Light, start: int, cycles: int) -> Words:
        """Words (ceil(cycles / 32), pixels) of the next cycles. light: cut by `PatchPlane.cut`."""
        words = self._camera.step(light, start, cycles).copy()
        words[:, self._inside] = self._fine.step(self._cut(light), start, cycles)
        self.bits = np.where(self._inside, 0, self._camera.bits)
        self.bits[self._inside] = self._fine.bits
        return words

    def phase(self) -> npt.NDArray[np.float64]:
        """Spikes so far, including the fraction of the current interval, (pixels,)."""
        phase = self._camera.phase()
        phase[self._inside] = self._fine.phase()
        return phase

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next step depends on."""
        fine = {f"fine:{key}": value for key, value in self._fine.state().items()}
        return {"mixed": self.bits.copy(), **self._camera.state(), **fine}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self.bits = state["mixed"].astype(np.int64)
        fine = {k.removeprefix("fine:"): v for k, v in state.items() if k.startswith("fine:")}
        self._fine.restore(fine)
        self._camera.restore(
            {k: v for k, v in state.items() if k != "mixed" and not k.startswith("fine:")}
        )
