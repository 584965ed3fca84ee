"""What a plan has cost: patches of the run's own exposures, converted again and again with
everything and as planned, with the same random numbers.

Of every pixel the mean and the temporal variance over the repeats are known in both ways. The error
of a patch is the larger of two: the RMS over its pixels of the mean's change, over the patch's mean
(at least one DN), and the change of its temporal noise, over that noise (at least what one DN's
rounding makes). The repeats' own noise in the mean's change is taken off: E[(mean of d)^2] is the
squared shift plus var(d)/R. Limits hold at 99.9 % for all patches together, a pixel's square being
taken as one of many alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.plan.paired import CONFIDENCE
from sensor.imagers import Exposed, PixelModel

__all__ = [
    "ROUNDING", "STRIP", "Compared", "Patches", "PlanPatches", "compared", "cut_rows", "strips",
]  # fmt: skip

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
class Compared:
    """mean, noise: relative change of a patch's mean and of its temporal noise, with the low and
    high limit of the larger."""

    mean: float
    noise: float
    low: float
    high: float

    @property
    def value(self) -> float:
        return max(self.mean, self.noise)


def compared(planned: Values, full: Values, many: int) -> Compared:
    """planned, full: (repeats, pixels) DN of one patch, paired. many: of patches in all."""
    from scipy.special import ndtri

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
    return Compared(mean, change, max(mean_low, low), max(mean_high, high))


def strips(rows: Exposed) -> list[slice]:
    """Strips of rows that stand for a frame: near its top, in its middle, near its bottom."""
    # Of rows that are exposed together only a window may be read.
    window = getattr(rows, "read", None) or (0, rows.lux_seconds.shape[0])
    begin, end = window[0], sum(window)
    spare = max(end - begin - STRIP, 0)
    starts = sorted({begin + int(spare * part) for part in (0.12, 0.5, 0.88)})
    return [slice(first, min(first + STRIP, end)) for first in starts]


def cut_rows(rows: Exposed, at: slice) -> Exposed:
    """These rows alone."""
    every: dict[str, Any] = {"read": None} if hasattr(rows, "read") else {}
    return replace(
        rows, lux_seconds=rows.lux_seconds[at], seconds=rows.seconds[at],
        waiting=rows.waiting[at], first=rows.first + at.start, **every,
    )  # fmt: skip


class Patches:
    """Watches a run's exposures and compares chosen ones.

    ways: sets of effects that are kept, by name, each held against `full`, all of them. frames:
    numbers of the frames that are looked at.
    """

    def __init__(
        self, full: frozenset[str], ways: Mapping[str, frozenset[str]], seed: int,
        frames: Sequence[int],
    ) -> None:  # fmt: skip
        self._full, self._seed, self._frames = full, seed, frozenset(frames)
        self._ways = dict(ways)
        self._pairs: dict[str, list[tuple[Values, Values]]] = {name: [] for name in ways}
        self.seen = 0
        """Patches."""

    def __call__(self, rows: Exposed, pixels: PixelModel) -> None:
        """Looks at rows that have just been converted, if their frame is one of the chosen."""
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
        self.seen += len(full)
        for name, kept in self._ways.items():
            self._pairs[name] += zip(repeats(kept), full, strict=True)

    def of(self, name: str) -> Compared | None:
        """The worst patch of one way; None where nothing was looked at. Its upper limit holds for
        all of them."""
        pairs = self._pairs.get(name, [])
        found = [compared(planned, full, len(pairs)) for planned, full in pairs]
        if not found:
            return None
        worst = max(found, key=lambda c: c.value)
        return replace(worst, high=max(c.high for c in found))


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

    def planned(self) -> Compared | None:
        """Of the plan; None where nothing was looked at."""
        return self.of(_PLAN) if self._out else Compared(0.0, 0.0, 0.0, 0.0)

    def measured(self, effect: str) -> Compared | None:
        """Of leaving out one effect alone."""
        return self.of(effect if len(self._out) > 1 else _PLAN)
