"""Observers of light: an eye that keeps still, an eye that pursues, a camera.

An observer is modelled by the light that its images integrate: from when, and from where. The delay
of the nerves is the same for every display and is left out: the image of instant T is of light
around T.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import PS
from display.observe.temporal import STAGE_TIME, STAGES, frequency_scale
from display.observe.views import Values

__all__ = ["CameraPlane", "FixedEye", "PursuingEye", "eye_time"]

Instants = npt.NDArray[np.int64]


def eye_time(luminance: float) -> float:
    """Seconds of a stage of the eye's temporal response at this luminance (cd/m2), in the fovea."""
    return STAGE_TIME / frequency_scale(luminance)


class _Still:
    """What keeps still makes an image around each of its instants, unshifted."""

    instants: tuple[int, ...]

    @property
    def images(self) -> int:
        return len(self.instants)

    def shifts(self, at: Instants) -> tuple[Values, Values]:
        still = np.zeros((self.images, len(at)))
        return still, still.copy()


@dataclass(frozen=True)
class FixedEye(_Still):
    """An eye that keeps still: light weighted by the sustained channel of its temporal response, a
    cascade of 15 equal stages, centred on each instant.

    Attributes:
        instants: ps.
        luminance: cd/m2 that it is adapted to.
        begin, end: ps, of the light there is: weights of what lies outside are given to what lies
            inside.
    """

    instants: tuple[int, ...]
    luminance: float
    begin: int
    end: int

    def _before(self, at: Instants) -> Values:
        """(images, n) share of the response that falls on light before instants `at`."""
        from scipy.special import gammaincc

        stage = eye_time(self.luminance) * PS
        centre = np.array(self.instants, np.float64)[:, None]
        age = (centre - at[None, :]) / stage + STAGES  # of light, in stages; the mean is STAGES
        return np.asarray(gammaincc(STAGES, np.maximum(age, 0.0)))

    def weights(self, start: Instants, stop: Instants) -> Values:
        low, high = (np.array([t], np.int64) for t in (self.begin, self.end))
        whole = self._before(high) - self._before(low)
        if not (whole > 0).all():
            raise ValueError(
                f"instants must be near {self.begin} to {self.end} ps, not {self.instants}"
            )
        inside = [np.clip(t, self.begin, self.end) for t in (start, stop)]
        return (self._before(inside[1]) - self._before(inside[0])) / whole


@dataclass(frozen=True)
class CameraPlane(_Still):
    """A camera's exposures: all light alike for `exposure` ps centred on each instant (ps)."""

    instants: tuple[int, ...]
    exposure: int

    def weights(self, start: Instants, stop: Instants) -> Values:
        first = np.array(self.instants, np.int64)[:, None] - self.exposure // 2
        exposed = np.minimum(stop, first + self.exposure) - np.maximum(start, first)
        return np.maximum(exposed, 0) / self.exposure


@dataclass(frozen=True)
class PursuingEye:
    """An eye that follows what moves at (vy, vx) pixels a second: retina image
    R(y, x) = integral of L(y + vy (t - T), x + vx (t - T), t) weighted in time as `still` does,
    for each of its instants T."""

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
