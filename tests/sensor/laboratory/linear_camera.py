"""A plain linear camera with every parameter set: what a laboratory must be able to find again.

A value is round(black + K (photoelectrons + dark electrons + offset + read noise)), clipped; the
photoelectrons of a pixel have the mean QE (1 + PRNU) photons. Electrons are Poisson, the rest is
normal. This is the camera model of EMVA 1288 (section 2) and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cosim.compute.draws import normal, poisson
from cosim.compute.streams import Stream
from cosim.light.radiometry import photons_per_lux
from cosim.plan.effects import Bound, Effect, Summary
from sensor.frame_pixels import Exposed, ImagerSummary

_COST = 60.0
"""ns a pixel-frame of one draw, about."""
_SOURCE = "EMVA 1288 release 4.0 linear, section 2"


def _effect(name: str, stream: Stream, value: Callable[[ImagerSummary], float]) -> Effect:
    def bound(scene: Summary) -> Bound:
        assert isinstance(scene, ImagerSummary)
        return Bound(value(scene), "estimate")

    return Effect(name, _SOURCE, stream, bound, lambda scene: _COST)


@dataclass(frozen=True, eq=False)
class LinearPixels:
    """shape: (H, W). bits: of a value. gain: K, DN an electron. efficiency: QE, electrons a photon.
    area: square metres. dark_current: electrons a second. dsnu: electrons. prnu: relative. read:
    electrons RMS. black: DN. device_seed: of the fixed pattern."""

    shape: tuple[int, int]
    bits: int
    gain: float
    efficiency: float
    area: float
    dark_current: float
    dsnu: float
    prnu: float
    read: float
    black: float
    device_seed: int = 1
    effects: dict[str, Effect] = field(init=False)

    def __post_init__(self) -> None:
        # Noise and mean are relative to what is there at the least light.
        def noise(s: ImagerSummary) -> float:
            dark = self.dark_current * s.exposure[0]
            return float(np.sqrt(s.darkest + dark + self.read**2 + 1 / 12 / self.gain**2))

        def mean(s: ImagerSummary) -> float:
            return float(np.maximum(s.darkest, 1 / self.gain))

        made = (
            _effect("shot noise", Stream.IMAGER_SHOT, lambda s: min(
                float(np.sqrt(s.brightest)) / noise(s), 1.0)),
            _effect("dark current", Stream.IMAGER_DARK, lambda s: max(
                self.dark_current * s.exposure[1] / mean(s),
                float(np.sqrt(self.dark_current * s.exposure[1])) / noise(s))),
            _effect("read noise", Stream.IMAGER_READ, lambda s: min(self.read / noise(s), 1.0)),
            _effect("DSNU", Stream.IMAGER_PATTERN, lambda s: self.dsnu / mean(s)),
            _effect("PRNU", Stream.IMAGER_PATTERN, lambda s: self.prnu),
        )  # fmt: skip
        object.__setattr__(self, "effects", {e.name: e for e in made})

    @cached_property
    def _patterns(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Of offset and gain, in their deviations."""
        numbers = np.arange(self.shape[0] * self.shape[1], dtype=np.int64).reshape(self.shape)
        stream = Stream.IMAGER_PATTERN
        return normal(numbers, 0, self.device_seed, stream), normal(
            numbers, 1, self.device_seed, stream
        )

    def _per_lux_second(self) -> float:
        """Photoelectrons."""
        return self.area * photons_per_lux(555) * self.efficiency

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`."""
        height, width = rows.lux_seconds.shape
        numbers = rows.first * width + np.arange(height * width, dtype=np.int64)
        numbers = numbers.reshape(height, width)

        def pattern(kind: int) -> npt.NDArray[np.float64]:
            return self._patterns[kind][rows.first : rows.first + height]

        light = rows.lux_seconds * self._per_lux_second()
        if "PRNU" in kept:
            light = light * np.maximum(1 + self.prnu * pattern(1), 0)
        if "shot noise" in kept:
            light = poisson(light, numbers, rows.frame, seed, Stream.IMAGER_SHOT).astype(float)
        electrons = light
        if "dark current" in kept:
            dark = np.broadcast_to((self.dark_current * rows.seconds)[:, None], light.shape)
            electrons = electrons + poisson(dark, numbers, rows.frame, seed, Stream.IMAGER_DARK)
        if "DSNU" in kept:
            electrons = electrons + self.dsnu * pattern(0)
        if "read noise" in kept:
            drawn = normal(numbers, rows.frame, seed, Stream.IMAGER_READ)
            electrons = electrons + self.read * drawn
        values = np.rint(self.black + self.gain * electrons)
        return np.clip(values, 0, (1 << self.bits) - 1).astype(np.uint16)

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`."""
        electrons = lux_seconds * self._per_lux_second() + self.dark_current * seconds
        variance = self.gain**2 * (electrons + self.read**2) + 1 / 12
        return self.black + self.gain * electrons, variance

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        """See `PixelModel`."""
        least, most = (each * self._per_lux_second() for each in lux_seconds)
        full = ((1 << self.bits) - 1 - self.black) / self.gain
        return ImagerSummary(
            least, most, full, frames, frames, exposure=seconds, step=1 / self.gain
        )
