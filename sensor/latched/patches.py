"""The same camera on a few patches of the chip: what a plan's promises are checked with.

Patches are tiles, stacked into one tall plane. Pixels keep their numbers, their rows' sampling
instants and their neighbours' light, so each has the very bits that it has on the whole chip.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light, Plane, PlaneMap
from cosim.spikes.viform import words_for
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier, tier_pixels

__all__ = ["Boxes", "PatchCamera", "PatchPlane"]

Words = npt.NDArray[np.uint32]


class Boxes(Protocol):
    """A plane of (height, width) pixels, and the rows y0 to y1 and columns x0 to x1 of each of its
    numbered boxes; `TileGrid` is one."""

    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    def box(self, tile: int) -> tuple[int, int, int, int]: ...


class PatchPlane:
    """Patches of one size, stacked: (patches x rows, columns). tiles: their numbers in the grid."""

    def __init__(self, grid: Boxes, tiles: list[int]) -> None:
        boxes = [grid.box(tile) for tile in tiles]
        sizes = {(y1 - y0, x1 - x0) for y0, y1, x0, x1 in boxes}
        if len(sizes) != 1:
            raise ValueError(f"patches must be of one size, not {sorted(sizes)}")
        self.tiles = tiles
        ((self.rows, self.columns),) = sizes
        self.shape = (len(tiles) * self.rows, self.columns)
        y = np.stack([np.arange(b[0] - 1, b[1] + 1) for b in boxes])
        x = np.stack([np.arange(b[2] - 1, b[3] + 1) for b in boxes])
        self._y = np.clip(y, 0, grid.height - 1)
        self._x = np.clip(x, 0, grid.width - 1)
        self.row = self._y[:, 1:-1].ravel()
        """Row on the chip of each row here."""
        rows, columns = self._y[:, 1:-1, None], self._x[:, None, 1:-1]
        self.numbers = (rows * grid.width + columns).astype(np.uint32).ravel()

    @property
    def places(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Rows (patches, rows + 2) and columns (patches, columns + 2) of the plane that `cut`
        takes."""
        return self._y, self._x

    def cut(self, plane: Plane) -> Plane:
        """The patches with a border of one pixel, stacked; beyond the chip its border goes on."""
        cut = plane[self._y[:, :, None], self._x[:, None, :]]
        return np.ascontiguousarray(cut.reshape(-1, self.columns + 2))

    def inner(self, plane: Plane) -> Plane:
        """Without that border."""
        cut = plane.reshape(len(self.tiles), self.rows + 2, self.columns + 2)[:, 1:-1, 1:-1]
        return np.ascontiguousarray(cut.reshape(self.shape))

    def split(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(..., pixels) values as (..., patches, pixels of a patch)."""
        return values.reshape(*values.shape[:-1], len(self.tiles), -1)


class PatchCamera:
    """Films the patches. flags: of the fast tier's work-items, (rows of the plane, groups). late:
    of the chip's rows; see `SpikeCamera`."""

    def __init__(
        self,
        setting: CameraSetting,
        plane: PatchPlane,
        tier: Tier,
        device: Device | None = None,
        flags: npt.NDArray[np.uint8] | None = None,
        late: npt.NDArray[np.int64] | None = None,
    ) -> None:
        self._pixels = tier_pixels(
            tier, setting, plane.shape, plane.numbers, plane.row, device, flags, late
        )
        self._inner = PlaneMap(plane.inner, None)
        self._light_map: Callable[[Light], Light] = setting.light_map or (lambda light: light)
        self.bits = np.zeros(plane.numbers.size, np.int64)
        """Latched spikes so far."""

    def step(self, light: Light, start: int, cycles: int) -> Words:
        """Words of so many cycles. light: of `PatchPlane.cut`."""
        words = self._pixels.expose(self._inner(self._light_map(light)), start, cycles)
        assert len(words) == words_for(cycles)
        self.bits += np.bitwise_count(words).sum(axis=0, dtype=np.int64)
        return words

    def phase(self) -> npt.NDArray[np.float64]:
        """Spikes so far, with the fraction of the one under way."""
        return self.bits + self._pixels.fraction()

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        return {"bits": self.bits.copy(), **self._pixels.state()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self.bits = state["bits"].astype(np.int64)
        self._pixels.restore({k: v for k, v in state.items() if k != "bits"})
