"""The exposure loop of an EBAPS: mean brightness of a frame, a fixed step, integers throughout.

Document 002, section 3.1: with a mean inside [24 000, 25 600] the exposure stays; above, it
decreases by a step of 640 000 ns; below, it increases by one. It is limited to [T_min, T_max].

The sum of all pixels is compared with limit x pixels, so there is no division and no rounding; 1280
x 1024 values of 16 bits need an accumulator of 37 bits. The mean of a frame affects the frame after
next (`timing`), so a loop that acts on every frame makes one more step before it sees the result of
the last. With `wait` (the default here; the document does not mention it) only frames count that
were exposed with the present exposure; the loop then settles whenever an ideal one does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from imagers.ebaps.board.timing import Timing

__all__ = [
    "ACCUMULATOR_BITS",
    "DEFAULT_EXPOSURE",
    "LATENCY",
    "SHORTEST_EXPOSURE",
    "STEP",
    "WINDOW",
    "ExposureRule",
    "Linear",
    "follow",
]  # fmt: skip

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
ACCUMULATOR_BITS = (1280 * 1024 * 65_535).bit_length()


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
