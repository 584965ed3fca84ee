"""A parameter with its interval, and whether the recordings determine it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cosim.config.amounts import amount

DEVIATIONS = 1.959964
"""Standard errors to either side that hold 95 % of a normal law."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the model.

    Attributes:
        name: key of a document.
        title: title in a table.
        value: estimate; None if there is none. The reset rule is a word.
        ci: limits at 95 %; None on a side without a limit.
        unit: unit of value and limits, "1" for none.
        known: whether the recordings determine it.
        why: how it is known, or why it cannot be.
        remedy: what would make it known; "" for a known one.
    """

    name: str
    title: str
    value: float | str | None
    ci: tuple[float | None, float | None]
    unit: str
    known: bool
    why: str
    remedy: str = ""

    def holds(self, truth: float) -> bool:
        """Whether a value lies within the limits."""
        low, high = self.ci
        return bool((low is None or low <= truth) and (high is None or truth <= high))

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "title": self.title, "value": self.value, "ci": list(self.ci), "unit": self.unit,
            "known": self.known, "why": self.why, "remedy": self.remedy or None,
        }  # fmt: skip

    @property
    def text(self) -> str:
        """Value and limits for a table; "" without either."""
        value = self.value if isinstance(self.value, str) else self._text(self.value)
        low, high = self.ci
        bare = "s" if self.unit == "s" else "1"  # prefixes of times differ
        if self.value is not None:
            limits = f"{self._text(low, bare)} to {self._text(high, bare)}"
            return value if low is high is None else f"{value}, {limits}"
        if high is None:
            return "" if low is None else f"at least {self._text(low)}"
        if not low:
            return f"at most {self._text(high)}"
        return f"{self._text(low, bare)} to {self._text(high)}"

    def _text(self, value: float | None, unit: str | None = None) -> str:
        return "?" if value is None else amount(value, unit or self.unit, 4)


def rooted(square: float, error: float) -> tuple[float, tuple[float, float]]:
    """Root of an estimated square and its limits: the roots of those of the square, 0 below 0."""
    low, high = (max(square + k * DEVIATIONS * error, 0.0) ** 0.5 for k in (-1, 1))
    return max(square, 0.0) ** 0.5, (low, high)


def proportion(count: int, total: int) -> tuple[float, tuple[float, float]]:
    """A share and its exact limits (Clopper and Pearson, Biometrika 26:404, 1934)."""
    from scipy.stats import beta

    low = float(beta.ppf(0.025, count, total - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, total - count)) if count < total else 1.0
    return count / total, (low, high)
