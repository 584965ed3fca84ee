"""Blur of a moving edge: widths of its profile on the retina, and the corresponding times.

An edge is filmed, shown, and followed by the eye; across it the retina image runs from one level to
the other. BEW is the distance from 10 to 90 % of that step; BET = BEW / v is the time the same, for
any speed v; EBET = BET / 0.8 extends it to the full width as though the profile were straight. An
ideal hold of T gives a straight profile of width v T, so BET = 0.8 T and EBET = T.

Two conventions of MPRT are in use. The mean of BET over transitions between greys is that of the
measurement standards; "1 ms persistence is 1 pixel per 1000 pixels/s" (TestUFO) is the full
width, which is the mean of EBET. VESA's exact formula of ClearMR is not public: what is here is a
ratio of its kind and is called CMR-like.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = [
    "STEP_SHARE", "bet", "blur_edge_width", "cmr_like", "ebet", "mprt", "mprt_full_width",
]  # fmt: skip

Values = npt.NDArray[np.float64]
LOW: Final = 0.1
HIGH: Final = 0.9
STEP_SHARE: Final = HIGH - LOW
"""Of the step that lies between BEW's two levels."""
CMR_FRAME: Final = 1 / 60
"""Seconds: the hold whose blur is called 100 % of CMR-like."""


def blur_edge_width(
    x: npt.ArrayLike, profile: npt.ArrayLike, low: float | None = None, high: float | None = None
) -> float:
    """BEW: distance, in units of x, over which an edge's profile runs from 10 to 90 % of its step.

    A noisy profile is replaced by the monotone one nearest to it in least squares (isotonic
    regression), which leaves a monotone one as it is; its crossings are interpolated linearly
    between samples. Raises ValueError without a step, or where x does not reach 10 and 90 %.

    Args:
        x: (n,) rising.
        profile: (n,) levels there, rows averaged where there are several; the edge may rise or
            fall.
        low, high: its settled levels at the first and the last x; unless given, the means of the
            first and the last eighth, which must lie beyond the blur.
    """
    from scipy.optimize import isotonic_regression  # half a second: only who measures pays for it

    at, level = np.asarray(x, np.float64), np.asarray(profile, np.float64)
    if at.ndim != 1 or at.shape != level.shape or len(at) < 4 or (np.diff(at) <= 0).any():
        raise ValueError(
            f"a profile must be 4 or more levels at rising places, not {level.shape} at {at.shape}"
        )
    end = max(len(at) // 8, 1)
    first = float(level[:end].mean()) if low is None else low
    last = float(level[-end:].mean()) if high is None else high
    if not (np.isfinite(level).all() and np.isfinite([first, last]).all() and first != last):
        raise ValueError(f"a profile must be finite and have a step, not {first:g} to {last:g}")
    share = np.asarray(isotonic_regression((level - first) / (last - first)).x)
    return _crossing(at, share, HIGH) - _crossing(at, share, LOW)


def _crossing(at: Values, share: Values, level: float) -> float:
    """Where a monotone profile reaches a level."""
    k = int(np.searchsorted(share, level, side="left"))
    if k == 0 or k == len(share):
        raise ValueError(
            f"a profile must run through {level:.0%} of its step, not {share[0]:.0%} to "
            f"{share[-1]:.0%}"
        )
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(at[k - 1] + part * (at[k] - at[k - 1]))


def bet(width: float, speed: float) -> float:
    """Seconds, blur edge time: BEW / v. width: pixels. speed: pixels a second, positive."""
    if not speed > 0:
        raise ValueError(f"speed must be positive, not {speed:g} pixels a second")
    return width / speed


def ebet(blur_edge_time: float) -> float:
    """Seconds, extended blur edge time: BET / 0.8, the full width of a straight profile."""
    return blur_edge_time / STEP_SHARE


def mprt(blur_edge_times: Sequence[float]) -> float:
    """Seconds, moving picture response time: the mean of BET (10 to 90 %) over transitions between
    greys. An ideal hold of T has 0.8 T."""
    if not len(blur_edge_times):
        raise ValueError("MPRT must be of at least one transition, not of none")
    return float(np.mean(blur_edge_times))


def mprt_full_width(blur_edge_times: Sequence[float]) -> float:
    """Seconds, MPRT as TestUFO tells it: of the full width, so that an ideal hold of T has T."""
    return ebet(mprt(blur_edge_times))


def cmr_like(extended: float) -> float:
    """Clear over blurred pixels, %: an edge that crosses n pixels in 1/60 s and is blurred over m
    of them has 100 n / m. extended: EBET, seconds, positive. Not VESA's ClearMR (see above)."""
    if not extended > 0:
        raise ValueError(f"EBET must be positive, not {extended:g} s")
    return 100 * CMR_FRAME / extended
