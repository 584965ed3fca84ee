"""A case of the stability suite: a check that takes the method under test.

The check computes one value, which must not exceed the limit of the case. `viform stability` passes
the production method to it. The tests also pass the naive method that the case guards against, for
which the check must fail. The check computes its reference by other means than the method.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from cosim.compute.opencl import Device


@dataclass(frozen=True)
class CaseRow:
    """Outcome of a case.

    Attributes:
        case, name: number and name of the case.
        holds: whether the value is within the limit.
        value: value of the check, None if it is not finite.
        limit, unit: limit of the value, and the unit of both.
        what, reference: the property, and what the method is compared with.
        seconds: duration of the check.
    """

    case: int
    name: str
    holds: bool
    value: float | None
    limit: float | None
    unit: str
    what: str
    reference: str
    seconds: float


@dataclass(frozen=True)
class Case:
    """One case of the stability suite.

    Attributes:
        number: number in the table of docs/stability.md.
        name: short name.
        what: the property that must hold, in words.
        reference: what the method is compared with.
        guards: the naive method that fails.
        unit, limit: unit and upper limit of the value.
        check: computes the value of a method.
        shipped: returns the production method for a device (None for numba).
        quick: arguments of the check for a smaller instance of the case.
    """

    number: int
    name: str
    what: str
    reference: str
    guards: str
    unit: str
    limit: float
    check: Callable[..., float]
    shipped: Callable[[Device | None], Any]
    quick: Mapping[str, Any] = field(default_factory=dict)

    def holds(self, value: float) -> bool:
        """Whether a value passes; NaN does not."""
        return value <= self.limit

    def measure(self, device: Device | None, quick: bool = False) -> CaseRow:
        """Runs the check on the production method. quick: whether to run the smaller instance."""
        begin = time.perf_counter()
        value = float(self.check(self.shipped(device), **(self.quick if quick else {})))
        return CaseRow(
            self.number, self.name, self.holds(value), value if math.isfinite(value) else None,
            self.limit, self.unit, self.what, self.reference, time.perf_counter() - begin,
        )  # fmt: skip
