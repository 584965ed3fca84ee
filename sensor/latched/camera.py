"""The spike camera as one stage of a run: `Light` in, `Viform` out, block by block."""

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
    """Exposes the chip's pixels to light. device: OpenCL, or None for numba; the bits of the exact
    tier are the same.

    rows: the rows of the chip that are simulated, all unless given; a pixel's number, and so its
    noise, is its place on the whole chip. Cross-talk takes the light beyond them to be as theirs.
    tier, flags: see `tier_pixels`. late: (height of the chip,) int64 picoseconds by which the light
    is early at each row: what is at an instant in the light given comes to that row so much later
    (a source whose own rows are late); it moves each row's sampling, at most a few cycles.
    """

    def __init__(
        self,
        setting: CameraSetting,
        device: Device | None,
        rows: tuple[int, int] | None = None,
        tier: Tier = "exact",
        flags: npt.NDArray[np.uint8] | None = None,
        late: npt.NDArray[np.int64] | None = None,
    ) -> None:
        chip = setting.chip
        first, stop = rows or (0, chip.height)
        self.shape = (stop - first, chip.width)
        self._clock = setting.clock
        numbers = np.arange(first * chip.width, stop * chip.width, dtype=np.uint32)
        self._light_map = setting.light_map
        self._pixels = tier_pixels(
            tier, setting, self.shape, numbers, np.arange(first, stop), device, flags, late
        )

    def step(self, light: Light, block: Block) -> Viform:
        """The latched flags of one block. light: lux on the pixels, at least this block's time and
        as many cycles around it as `CameraSetting.reach` and `late` say."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        if self._light_map is not None:
            light = self._light_map(light)
        words = self._pixels.expose(light, block.start, block.cycles).reshape(-1, *self.shape)
        return Viform(words, block.cycles, self._clock, block.start)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next block depends on."""
        return self._pixels.state()

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._pixels.restore(state)
