"""What a display's effects cost, in nanoseconds a pixel-plane: the order in which the planner
leaves them out.

Of the GL renderer on two cores (llvmpipe, 1000 x 1000): a draw for each plane 336 planes/s, spans
of 8 planes 9.4 k, of 64 planes 12 k. Not of the machine at hand, as in
`sensor/latched/effects/costs.py`.
"""

from __future__ import annotations

from typing import Final

__all__ = ["EMISSION", "ROWS", "SHOWN", "SPAN_COST"]

_PLANES_A_SECOND: Final = {1: 336.0, 8: 9.4e3, 64: 12.0e3}
_PIXELS: Final = 1e6
SHOWN: Final = 1e9 / (_PLANES_A_SECOND[64] * _PIXELS)
"""A pixel-plane shown in spans of 64."""
SPAN_COST: Final = {n: 1e9 / (rate * _PIXELS) - SHOWN for n, rate in _PLANES_A_SECOND.items()}
"""What spans of so many planes cost beyond that."""
ROWS: Final = 0.005
"""Weights that differ from row to row: assumed, a multiplication and an addition a span."""
EMISSION: Final = 0.1
"""A level that relaxes in every plane: assumed, of the size of the exact hold."""
