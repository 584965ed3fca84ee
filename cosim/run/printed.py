"""Comparison of numbers printed in a document with numbers computed by the simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal

Relation = Literal["=", "<", "<=", ">", ">="]
"""Relation of the computed to the printed number, as the document states it."""
By = Literal["run", "component", "formula", "constant"]
"""What computed a number: a scenario that ran, simulation code that ran, a formula, or a constant
of the program."""
_ROUNDING = 1e-9
"""Relative rounding error that is allowed at a limit."""


@dataclass(frozen=True)
class PrintedRow:
    """A number printed in a source document, with the computed one.

    Attributes:
        source: document and place.
        what: the quantity.
        printed: a number or a list; None if the document does not print it.
        relation: relation of `computed` to `printed`.
        computed: the number that the simulation computes.
        unit: unit of both.
        holds: whether the relation holds to the printed digits, or a calculation has proved an
            error of the document, which `note` states.
        note: remark for the reader.
        by: what computed the number.
    """

    source: str
    what: str
    printed: Any
    relation: Relation
    computed: Any
    unit: str
    holds: bool
    note: str
    by: By


def agreement(printed: str, computed: float) -> Literal["rounded", "cut"] | None:
    """Whether a number agrees with printed digits "rounded", "cut" (truncated), or not (None)."""
    if not math.isfinite(computed):
        return None
    text = Decimal(printed)
    exponent = text.as_tuple().exponent
    assert isinstance(exponent, int)
    step = 10.0**exponent
    apart = computed - float(text)
    slack = _ROUNDING * max(abs(computed), step)
    if abs(apart) <= step / 2 + slack:
        return "rounded"
    beyond = apart if computed > 0 else -apart
    return "cut" if -slack <= beyond < step else None


def _compare(relation: Relation, printed: float, computed: float) -> bool:
    """Whether a relation holds, up to rounding."""
    slack = _ROUNDING * max(abs(printed), abs(computed))
    return {
        "<": computed < printed,
        "<=": computed <= printed + slack,
        ">": computed > printed,
        ">=": computed >= printed - slack,
        "=": computed == printed,
    }[relation]


def number(
    source: str,
    what: str,
    printed: str,
    computed: float,
    unit: str = "1",
    *,
    by: By,
    relation: Relation = "=",
    note: str = "",
    proof: bool | None = None,
) -> PrintedRow:
    """A row of one number.

    Args:
        source: document and place.
        what: the quantity.
        printed: the digits as printed, such as "4.09e10".
        computed: the number that the simulation computes.
        unit: unit of both.
        by: what computed the number.
        relation: relation of `computed` to `printed`.
        note: remark for the reader.
        proof: proof, for an error of the document, that a calculation shows it; None otherwise. The
            row then holds if the numbers differ and the proof is true.
    """
    value = float(Decimal(printed))
    if relation == "=":
        how = agreement(printed, computed)
        if how == "cut":
            note = "; ".join(filter(None, ("printed digits are cut off, not rounded", note)))
        good = how is not None
    else:
        good = _compare(relation, value, computed)
    if proof is not None:
        good = proof and not good
    printed_value = int(value) if value.is_integer() and abs(value) < 1e15 else value
    finite = computed if math.isfinite(computed) else None
    return PrintedRow(source, what, printed_value, relation, finite, unit, good, note, by)


def listed(
    source: str, what: str, printed: Sequence[Any], computed: Sequence[Any], unit: str = "1",
    *, by: By, note: str = "",
) -> PrintedRow:  # fmt: skip
    """A row of several numbers, all of which must be equal."""
    one, other = list(printed), list(computed)
    return PrintedRow(source, what, one, "=", other, unit, one == other, note, by)


def unprinted(
    source: str, what: str, computed: Any, unit: str = "1", *, by: By, holds: bool, note: str
) -> PrintedRow:
    """A row of a number that follows from the document and is not printed there, or is lost.

    holds: result of a second calculation, which `note` describes.
    """
    return PrintedRow(source, what, None, "=", computed, unit, holds, note, by)


def turning_point(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The positive argument from which on a condition holds, by bisection of its logarithm to 1e-7.
    Raises ValueError if it holds at `low` or does not hold at `high`."""
    if holds(low) or not holds(high):
        raise ValueError(f"the turning point must lie between {low:g} and {high:g}")
    while high / low > 1 + 1e-7:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return math.sqrt(low * high)
