"""Error rates of all detectors with the sensor's own pixels, and the theory of a spike count."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from link.detect.comparison import comparison
from link.theory import pixel_errors

Q, ON, OFF = 100.0, 1.5, 0.1
"""Q: electrons of the threshold. ON, OFF: charge of a tick, thresholds, background included."""
SIDE, SYMBOLS = 128, 96
"""SIDE: panel pixels. SYMBOLS: 48 of them train; about 1e5 bits for cells of 2 x 2."""
COUNTED: Final = {
    "threshold, one pixel, one tick": (1, 1),
    "joint, 2 x 2 pixels": (1, 4),
    "joint, two ticks": (2, 1),
}
"""(ticks, pixels) of the detectors whose decision by a spike count has a closed form."""


def compare_detectors(seed: int) -> list[dict[str, Any]]:
    """Rows of `link.detect.comparison` for a residual reset and a background of 0.1 Q.

    `theory` is the error rate of deciding by the count of spikes; None if it does not apply.
    """
    rows = comparison(
        threshold=Q, background=OFF, on_level=ON - OFF, size=SIDE, symbols=SYMBOLS, seed=seed
    )  # fmt: skip
    out = []
    for row in rows:
        size = COUNTED.get(row.what)
        theory = None
        if size is not None:
            theory = sum(pixel_errors(Q, ON * Q, OFF * Q, "residual", *size, longest=None)) / 2
        out.append({**asdict(row), "theory": theory})
    return out
