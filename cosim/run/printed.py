"""A number that a document prints, beside the one that the simulation's own code gives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal

__all__ = ["Relation", "Row", "agreement", "listed", "number", "unprinted"]

Relation = Literal["=", "<", "<=", ">", ">="]
"""What the document says of the number: that it is, is below, at most, above, at least."""
_ROUNDING = 1e-9
"""Relative error that floats may have where a limit is met exactly."""


@dataclass(frozen=True)
class Row:
    """A number that a source document prints, beside the computed one.

    Attributes:
        source: document and place.
        what: the quantity.
        printed: a number or a list; None where the document leaves the number to the reader.
        relation: of `computed` to `printed`.
        computed: the number that the simulation gives.
        unit: of both.
        holds: whether the relation holds to the printed digits, or `note` states the document's
            error, which a calculation has proved.
        note: for the reader.
    """

    source: str
    what: str
    printed: Any
    relation: Relation
    computed: Any
    unit: str
    holds: bool
    note: str


def agreement(printed: str, computed: float) -> Literal["rounded", "cut"] | None:
    """How a number gives the printed digits: rounded to them, cut off at them, or not at all."""
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
    relation: Relation = "=",
    note: str = "",
    proof: bool | None = None,
) -> Row:
    """A row of one number. printed: its digits as they stand, "4.09e10". proof: whether a
    calculation shows that the document errs here, where it does: then the row holds although the
    numbers differ, and not if they agree."""
    given = float(Decimal(printed))
    if relation == "=":
        how = agreement(printed, computed)
        if how == "cut":
            note = "; ".join(filter(None, ("printed digits are cut off, not rounded", note)))
        good = how is not None
    else:
        good = _compare(relation, given, computed)
    if proof is not None:
        good = proof and not good
    shown = int(given) if given.is_integer() and abs(given) < 1e15 else given
    finite = computed if math.isfinite(computed) else None
    return Row(source, what, shown, relation, finite, unit, good, note)


def listed(
    source: str, what: str, printed: Sequence[Any], computed: Sequence[Any], unit: str = "1",
    note: str = "",
) -> Row:  # fmt: skip
    """A row of several numbers, all of which must be the same."""
    one, other = list(printed), list(computed)
    return Row(source, what, one, "=", other, unit, one == other, note)


def unprinted(
    source: str, what: str, computed: Any, unit: str = "1", *, holds: bool, note: str
) -> Row:
    """A row of what follows from the document and is not printed there, or is lost. holds: what a
    second calculation says of it, as `note` tells."""
    return Row(source, what, None, "=", computed, unit, holds, note)
