"""Costs of a display's effects, ns per pixel and plane. They set the order in which the planner
leaves effects out.

Measured with the GL renderer on two cores (llvmpipe, 1000 x 1000): one draw for each plane 336
planes/s, spans of 8 planes 9.4 k, of 64 planes 12 k. As in `sensor/latched/effects/costs.py`, the
costs are constants and are not measured on the current machine.
"""

from __future__ import annotations

from typing import Final

_PLANES_A_SECOND: Final = {1: 336.0, 8: 9.4e3, 64: 12.0e3}
_PIXELS: Final = 1e6
BASE_COST: Final = 1e9 / (_PLANES_A_SECOND[64] * _PIXELS)
"""Cost of spans of 64 planes."""
SPAN_COST: Final = {n: 1e9 / (rate * _PIXELS) - BASE_COST for n, rate in _PLANES_A_SECOND.items()}
"""Additional cost of shorter spans, by their number of planes."""
ROWS: Final = 0.005
"""Cost of weights for each row (assumed): a multiplication and an addition for each span."""
EMISSION: Final = 0.1
"""Cost of an emitter level that relaxes in every plane (assumed): similar to the exact hold."""
