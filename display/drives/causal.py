"""Causal: as hold, and darker once the present interval is the longer one. x = 1 / max(tau, age).

Only past spikes enter; without another spike light decays as 1 / age.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from display.drives.drive import Drive
from display.drives.intervals import interval_flutter, interval_unsteadiness

__all__ = ["CAUSAL"]


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return 1.0 / np.maximum(tau, age)


CAUSAL = Drive("causal", 2, _level, "min(held, inverse)", interval_flutter, interval_unsteadiness)
