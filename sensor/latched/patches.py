"""A latched camera on a few patches of its chip, with the same bits as on the whole chip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light, PlaneMap
from cosim.plan.tiles import PatchPlane
from cosim.spikes.viform import words_for
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier, tier_pixels
from sensor.latched.written import pending_of

Words = npt.NDArray[np.uint32]


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
