"""Causal: as hold, but darker when the current interval exceeds the last one.
x = p / max(tau, age), at most 1, where p is a packet and the repayment of the balance
(`intervals.py`).

Only past spikes enter; without another spike, the light decays as 1 / age.
"""

from __future__ import annotations

from typing import Any

import numpy as np

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
    return packets_at(np.maximum(tau, age), memory)


CAUSAL = Drive(
    "causal", 2, _level, GLSL_LEVEL.format(rate="min(held, inverse)"), interval_fluctuation,
    interval_variation, repaid, GLSL_REPAID,
)  # fmt: skip
