"""The spike camera as a stage of a run: it turns `Light` into a `Viform`, block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light
from cosim.spikes.viform import Viform, Words, words_for
from cosim.stage import Block
from sensor.latched.fine_tiles import FineTiles
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier, TierPixels, tier_pixels


class Gathering:
    """The light that pixels gather: after cross-talk and drift.

    Args:
        setting: setting of the camera.
        tier: arithmetic of the pixels.
        late: most time, ps, by which the light reaches a row later; see `row_delay` of
            `SpikeCamera`.
    """

    def __init__(self, setting: CameraSetting, tier: Tier, late: int = 0) -> None:
        self._light_map, self._gain, self._late = setting.light_map, setting.common_gain, late
        self._products = tier == "fast" and not setting.writes

    def __call__(self, light: Light, block: Block) -> Light:
        """The light of a block, lux. Blocks follow each other."""
        light = light if self._light_map is None else self._light_map(light)
        if self._gain is None:
            return light
        return self._gain.on(light, block.start, block.cycles, self._late, products=self._products)


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
        fine: every effect on some tiles of the whole chip, in a better tier; None for no tile.
        row_delay: (height of the chip,) int64 ps, time by which the light reaches each row later
            than `step` is given it, such as that of a source with a rolling shutter. It moves the
            sampling instant of each row. None for 0.
        like: `constants` of a camera that differs in its seed only; None for none.
        gathering: light that the pixels of the setting gather, if it has begun; None for a new one.
    """

    def __init__(
        self,
        setting: CameraSetting,
        device: Device | None,
        rows: tuple[int, int] | None = None,
        tier: Tier = "exact",
        flags: npt.NDArray[np.uint8] | None = None,
        row_delay: npt.NDArray[np.int64] | None = None,
        fine: FineTiles | None = None,
        like: TierPixels | None = None,
        gathering: Gathering | None = None,
    ) -> None:
        chip = setting.chip
        first, stop = rows or (0, chip.height)
        self.shape = (stop - first, chip.width)
        self._clock = setting.clock
        numbers = np.arange(first * chip.width, stop * chip.width, dtype=np.uint32)
        late = 0 if row_delay is None else int(row_delay.max())
        self._fine, self._gathering = fine, gathering or Gathering(setting, tier, late)
        self._pixels: TierPixels | None = None
        if fine is None or not fine.everywhere:
            self._pixels = tier_pixels(
                tier, setting, self.shape, numbers, np.arange(first, stop), device, flags,
                row_delay, like,
            )  # fmt: skip

    @property
    def constants(self) -> TierPixels | None:
        """What a camera with another seed can share; None for nothing."""
        return getattr(self._pixels, "constants", lambda: None)()

    def into(self, words: Words) -> None:
        """Has the next steps write into these words, (words, H, W) uint32, one after another, where
        the tier can; they return views of what they wrote."""
        into = getattr(self._pixels, "into", None)
        if into is not None:
            into(words.reshape(len(words), -1))

    def step(self, light: Light, block: Block) -> Viform:
        """Latched bits of one block.

        Args:
            light: lux on the pixels. It covers the block and, around it, `CameraSetting.reach` and
                the row delays.
            block: cycles to simulate.

        Raises:
            ValueError: the light has another shape or does not cover these cycles.
        """
        return self._begin(light, self._gathered(light, block), block)()

    def each(
        self, blocks: Sequence[Block], light: Callable[[Block], Light],
        seen: Callable[[Light, Block], Any] | None = None,
        first: tuple[Light, Light] | None = None,
    ) -> Iterator[Viform]:  # fmt: skip
        """`step` for blocks that follow each other.

        Args:
            blocks: the blocks.
            light: gives the light of a block; it is asked for that of the next one while a device
                works.
            seen: is given each block's light before it is simulated; None for nothing.
            first: light of the first block, and what `gathering` gave for it; None if it gave
                nothing yet.
        """
        if first is None:
            given = light(blocks[0])
            gathered = self._gathered(given, blocks[0])
        else:
            given, gathered = first
        for block, following in zip_longest(blocks, blocks[1:]):
            if seen is not None:
                seen(given, block)
            end = self._begin(given, gathered, block)
            try:
                if following is not None:
                    given = light(following)
                    gathered = self._gathered(given, following)
            except BaseException:
                self._finish()
                raise
            yield end()

    def _gathered(self, light: Light, block: Block) -> Light:
        """The light that pixels gather in a block. Blocks follow each other."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        # Better tiers gather for themselves.
        return light if self._pixels is None else self._gathering(light, block)

    def _begin(self, light: Light, gathered: Light, block: Block) -> Callable[[], Viform]:
        """Begins a block, where the tier can. The result ends it and returns the bits; it must be
        called, as a device writes into memory of the host until then."""
        start, cycles = block.start, block.cycles
        launch = getattr(self._pixels, "launch", None)
        launched = None if launch is None else launch(gathered, start, cycles)

        def end() -> Viform:
            fine: list[tuple[Any, Any]] = []
            try:
                if self._fine is not None:
                    fine = self._fine.step(light, start, cycles)
            except BaseException:
                self._finish()
                raise
            if launched is not None:
                words = launched()
            elif self._pixels is not None:
                words = self._pixels.expose(gathered, start, cycles)
            else:
                words = np.zeros((words_for(cycles), self.shape[0] * self.shape[1]), np.uint32)
            if fine and not words.flags.writeable:
                words = np.array(words)
            for numbers, some in fine:
                words[:, numbers] = some
            return Viform(words.reshape(-1, *self.shape), cycles, self._clock, start)

        return end

    def _finish(self) -> None:
        """Waits until a device no longer writes what `_begin` has begun."""
        finish = getattr(self._pixels, "finish", None)
        if finish is not None:
            finish()

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the threshold of the current interval, (H W,)."""
        if self._pixels is None:
            share = np.zeros(self.shape[0] * self.shape[1])
        else:
            share = self._pixels.fraction()
        if self._fine is not None:
            self._fine.fraction(share)
        return share

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next block depends on."""
        state = {} if self._pixels is None else self._pixels.state()
        return state | ({} if self._fine is None else self._fine.state())

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        if self._fine is not None:
            self._fine.restore(state)
        if self._pixels is not None:
            self._pixels.restore({k: v for k, v in state.items() if not k.startswith("fine")})
