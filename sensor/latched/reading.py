"""Sub-threshold readings of a latched chip: the stored charge of every pixel, in N levels.

Huang 2022, section 4.5: if a pixel has not reached its threshold within the longest time that is
acceptable, its charge is measured directly and quantised into N levels. Here a chip measures the
charge at whole multiples of that time, without a reset, so the spikes are the same bit for bit.

All tiers give the smooth charge (the integral of the rate) as a share f of the interval's
threshold, which is Gamma(Q). Given that the Q-th electron comes at the threshold, the Q - 1 before
it are spread uniformly over the smooth charge (order statistics of a Poisson process), so

    electrons ~ Binomial(Q - 1, f),

and those between two readings of one interval, at f and g, are Binomial(Q - 1 - n, (g - f)/(1 - f))
where n were counted before. Over all thresholds that have not been reached, electrons are Poisson
and cut off at Q. Threshold noise is part of the threshold: it scales the charge that is read. The
noise of the converter is not modelled.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.draws import binomial
from cosim.compute.streams import Stream
from cosim.light.light import Light
from cosim.spikes.viform import WORD, Viform, words_for
from cosim.stage import Block
from sensor.latched.camera import SpikeCamera
from sensor.latched.effects.shot_noise import SHOT_NOISE
from sensor.latched.setting import CameraSetting
from sensor.reconstruct.readings import Readings, quantised

_PREFIX: Final = "reading:"


class ReadingCamera:
    """A spike camera that also reads the charge of its pixels.

    The first reading precedes the first cycle, because the charge of a pixel that has not fired
    yet is the difference of two readings.

    Args:
        camera: the camera.
        setting: setting of the user, whose shot noise a reading has.
        every: cycles between two readings.
        levels: N of a reading, 1 to 65535.

    Attributes:
        shape: (height, width) of the camera.
        every, levels: cycles between two readings, and levels, as given.
    """

    def __init__(
        self, camera: SpikeCamera, setting: CameraSetting, every: int, levels: int
    ) -> None:
        self.shape = camera.shape
        self._camera, self.every, self.levels = camera, every, levels
        self._threshold, self._seed = setting.threshold, setting.seed
        self._noisy = SHOT_NOISE in setting.effects
        pixels = self.shape[0] * self.shape[1]
        self._numbers = np.arange(pixels, dtype=np.int64)
        self._fired = np.ones(pixels, bool)
        self._share, self._electrons = np.zeros(pixels), np.zeros(pixels, np.int64)
        self._taken: list[npt.NDArray[np.uint16]] = []

    def step(self, light: Light, block: Block) -> Viform:
        """Latched bits of one block, as `SpikeCamera.step` returns them."""
        if not self._taken:
            self._read()
        parts, start = [], block.start
        while start < block.stop:
            stop = min(block.stop, (start // self.every + 1) * self.every)
            parts.append(self._camera.step(light, Block(start, stop - start)))
            self._fired |= parts[-1].words.any(axis=0).ravel()
            if stop % self.every == 0:
                self._read()
            start = stop
        return parts[0] if len(parts) == 1 else joined(parts)

    def _read(self) -> None:
        """Takes a reading."""
        share = np.clip(self._camera.fraction(), 0.0, 1.0)
        electrons = share * self._threshold
        if self._noisy:
            before = np.where(self._fired, 0, self._electrons)
            known = np.where(self._fired, 0.0, self._share)
            rest = (share - known) / np.maximum(1 - known, 1e-300)
            count = np.maximum(round(self._threshold) - 1 - before, 0)
            frame = len(self._taken)
            more = binomial(count, rest, self._numbers, frame, self._seed, Stream.CHARGE)
            self._electrons, self._share = before + more, np.maximum(share, known)
            electrons = self._electrons.astype(np.float64)
        level = quantised(electrons, self._threshold, self.levels)
        self._taken.append(level.reshape(self.shape))
        self._fired = np.zeros_like(self._fired)

    def readings(self) -> Readings:
        """The readings so far."""
        cycles = np.arange(len(self._taken), dtype=np.int64) * self.every
        return Readings(cycles, np.stack(self._taken), self.levels)

    def gain(self, number: int) -> npt.NDArray[np.int64]:
        """Levels from reading `number` - 1 to reading `number`, (H, W), 0 or more: those of a pixel
        that has not fired between them."""
        more = self._taken[number].astype(np.int64) - self._taken[number - 1]
        return np.maximum(more, 0)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next block depends on, and the readings so far."""
        own = {"fired": self._fired, "share": self._share, "electrons": self._electrons}
        if self._taken:
            own["taken"] = np.stack(self._taken)
        return self._camera.state() | {_PREFIX + key: own[key].copy() for key in own}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._fired = state[_PREFIX + "fired"].astype(bool)
        self._share = state[_PREFIX + "share"].astype(np.float64)
        self._electrons = state[_PREFIX + "electrons"].astype(np.int64)
        self._taken = list(state.get(_PREFIX + "taken", ()))
        self._camera.restore({k: v for k, v in state.items() if not k.startswith(_PREFIX)})


def joined(parts: list[Viform]) -> Viform:
    """One stream of consecutive parts, each packed from bit 0."""
    first = parts[0]
    cycles = sum(part.cycles for part in parts)
    words = np.zeros((words_for(cycles), *first.shape), np.uint32)
    at = 0
    for part in parts:
        word, shift = divmod(at, WORD)
        for n, each in enumerate(part.words):
            words[word + n] |= each << np.uint32(shift)
            if shift and word + n + 1 < len(words):
                words[word + n + 1] |= each >> np.uint32(WORD - shift)
        at += part.cycles
    return Viform(words, cycles, first.clock, first.start)
