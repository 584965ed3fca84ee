"""Observers of light: a still eye, a pursuing eye, and a camera.

The model of an observer is the weight and the position with which its images integrate light. An
eye's weight follows from its temporal response. The neural delay is the same for every display and
is left out: the image of the instant T integrates light around T.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import PS
from display.observe.views import Values

Instants = npt.NDArray[np.int64]
STAGES: Final = 15
"""Number of stages of the low-pass cascade, the sustained term of elaTCSF."""
STAGE_TIME: Final = 0.00292069
"""Time constant of each stage at a frequency scale of 1, s (tau of elaTCSF)."""
SPEED: Final = 0.6678, 0.222269
"""Constants of the frequency scale: offset, and slope per decade of luminance."""
DIMMEST: Final = 0.1
"""Lower limit of the luminance, cd/m2: the frequency scale would be 0 at 0.001."""


class _Still:
    """A static observer, with one unshifted image for each instant."""

    instants: tuple[int, ...]

    @property
    def images(self) -> int:
        return len(self.instants)

    def shifts(self, at: Instants) -> tuple[Values, Values]:
        still = np.zeros((self.images, len(at)))
        return still, still.copy()


@dataclass(frozen=True)
class FixedEye(_Still):
    """A still eye: it weights light by the sustained channel of its temporal response, a cascade of
    15 equal stages, centred on each instant.

    Attributes:
        instants: instants of the images, ps.
        luminance: adaptation luminance, cd/m2.
        begin, end: limits of the light, ps; the weights within them are normalised to 1.
    """

    instants: tuple[int, ...]
    luminance: float
    begin: int
    end: int

    def _before(self, at: Instants) -> Values:
        """Share of the response for light before the instants `at`, ps, (images, n)."""
        from scipy.special import gammaincc

        stage = eye_time(self.luminance) * PS
        centre = np.array(self.instants, np.float64)[:, None]
        age = (
            centre - at[None, :]
        ) / stage + STAGES  # age of the light, stages; the mean is STAGES
        return np.asarray(gammaincc(STAGES, np.maximum(age, 0.0)))

    def weights(self, start: Instants, stop: Instants) -> Values:
        # Each instant once: most spans begin where another ends.
        asked = np.concatenate([[self.begin, self.end], start, stop])
        at, place = np.unique(np.clip(asked, self.begin, self.end), return_inverse=True)
        low, high, *_ = before = self._before(at)[:, place].T
        whole = (high - low)[:, None]
        if not (whole > 0).all():
            raise ValueError(
                f"instants must be near {self.begin} to {self.end} ps, not {self.instants}"
            )
        first, last = before[2 : len(start) + 2].T, before[len(start) + 2 :].T
        return (last - first) / whole


@dataclass(frozen=True)
class PursuingEye:
    """An eye that moves at (vy, vx). Its retina image at the instant T is R(y, x) = integral of
    L(y + vy (t - T), x + vx (t - T), t), with the weights of `still`.

    Attributes:
        still: weights and instants.
        velocity: (vy, vx), pixels/s.
    """

    still: FixedEye | CameraPlane
    velocity: tuple[float, float]

    @property
    def images(self) -> int:
        return self.still.images

    def weights(self, start: Instants, stop: Instants) -> Values:
        return self.still.weights(start, stop)

    def shifts(self, at: Instants) -> tuple[Values, Values]:
        centre = np.array(self.still.instants, np.float64)[:, None]
        seconds = (at[None, :] - centre) / PS
        return seconds * self.velocity[0], seconds * self.velocity[1]


@dataclass(frozen=True)
class CameraPlane(_Still):
    """The exposures of a camera, with constant weight.

    Attributes:
        instants: centres of the exposures, ps.
        exposure: length of an exposure, ps.
    """

    instants: tuple[int, ...]
    exposure: int

    def weights(self, start: Instants, stop: Instants) -> Values:
        first = np.array(self.instants, np.int64)[:, None] - self.exposure // 2
        exposed = np.minimum(stop, first + self.exposure) - np.maximum(start, first)
        return np.maximum(exposed, 0) / self.exposure


def frequency_scale(luminance: float) -> float:
    """Scale of the eye's temporal frequencies at a luminance, cd/m2: f' = f / scale of elaTCSF in
    the fovea."""
    return SPEED[0] + SPEED[1] * math.log10(max(luminance, DIMMEST))


def eye_time(luminance: float) -> float:
    """Time constant of a stage of the eye's temporal response in the fovea, s, at a luminance,
    cd/m2."""
    return STAGE_TIME / frequency_scale(luminance)
