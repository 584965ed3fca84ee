"""Views: the weights and shifts with which observers integrate the light of a block.

An observer has one or more images. Each is the integral of the light over time, weighted by the
response of the observer and, for a moving eye, shifted on the retina. Light is the mean over short
spans of time, so an image is a sum of the (shifted) light of the spans times their weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from display.panels.panel import SpikePanel

Values = npt.NDArray[np.float64]


class Observer(Protocol):
    """An observer with one or more images."""

    @property
    def images(self) -> int:
        """Number of images."""
        ...

    def weights(self, start: npt.NDArray[np.int64], stop: npt.NDArray[np.int64]) -> Values:
        """The response integrated over each span [start, stop), ps, for each image: (images, spans)
        float64. The weights of an image over all time add up to 1, so constant light 1 gives an
        image of 1."""
        ...

    def shifts(self, at: npt.NDArray[np.int64]) -> tuple[Values, Values]:
        """The shifts (dy, dx) at the instants `at`, ps, each (images, spans), pixels: the image at
        (y, x) integrates the light at (y + dy, x + dx), bilinear, dark outside."""
        ...


@dataclass(frozen=True, eq=False)
class Views:
    """The weights and shifts for the images of a block of planes.

    Each array is (images, spans) float64. The light of a span is the sum over its planes, Q.

    Attributes:
        weight: factor of the light in row 0.
        slope: change of the weight from row 0 to row `height`, because rows are driven one after
            another: row r has weight + slope r / height. Accurate to 1e-6 for an eye, and to a
            share of a plane at the ends of a camera's exposure.
        dy, dx: shift in row 0, pixels.
        dy_slope, dx_slope: change of the shift, as `slope`.
    """

    weight: Values
    slope: Values
    dy: Values
    dx: Values
    dy_slope: Values
    dx_slope: Values

    @property
    def images(self) -> int:
        return len(self.weight)

    def __post_init__(self) -> None:
        shapes = {a.shape for a in vars(self).values()}
        if len(shapes) != 1:
            raise ValueError(f"views must share one (images, spans), not {sorted(shapes)}")

    @classmethod
    def joined(cls, several: Sequence[Views]) -> Views:
        """The images of all views, one after another."""
        return cls(
            *(np.concatenate([getattr(v, name) for v in several]) for name in vars(several[0]))
        )


def panel_views(
    observer: Observer, panel: SpikePanel, first: int, planes: int, batch: int
) -> Views:
    """The views of planes of a panel. The white of the panel gives images of 1.

    Args:
        observer: the observer.
        panel: the panel.
        first, planes: first plane, and number of planes.
        batch: number of planes in a span; the last span may be shorter.
    """
    edges = [*range(first, first + planes, batch), first + planes]
    at = np.array([panel.start(n) for n in edges], np.int64)
    start, stop = at[:-1], at[1:]
    delay = round(panel.row_delay)
    per_q = 1 / (np.diff(edges) * panel.white_rate)
    top = observer.weights(start, stop) * per_q
    bottom = observer.weights(start + delay, stop + delay) * per_q
    middle = (start + stop) // 2
    (y0, x0), (y1, x1) = observer.shifts(middle), observer.shifts(middle + delay)
    return Views(top, bottom - top, y0, x0, y1 - y0, x1 - x0)
