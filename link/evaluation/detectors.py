"""Detectors side by side on the sensor's own pixels, and what a count of spikes would do."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from link.detect.comparison import comparison
from link.theory import pixel_errors

__all__ = ["compare_detectors"]

Q, ON, OFF = 100.0, 1.5, 0.1
"""Electrons of the threshold; thresholds a tick, background included."""
SIDE, SYMBOLS = 128, 96
"""Panel pixels, and symbols, 48 of which train: some 1e5 bits of a cell of 2 x 2."""
COUNTED: Final = {
    "threshold, one pixel, one tick": (1, 1),
    "joint, 2 x 2 pixels": (1, 4),
    "joint, two ticks": (2, 1),
}
"""(ticks, pixels) whose count of spikes has a closed form, by what it is called there."""


def compare_detectors(seed: int) -> list[dict[str, Any]]:
    """Rows of `link.detect.comparison` for a residual reset and a tenth of Q of background, with
    the error rate of deciding by the count of spikes as theory; None where that is no theory."""
    rows = comparison(
        threshold=Q, background=OFF, on_level=ON - OFF, size=SIDE, symbols=SYMBOLS, seed=seed
    )  # fmt: skip
    out = []
    for row in rows:
        looks = COUNTED.get(row.what)
        theory = None
        if looks is not None:
            theory = sum(pixel_errors(Q, ON * Q, OFF * Q, "residual", *looks, longest=None)) / 2
        out.append({**asdict(row), "theory": theory})
    return out
