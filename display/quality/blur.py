"""Blur of a moving edge: widths of its profile on the retina, and the corresponding times.

A camera records an edge, a display shows it, and the eye follows it; the retina image has a step
between two levels. BEW is the distance from 10 to 90 % of this step. BET = BEW / v is independent
of the speed v. EBET = BET / 0.8 is the full width of a linear profile. An ideal hold of T gives a
linear profile of the width v T, so BET = 0.8 T and EBET = T.

MPRT has two conventions. In the measurement standards it is the mean of BET over transitions
between greys; in "1 ms persistence is 1 pixel per 1000 pixels/s" (TestUFO) it is the full width,
the mean of EBET. The exact formula of VESA's ClearMR is not public; this file has a similar ratio,
called CMR-like.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
LOW: Final = 0.1
HIGH: Final = 0.9
STEP_SHARE: Final = HIGH - LOW
"""Share of the step between the two levels of BEW."""
CMR_FRAME: Final = 1 / 60
"""Hold time whose CMR-like is 100 %, s."""


def blur_edge_width(
    x: npt.ArrayLike, profile: npt.ArrayLike, low: float | None = None, high: float | None = None
) -> float:
    """BEW: the distance from 10 to 90 % of the step in an edge profile, in the unit of x.

    The profile is replaced by the nearest monotone profile in least squares (isotonic regression),
    which does not change a monotone profile. Crossings are interpolated linearly between samples.

    Args:
        x: positions, (n,), increasing.
        profile: levels, (n,); the edge may rise or fall.
        low, high: settled levels at the first and the last x; by default the means of the first and
            the last eighth, which must be outside the blur.

    Raises:
        ValueError: the profile has no step, or does not reach 10 and 90 % of it.
    """
    from scipy.optimize import isotonic_regression  # the import takes 0.5 s

    at, level = np.asarray(x, np.float64), np.asarray(profile, np.float64)
    if at.ndim != 1 or at.shape != level.shape or len(at) < 4 or (np.diff(at) <= 0).any():
        raise ValueError(
            f"a profile must be 4 or more levels at increasing positions, not {level.shape} at "
            f"{at.shape}"
        )
    end = max(len(at) // 8, 1)
    first = float(level[:end].mean()) if low is None else low
    last = float(level[-end:].mean()) if high is None else high
    if not (np.isfinite(level).all() and np.isfinite([first, last]).all() and first != last):
        raise ValueError(f"a profile must be finite and have a step, not {first:g} to {last:g}")
    share = np.asarray(isotonic_regression((level - first) / (last - first)).x)
    return _crossing(at, share, HIGH) - _crossing(at, share, LOW)


def _crossing(at: Values, share: Values, level: float) -> float:
    """The position at which a monotone profile reaches a level. Raises ValueError."""
    k = int(np.searchsorted(share, level, side="left"))
    if k == 0 or k == len(share):
        raise ValueError(
            f"a profile must run through {level:.0%} of its step, not {share[0]:.0%} to "
            f"{share[-1]:.0%}"
        )
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(at[k - 1] + part * (at[k] - at[k - 1]))


def bet(width: float, speed: float) -> float:
    """Blur edge time BEW / v, s, from the width, pixels, and the speed, pixels/s. Raises ValueError
    unless the speed is positive."""
    if not speed > 0:
        raise ValueError(f"speed must be positive, not {speed:g} pixels a second")
    return width / speed


def ebet(blur_edge_time: float) -> float:
    """Extended blur edge time BET / 0.8, s: the full width of a linear profile."""
    return blur_edge_time / STEP_SHARE


def mprt(blur_edge_times: Sequence[float]) -> float:
    """Moving picture response time, s: the mean of BET (10 to 90 %) over transitions between greys.
    An ideal hold of T has 0.8 T. Raises ValueError without a transition."""
    if not len(blur_edge_times):
        raise ValueError("MPRT must be of at least one transition, not of none")
    return float(np.mean(blur_edge_times))


def cmr_like(extended: float) -> float:
    """Ratio of clear to blurred pixels, %: an edge that crosses n pixels in 1/60 s with a blur of m
    pixels has 100 n / m. It is not VESA's ClearMR. `extended`: EBET, s; raises ValueError unless it
    is positive."""
    if not extended > 0:
        raise ValueError(f"EBET must be positive, not {extended:g} s")
    return 100 * CMR_FRAME / extended
