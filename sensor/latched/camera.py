"""The spike camera as a stage of a run: it turns `Light` into a `Viform`, block by block."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light
from cosim.spikes.viform import Viform
from cosim.stage import Block
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier, tier_pixels

__all__ = ["SpikeCamera"]


class SpikeCamera:
    """Exposes the pixels of a chip, or of some of its rows, to light.

    Args:
        setting: setting of the camera.
        device: OpenCL device, or None for numba. The exact tier gives the same bits on both.
        rows: (first, stop) rows of the chip to simulate, by default all. A pixel keeps its number
            on the whole chip, and so its noise. For cross-talk the light continues beyond these
            rows as at their edge.
        tier: arithmetic of the pixels.
        flags: effects that each group of pixels keeps in the fast tier; see `PixelArray`.
        row_delay: (height of the chip,) int64 ps, time by which the light reaches each row later
            than `step` is given it, such as that of a source with a rolling shutter; at most a few
            cycles. It moves the sampling instant of each row. None for 0.
    """

    def __init__(
        self,
        setting: CameraSetting,
        device: Device | None,
        rows: tuple[int, int] | None = None,
        tier: Tier = "exact",
        flags: npt.NDArray[np.uint8] | None = None,
        row_delay: npt.NDArray[np.int64] | None = None,
    ) -> None:
        chip = setting.chip
        first, stop = rows or (0, chip.height)
        self.shape = (stop - first, chip.width)
        self._clock = setting.clock
        numbers = np.arange(first * chip.width, stop * chip.width, dtype=np.uint32)
        self._light_map = setting.light_map
        self._pixels = tier_pixels(
            tier, setting, self.shape, numbers, np.arange(first, stop), device, flags, row_delay
        )

    def step(self, light: Light, block: Block) -> Viform:
        """Latched bits of one block.

        Args:
            light: lux on the pixels. It covers the block and, around it, `CameraSetting.reach` and
                the row delays.
            block: cycles to simulate.

        Raises:
            ValueError: the light has another shape or does not cover these cycles.
        """
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        if self._light_map is not None:
            light = self._light_map(light)
        words = self._pixels.expose(light, block.start, block.cycles).reshape(-1, *self.shape)
        return Viform(words, block.cycles, self._clock, block.start)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next block depends on."""
        return self._pixels.state()

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._pixels.restore(state)
