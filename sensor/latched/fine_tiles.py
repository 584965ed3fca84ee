"""Tiles of a chip, and patches of it, that the exact tier or the reference simulates, whatever the
others have.

A plan gives a tile to one of them if the arithmetic of the cheaper tiers could change its rates by
more than the tolerance allows. A camera on a few patches of the chip gives the same bits as on the
whole chip.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light, Plane, PlaneMap
from cosim.plan.tiles import PatchPlane, TileGrid
from cosim.spikes.viform import words_for
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier, tier_pixels
from sensor.latched.written import pending_of

Words = npt.NDArray[np.uint32]
Tiles = Mapping[Tier, npt.NDArray[np.bool_]]
"""Tiles or patches that each of the better tiers simulates."""
_TOGETHER: Final = 256
"""Tiles that are simulated at once, which limits the memory for their light."""


class FineTiles:
    """Every effect on some tiles of a chip.

    Args:
        setting: the camera with every effect.
        grid: tiles of the chip.
        tiles: (tiles,) bool of each tier.
        device: OpenCL device of the exact tier, or None for numba.
        row_delay: (height of the chip,) int64 ps; see `SpikeCamera`.

    Attributes:
        everywhere: whether these are all tiles of the chip.
    """

    def __init__(
        self,
        setting: CameraSetting,
        grid: TileGrid,
        tiles: Tiles,
        device: Device | None = None,
        row_delay: npt.NDArray[np.int64] | None = None,
    ) -> None:
        self.everywhere = bool(np.any(list(tiles.values()), axis=0).all())
        self._parts = []
        for tier, mask in tiles.items():
            for some in _equal_boxes(grid, np.flatnonzero(mask)):
                plane = PatchPlane(grid, some)
                camera = PatchCamera(setting, plane, tier, device, row_delay=row_delay)
                self._parts.append((plane.numbers, PlaneMap(plane.cut, None), camera))

    def step(
        self, light: Light, start: int, cycles: int
    ) -> list[tuple[npt.NDArray[np.uint32], Words]]:
        """Simulates the tiles.

        Args:
            light: light on the chip, before the map of the light (cross-talk).
            start, cycles: cycles to simulate.

        Returns:
            Numbers of pixels on the chip, (n,), and their words, (ceil(cycles / 32), n).
        """
        return [
            (numbers, camera.step(cut(light), start, cycles))
            for numbers, cut, camera in self._parts
        ]

    def fraction(self, share: npt.NDArray[np.float64]) -> None:
        """Writes the stored charge of the tiles into that of the chip, which is changed in place;
        see `SpikeCamera.fraction`."""
        for numbers, _, camera in self._parts:
            share[numbers] = camera.fraction()

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next step depends on."""
        return _states([camera for *_, camera in self._parts])

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`, which may hold other keys."""
        _restore([camera for *_, camera in self._parts], state)


class MixedPatches:
    """A camera on patches, some of which a better tier simulates.

    Args:
        camera: camera on all patches of `plane`.
        setting: the camera with every effect.
        plane: the patches.
        fine: (patches,) bool of each tier.
        device: OpenCL device of the exact tier, or None for numba.

    Attributes:
        bits: (pixels,) int64, latched spikes so far.
    """

    def __init__(
        self,
        camera: PatchCamera,
        setting: CameraSetting,
        plane: PatchPlane,
        fine: Tiles,
        device: Device | None = None,
    ) -> None:
        self._camera = camera
        size = plane.rows + 2, plane.columns + 2
        self._parts = []
        for tier, patches in fine.items():
            if patches.any():
                tiles = np.array(plane.tiles)[patches].tolist()
                part = PatchCamera(setting, PatchPlane(plane.grid, tiles), tier, device)
                inside = np.repeat(patches, plane.rows * plane.columns)
                self._parts.append((inside, PlaneMap(_selecting(patches, size), None), part))
        self.bits = np.zeros(plane.numbers.size, np.int64)

    def step(self, light: Light, start: int, cycles: int) -> Words:
        """Words (ceil(cycles / 32), pixels) of the next cycles. light: cut by `PatchPlane.cut`."""
        words = self._camera.step(light, start, cycles).copy()
        self.bits = self._camera.bits.copy()
        for inside, cut, part in self._parts:
            words[:, inside] = part.step(cut(light), start, cycles)
            self.bits[inside] = part.bits
        return words

    def phase(self) -> npt.NDArray[np.float64]:
        """Spikes so far, including the fraction of the current interval, (pixels,)."""
        phase = self._camera.phase()
        for inside, _, part in self._parts:
            phase[inside] = part.phase()
        return phase

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next step depends on."""
        fine = _states([part for *_, part in self._parts])
        return {"mixed": self.bits.copy(), **self._camera.state(), **fine}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self.bits = state["mixed"].astype(np.int64)
        _restore([part for *_, part in self._parts], state)
        self._camera.restore(
            {k: v for k, v in state.items() if k != "mixed" and not k.startswith("fine")}
        )


class PatchCamera:
    """Exposes the pixels of patches to light.

    Args:
        setting: setting of the camera.
        plane: places of the patches on the chip.
        tier: arithmetic of the pixels.
        device: OpenCL device, or None for numba.
        flags: (rows of the plane, groups) uint8, effects that the fast tier keeps in each group.
        row_delay: (height of the chip,) int64 ps; see `SpikeCamera`.

    Attributes:
        bits: (pixels,) int64, latched spikes so far.
    """

    def __init__(
        self,
        setting: CameraSetting,
        plane: PatchPlane,
        tier: Tier,
        device: Device | None = None,
        flags: npt.NDArray[np.uint8] | None = None,
        row_delay: npt.NDArray[np.int64] | None = None,
    ) -> None:
        self._pixels = tier_pixels(
            tier, setting, plane.shape, plane.numbers, plane.row, device, flags, row_delay
        )
        self._inner = PlaneMap(plane.inner, None)
        self._light_map: Callable[[Light], Light] = setting.light_map or (lambda light: light)
        self._gain = setting.common_gain
        self._late = 0 if row_delay is None else int(row_delay.max())
        self.bits = np.zeros(plane.numbers.size, np.int64)

    def step(self, light: Light, start: int, cycles: int) -> Words:
        """Words (ceil(cycles / 32), pixels) of the next cycles. light: cut by `PatchPlane.cut`."""
        light = self._inner(self._light_map(light))
        if self._gain is not None:
            light = self._gain.on(light, start, cycles, self._late)
        words = self._pixels.expose(light, start, cycles)
        assert len(words) == words_for(cycles)
        self.bits += np.bitwise_count(words).sum(axis=0, dtype=np.int64)
        return words

    def phase(self) -> npt.NDArray[np.float64]:
        """Spikes so far, including the fraction of the current interval, (pixels,). It is less what
        a dead time has yet to lose, so that tiers which lose it at once have the same phase."""
        return self.bits + self._pixels.fraction() - pending_of(self._pixels)

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the threshold of the current interval, (pixels,)."""
        return self._pixels.fraction()

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next step depends on."""
        return {"bits": self.bits.copy(), **self._pixels.state()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self.bits = state["bits"].astype(np.int64)
        self._pixels.restore({k: v for k, v in state.items() if k != "bits"})


def _equal_boxes(grid: TileGrid, tiles: npt.NDArray[np.intp]) -> list[list[int]]:
    """The tiles in lists of one size each, of at most _TOGETHER tiles."""
    sizes: dict[tuple[int, int], list[int]] = {}
    for tile in tiles.tolist():
        y0, y1, x0, x1 = grid.box(tile)
        sizes.setdefault((y1 - y0, x1 - x0), []).append(tile)
    return [
        some[n : n + _TOGETHER] for some in sizes.values() for n in range(0, len(some), _TOGETHER)
    ]


def _states(cameras: Sequence[PatchCamera]) -> dict[str, npt.NDArray[Any]]:
    """The states of cameras as one."""
    return {
        f"fine{n}:{key}": value
        for n, camera in enumerate(cameras)
        for key, value in camera.state().items()
    }


def _restore(cameras: Sequence[PatchCamera], state: dict[str, npt.NDArray[Any]]) -> None:
    """Continues cameras from `_states`, among which there may be other keys."""
    for n, camera in enumerate(cameras):
        own = f"fine{n}:"
        camera.restore({k.removeprefix(own): v for k, v in state.items() if k.startswith(own)})


def _selecting(patches: npt.NDArray[np.bool_], size: tuple[int, int]) -> Callable[[Plane], Plane]:
    """Reduces the light of all patches to that of some. size: of a patch with its border."""

    def select(cut: npt.NDArray[Any]) -> npt.NDArray[Any]:
        some = cut.reshape(patches.size, *size)[patches]
        return np.ascontiguousarray(some.reshape(-1, size[1]))

    return select
