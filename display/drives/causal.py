"""Causal: as hold, but darker when the current interval exceeds the last one. x = 1 / max(tau,
age).

Only past spikes enter; without another spike, the light decays as 1 / age.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from display.drives.drive import Drive
from display.drives.intervals import interval_fluctuation, interval_variation

__all__ = ["CAUSAL"]


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return 1.0 / np.maximum(tau, age)


CAUSAL = Drive("causal", 2, _level, "min(held, inverse)", interval_fluctuation, interval_variation)
