"""What one recording of a moving or unknown scene tells: limits, and the reset rule.

The reset rule from intervals N of successive spikes, in cycles. A pixel that carries the charge
beyond its threshold (residual) fires at instants that the latch rounds, and neighbouring intervals
share a rounding: N = X + u' - u, with rounding errors u of variance 1/12. A pixel that is reset to
zero at the latch (hard) begins each interval anew: N = X + v, with errors v that no two intervals
share. In both, X holds the light and the noise.

Light that moves also makes successive intervals differ, and correlates them with either sign. So a
correlation alone does not tell the rule. As power over frequency f, in cycles an interval, N has

    S(f) = S_X(f) + (4 sin^2(pi f)) / 12                                              residual
    S(f) = S_X(f) + 1/12 at most on average over phases                               hard

and differences of order p weigh it with (4 sin^2 pi f)^p: A_p is their mean square, and

    A_p = C(2 p, p) w + C(2 p + 2, p + 1) / 12 + M_p                                  residual

for a white noise w and motion M_p >= 0. Hence two statistics, with errors from blocks of pixels,
since neighbours see the same picture move:

    floor = A_3 / (70 / 12)        not below 1 with a residual, whatever the light does; 2/7 without
    share = 12 (0.3 A_3 - A_2)     1 with a residual, 0 without one; white noise cancels

The floor proves a hard reset. It takes phases of all kinds, so the picture must have several levels
of light: intervals that are all whole are those of a residual as well. Only the shape of the power
speaks for a residual: a share of 1 and a floor near 1. Slow motion adds little to differences of
second and third order; fast motion adds much, mostly at lower frequencies, and lowers the share
below 0; a stripe that passes in 2.5 intervals raises it far above 1. Then the rule is not known.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.histograms import latched_variance
from sensor.calibrate.known import Parameter, proportion
from sensor.calibrate.trains import WINDOW, Changes, Trains

Values = npt.NDArray[np.float64]

_CLEAR: Final = 0.25
"""Largest standard error of the share that decides between 0 and 1."""
_FLOOR: Final = 70 / 12
"""A_3 that the rounding errors of a carried residual give, cycles^2."""
_BELOW: Final = 0.7
"""Floor below which there is no carried residual: phases need not be quite even over a cycle."""
_NEAR: Final = (0.9, 1.35)
"""Floors of a carried residual with little noise and motion."""
_SHARES: Final = (0.5, 1.6)
"""Shares of a carried residual. Timing noise s of the latch adds 12 s^2."""
_LEVELS: Final = 3
"""Mean intervals, in whole cycles, that a scene of several levels of light has at least ..."""
_HELD: Final = 0.05
"""... each in this share of the windows."""
_MIDDLE: Final = slice(WINDOW // 2 - 1, WINDOW // 2 + 2)
"""Cycles over whole mean intervals of windows whose mean is about half-whole."""
_OFTEN: Final = 0.1
"""Share of the windows that these are at least in light taken as constant: fewer may be moments in
which it was not."""
_GRID: Final = 128
"""Phases, and means, of a table of constant light."""
_BLOCKS: Final = 6
"""Blocks of pixels in a row, and in a column of them."""
_FEWEST: Final = 8
"""Fewest blocks whose spread is an error."""
_REMEDY: Final = "slower motion, or constant light, at 0.2 to 0.5 spikes a cycle"


def reset_rule(trains: Trains, good: npt.NDArray[np.bool_], squared: float) -> Parameter:
    """The reset rule from one recording of constant light.

    With a residual the covariance of neighbouring intervals is (q(2m) - 2 q(m)) / 2, with q of
    histograms.py, about -1/12; without one it is 0. The measured share of the expected sum is about
    1 or 0. Light that changes unnoticed raises the covariance, so a share of 0 is a hard reset only
    if the floor is low as well, for the mean interval of each pixel and for that of each window.
    `subtract` differs from `residual` only above one threshold a cycle.

    Args:
        trains: a recording in which intervals are long enough to have a rounding.
        good: (n,) bool, the pixels.
        squared: relative variance of an interval.
    """
    used = good & (trains.spikes > 3)
    _, products = trains.successive(used)
    mean, number = trains.intervals[used], trains.spikes[used] - 2
    variance = np.maximum(squared, 0.0) * mean**2
    q = [latched_variance(k * mean, k * variance) for k in range(5)]
    two, one = q[2], q[1]
    expected = number * (two - 2 * one) / 2
    share, error = _ratio(products[used], expected, _blocks(trains.shape)[used])
    rule, but = None, ""
    if error < _CLEAR and share - 2 * error > 0.5:
        rule = "residual"
    elif error < _CLEAR and share + 2 * error < 0.5:
        changes = trains.changes(used)
        # Covariances of intervals that are h apart, times the weights of third differences.
        third = 20 * one + sum(
            2 * weight * (q[h + 1] - 2 * q[h] + q[h - 1]) / 2
            for h, weight in ((1, -15), (2, 6), (3, -1))
        )
        least = changes.number[used].sum(axis=1) * third
        blocks = _blocks(trains.shape)
        floor, off = _ratio(changes.third.sum(axis=1)[used], least, blocks[used])
        middle = float(changes.number[:, _MIDDLE].sum() / max(changes.number.sum(), 1))
        if middle > _OFTEN and floor + 2 * off < _BELOW and _drawn_anew(changes, blocks):
            rule = "hard"
        else:
            but = ", but so it is in light that changes unseen, and between whole intervals"
    return _rule(
        rule, f"the covariance of successive intervals is {share:.2f} +- {2 * error:.2f} of that "
        f"by a carried residual, 0 without one{but}",
        "constant light of another level, at 0.2 to 0.6 spikes a cycle",
    )  # fmt: skip


def moving_reset_rule(trains: Trains) -> Parameter:
    """The reset rule under light that changes, or the reason why it cannot be known."""
    changes = trains.changes(np.ones(trains.spikes.size, bool))
    blocks = _blocks(trains.shape)
    number, third = changes.number.sum(axis=1), changes.third.sum(axis=1)
    floor, off = _ratio(third, number * _FLOOR, blocks)
    share, error = _ratio(12 * (0.3 * third - changes.second), number, blocks)
    if not np.isfinite(off):
        return _rule(None, "too few pixels have nine spikes at intervals of 2 to 8 cycles", _REMEDY)
    shown = (
        f"third differences of intervals have {floor:.2f} +- {2 * off:.2f} of the least power by a "
        f"carried residual, and their rise over second ones is {share:.2f} +- {2 * error:.2f} of "
        "that by one, 0 without one"
    )
    if floor + 2 * off < _BELOW:
        levels = int((changes.levels > _HELD * changes.levels.sum()).sum())
        if levels >= _LEVELS and _drawn_anew(changes, blocks):
            return _rule("hard", shown, "")
        return _rule(
            None, f"{shown}, but a residual may leave as little in light of few levels",
            f"a scene of more levels of light; {_REMEDY}",
        )  # fmt: skip
    near = floor + 2 * off > _NEAR[0] and floor + 2 * off < _NEAR[1]
    low, high = share - 2 * error, share + 2 * error
    if near and error < _CLEAR and low > _SHARES[0] and high < _SHARES[1]:
        return _rule("residual", shown, "")
    return _rule(None, f"{shown}: light that changes within a few intervals hides it", _REMEDY)


def _drawn_anew(changes: Changes, blocks: npt.NDArray[np.intp]) -> bool:
    """Whether intervals of windows whose mean is about half-whole are too uneven for a residual in
    constant light, which lets longer and shorter ones alternate. Other windows do not tell: one odd
    interval is the same by any rule. It holds for any levels of light."""
    third = changes.third[:, _MIDDLE].sum(axis=1)
    expected = changes.number[:, _MIDDLE] @ _still_thirds()[_MIDDLE]
    share, error = _ratio(third, expected, blocks)
    return share + 2 * error < _BELOW


@cache
def _still_thirds() -> Values:
    """Mean square of third differences with a residual in constant light, cycles^2, by what the
    cycles of a window leave over whole mean intervals, (WINDOW,): over all phases and means."""
    grid = (np.arange(_GRID) + 0.5) / _GRID
    phase, mean = grid[:, None, None], 1 + grid[None, :, None]
    at = np.ceil(phase + mean * np.arange(WINDOW + 1)).astype(np.int64)
    over = (at[..., -1] - at[..., 0]) % WINDOW
    power = (np.diff(at, 4, axis=-1) ** 2).mean(axis=-1)
    sums = np.bincount(over.ravel(), power.ravel(), WINDOW)
    return np.asarray(sums / np.bincount(over.ravel(), minlength=WINDOW))


def _rule(rule: str | None, why: str, remedy: str) -> Parameter:
    """The parameter; remedy: what would make an unknown rule known."""
    return Parameter(
        "reset", "reset rule", rule, (None, None), "1", rule is not None,
        f"{why}; below one threshold a cycle subtract is residual", "" if rule else remedy,
    )  # fmt: skip


def _blocks(shape: tuple[int, int]) -> npt.NDArray[np.intp]:
    """Block of each pixel, (n,)."""
    rows, columns = (np.arange(n) * _BLOCKS // n for n in shape)
    return np.asarray((rows[:, None] * _BLOCKS + columns).ravel(), np.intp)


def _ratio(got: Values, expected: Values, blocks: npt.NDArray[np.intp]) -> tuple[float, float]:
    """Sum of what pixels show over that of what is expected, (n,) each, and its standard error from
    the spread over blocks of pixels; infinite with fewer than `_FEWEST` blocks."""
    sums = [np.bincount(blocks, each, _BLOCKS**2) for each in (got, expected)]
    total = float(sums[1].sum())
    used = int((sums[1] != 0).sum())
    if used < _FEWEST or not total:
        return 0.0, float("inf")
    ratio = float(sums[0].sum()) / total
    spread = float(((sums[0] - ratio * sums[1]) ** 2).sum()) * used / (used - 1)
    return ratio, float(np.sqrt(spread)) / abs(total)


_FLATS: Final = "recordings of constant uniform light: --flat A.dat --flat B.dat"
_WHY: Final = "the light of each pixel is unknown and changes"


def moving_parameters(trains: Trains) -> list[Parameter]:
    """Parameters from one recording whose light is not constant.

    Motion only adds to the variance of sums of intervals. So the noise that the differences of
    successive sums show, less the rounding of the latch, is an upper limit of the temporal noise,
    and its inverse square a lower limit of the threshold in electrons. Let a and b be successive
    sums of k intervals with a common end: var(b - a) = 2 k sigma^2 m^2 + 1/2 (rounding errors u0 -
    2 u1 + u2 of variance 1/12 each), plus the change of the light squared.
    """
    total = trains.spikes.size
    out = []
    noise = _most_noise(trains)
    out.append(Parameter(
        "interval_noise", "temporal noise of an interval, relative", None, (0.0, noise), "1", False,
        f"{_WHY}; motion adds to the variance of intervals, so it is a limit from above",
        "one recording of constant light",
    ))  # fmt: skip
    out.append(Parameter(
        "threshold", "threshold", None, (noise**-2 if noise else None, None), "e", False,
        "1/Q is at most the noise squared", "constant light and a light meter",
    ))  # fmt: skip
    out.append(moving_reset_rule(trains))
    for name, title in (
        ("gain_spread", "spread of the pixels' response to light, in all"), ("prnu", "PRNU"),
        ("threshold_fpn", "spread of the threshold"),
    ):  # fmt: skip
        out.append(Parameter(
            name, title, None, (None, None), "1", False,
            "a pixel of higher gain and a brighter place of the scene look alike", _FLATS,
        ))  # fmt: skip
    dimmest = _dimmest(trains)
    out.append(Parameter(
        "dark_current", "dark current over the threshold", None,
        (0.0, dimmest * trains.clock.hz), "1/s", False,
        "no pixel fires less than its dark current: the mean over pixels of the rate in their "
        "longest interval is a limit from above", "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    out.append(Parameter(
        "dsnu", "DSNU, relative to the dark current", None, (None, None), "1", False, _WHY,
        "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    shortest = _shortest(trains)
    out.append(Parameter(
        "dead_time", "dead time", None,
        (0.0, None if shortest is None else shortest / trains.clock.hz), "s", False,
        "the dead time is not longer than an interval; the least mean of a pixel, with the "
        f"rounding of the latch, is {'?' if shortest is None else format(shortest, '.3g')} cycles",
        "two flats of different light: --flat A.dat --flat B.dat",
    ))  # fmt: skip
    silent, stuck = int((trains.spikes == 0).sum()), int((trains.spikes >= trains.cycles).sum())
    out.append(Parameter(
        "dead_pixels", "dead pixels, share", None, (0.0, proportion(silent, total)[1][1]), "1",
        False, f"{silent} of {total} pixels never fire; the scene may be dark there", _FLATS,
    ))  # fmt: skip
    out.append(Parameter(
        "hot_pixels", "hot pixels, share", None, (None, None), "1", False,
        "cannot be known in light: a hot pixel and a bright place look alike",
        "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    out.append(Parameter(
        "stuck_pixels", "stuck pixels, share", None, (0.0, proportion(stuck, total)[1][1]), "1",
        False, f"{stuck} of {total} pixels fire in every cycle; the scene may be bright there",
        "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    return out


def _most_noise(trains: Trains) -> float:
    """Upper limit of the relative noise of an interval: the least over k of what sums of k
    intervals show, with two standard errors."""
    limits = [1.0]
    spikes = trains.spikes[trains.spikes > 0]
    fewest = int(np.quantile(spikes, 0.1)) - 1
    for k in (1, 2, 4, 8, 16, 32):
        if fewest < 2 * k:
            break
        sums = trains.sums(k, 2, np.ones(trains.spikes.size, bool))
        used = sums.used & np.isfinite(trains.intervals)
        mean = trains.intervals[used]
        # The sample variance of two sums is half the squared difference: its rounding is 1/4.
        off, weight = sums.variance[used] - 0.25, k * mean**2
        value = float(off.sum() / weight.sum())
        error = float(np.sqrt(((off - value * weight) ** 2).sum())) / float(weight.sum())
        limits.append(float(np.sqrt(max(value + 2 * error, 1e-12))))
    return min(limits)


def _shortest(trains: Trains) -> float | None:
    """Least mean interval of a pixel, cycles, with the rounding of its first and last spike by up
    to one cycle; None without two spikes in a pixel."""
    used = trains.spikes > 1
    if not used.any():
        return None
    return float((trains.intervals[used] + 1 / (trains.spikes[used] - 1)).min())


def _dimmest(trains: Trains) -> float:
    """Mean over pixels of the least rate, spikes a cycle: the inverse of the longest interval, or
    of the recording for a pixel with fewer than two spikes."""
    total = 0.0
    for words in np.array_split(trains.words, max(len(trains.words) // 4096, 1)):
        bits = np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=1, bitorder="little")[
            :, : trains.cycles
        ]
        for row in bits:
            at = np.flatnonzero(row)
            total += 1 / (np.diff(at).max() if len(at) > 1 else trains.cycles)
    return total / len(trains.words)
