"""The exposure loop of an EBAPS and the subtraction of dark frames.

The loop (document 002, section 3.1) knows the mean brightness of a frame and a fixed step, in
integers throughout. With a mean inside [24 000, 25 600] the exposure stays; above, it
decreases by a step of 640 000 ns; below, it increases by one. It is limited to [T_min, T_max].

The sum of all pixels is compared with limit x pixels, so there is no division and no rounding; 1280
x 1024 values of 16 bits need an accumulator of 37 bits. The mean of a frame affects the frame after
next (`timing`), so a loop that acts on every frame makes one more step before it sees the result of
the last. With `wait` (the default here; the document does not mention it) only frames count that
were exposed with the present exposure; the loop then settles whenever an ideal one does.

The mean of four dark frames is subtracted from the live frame, which suppresses the fixed pattern
(document 002, section 3.2). The mean is sum >> 2. The truncation lowers it by 3/8 DN on average, so
the difference is too large by this amount (variance of the truncation: 5/64 DN^2 if the noise is a
few DN). The difference is unsigned, as the 16 bits of the memory: negative values become zero,
which raises a mean near zero. `pedestal` can be added before to avoid this.

Residual: with dark frames of the same exposure the dark fixed pattern is removed completely, and
the noise of their mean remains as a fixed pattern of variance var_dark/4 + 5/64. With dark frames
of another exposure, the pattern of the dark current remains in proportion to the difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.timing import Timing

WINDOW = (24_000, 25_600)
"""Target of the mean, DN, both limits inside: document 002, section 3.1."""
STEP = 640_000
"""s, ns: document 002, section 3.1."""
SHORTEST_EXPOSURE = 1_000_000
"""T_min, ns: document 002, section 3.1."""
DEFAULT_EXPOSURE = 16_384_000
"""T_default, ns: document 002, section 3.1."""
LATENCY = 2
"""Frames from the one that is measured to the first that its exposure can change."""
DARKS = 4
"""Frames in the dark mean: document 002, section 3.2."""
TRUNCATION_VARIANCE = 5 / 64
"""Variance of what >> 2 drops, DN^2."""
Image = npt.NDArray[np.uint16]


@dataclass(frozen=True)
class ExposureRule:
    """Limits in DN and ns.

    Attributes: wait: whether to act only on frames that were exposed after the last action of the
        loop.
    """

    low: int = WINDOW[0]
    high: int = WINDOW[1]
    step: int = STEP
    shortest: int = SHORTEST_EXPOSURE
    longest: int = Timing().longest_exposure
    wait: bool = True

    def clip(self, exposure: int) -> int:
        """Within [shortest, longest]; a shortest above the longest gives the longest."""
        return min(max(exposure, self.shortest), self.longest)

    def side(self, total: int | Fraction, pixels: int) -> int:
        """-1 below the window, 0 inside, 1 above. total: sum of all pixels, DN."""
        if total > self.high * pixels:
            return 1
        return -1 if total < self.low * pixels else 0

    def after(self, exposure: int, total: int | Fraction, pixels: int) -> int:
        """The exposure that follows, ns; equation 2."""
        return self.clip(exposure - self.side(total, pixels) * self.step)

    def judged(self, standing: int, exposed: int, total: int | Fraction, pixels: int) -> int:
        """The exposure after judgement of a frame that was exposed for `exposed`."""
        if self.wait and exposed != standing:
            return standing
        return self.after(standing, total, pixels)


@dataclass(frozen=True)
class Linear:
    """Mean of a frame, DN, exact: zero + slope x exposure, no clipping.

    Attributes:
        slope: DN a ns.
    """

    slope: Fraction
    zero: Fraction = Fraction(0)

    @classmethod
    def wanting(cls, exposure: int | Fraction, rule: ExposureRule, zero: int = 0) -> Linear:
        """Light under which this exposure (ns) gives the window's middle."""
        middle = Fraction(rule.low + rule.high, 2)
        return cls((middle - zero) / Fraction(exposure), Fraction(zero))

    def mean(self, exposure: int) -> Fraction:
        """DN."""
        return self.zero + self.slope * exposure


def follow(
    rule: ExposureRule, brightness: Callable[[int, int], int | Fraction], frames: int, *,
    start: int = DEFAULT_EXPOSURE, latency: int = LATENCY, pixels: int = 1,
) -> list[int]:  # fmt: skip
    """Exposures of successive frames, ns, with the latency of the hardware.

    Args: brightness: sum over `pixels` pixels, DN, of a frame by number and exposure. latency:
        frames from a mean to the exposure that it changes; 1 for the next frame, as in the text of
        the document.
    """
    standing = rule.clip(start)
    exposed: list[int] = []
    for frame in range(frames):
        seen = frame - latency
        if seen >= 0:
            total = brightness(seen, exposed[seen])
            standing = rule.judged(standing, exposed[seen], total, pixels)
        exposed.append(standing)
    return exposed


def mean_of_four(frames: Sequence[Image]) -> Image:
    """(H, W) of four frames: their sum in 18 bits, shifted right by two."""
    if len(frames) != DARKS:
        raise ValueError(f"there must be {DARKS} dark frames, not {len(frames)}")
    total = np.zeros(frames[0].shape, np.uint32)
    for frame in frames:
        total += frame
    return (total >> 2).astype(np.uint16)


def subtract(live: Image, dark: Image, pedestal: int = 0) -> Image:
    """(H, W) live - dark + pedestal, held within 16 bits."""
    difference = live.astype(np.int32) - dark + pedestal
    return np.clip(difference, 0, 65_535).astype(np.uint16)


def residual_variance(dark: float, live: float = 0.0, frames: int = 1) -> float:
    """Residual spatial variance of the mean of `frames` corrected frames in the dark, DN^2.

    dark, live: temporal variance of a pixel in a dark frame and in a live one, DN^2.
    """
    return dark / DARKS + TRUNCATION_VARIANCE + live / frames
