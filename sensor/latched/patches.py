"""A latched camera on a few patches of its chip, with the very bits that they have on it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light, PlaneMap
from cosim.plan.patches import PatchPlane
from cosim.spikes.viform import words_for
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier, tier_pixels

__all__ = ["PatchCamera"]

Words = npt.NDArray[np.uint32]


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
