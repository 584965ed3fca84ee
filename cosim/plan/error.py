"""The error of a simulation: as a plan promises it, as a check measures it, and what follows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import number
from cosim.plan.effects import Kind
from cosim.plan.planner import ESTIMATE_WEIGHT

CONFIDENCE: Final = 0.999
"""Confidence level of the limits of every error, and of the intervals that go into one."""
DEVIATIONS: Final = 3.2905
"""Standard deviations of half an interval of CONFIDENCE, of a normal variate."""
FINEST: Final = 1e-3
"""Largest error that is accepted at tolerance 0, which is the default tolerance of a scenario."""
ARITHMETIC: Final = "32-bit arithmetic"
"""Name of the fast tier's arithmetic as an effect; the exact tier reinstates it."""
EVERYTHING: Final = "every effect"
"""Name that stands for all effects where they are reinstated together."""
Of = Literal["run", "law"]
"""What an error is of: "run", the same random words as in full physics, compared spike by spike;
"law", other draws of the same noise, of which only the distributions can be compared."""
OTHER_NOISE: Final = (
    "other noise of the same law: single spikes, or reports, differ from those of full physics, "
    "their distributions do not; with latched pixels --draws each keeps its draws"
)
"""What a user must know of an error in law, in one sentence."""


def deviations(among: int) -> float:
    """Number of standard deviations that none of `among` normal variates exceeds, at CONFIDENCE."""
    from scipy.special import ndtri

    return -float(ndtri((1 - CONFIDENCE) / 2 / max(among, 1)))


def accepted_error(tolerance: float) -> float:
    """The largest relative error with which a run is "ok".

    Tolerance 0 keeps every effect, but the error of the tier itself remains. A run at tolerance 0
    must not be called "ok" with an error that is refused at a looser tolerance, so it has the
    limit of the default tolerance.
    """
    return tolerance if tolerance > 0 else FINEST


@dataclass(frozen=True)
class Measured:
    """An error that was measured, in the unit of its part of the system.

    Attributes:
        value: the error.
        low, high: its limits at CONFIDENCE.
        tile: number of the tile that it was measured on; None for no single one.
    """

    value: float
    low: float
    high: float
    tile: int | None = None

    @classmethod
    def worst(cls, found: Iterable[Measured]) -> Measured | None:
        """The largest of some errors, with the largest of their upper limits; None for none."""
        every = list(found)
        largest = max(every, key=lambda error: error.value, default=None)
        return largest and replace(largest, high=max(error.high for error in every))

    @classmethod
    def rms(cls, squares: npt.NDArray[np.float64], scale: float, tile: int | None) -> Measured:
        """The root mean square of differences over `scale`. squares: (n,) squared differences,
        whose chance gives the limits."""
        mean = float(squares.mean())
        spread = DEVIATIONS * float(squares.std()) / math.sqrt(squares.size)
        low, high = (math.sqrt(max(mean + sign * spread, 0.0)) / scale for sign in (-1, 1))
        return cls(math.sqrt(mean) / scale, low, high, tile)

    def at_least(self, value: float, high: float | None = None) -> Measured:
        """The error where another one may be larger. high: upper limit of that, `value` by
        default."""
        most = max(self.high, value if high is None else high)
        return replace(self, value=max(self.value, value), low=max(self.low, value), high=most)

    def in_law(self, apart: float, least: float = 0.0, most: float | None = None) -> Measured:
        """The error in law of a simulation that was measured with the draws of full physics.

        Args:
            apart: estimate of the distance of its own draws from these in law; 0 for none, which
                leaves the error as it is.
            least: error that a comparison of the distributions has proven.
            most: upper limit of the distance; None for that of an estimate.
        """
        if apart == 0:
            return self
        limit = ESTIMATE_WEIGHT * apart if most is None else most
        value, high = self.value + apart, self.high + limit
        return replace(
            self, value=max(value, least), low=min(self.low, least), high=max(high, least)
        )


@dataclass(frozen=True)
class LawFigure:
    """The change of one figure of a distribution.

    Attributes:
        value: the change.
        ci: its limits (low, high), at CONFIDENCE where it was measured; where it was computed,
            the least and the largest of all tiles.
    """

    value: float
    ci: tuple[float, float]

    def within(self, high: float, low: float = 0.0) -> LawFigure:
        """The figure with limits that include another change."""
        return replace(self, ci=(min(self.ci[0], low), max(self.ci[1], high)))


