"""The ladder of `viform accuracy`: error against run time over a range of tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, TypeVar

import numpy as np

LADDER: Final = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
"""Tolerances of the ladder."""
_CLEAR: Final = 3.0
"""Least ratio to the error at tolerance 0 at which an error is attributed to the tolerance."""

P = TypeVar("P")


@dataclass(frozen=True)
class Row:
    """One tier at one tolerance.

    Attributes:
        tier: "reference", "exact" or "fast".
        tolerance: requested tolerance; None for the reference.
        error, ci: error of the worst patch, and its 99.9 % interval.
        run_time_s: run time of the whole run, from ns_per_pixel_cycle.
        ns_per_pixel_cycle: measured run time.
        effects: effects that some tile keeps.
        left_out: effects that some tile leaves out.
        same_as: tighter tolerance with the same plan, and so the same figures.
    """

    tier: str
    tolerance: float | None
    error: float | None
    ci: tuple[float, float] | None
    run_time_s: float | None
    ns_per_pixel_cycle: float | None
    effects: list[str]
    left_out: list[str]
    same_as: float | None = None

    def document(self) -> dict[str, Any]:
        """The row as a JSON object."""
        return asdict(self)


def distinct_plans(
    plan: Callable[[float], P], key: Callable[[P], object], tolerances: Sequence[float] = LADDER
) -> list[tuple[list[float], P]]:
    """The distinct plans of a ladder of tolerances, each with all tolerances that lead to it.

    Args:
        plan: returns the plan for a tolerance.
        key: returns a value that is equal for equal plans.
        tolerances: tolerances, the tightest first.
    """
    rungs: list[tuple[list[float], P]] = []
    for tolerance in tolerances:
        planned = plan(tolerance)
        if rungs and key(planned) == key(rungs[-1][1]):
            rungs[-1][0].append(tolerance)
        else:
            rungs.append(([tolerance], planned))
    return rungs


def fit_order(points: Sequence[tuple[float, float]], floor: float = 0.0) -> float | None:
    """Exponent e of error = C tolerance^e, by least squares in logarithms.

    Args:
        points: (tolerance, error). Only positive ones well above `floor` are used.
        floor: error at tolerance 0.

    Returns:
        The exponent, None for fewer than three different tolerances.
    """
    clear = [(t, e) for t, e in points if t > 0 and e > max(_CLEAR * floor, 0.0)]
    if len({t for t, _ in clear}) < 3:
        return None
    x, y = np.log(clear).T
    return float(np.polyfit(x, y, 1)[0])


def fit_rows(rows: Sequence[Row]) -> float | None:
    """`fit_order` over the rows that do not repeat another plan."""
    floor = min((r.error for r in rows if r.error and not r.tolerance), default=0.0)
    points = [(r.tolerance or 0.0, r.error or 0.0) for r in rows if r.same_as is None]
    return fit_order(points, floor)
