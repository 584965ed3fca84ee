"""What belief propagation must know of a link, by maximum likelihood from known symbols.

The likelihood of a pixel's spikes under known bits is that of its charge alone: one forward pass.
Light, blur, place of the image to hundredths of a pixel, and the softness of the threshold are
those of greatest likelihood over pixels spread across the panel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from link.detect.detector import Bits
from link.layout import Layout
from link.timing import Registration
from tests.link.detect.belief_kernel import LEVELS, laws, shared, tick
from tests.link.detect.footprints import seen_by

_PIXELS: Final = 800
"""Pixels that the likelihood is computed for."""
_EVALUATIONS: Final = 300
_STEPS: Final = (0.3, 0.1, 0.15, 0.3, 0.06, 0.06)
"""First steps of the search, in the order of `_of`."""
_BRIGHTEST: Final = 8.0
"""Largest light of a tick, thresholds; brighter pixels always fire."""


@dataclass(frozen=True)
class PixelModel:
    """A camera pixel and its light.

    Attributes:
        off: light of a tick with all cells off, thresholds.
        on: light that all cells on add to it.
        blur: standard deviation of the image's blur, camera pixels.
        softness: standard deviation of the threshold, thresholds: its noise and fixed pattern.
        dx, dy: shift of the image from the registration, camera pixels.
        shot: variance of the charge over its mean, thresholds.
        hard: whether a spike removes all charge.
    """

    off: float = 0.02
    on: float = 1.4
    blur: float = 0.35
    softness: float = 0.02
    dx: float = 0.0
    dy: float = 0.0
    shot: float = 1e-3
    hard: bool = True

    @property
    def brightest(self) -> float:
        """Largest light that is modelled, thresholds."""
        return min(self.off + self.on * 1.02, _BRIGHTEST)


@njit(cache=True, nogil=True)
def _likelihood(spikes, light, late, kernel, first, fires, hard):  # type: ignore[no-untyped-def]
    """ln P(spikes) of pixels.

    Args:
        spikes: (pixels, symbols, ticks) uint8.
        light: (pixels, symbols) float32, thresholds.
        late: (pixels,) float32, as for `shared`.
        kernel, first, fires, hard: kernel, first, fires and hard as for `tick`.
    """
    states, symbols, ticks = fires.size, spikes.shape[1], spikes.shape[2]
    one, two = np.empty(states, np.float32), np.empty(states, np.float32)
    total = 0.0
    for p in range(spikes.shape[0]):
        one[:] = np.float32(0.0)
        one[:LEVELS] = np.float32(1.0 / LEVELS)
        a, b = 0, LEVELS
        for n in range(1, symbols - 1):
            for j in range(ticks):
                now = shared(light[p, n], j, ticks, late[p], light[p, n - 1], light[p, n + 1])
                a, b = tick(one, a, b, now, spikes[p, n, j] > 0, kernel, first, fires, hard, two)
                mass = np.float32(0.0)
                for g in range(a, b):
                    mass += two[g]
                # As in `explain`: nothing is impossible.
                total += np.log(max(mass, np.float32(1e-4)))
                if mass > 0:
                    for g in range(a, b):
                        two[g] /= mass
                    while a < b - 1 and two[a] < np.float32(1e-6):
                        a += 1
                    while b > a + 1 and two[b - 1] < np.float32(1e-6):
                        b -= 1
                else:
                    two[:LEVELS] = np.float32(1.0 / LEVELS)
                    a, b = 0, LEVELS
                one, two = two, one
    return total


def _of(place: npt.NDArray[np.float64], model: PixelModel) -> PixelModel:
    """Model at a place of the search: logarithms of off, on, blur and softness, and the shift."""
    off, on, blur, softness = (float(each) for each in np.exp(place[:4]))
    return replace(
        model, off=off, on=on, blur=blur, softness=softness, dx=float(place[4]),
        dy=float(place[5]),
    )  # fmt: skip


def learn_model(
    layout: Layout, registration: Registration, row: npt.NDArray[np.int64],
    column: npt.NDArray[np.int64], spikes: npt.NDArray[np.uint8], cells: Bits,
    late: npt.NDArray[np.float32], shift: tuple[float, float], start: PixelModel,
) -> PixelModel:  # fmt: skip
    """The likeliest model.

    Args:
        layout, registration: cells and their place.
        row, column: (pixels,) camera pixels whose footprints hold data and pilots alone.
        spikes: (pixels, symbols, ticks) uint8 of known symbols.
        cells: (symbols, rows x columns) bits of all cells.
        late: (pixels,) ticks by which symbols begin after a tick.
        shift: shift of the image in these symbols, by the registration.
        start: model at which the search begins; its shot noise and reset rule are kept.
    """
    from scipy.optimize import minimize

    chosen = np.linspace(0, len(row) - 1, min(_PIXELS, len(row))).astype(np.intp)
    row, column, spikes, late = row[chosen], column[chosen], spikes[chosen], late[chosen]

    def cost(place: npt.NDArray[np.float64]) -> float:
        model = _of(place, start)
        if not (0.05 < model.blur < 3 and 1e-3 < model.softness < 0.3 and model.on < 50):
            return np.inf
        cell, share, _ = seen_by(
            layout, registration, row, column, model.blur,
            (shift[0] + model.dx, shift[1] + model.dy),
        )  # fmt: skip
        lit = np.einsum("npk,pk->pn", cells[:, cell], share)
        light = np.minimum(model.off + model.on * lit, model.brightest).astype(np.float32)
        tables = laws(model.brightest, model.shot, model.softness, model.hard)
        return -float(_likelihood(spikes, light, late, *tables, model.hard))

    place = np.array([*np.log([start.off, start.on, start.blur, start.softness]), 0.0, 0.0])
    place[4:] = start.dx, start.dy
    simplex = np.vstack([place, place + np.diag(_STEPS)])
    found = minimize(
        cost, place, method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 2e-3, "fatol": 0.5, "maxfev": _EVALUATIONS},
    )  # fmt: skip
    return _of(found.x, start)
