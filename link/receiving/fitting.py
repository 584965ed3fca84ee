"""The homography from known symbols, with every cell of the panel as a mark.

The spikes of about a thousand pixels are modelled from the known cells around them (as for the
timing), with the image shifted slightly to each side. The change of the likelihood of each pixel's
spikes gives its displacement, and all of them together the homography: a Newton step with numerical
derivatives. This registers the panel if its tags are only a few camera pixels large.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.receiving.recording import Recording
from link.receiving.refining import project
from link.receiving.synthesis import KnownSymbols, Levels, choose_witnesses, light_on, likelihoods
from link.timing import Registration, Timing

Floats = npt.NDArray[np.float64]
_PIXELS: Final = 1500
_STEPS: Final = 2
_MOVE: Final = 0.15
"""Step of the numerical derivatives, camera pixels."""
_FAR: Final = 1.0
"""Largest plausible change at a corner, camera pixels."""


def fit_by_known(
    recording: Recording, layout: Layout, registration: Registration, timing: Timing,
    levels: Levels, known: KnownSymbols,
) -> Floats | None:  # fmt: skip
    """Homography; None with too few pixels, or if it changes implausibly.

    Args:
        recording: spikes.
        layout, registration, timing: layout, registration and timing of the transmission, so far.
        levels: light of the cells.
        known: the known symbols.
    """
    mode = layout.mode
    half = np.array([(mode.width - 1) / 2, (mode.height - 1) / 2])
    unit = np.array([[half[0], 0, half[0]], [0, half[1], half[1]], [0, 0, 1.0]])
    back = np.linalg.inv(unit)
    w = choose_witnesses(
        recording, layout, registration, timing, known, count=_PIXELS, pure=False, seed=2
    )
    if w is None:
        return None
    dx, dy = registration.shift(
        float(timing.start(known.begin + len(known.cells) / 2, timing.rows / 2))
    )
    u, v = w.columns - dx, w.rows - dy
    h = registration.homography @ unit
    h = h / h[2, 2]
    for _ in range(_STEPS):
        by: list[Floats] = []
        for mx, my in ((0.0, 0.0), (_MOVE, 0.0), (-_MOVE, 0.0), (0.0, _MOVE), (0.0, -_MOVE)):
            # The image shifted by (mx, my) shows at u what it showed at u - mx.
            light = light_on(layout, h @ back, registration.blur, u - mx, v - my, known.cells)
            by.append(likelihoods(replace(w, light=light), timing, levels))
        step = _newton(h, u, v, by)
        if step is None:
            return None
        h = h + step
    out = h @ back
    out = out / out[2, 2]
    x = np.array([0, 1, 1, 0]) * (mode.width - 1)
    y = np.array([0, 0, 1, 1]) * (mode.height - 1)
    before, after = project(registration.homography, x, y), project(out, x, y)
    off = float(np.hypot(after[0] - before[0], after[1] - before[1]).max())
    return out if np.isfinite(off) and off < _FAR else None


def _newton(h: Floats, u: Floats, v: Floats, by: list[Floats]) -> Floats | None:
    """Change of the homography, from ln P without shift and shifted right, left, down, up."""
    still, right, left, down, up = by
    slope_x, slope_y = (right - left) / (2 * _MOVE), (down - up) / (2 * _MOVE)
    bend_x, bend_y = (2 * still - right - left) / _MOVE**2, (2 * still - down - up) / _MOVE**2
    mx, my = project(np.linalg.inv(h), u, v)
    w = (h[2, 0] * mx + h[2, 1] * my + h[2, 2])[:, None]
    zero, one = np.zeros_like(mx), np.ones_like(mx)
    by_x = np.stack([mx, my, one, zero, zero, zero, -u * mx, -u * my], 1) / w
    by_y = np.stack([zero, zero, zero, mx, my, one, -v * mx, -v * my], 1) / w
    bend = by_x.T @ (bend_x[:, None] * by_x) + by_y.T @ (bend_y[:, None] * by_y)
    slope = by_x.T @ slope_x + by_y.T @ slope_y
    # Scaled, since the last two columns are large. All curvatures must be those of a maximum.
    size = np.sqrt(np.abs(np.diag(bend)))
    if not np.isfinite(bend).all() or (size <= 0).any():
        return None
    scaled = bend / size[:, None] / size[None, :]
    if np.linalg.eigvalsh(scaled)[0] <= 1e-9:
        return None
    return np.append(np.linalg.solve(scaled, slope / size) / size, 0).reshape(3, 3)
