"""Hold: the light follows the last interval until the next spike.
x = p / tau, at most 1, where p is a packet and the repayment of the balance (`intervals.py`).
"""

from __future__ import annotations

from typing import Any

from display.drives.drive import (
    GLSL_LEVEL,
    GLSL_REPAID,
    Drive,
    interval_fluctuation,
    interval_variation,
    packets_at,
    repaid,
)


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return packets_at(tau, memory)


HOLD = Drive(
    "hold", 2, _level, GLSL_LEVEL.format(rate="held"), interval_fluctuation, interval_variation,
    repaid, GLSL_REPAID,
)  # fmt: skip
