"""The error of a plan: patches of a run's exposures are converted repeatedly, with every effect and
as planned, with the same random numbers.

The repeats give the mean and the temporal variance of every pixel in both ways. The error of a
patch is the larger of two: the RMS over its pixels of the mean's change, relative to the patch's
mean (at least one DN), and the change of its temporal noise, relative to that noise (at least the
noise of rounding to one DN). The noise of R repeats is subtracted from the mean's change d:
E[(mean of d)^2] is the squared shift plus var(d)/R. Limits hold at 99.9 % for all patches together;
squares of pixels are taken as samples of one distribution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from cosim.plan.paired import CONFIDENCE
from sensor.imagers import Exposed, PixelModel

__all__ = [
    "STRIP", "PairedError", "Patches", "PlanPatches", "cut_rows", "paired_error", "strips",
    "watched_frames",
]  # fmt: skip

WATCHED: Final = 4
"""Frames, evenly spaced, whose exposures the plan is checked on."""

REPEATS: Final = (32, 256)
"""Conversions of each patch in each way, least and most: `VALUES` of a strip between."""
VALUES: Final = 1 << 16
STRIP: Final = 8
"""Rows of a patch."""
ACROSS: Final = 4
"""Patches side by side in a strip, at most: none of fewer than `LEAST` pixels."""
LEAST: Final = 512
FRESH: Final = 1 << 24
"""Frame numbers of the repeats begin here, beyond any that a run reaches."""
ROUNDING: Final = 1 / np.sqrt(12.0)
"""Standard deviation of rounding to whole DN."""
_PLAN: Final = "the plan"
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PairedError:
    """The error of a patch.

    Attributes:
        mean, noise: relative change of its mean and of its temporal noise.
        low, high: limits of the larger of the two.
    """

    mean: float
    noise: float
    low: float
    high: float

    @property
    def value(self) -> float:
        return max(self.mean, self.noise)


def paired_error(planned: Values, full: Values, many: int) -> PairedError:
    """The error of one patch.

    Args:
        planned, full: (repeats, pixels) DN, as planned and with every effect.
        many: number of patches for which the limits hold together.
    """
    repeats, pixels = full.shape
    wide = -float(ndtri((1 - CONFIDENCE) / 4 / max(many, 1)))
    step = planned - full
    square = step.mean(axis=0) ** 2 - step.var(axis=0, ddof=1) / repeats
    base = max(float(full.mean()), 1.0)
    shift, doubt = float(square.mean()), wide * float(square.std()) / np.sqrt(pixels)
    mean, mean_low, mean_high = (
        float(np.sqrt(max(v, 0.0))) / base for v in (shift, shift - doubt, shift + doubt)
    )
    gain = planned.var(axis=0, ddof=1) - full.var(axis=0, ddof=1)
    sigma = [float(np.sqrt(x.var(axis=0, ddof=1).mean())) for x in (planned, full)]
    under = max(sum(sigma), 1e-300) * max(sigma[1], ROUNDING)
    change = abs(float(gain.mean())) / under
    doubt = wide * float(gain.std()) / np.sqrt(pixels) / under
    low, high = max(change - doubt, 0.0), change + doubt
    return PairedError(mean, change, max(mean_low, low), max(mean_high, high))


def watched_frames(frames: int) -> list[int]:
    """Numbers of the frames to check, evenly spaced within a run of so many."""
    return sorted({int((n + 0.5) * frames / WATCHED) for n in range(WATCHED)})


def strips(rows: Exposed) -> list[slice]:
    """Strips of rows that represent a frame: near its top, in its middle, near its bottom."""
    # A frame transfer exposes all rows together and may read a window of them.
    window = getattr(rows, "read", None) or (0, rows.lux_seconds.shape[0])
    begin, end = window[0], sum(window)
    spare = max(end - begin - STRIP, 0)
    starts = sorted({begin + int(spare * part) for part in (0.12, 0.5, 0.88)})
    return [slice(first, min(first + STRIP, end)) for first in starts]


def cut_rows(rows: Exposed, at: slice) -> Exposed:
    """The exposure of these rows alone."""
    every: dict[str, Any] = {"read": None} if hasattr(rows, "read") else {}
    return replace(
        rows, lux_seconds=rows.lux_seconds[at], seconds=rows.seconds[at],
        waiting=rows.waiting[at], first=rows.first + at.start, **every,
    )  # fmt: skip


class Patches:
    """Compares ways of converting chosen exposures of a run.

    Attributes:
        count: patches that have been compared.

    Args:
        full: all effects.
        ways: sets of effects that are kept, by name; each is compared with `full`.
        seed: of the temporal noise.
        frames: numbers of the frames to compare.
    """

    def __init__(
        self, full: frozenset[str], ways: Mapping[str, frozenset[str]], seed: int,
        frames: Sequence[int],
    ) -> None:  # fmt: skip
        self._full, self._seed, self._frames = full, seed, frozenset(frames)
        self._ways = dict(ways)
        self._pairs: dict[str, list[tuple[Values, Values]]] = {name: [] for name in ways}
        self.count = 0

    def __call__(self, rows: Exposed, pixels: PixelModel) -> None:
        """Compares rows that have just been converted, if their frame is one of the chosen."""
        if rows.frame not in self._frames or not self._ways:
            return
        for at in strips(rows):
            self._strip(rows, pixels, at)

    def _strip(self, rows: Exposed, pixels: PixelModel, at: slice) -> None:
        cut = cut_rows(rows, at)
        size = cut.lux_seconds.size
        many = min(max(VALUES // size, REPEATS[0]), REPEATS[1])
        across = min(max(size // LEAST, 1), ACROSS)

        def repeats(kept: frozenset[str]) -> list[Values]:
            """(repeats, pixels) of each patch of the strip."""
            made = [
                pixels.convert(
                    replace(cut, frame=FRESH + rows.frame * REPEATS[1] + n), self._seed, kept
                ).astype(np.float64)
                for n in range(many)
            ]
            parts = np.array_split(np.stack(made), across, axis=2)
            return [part.reshape(many, -1) for part in parts if part.size]

        full = repeats(self._full)
        self.count += len(full)
        for name, kept in self._ways.items():
            self._pairs[name] += zip(repeats(kept), full, strict=True)

    def of(self, name: str) -> PairedError | None:
        """The worst patch of one way, with the largest upper limit of all patches; None if there
        was none."""
        pairs = self._pairs.get(name, [])
        errors = [paired_error(planned, full, len(pairs)) for planned, full in pairs]
        if not errors:
            return None
        worst = max(errors, key=lambda error: error.value)
        return replace(worst, high=max(error.high for error in errors))


class PlanPatches(Patches):
    """Patches of a plan as a whole, and of leaving out each of its effects alone."""

    def __init__(
        self, effects: Sequence[str], out: Sequence[str], seed: int, frames: Sequence[int]
    ) -> None:
        full = frozenset(effects)
        ways = {_PLAN: full - set(out)} if out else {}
        if len(out) > 1:
            ways |= {name: full - {name} for name in out}
        super().__init__(full, ways, seed, frames)
        self._out = list(out)

    def planned(self) -> PairedError | None:
        """Of the plan; None if no frame was compared."""
        return self.of(_PLAN) if self._out else PairedError(0.0, 0.0, 0.0, 0.0)

    def measured(self, effect: str) -> PairedError | None:
        """Of leaving out one effect alone."""
        return self.of(effect if len(self._out) > 1 else _PLAN)
