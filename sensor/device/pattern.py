"""Fixed pattern: what differs from pixel to pixel and stays, from the device seed.

Light, dark current and threshold of a pixel are scaled; a scaled threshold is the inverse scale of
all charge, so the whole pattern is one gain and one dark charge a pixel, applied before a cycle
begins. Gains are rounded to 2^-24, so that no library's last bit can show.

Neighbours may have gains in common, because they share circuits and lie close together on the
wafer: the normal values of light's gain are then sums of independent ones of a square of 3 x 3,
with the weights a and 1 along a row, b and 1 along a column. Next neighbours in a row then have the
correlation r = 2 a / (1 + 2 a^2), and those two columns apart a^2 / (1 + 2 a^2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import cores
from cosim.compute.philox import philox4x32
from cosim.compute.stopping import threads
from cosim.compute.streams import Stream

DOUBLING: Final = 6.5
"""Kelvin in which dark current doubles: 6 to 7 for silicon near room temperature."""
_GRAIN: Final = 1 << 24
_PART: Final = 1 << 17
"""Number of pixels that a thread draws at once: numpy and the compiled words release the
interpreter lock, and the arrays stay in the cache."""
CORRELATED: Final = 0.6
"""Largest correlation of neighbours; sums of 3 x 3 allow up to 0.7."""
_ROW, _COLUMN, _PLACE = 1, 2, 3
"""What the second word of a counter says that the first one numbers; 0 for pixels."""
_KEPT: Final = 4
"""Patterns of consecutive pixels that are kept, 16 bytes a pixel."""
_FEW, _MOST = 1 << 10, 1 << 21
"""Pixels from which a pattern is kept, and up to which."""

Gain = npt.NDArray[np.float64]


def dark_current(
    at_reference: float, celsius: float, reference: float = 25.0, doubling: float = DOUBLING
) -> float:
    """Dark current at a temperature: I0 2^((T - T0) / T_d), electrons a second."""
    return float(at_reference * 2 ** ((celsius - reference) / doubling))


@dataclass(frozen=True, kw_only=True)
class DevicePattern:
    """Sizes of a device's fixed pattern; all zero is a perfect device.

    Attributes:
        prnu: standard deviation of the light's gain.
        dark: mean dark current, electrons a second, at the run's temperature.
        dsnu: its standard deviation, relative to it.
        threshold_fpn: standard deviation of the threshold, relative.
        hot, dead: shares of pixels.
        hot_current: electrons a second that a hot pixel has on top.
        warm: share of pixels with a dark current of their own on top, exponentially distributed.
        warm_current: mean of that current, electrons a second.
        device_seed: seed of the device, below 2^32.
        rows, columns: standard deviations of the light's gain that a row, and a column, has in
            common.
        along_row, along_column: correlation of the light's gain (of `prnu`) between neighbours in a
            row, and in a column; at most CORRELATED.
        width: columns of the chip; needed where one of these four has a size.
    """

    prnu: float = 0.0
    dark: float = 0.0
    dsnu: float = 0.0
    threshold_fpn: float = 0.0
    hot: float = 0.0
    hot_current: float = 0.0
    dead: float = 0.0
    warm: float = 0.0
    warm_current: float = 0.0
    device_seed: int = 0
    rows: float = 0.0
    columns: float = 0.0
    along_row: float = 0.0
    along_column: float = 0.0
    width: int = 0

    def __post_init__(self) -> None:
        sizes = "prnu", "dark", "dsnu", "threshold_fpn", "hot_current", "warm_current"
        for name in (*sizes, "rows", "columns"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be 0 or more, not {getattr(self, name):g}")
        for name in ("hot", "dead", "warm"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} must be a share from 0 to 1, not {getattr(self, name):g}")
        for name in ("along_row", "along_column"):
            if not 0 <= getattr(self, name) <= CORRELATED:
                raise ValueError(f"{name} must be 0 to {CORRELATED:g}, not {getattr(self, name):g}")

    @property
    def placed(self) -> bool:
        """Whether the pattern depends on where a pixel lies."""
        return bool(self.rows or self.columns or self.along_row or self.along_column)

    def at(self, pixels: npt.NDArray[np.uint32]) -> FixedPattern:
        """The pattern of pixels, (n,), by their numbers on the chip. That of consecutive pixels is
        kept for a later call, and must not be modified."""
        if self.placed and self.width < 1:
            raise ValueError("width must be 1 or more where rows, columns or neighbours count")
        first, count = int(pixels[0]) if pixels.size else 0, pixels.size
        if _FEW < count <= _MOST and np.array_equal(pixels, np.arange(first, first + count)):
            return _consecutive(self, first, count)
        return self._made(pixels)

    def _made(self, pixels: npt.NDArray[np.uint32]) -> FixedPattern:
        if pixels.size <= _PART:
            return self._at(pixels)
        parts = [pixels[n : n + _PART] for n in range(0, pixels.size, _PART)]
        with threads(min(cores(), len(parts))) as pool:
            patterns = list(pool.map(self._at, parts))
        return FixedPattern(
            np.concatenate([part.gain for part in patterns]),
            np.concatenate([part.dark for part in patterns]),
        )

    def _at(self, pixels: npt.NDArray[np.uint32]) -> FixedPattern:
        from scipy.special import ndtri

        def words(draw: int) -> list[npt.NDArray[np.float64]]:
            four = philox4x32((pixels, 0, 0, draw), (self.device_seed, Stream.PATTERN))
            return [(w.astype(np.float64) + 0.5) / 2.0**32 for w in four]

        # What has no size is not drawn: the bits are the same.
        spreads = (self.prnu, self.dsnu if self.dark else 0.0, self.threshold_fpn)
        drawn = words(0)[:3] if any(spreads) else [np.zeros(pixels.shape)] * 3
        light, dark, threshold = (
            size * ndtri(u) if size else np.zeros(pixels.shape)
            for size, u in zip(spreads, drawn, strict=True)
        )
        if self.prnu and (self.along_row or self.along_column):
            light = self.prnu * self._alike(pixels)
        if self.rows:
            light = light + self.rows * self._normal(pixels // np.uint32(self.width), _ROW)
        if self.columns:
            light = light + self.columns * self._normal(pixels % np.uint32(self.width), _COLUMN)
        # A normal gain below zero would be a pixel that light empties; it is held at nothing.
        scale = 1 / np.maximum(1 + threshold, 0.05)
        gain = np.maximum(1 + light, 0) * scale
        current = self.dark * np.maximum(1 + dark, 0)
        if self.dead or self.hot or self.warm:
            hot, dead, warm, excess = words(1)
            gain = np.maximum(1 + light, 0) * (dead >= self.dead) * scale
            current = current + self.hot_current * (hot < self.hot)
            current = current - self.warm_current * np.log(excess) * (warm < self.warm)
        return FixedPattern(
            np.rint(gain * _GRAIN) / _GRAIN, np.rint(current * scale * _GRAIN) / _GRAIN
        )

    def _normal(self, numbers: npt.NDArray[np.uint32], kind: int) -> Gain:
        """Normal values by their numbers, (n,). kind: what is numbered."""
        from scipy.special import ndtri

        word = philox4x32((numbers, kind, 0, 0), (self.device_seed, Stream.PATTERN))[0]
        return np.asarray(ndtri((word.astype(np.float64) + 0.5) / 2.0**32))

    def _alike(self, pixels: npt.NDArray[np.uint32]) -> Gain:
        """Normal values of pixels that are correlated with their neighbours, (n,)."""
        row, column = (each.astype(np.int64) + 1 for each in np.divmod(pixels, self.width))
        a, b = _weight(self.along_row), _weight(self.along_column)
        total = np.zeros(pixels.shape)
        for dy, dx in np.ndindex(3, 3):
            weight = (b if dy != 1 else 1.0) * (a if dx != 1 else 1.0)
            if weight:
                place = (row + dy - 1) * (self.width + 2) + column + dx - 1
                total += weight * self._normal(place.astype(np.uint32), _PLACE)
        return np.asarray(total / np.sqrt((1 + 2 * a * a) * (1 + 2 * b * b)))


def _weight(correlation: float) -> float:
    """a of a correlation r: the smaller root of 2 r a^2 - 2 a + r = 0."""
    if not correlation:
        return 0.0
    return float((1 - np.sqrt(1 - 2 * correlation**2)) / (2 * correlation))


@dataclass(frozen=True, eq=False)
class FixedPattern:
    """The fixed pattern of some pixels.

    Attributes:
        gain: gain of light, (n,) float64.
        dark: electrons a second, (n,) float64. Both in charge scaled to the nominal threshold.
    """

    gain: Gain
    dark: Gain


@lru_cache(_KEPT)
def _consecutive(pattern: DevicePattern, first: int, count: int) -> FixedPattern:
    """The pattern of `count` pixels from number `first` on."""
    return pattern._made(np.arange(first, first + count, dtype=np.uint32))
