"""What the check of a run found, as the run and its documents need it."""

from __future__ import annotations

import math
from typing import Any

from scenarios.assemble.planning import RunPlan
from scenarios.assemble.verifier import ARITHMETIC, Finding, Verifier

__all__ = ["full_physics_s", "left_out", "shortfall", "too_far"]


def shortfall(plan: RunPlan, verifier: Verifier | None) -> list[Finding]:
    """What to put back because the whole error is larger than asked for: the effect that changed
    most, or the fast tier itself. Promised is the tolerance, measured the error's upper limit."""
    if verifier is None:
        return []
    error, tolerance = verifier.error(), plan.plan.tolerance
    if tolerance == 0 or error.high <= tolerance:
        return []
    measured = verifier.measured()
    # What no patch left out has not been measured: it is put back all the same.
    names = [max(measured, key=lambda n: measured[n])] if measured else list(plan.plan.left_out)
    if not names and plan.tier == "fast":
        names = [ARITHMETIC]
    return [Finding(name, tolerance, error.high, None) for name in names]


def full_physics_s(verifier: Verifier | None, pixels: int, cycles: int) -> float | None:
    """Seconds that the reference would take for so many pixels of the run, from what it took for
    the patches."""
    if verifier is None:
        return None
    seconds = verifier.ns("reference") * 1e-9 * pixels * cycles
    return seconds if math.isfinite(seconds) else None


def left_out(plan: RunPlan, verifier: Verifier | None) -> list[dict[str, Any]]:
    """What some tile left out: its bound there, and what the check measured on the patches."""
    if verifier is None:
        return []
    measured = verifier.measured()
    return [
        {
            "effect": row.effect, "bound": row.bound, "kind": row.kind,
            "measured": measured.get(row.effect),
        }
        for row in plan.plan.rows if row.effect in plan.plan.left_out
    ]  # fmt: skip


def too_far(plan: RunPlan, verifier: Verifier | None) -> list[str]:
    """A note where the tolerance was not reached with everything kept."""
    if verifier is None:
        return []
    error, tolerance = verifier.error(), plan.plan.tolerance
    if tolerance == 0 or error.high <= tolerance:
        return []
    return [
        f"the error is {error.value:.2g} (up to {error.high:.2g}) where {tolerance:g} was asked "
        "for, with every effect kept: the exact tier comes no nearer"
    ]