@dataclass(frozen=True)
class Law:
    """Error in law: what distinguishes the distribution of spikes from that of full physics.

    Attributes:
        mean: Change of the mean rate, relative to it.
        variance: Change of the variance of a rate, relative to it.
        interval_tv: Total variation distance of the distributions of latched intervals, 0 to 1.
        correlation: Change of the correlation of two pixels, or of successive draws of one.
    """

    mean: LawFigure
    variance: LawFigure
    interval_tv: LawFigure
    correlation: LawFigure

    def document(self) -> dict[str, dict[str, Any]]:
        """The law as a JSON object."""
        return {
            name: {"value": figure.value, "ci": list(figure.ci)}
            for name, figure in vars(self).items()
        }

    @classmethod
    def of(cls, document: dict[str, Any]) -> Law:
        """The law of a `document`."""
        return cls(**{
            name: LawFigure(figure["value"], tuple(figure["ci"]))
            for name, figure in document.items()
        })  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """What a plan promises of the error of a simulation against full physics, and what a check has
    measured of it.

    Attributes:
        of: "run" where the spikes are those of full physics up to the error, "law" where they have
            other noise of the same law.
        law: Error in law; None where `of` is "run". Computed, or measured by a check.
        bound: Limit of the relative error of the rates of a tile, in the worst tile.
        kind: "proof", or "estimate".
        left_out: Limit for each effect that some tile leaves out, by name.
        kept: Effects that some tile keeps.
        tolerance: Tolerance of the plan.
        measured: The error on patches, with its 99.9 % limits, of which the upper one holds for all
            tiles; None without a check.
    """

    bound: float
    kind: Kind
    left_out: dict[str, float]
    kept: tuple[str, ...]
    tolerance: float
    measured: Measured | None = None
    of: Of = "run"
    law: Law | None = None


@dataclass(frozen=True)
class Finding:
    """A bound of the plan that a measurement exceeds. Its effect must be kept.

    Attributes:
        effect: name of the effect to reinstate.
        message: text for the user, one line.
        promised: the bound, None if unknown.
        measured: upper limit of the measurement, None if unknown.
        tile: number of the tile, None if the finding concerns the whole plane.
    """

    effect: str
    message: str
    promised: float | None = None
    measured: float | None = None
    tile: int | None = None


class BrokenPromise(Exception):
    """Raised by a running chain as soon as a bound of its plan is exceeded."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        super().__init__(", ".join(finding.effect for finding in findings))
        self.findings = list(findings)


def required(effects: Sequence[str]) -> tuple[list[str], Literal["exact"] | None]:
    """What a plan must keep after a check has reinstated some effects, and the tier that it must
    have; None for any."""
    forced = [name for name in effects if name != ARITHMETIC]
    return forced, "exact" if len(forced) < len(effects) else None


def reinstated(effect: str, promised: float, measured: float, tile: int | None = None) -> Finding:
    """The finding of an exceeded bound. If `tile` is None, the total error exceeds the tolerance
    `promised`.

    Args:
        effect: name of the effect, ARITHMETIC, or EVERYTHING.
        promised: the bound, or the tolerance.
        measured: upper limit of the measurement.
        tile: number of the tile.
    """
    remedy = "the exact tier" if effect == ARITHMETIC else f"{effect} kept"
    message = (
        f"the total error is up to {number(measured, 2)} where the tolerance is "
        f"{number(promised, 2)}: the run is repeated with {remedy}"
        if tile is None
        else f"the run is repeated with {remedy}: its absence changes up to "
        f"{number(measured, 2)} on tile {tile}, where the bound is {number(promised, 2)}"
    )
    return Finding(effect, message, promised, measured, tile)


def beyond(error: Measured, tolerance: float) -> str:
    """The note on an error that is above the tolerance although every effect is kept."""
    accepted = accepted_error(tolerance)
    limit = "" if tolerance > 0 else f" (at most {number(accepted)} is accepted)"
    return (
        f"the error is {number(error.value, 2)} (up to {number(error.high, 2)}) where the "
        f"tolerance is {number(tolerance)}{limit}, with every effect kept: it is the limit of the "
        "exact tier"
    )
