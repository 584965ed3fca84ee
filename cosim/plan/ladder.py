"""The ladder of `viform accuracy`: error against run time over a range of tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, TypeVar

import numpy as np

__all__ = ["LADDER", "Row", "distinct_plans", "fit_order", "fit_rows"]

LADDER: Final = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
"""Tolerances that are tried."""
_CLEAR: Final = 3.0
"""Ratio to the error at tolerance 0 above which an error is the tolerance's."""

P = TypeVar("P")


@dataclass(frozen=True)
class Row:
    """One tier at one tolerance.

    Attributes:
        tier: "reference", "exact" or "fast".
        tolerance: asked for; None for the reference, which has none.
        error, ci: of the worst patch, with its 99.9 % interval.
        run_time_s: for the whole run, from ns_per_pixel_cycle.
        effects: kept somewhere.
        left_out: left out somewhere.
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
        return asdict(self)


def distinct_plans(
    plan: Callable[[float], P], key: Callable[[P], object], tolerances: Sequence[float] = LADDER
) -> list[tuple[list[float], P]]:
    """Plans of a ladder of tolerances, the tightest first, each with the tolerances that give it.

    Args:
        plan: makes the plan of a tolerance.
        key: what two plans have in common that are the same.
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
        points: (tolerance, error); those count that are positive and lie well above `floor`.

    Returns None for fewer than three different tolerances.
    """
    clear = [(t, e) for t, e in points if t > 0 and e > max(_CLEAR * floor, 0.0)]
    if len({t for t, _ in clear}) < 3:
        return None
    x, y = np.log(clear).T
    return float(np.polyfit(x, y, 1)[0])


def fit_rows(rows: Sequence[Row]) -> float | None:
    """The order over the rows that leave something to the tolerance and do not repeat another."""
    floor = min((r.error for r in rows if r.error and not r.tolerance), default=0.0)
    points = [(r.tolerance or 0.0, r.error or 0.0) for r in rows if r.same_as is None]
    return fit_order(points, floor)
