"""What a case of the stability suite is: a check that takes the method under test.

The check computes one value that must not exceed the case's limit. It is given the method that
ships by `viform stability`, and the naive method that the case guards against by the tests, which
must then fail. References are computed inside the check, by other means than the method.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from cosim.compute.opencl import Device

__all__ = ["Case", "Row"]


@dataclass(frozen=True)
class Row:
    """A case's outcome. value: null where it is not finite. seconds: that it took."""

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
        number: in the table of docs/stability.md.
        name: short.
        what: the property that must hold, in words.
        reference: what the method is compared with.
        guards: the naive method that fails.
        unit, limit: of the check's value, which must not exceed the limit.
        check: computes the value of a method.
        shipped: makes the method that ships for a device (None for numba).
        quick: arguments of the check for a smaller instance of the same case.
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
        """The pass rule; no number at all (NaN) does not pass."""
        return value <= self.limit

    def measure(self, device: Device | None, quick: bool = False) -> Row:
        """Runs the check on the method that ships."""
        begin = time.perf_counter()
        value = float(self.check(self.shipped(device), **(self.quick if quick else {})))
        return Row(
            self.number, self.name, self.holds(value), value if math.isfinite(value) else None,
            self.limit, self.unit, self.what, self.reference, time.perf_counter() - begin,
        )  # fmt: skip
